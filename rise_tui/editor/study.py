"""The workspace of a study for a screen. Work on the disk runs in a thread, one task after the other."""

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
    """What pages show (`draft`) and how they change it. Belongs to the loop that made it."""

    def __init__(self, workspace: Workspace, draft: StudyDraft) -> None:
        """`draft`: what `draft_of(workspace)` gave; that call blocks, and is made in a thread, too."""
        self._workspace, self.draft = workspace, draft
        self._turn = asyncio.Lock()
        self.busy = ""
        """What is being done, in a word; empty: nothing."""

    async def apply(self, *edits: AnyEdit) -> Change:
        """Make edits as one step. :raises EditRefused: one cannot be made; then none is."""
        return await self._do("changing", lambda: self._workspace.apply(*edits))

    async def undo(self) -> Change | None:
        """Take the last step back; gives it, None: there is none."""
        return await self._do("undoing", self._workspace.undo)

    async def redo(self) -> Change | None:
        """Make the step again that was taken back last."""
        return await self._do("redoing", self._workspace.redo)

    def preview(self, *edits: AnyEdit) -> LoadResult:
        """The check of what the files would be, in some milliseconds. :raises EditRefused: an edit cannot be made."""
        return self._workspace.preview(*edits)

    def remedies(self, finding: Diagnostic) -> list[Remedy]:
        """What can be done about a finding."""
        return remedies(finding, self._workspace.state)

    def diff(self) -> str:
        """What saving would change, line by line."""
        return self._workspace.diff()

    async def notice_outside(self) -> OutsideChange | None:
        """Look whether somebody else has changed the files, and take it in."""
        return await self._do("", self._workspace.notice_outside)

    async def take_outside(self, names: Sequence[str]) -> Change:
        """Take files as they are on the disk, as one step."""
        return await self._do("changing", lambda: self._workspace.take_outside(names))

    async def save(self) -> SaveReport:
        """Write all changed files or none. :raises EditRefused: it cannot be."""
        return await self._do("saving", self._workspace.save)

    async def read_draft(self) -> Draft | None:
        """What an earlier editor has not saved."""
        return await self._do("", lambda: self._workspace.draft)

    async def take_up(self, draft: Draft) -> OutsideChange:
        """Take the files of a draft, as one step."""
        return await self._do("reading the draft", lambda: self._workspace.take_up_draft(draft))

    async def discard_draft(self) -> None:
        """Forget what an earlier editor has not saved."""
        await self._do("", self._workspace.discard_draft)

    async def close(self) -> None:
        """Give the study up; what is not saved stays as a draft."""
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
    """A session that runs on the scenario that is being edited."""

    socket: str
    participant: str

    @property
    def sentence(self) -> str:
        """For the line above the key hints."""
        who = f"a session with {self.participant}" if self.participant else "a session"
        return f"{who} runs on its own copy; what you save counts for the next one"


class SessionWatch(Protocol):
    """Finds such a session, and stops it. Both block."""

    def find(self, folder: Path) -> RunningHere | None:
        """The latest one of this scenario on this computer."""

    def stop(self, session: RunningHere) -> str:
        """Stop everything there; says what came of it."""


class NoSessions:
    """Where somebody else takes care of the session: over a console, which has the stop key itself."""

    def find(self, folder: Path) -> RunningHere | None:
        return None

    def stop(self, session: RunningHere) -> str:
        return ""
