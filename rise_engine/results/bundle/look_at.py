"""What a person should check before a bundle is given away, because no program can judge it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from rise_engine.base.errors import SessionError
from rise_engine.base.text import name_some, pluralize
from rise_engine.kernel.records import TaskRecord
from rise_engine.kernel.speech import SAY
from rise_engine.privacy.levels import ExportLevel
from rise_engine.privacy.sharing import SharedSession
from rise_engine.privacy.suggestions import suggest_words
from rise_engine.results.analysis.model import SessionData
from rise_engine.study.model import Participant, Study
from rise_engine.study.study_toml import STUDY_FILE
from rise_engine.study.traces import has_name

_STAND_IN = re.compile(r"[A-Z0-9]+\d")
_HIDDEN = re.compile(r"= \{\w+\}$")
"""The behaviour of an assignment to a private key, as a level shows it."""
_SHOWN = 12


class LookAt:
    """A collector of what a person should check. Give it one session after another."""

    def __init__(self, study: Study, level: ExportLevel) -> None:
        self._study = study
        self._level = level
        self._said = 0
        self._typed = 0
        self._own_values: dict[str, None] = {}
        self._words: Counter[str] = Counter()
        self._alone = 0
        self._people = 0
        self._columns: list[str] = []
        self._warnings: list[str] = []

    def add(self, data: SessionData) -> None:
        """Add what people said and typed in a session."""
        self._said += sum(act.act == SAY and act.actor == "wizard" for act in data.acts)
        for record in data.records:
            if isinstance(record, TaskRecord) and record.source.startswith("wizard:"):
                told = not _HIDDEN.search(record.behavior)
                self._typed += record.function == "assignValue" and record.status == "SUCCEEDED" and told

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
        """Return everything in sentences.

        :param root: the bundle, as far as it is made.
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
                f"participants.csv: {self._alone} of {pluralize(self._people, 'participant')} {_is(self._alone)} the "
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
        if self._said and self._level == "shared":
            found.append(
                f'{pluralize(self._said, "sentence")} that wizards said freely (in sessions/*/journal.jsonl, "say"): '
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


def _is(count: int) -> str:
    return "is" if count == 1 else "are each"
