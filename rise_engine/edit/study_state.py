"""What an edit is planned on."""

from __future__ import annotations

from pathlib import Path

from msgspec import Struct

from rise_engine.edit.outline import Outline
from rise_engine.edit.plan import Files
from rise_engine.scenario.loader import LoadResult


class StudyState(Struct, frozen=True):
    """A study as it stands, for planning an edit."""

    files: Files
    outline: Outline
    checked: LoadResult
    folder: Path
    """Where the study lies. Nothing of it is read while an edit is planned, but where links lead to."""
    above: Files = {}
    """The study.toml of a folder above, by its path (`read_study_above`): what it names is known, and not changed."""
