"""Explores the saved files in a process of its own, beside the editor."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Awaitable, Callable
from datetime import datetime
from typing import TypeAlias

from msgspec.structs import replace

from rise_tui.editor.model.draft import StudyDraft
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
