"""A study's workspace for a screen. Work on the disk runs in a thread, one task after the other."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

from rise_engine.author.edit.drafts import Draft
from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.remedies import Remedy, remedies
from rise_engine.author.edit.workspace import Change, OutsideChange, SaveReport, Workspace
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.loader import LoadResult
from rise_tui.editor.model.draft import StudyDraft, draft_of

Result = TypeVar("Result")


class EditedStudy:
    """The content of pages (`draft`) and how they change it. Belongs to the loop that created it."""

    def __init__(self, workspace: Workspace, draft: StudyDraft) -> None:
        """`draft`: the result of `draft_of(workspace)`. That call blocks, so it also runs in a thread."""
        self._workspace, self.draft = workspace, draft
        self._turn = asyncio.Lock()
        self.busy = ""
        """The current work, in a word; empty: none."""

    async def apply(self, *edits: AnyEdit) -> Change:
        """Make edits as one step. :raises EditRefused: one cannot be made; then none is."""
        return await self._do("changing", lambda: self._workspace.apply(*edits))

    async def undo(self) -> Change | None:
        """Undo the last step and return it; None: there is none."""
        return await self._do("undoing", self._workspace.undo)

    async def redo(self) -> Change | None:
        """Make the last undone step again."""
        return await self._do("redoing", self._workspace.redo)

    def preview(self, *edits: AnyEdit) -> LoadResult:
        """Check the files with these edits, in some milliseconds. :raises EditRefused: an edit cannot be made."""
        return self._workspace.preview(*edits)

    def remedies(self, finding: Diagnostic) -> list[Remedy]:
        """What can be done about a diagnostic."""
        return remedies(finding, self._workspace.state)

    def diff(self) -> str:
        """What saving would change, line by line."""
        return self._workspace.diff()

    async def notice_outside(self, *, settled: bool = False) -> OutsideChange | None:
        """Look for other people's changes to the files, and take them in. `settled`: but not while somebody writes."""
        return await self._do("", lambda: self._workspace.notice_outside(settled=settled))

    async def take_outside(self, names: Sequence[str]) -> Change:
        """Take over files from the disk, as one step."""
        return await self._do("changing", lambda: self._workspace.take_outside(names))

    async def save(self) -> SaveReport:
        """Write all changed files or none. :raises EditRefused: they cannot be written."""
        return await self._do("saving", self._workspace.save)

    async def read_draft(self) -> Draft | None:
        """The unsaved changes of an earlier editor."""
        return await self._do("", lambda: self._workspace.draft)

    async def take_up(self, draft: Draft) -> OutsideChange:
        """Take over the files of a draft, as one step."""
        return await self._do("reading the draft", lambda: self._workspace.take_up_draft(draft))

    async def discard_draft(self) -> None:
        """Delete the unsaved changes of an earlier editor."""
        await self._do("", self._workspace.discard_draft)

    async def close(self) -> None:
        """Close the study. Unsaved changes stay as a draft."""
        async with self._turn:
            await asyncio.to_thread(self._workspace.close)

    async def _do(self, busy: str, work: Callable[[], Result]) -> Result:
        def work_and_look() -> tuple[Result, StudyDraft]:
            result = work()
            return result, draft_of(self._workspace)

        async with self._turn:
            self.busy = busy
            try:
                result, self.draft = await asyncio.to_thread(work_and_look)
            finally:
                self.busy = ""
        return result


class RunningHere(NamedTuple):
    """A running session of the scenario that is being edited."""

    socket: str
    participant: str

    @property
    def sentence(self) -> str:
        """The sentence above the key hints."""
        who = f"a session with {self.participant}" if self.participant else "a session"
        return f"{who} runs on its own copy; what you save counts for the next one"


class SessionWatch(Protocol):
    """Finds such a session, and stops it. Both methods block."""

    def find(self, folder: Path) -> RunningHere | None:
        """The latest session of this scenario on this computer."""

    def stop(self, session: RunningHere) -> str:
        """Stop everything there; returns the result as a sentence."""


class NoSessions:
    """No watch: over a console, which has the stop key itself."""

    def find(self, folder: Path) -> RunningHere | None:
        return None

    def stop(self, session: RunningHere) -> str:
        return ""
