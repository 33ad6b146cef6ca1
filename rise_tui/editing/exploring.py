"""Exploring beside the editor: in a process of its own, of the files as they are saved, when they have been."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import Awaitable, Callable
from datetime import datetime
from typing import TypeAlias

from rise_tui.editing.model.explored import ExploredStudy, read_explored

Explorer: TypeAlias = Callable[[str], Awaitable[ExploredStudy | None]]
"""Explores the study in a folder; None: it could not be."""


async def explore_saved(folder: str) -> ExploredStudy | None:
    """What `rise-engine check --deep` finds in a folder. The process is ended when nobody waits for it any more."""
    at = f"{datetime.now():%H:%M}"
    arguments = [sys.executable, "-m", "rise_engine", "check", folder, "--deep", "--json"]
    quiet = asyncio.subprocess.DEVNULL
    process = await asyncio.create_subprocess_exec(
        *arguments, stdin=quiet, stdout=asyncio.subprocess.PIPE, stderr=quiet
    )
    try:
        printed, _ = await process.communicate()
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
    return read_explored(printed, at)
