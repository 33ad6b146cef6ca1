"""A study at one moment, as the editor shows it."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from msgspec import Struct

from rise_engine.author.edit.outline import Outline
from rise_engine.author.edit.plan import Files
from rise_engine.author.edit.workspace import Change, Workspace
from rise_engine.scenario.checking.uses import Uses
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.loader import LoadResult


@lru_cache(maxsize=8)
def toml_values(data: bytes) -> Mapping[str, Any]:
    """The values of a TOML file; empty if it cannot be read."""
    try:
        return tomllib.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        return {}


class StudyDraft(Struct, frozen=True):
    """The files with all changes, their contents and their diagnostics, all of the same moment."""

    folder: str
    files: Files
    saved: Files
    outline: Outline
    checked: LoadResult
    uses: Uses
    changes: Sequence[Change]
    above: Files = {}
    """The study.toml of a folder above, by its path. It is shown, but not changed here."""

    @property
    def title(self) -> str:
        """The study's title."""
        scenario = self.checked.scenario
        title = scenario.title if scenario is not None else self.values_in(SCENARIO_FILE).get("title")
        if is_study_alone(self):
            title = self.values_in(STUDY_FILE).get("title")
        return title if isinstance(title, str) and title else self.folder.rstrip("/").rpartition("/")[2]

    def values_in(self, file: str) -> Mapping[str, Any]:
        """The values of one of its TOML files; empty if it cannot be read."""
        return toml_values(self.files.get(file, b""))

    @property
    def findings(self) -> list[Diagnostic]:
        """All diagnostics, errors first."""
        return sorted(self.checked.diagnostics, key=lambda each: each.severity != "error")

    @property
    def changed_files(self) -> list[str]:
        """Names of files that differ from the saved ones."""
        names = {*self.files, *self.saved}
        return sorted(name for name in names if self.files.get(name) != self.saved.get(name))


def is_study_alone(draft: StudyDraft) -> bool:
    """Whether the files are those of a study with participants, whose scenarios are edited separately."""
    return STUDY_FILE in draft.files and SCENARIO_FILE not in draft.files


def first_new_finding(draft: StudyDraft, checked: LoadResult, *, but: Sequence[str] = ()) -> Diagnostic | None:
    """Return the first diagnostic that a change would add, errors before warnings; None: no new one.

    :param checked: the study with the change. :param but: codes of diagnostics to ignore.
    """
    known = Counter((each.code, each.message) for each in draft.checked.diagnostics)
    new = []
    for each in checked.diagnostics:
        known[each.code, each.message] -= 1
        if known[each.code, each.message] < 0 and each.code not in but:
            new.append(each)
    return next((each for each in new if each.severity == "error"), new[0] if new else None)


class FilePlace(NamedTuple):
    """A stretch of lines of a file, from 1."""

    file: str
    line: int
    end: int


def draft_of(workspace: Workspace) -> StudyDraft:
    """Return the present contents of a workspace. Blocks while the workspace works."""
    return StudyDraft(
        str(workspace.folder),
        workspace.files,
        workspace.saved,
        workspace.outline,
        workspace.checked,
        workspace.uses,
        tuple(workspace.changes),
        workspace.above,
    )
