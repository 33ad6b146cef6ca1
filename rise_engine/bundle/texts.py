"""What a bundle says about itself to people: README.md and LICENSE."""

from __future__ import annotations

from collections.abc import Sequence

from rise_engine import __version__
from rise_engine.bundle.crate import license_url
from rise_engine.bundle.study_files import GIVEN
from rise_engine.session.levels import ExportLevel
from rise_engine.study.model import Study

_LEVELS: dict[ExportLevel, str] = {
    "full": "Everything is told as it was recorded. This is an archive, and not to be published.",
    "shared": "For other researchers: no dates and times of day, no notes and reasons that people typed, no names of "
    "wizards, and nothing that the scenario declares private.",
    "public": "For everybody: no dates and times of day, no notes and reasons that people typed, no names of wizards, "
    "no words that wizards said freely, and nothing that the scenario declares private.",
}


def readme_text(study: Study, level: ExportLevel, contents: Sequence[str], left_out: Sequence[str]) -> str:
    """README.md."""
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
        "## What is not",
        "",
        *(f"- {line}" for line in left_out),
        "",
        "## Check it, run it again",
        "",
        "```",
        "sha256sum --check --quiet manifest-sha256.txt",
        f'pip install "rise-tui=={__version__}"',
        "rise-engine reproduce .",
        "```",
        "",
        "`rise-engine reproduce` feeds the recorded inputs of every session to the program once more, and says whether "
        "the same comes out, record for record. With `--robot NAME`, another robot is simulated and what differs is "
        "told.",
        "",
    ]
    if level != "full":
        lines += [
            "## How the sessions were changed",
            "",
            "- Onsets are seconds of the session; `wall` is empty everywhere.",
            "- Wizards are W1, W2, ...; what people typed is counted: `[note, 5 words]`.",
            "- Where something private stood, another word stands (`PERSONNAME1`) or another number (from 90001 on), "
            "the same one for the same value. Each session was replayed with these: it went the same way.",
            f"- `{GIVEN}` in participants.csv stands for a consent that was given, whenever that was.",
            "- study.toml names no wizards, so its check sum is not the one that the records name.",
            "",
        ]
    return "\n".join(lines)


def license_text(license: str, study: Study) -> str:
    """LICENSE."""
    holder = study.report.get("authors", "") or "the people who ran the study"
    if not license:
        return (
            f"Nobody has said yet what others may do with this bundle. Until somebody does, all rights stay with "
            f"{holder}: ask them.\n"
        )
    url = license_url(license)
    where = f"\n{url}\n" if url and url != license else ""
    return f"{study.title}\nby {holder}\n\nThis bundle may be used under the licence {license}.\n{where}"
