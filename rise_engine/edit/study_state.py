"""The study as it is when an edit is planned."""

from __future__ import annotations

from pathlib import Path

from msgspec import Struct

from rise_engine.edit.outline import Outline
from rise_engine.edit.plan import Files
from rise_engine.scenario import LoadResult


class StudyState(Struct, frozen=True):
    """What planners look at. They change nothing of it."""

    files: Files
    outline: Outline
    checked: LoadResult
    """The check of `files`; `scenario` is None while there is an error."""
    folder: Path
