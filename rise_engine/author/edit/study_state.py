"""What an edit is planned on."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

from msgspec import Struct

from rise_engine.author.edit.outline import Outline
from rise_engine.author.edit.plan import Files
from rise_engine.author.edit.read_outline import read_outline
from rise_engine.scenario.loader import LoadResult


class StudyState(Struct, frozen=True, dict=True):
    """A study as it stands, for planning an edit."""

    files: Files
    checked: LoadResult
    """The check of these files."""
    folder: Path
    """Where the study lies. Nothing of it is read while an edit is planned, but where links lead to."""
    above: Files = {}
    """The study.toml of a folder above, by its path (`read_study_above`): what it names is known, and not changed."""

    @cached_property
    def outline(self) -> Outline:
        """What is written in its acts and rules."""
        return read_outline(self.checked.parts)
