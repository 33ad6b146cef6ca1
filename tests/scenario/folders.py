"""Scenario folders made in a test from a few texts."""

from __future__ import annotations

from pathlib import Path

from rise_engine.scenario.loader import LoadResult, load

LISTINGS = Path(__file__).with_name("listings")
"""Listings 1 to 3 of Groß et al., RISE: an open-source architecture for interdisciplinary and reproducible
human-robot interaction research, Frontiers in Robotics and AI 10:1245501, 2023. Verbatim, without the line numbers."""


def folder(path: Path, files: dict[str, str | bytes]) -> Path:
    """Write files, by their names within the folder."""
    for name, content in files.items():
        file = path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def loaded(path: Path, files: dict[str, str | bytes]) -> LoadResult:
    return load(folder(path, files))


def found(result: LoadResult) -> list[str]:
    """Findings as `file:line:column code`."""
    return [f"{diagnostic.location} {diagnostic.code}" for diagnostic in result.diagnostics]


def act(body: str, name: str = "A") -> str:
    return f'<Dialog name="{name}">\n{body}\n</Dialog>\n'


def rule(body: str, name: str = "R", initial: str = "S") -> str:
    return f'<InteractionRule name="{name}" initial="{initial}">\n{body}\n</InteractionRule>\n'


def in_state(entry: str, rest: str = "") -> str:
    """A rule with one state; `entry` begins in line 3, column 10."""
    return rule(f'<State id="S">\n<onEntry>{entry}</onEntry>{rest}\n</State>')


SPEECH = "<Speech><actionID>1</actionID><message>Hello</message></Speech>"
