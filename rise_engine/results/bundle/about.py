"""A bundle's description of itself (`bundle.json`, README, LICENSE), and what to check before sharing it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from rise_engine import __version__
from rise_engine.base.errors import SessionError
from rise_engine.base.text import name_some, pluralize
from rise_engine.kernel.records import TaskRecord
from rise_engine.kernel.speech import SAY
from rise_engine.privacy.levels import ExportLevel
from rise_engine.privacy.sharing import SharedSession
from rise_engine.privacy.suggestions import suggest_words
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.bundle.contents import ENVIRONMENT_FILE, HIDDEN_DATE, PROGRAM, REQUIREMENTS
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.table_schema import UNSAFE
from rise_engine.study.model import Participant, Study
from rise_engine.study.publishing import license_url
from rise_engine.study.study_toml import STUDY_FILE
from rise_engine.study.traces import has_name

ABOUT_FILE = "bundle.json"


class BundleOptions(Struct, frozen=True):
    """The options of a bundle."""

    level: ExportLevel = "shared"
    private: tuple[str, ...] = ()
    """Private memory keys in addition to the scenario's."""
    license: str = ""
    """Replaces the licence in `[report]` of study.toml."""


class AboutBundle(Struct, frozen=True):
    """The contents of `bundle.json`."""

    options: BundleOptions
    program: str = __version__
    """The version of rise-tui that made it."""
    rehearsals: dict[str, int] = {}
    """The number of omitted rehearsals, by their purpose."""
    absent: dict[str, str] = {}
    """Why sessions in study.jsonl are not in the bundle, as part of a sentence, by the session's name."""


def write_about(root: Path, about: AboutBundle) -> None:
    """Write `bundle.json` into the bundle in `root`. Raises OSError."""
    text = msgspec.json.format(msgspec.json.encode(about), indent=2)
    (root / ABOUT_FILE).write_bytes(text + b"\n")


def read_about(root: Path) -> AboutBundle:
    """Read `bundle.json` of the bundle in `root`. Raises ExportError if it is missing or invalid."""
    try:
        return msgspec.json.decode((root / ABOUT_FILE).read_bytes(), type=AboutBundle)
    except FileNotFoundError:
        raise ExportError(f"this bundle cannot be made again: it has no {ABOUT_FILE}") from None
    except (OSError, msgspec.DecodeError) as error:
        raise ExportError(f"{ABOUT_FILE} cannot be read: {error}") from None


PYTHON = (3, 11)
"""The oldest supported Python (pyproject.toml)."""
_LEVELS: dict[ExportLevel, str] = {
    "full": "Everything is included as it was recorded. This is an archive. Do not publish it.",
    "shared": "For other researchers: no dates and times of day, no notes and reasons that people typed, no names of "
    "wizards, and nothing that the scenario declares private.",
    "public": "For everybody: no dates and times of day, no notes and reasons that people typed, no names of wizards, "
    "no words that wizards said freely, and nothing that the scenario declares private.",
}


def readme_text(study: Study, level: ExportLevel, contents: Sequence[str], omitted: Sequence[str], wheel: str) -> str:
    """Write README.md.

    :param wheel: the path of the program in the bundle; empty: it is not included.
    """
    program = wheel or f'"rise-tui=={__version__}"'
    lines = [
        f"# {study.title}",
        "",
        f"The study `{study.id}`, as one folder that others can check and run again: an RO-Crate, made by rise-tui "
        f"{__version__}.",
        "",
        f"Level `{level}`. {_LEVELS[level]}",
        "",
        "## What is in it",
        "",
        *(f"- {line}" for line in contents),
        "- ro-crate-metadata.json: the same for programs",
        "- manifest-sha256.txt: the check sum of every file",
        "",
        UNSAFE,
        "",
        "## What is not",
        "",
        *(f"- {line}" for line in omitted),
        "",
        "## Check it, run it again",
        "",
        "```",
        "sha256sum --check --quiet manifest-sha256.txt",
        "python3 -m venv ~/rise-tui",
        f"~/rise-tui/bin/pip install {program}",
        "~/rise-tui/bin/rise-engine reproduce .",
        "```",
        "",
        *_about_program(wheel),
        "`rise-engine reproduce` feeds the recorded inputs of every session to the program once more, and says whether "
        "it gives the same records. It makes tables, BIDS and the report again from the sessions, and "
        "compares them. At the end it says what this has proved, and what it has not. With `--robot NAME`, another "
        "robot is simulated, and the differences are listed.",
        "",
    ]
    if level != "full":
        lines += [
            "## How the sessions were changed",
            "",
            "- Onsets are seconds of the session; `wall` is empty everywhere.",
            "- Wizards are W1, W2, ...; annotators are C1, C2, ...; what people typed, and what was annotated as the "
            "participant's speech, is counted: `[note, 5 words]`.",
            "- Private words and numbers are replaced (`PERSONNAME1`, numbers from 90001 on), each value always the "
            "same way. Each session was replayed with these, and the same happened.",
            f"- `{HIDDEN_DATE}` in participants.csv stands for a consent that was given, whenever that was.",
            "",
        ]
    return "\n".join(lines)


def _about_program(wheel: str) -> list[str]:
    """Describe how to get the program."""
    if not wheel:
        return [f"The program itself is not in here; {ENVIRONMENT_FILE} says which one it was, and where it is.", ""]
    return [
        f"`{wheel}` is the program with which this was made; `{ENVIRONMENT_FILE}` has its check sum. It needs Python "
        f"{'.'.join(map(str, PYTHON))} or newer; pip fetches the packages that it needs. If newer ones do not fit any "
        f"more, `pip install -r {PROGRAM}/{REQUIREMENTS}` takes the same versions as here.",
        "",
    ]


def license_text(license: str, study: Study) -> str:
    """Write LICENSE."""
    holder = study.report.get("authors", "") or "the people who ran the study"
    if not license:
        return (
            f"No licence says yet what others may do with this bundle. Until one does, all rights stay with "
            f"{holder}: ask them.\n"
        )
    url = license_url(license)
    where = f"\n{url}\n" if url and url != license else ""
    return f"{study.title}\nby {holder}\n\nThis bundle may be used under the licence {license}.\n{where}"


_STAND_IN = re.compile(r"[A-Z0-9]+\d")
_HIDDEN = re.compile(r"= \{\w+\}$")
"""An assignment to a private key, as a level shows it."""
_SHOWN = 12


class ReviewList:
    """Collects what a person should check. Give it one session after another."""

    def __init__(self, study: Study, level: ExportLevel) -> None:
        self._study = study
        self._level = level
        self._free = 0
        self._typed = 0
        self._own_values: dict[str, None] = {}
        self._words: Counter[str] = Counter()
        self._alone = 0
        self._people = 0
        self._columns: list[str] = []
        self._warnings: list[str] = []

    def add(self, data: SessionData) -> None:
        """Add the typed and spoken texts of a session."""
        self._free += sum(act.act == SAY and act.actor == "wizard" for act in data.acts)
        for record in data.records:
            if isinstance(record, TaskRecord) and record.source.startswith("wizard:"):
                is_shown = not _HIDDEN.search(record.behavior)
                self._typed += record.function == "assignValue" and record.status == "SUCCEEDED" and is_shown

    def add_shared(self, folder: Path, shared: SharedSession) -> None:
        """Add a session as it is in the bundle."""
        self._own_values.update(dict.fromkeys(shared.own_values))
        try:
            found = suggest_words(folder)
        except SessionError:
            return
        for each in found:
            if not _STAND_IN.fullmatch(each.word) and not each.why.startswith("the value of the private key"):
                self._words[each.word] += each.count

    def add_people(self, people: Sequence[Participant]) -> None:
        """Add the rows of participants.csv."""
        self._columns = [*self._study.strata, *self._study.columns]
        rows = [tuple(each.strata.get(name) or each.columns.get(name, "") for name in self._columns) for each in people]
        counts = Counter(rows)
        self._people, self._alone = len(rows), sum(counts[row] == 1 for row in rows)

    def add_warnings(self, name: str, warnings: Sequence[str]) -> None:
        self._warnings += [f"{name}: {each}" for each in warnings]

    def sentences(self, root: Path, people: Mapping[str, str], license: str) -> list[str]:
        """Return everything to check, in sentences.

        :param root: the unfinished bundle.
        :param people: the code of each wizard in it, by name.
        :param license: the licence; empty: there is none.
        """
        found = []
        if self._level == "full":
            found.append(
                "level full: everything is in it as it was recorded, what people typed and the names of wizards, too. "
                "It is for an archive of your own, so do not publish it"
            )
        if not license:
            found.append(
                "LICENSE: nothing says what others may do with it; add --license CC-BY-4.0, or write license into "
                "[report] in study.toml"
            )
        found += self._spoken()
        if self._alone and self._columns:
            found.append(
                f"participants.csv: {self._alone} of {pluralize(self._people, 'participant')} {_verb(self._alone)} the "
                f"only one with their {', '.join(self._columns)}: they can be recognised"
            )
        text = (root / STUDY_FILE).read_text("utf-8")
        found.append(f"{STUDY_FILE}: comments, [report] and [recording] are in it as you wrote them")
        if self._level != "full":
            for name in people:
                lines = [str(n) for n, line in enumerate(text.splitlines(), 1) if has_name(line, name)]
                if lines and people[name] != name:
                    found.append(f"{STUDY_FILE}, line {', '.join(lines)}: {name!r}, the name of a wizard")
        found.append("the scenarios: every file that is not hidden is in it, pictures and texts of others as well")
        return [*found, *self._warnings]

    def _spoken(self) -> list[str]:
        found = []
        if self._free and self._level == "shared":
            found.append(
                f'{pluralize(self._free, "sentence")} that wizards said freely (in sessions/*/journal.jsonl, "say"): '
                "read them, redact names, or make the bundle with --level public"
            )
        if self._typed and self._level != "full":
            found.append(
                f"{pluralize(self._typed, 'memory value')} that wizards set: a key that holds something about a person "
                "can be kept out with --private KEY, or with private = [...] in scenario.toml"
            )
        if self._own_values:
            keys = ", ".join(self._own_values)
            found.append(f"the scenario's own start values of private keys ({keys}): memory.json is included unchanged")
        if self._words:
            words = [word for word, _ in self._words.most_common()]
            found.append(f"words that could be names: {name_some(words, _SHOWN)}")
        return found


def _verb(count: int) -> str:
    return "is" if count == 1 else "are each"
