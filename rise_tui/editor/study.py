"""A study's workspace for a screen, and exploring it beside the editor.

Work on the disk runs in a thread, one task after the other.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Awaitable, Callable
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, Protocol, TypeAlias, TypeVar

from rise_engine.author.edit.workspace import Workspace
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


Result = TypeVar("Result")


class EditedStudy:
    """The content of pages (`draft`), and the workspace that changes it. Belongs to the loop that created it."""

    def __init__(self, workspace: Workspace, draft: StudyDraft) -> None:
        """`draft`: the result of `draft_of(workspace)`. That call blocks, so it also runs in a thread."""
        self.workspace, self.draft = workspace, draft
        self._turn = asyncio.Lock()
        self.busy = ""
        """The current work, in a word; empty: none."""

    async def do(self, busy: str, work: Callable[[Workspace], Result]) -> Result:
        """Let the workspace do something in a thread, after all earlier work; then renew the draft.

        :param busy: the work, in a word. :raises EditRefused: it cannot be done; then nothing has changed.
        """

        def work_and_look() -> tuple[Result, StudyDraft]:
            result = work(self.workspace)
            return result, draft_of(self.workspace)

        async with self._turn:
            self.busy = busy
            try:
                result, self.draft = await asyncio.to_thread(work_and_look)
            finally:
                self.busy = ""
        return result

    async def close(self) -> None:
        """Close the study. Unsaved changes stay as a draft."""
        async with self._turn:
            await asyncio.to_thread(self.workspace.close)


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
