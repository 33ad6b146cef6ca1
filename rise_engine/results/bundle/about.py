"""A bundle's description of itself: how it was made (`bundle.json`), README, and how to check it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec import Struct

from rise_engine import __version__
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.bundle.environment import ENVIRONMENT_FILE, PROGRAM, REQUIREMENTS
from rise_engine.results.bundle.study_files import GIVEN
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.table_schema import UNSAFE
from rise_engine.study.model import Study
from rise_engine.study.publishing import license_url

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
    """The number of rehearsals left out, by their purpose."""
    absent: dict[str, str] = {}
    """Why sessions in study.jsonl are not in the bundle, as part of a sentence, by the session's name."""


def write_about(root: Path, about: AboutBundle) -> None:
    """Write `bundle.json` into the bundle in `root`. Raises OSError."""
    text = msgspec.json.format(msgspec.json.encode(about), indent=2)
    (root / ABOUT_FILE).write_bytes(text + b"\n")


def read_about(root: Path) -> AboutBundle:
    """Read `bundle.json` of the bundle in `root`. Raises ExportError when it is missing or invalid."""
    try:
        return msgspec.json.decode((root / ABOUT_FILE).read_bytes(), type=AboutBundle)
    except FileNotFoundError:
        raise ExportError(f"this bundle cannot be made again: it has no {ABOUT_FILE}") from None
    except (OSError, msgspec.DecodeError) as error:
        raise ExportError(f"{ABOUT_FILE} cannot be read: {error}") from None


PYTHON = (3, 11)
"""The oldest Python that runs the program (pyproject.toml)."""
_LEVELS: dict[ExportLevel, str] = {
    "full": "Everything is told as it was recorded. This is an archive. Do not publish it.",
    "shared": "For other researchers: no dates and times of day, no notes and reasons that people typed, no names of "
    "wizards, and nothing that the scenario declares private.",
    "public": "For everybody: no dates and times of day, no notes and reasons that people typed, no names of wizards, "
    "no words that wizards said freely, and nothing that the scenario declares private.",
}


def readme_text(study: Study, level: ExportLevel, contents: Sequence[str], left_out: Sequence[str], wheel: str) -> str:
    """Write README.md.

    :param wheel: the path of the program in the bundle; empty: it is not in it.
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
        *(f"- {line}" for line in left_out),
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
            f"- `{GIVEN}` in participants.csv stands for a consent that was given, whenever that was.",
            "",
        ]
    return "\n".join(lines)


def _about_program(wheel: str) -> list[str]:
    """Say how to get the program."""
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
