"""Checks a scenario repeatedly while it is edited, without reading unchanged files again."""

from __future__ import annotations

import os
from pathlib import Path

from rise_engine.base.nearest_name import limited_comparisons
from rise_engine.scenario.files.source_files import Memo
from rise_engine.scenario.files.tree import Held
from rise_engine.scenario.loader import LoadResult, ScenarioLoader


class ScenarioChecker:
    """Checks like `load`, but only reads changed files. For one thread at a time.

    >>> checker = ScenarioChecker("scenarios/greeting")
    >>> checker.check({}).diagnostics
    []
    >>> print(checker.check({"acts/greeting.xml": b"<Dialogs>"}).errors[0])
    acts/greeting.xml:1:10: error not-well-formed: `<Dialogs>` of line 1 is never closed; add `</Dialogs>`
    """

    def __init__(self, folder: str | os.PathLike[str], robot: str | None = None) -> None:
        """
        :param folder: the scenario's folder, or the `scenario.toml` in it.
        :param robot: the name of a profile to use instead of the scenario's.
        """
        self.path = Path(folder)
        self.robot = robot
        self._memo = Memo()

    def check(self, held: Held) -> LoadResult:
        """Check as `load(folder, robot=robot, held=held)` does. Files that are not held are read from the disk."""
        with limited_comparisons():
            result = ScenarioLoader(self.path, held, self._memo).load(self.robot, None, {})
        self._memo.end_round()
        return result
