"""A study's workspace for a screen, and exploring it beside the editor.

Work on the disk runs in a thread, one task after the other.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Awaitable, Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, Protocol, TypeAlias, TypeVar

from msgspec.structs import replace

from rise_engine.author.edit.drafts import Draft
from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.remedies import Remedy, remedies
from rise_engine.author.edit.workspace import Change, OutsideChange, SaveReport, Workspace
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.loader import LoadResult
from rise_tui.editor.model.draft import StudyDraft, draft_of
from rise_tui.editor.model.explored import ExploredStudy, read_explored

QUIET_SECONDS = 3.0
"""Seconds between opening or saving and exploring: authors often continue immediately after saving."""
_NICENESS = 10
"""The process gets the processor time that the editor, and a session elsewhere, leave."""

Explorer: TypeAlias = Callable[[str], Awaitable[ExploredStudy | None]]
"""Explores the study in a folder; None: that was impossible."""


async def explore_saved(folder: str, *, after: float = QUIET_SECONDS) -> ExploredStudy | None:
    """What `rise-engine check --deep` finds in a folder, after `after` seconds.

    The process ends with the task that waits for it. None: the study has errors, or the process has failed.
    """
    await asyncio.sleep(after)
    at = f"{datetime.now():%H:%M}"
    arguments = [sys.executable, "-m", "rise_engine", "check", folder, "--deep", "--json"]
    quiet = asyncio.subprocess.DEVNULL
    process = await asyncio.create_subprocess_exec(
        *arguments, stdin=quiet, stdout=asyncio.subprocess.PIPE, stderr=quiet
    )
    try:
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, process.pid, _NICENESS)
        printed, _ = await process.communicate()
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
    return read_explored(printed, at)


class ExploringBeside:
    """What exploring has found in the open study, renewed after each save."""

    def __init__(self, explorer: Explorer | None) -> None:
        """`explorer`: None: nothing is explored."""
        self._explorer = explorer
        self.found = ExploredStudy()

    def ask(self, draft: StudyDraft) -> bool:
        """Whether to explore the saved files: not if they have errors that are known here."""
        has_errors = bool(draft.checked.errors) and not draft.changed_files
        is_asked = self._explorer is not None and not has_errors
        self.found = replace(self.found, is_asked_again=is_asked, has_failed=False)
        return is_asked

    async def explore(self, draft: StudyDraft) -> None:
        """Explore the files as they are saved now."""
        if self._explorer is None:
            return
        found = await self._explorer(draft.folder)
        if found is not None:
            self.found = replace(found, files=draft.saved)
        else:
            self.found = replace(self.found, is_asked_again=False, has_failed=True)


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
