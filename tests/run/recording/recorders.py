"""Recorders that do what a test says."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import TypeAlias

from rise_engine.ports.recorder import MediaKind, RecorderError, RecorderStatus, RecordingPlan
from rise_engine.scenario.model import Json

Behaviour: TypeAlias = Callable[["ScriptedRecorder"], Awaitable[object]]


async def hang(recorder: ScriptedRecorder) -> None:
    """Gives no answer, and does not listen when it is cancelled; only to the end of the loop, which cancels again."""
    try:
        await asyncio.Event().wait()
    except asyncio.CancelledError:
        await asyncio.Event().wait()


async def refuse(recorder: ScriptedRecorder) -> None:
    raise RecorderError("the lens cap is on")


async def fail(recorder: ScriptedRecorder) -> None:
    raise ZeroDivisionError("division by zero")


class ScriptedRecorder:
    """Writes 100 bytes a second into a file that is only a number, unless `does` says otherwise for a call."""

    kind: MediaKind = "video"
    stalled_after = 3.0

    def __init__(self, name: str, options: Mapping[str, Json], **does: Behaviour) -> None:
        self.name, self.options, self.does = name, options, does
        self.calls: list[str] = []
        self.grows = True
        self.size = 0
        self.recording = False
        self.asked_at = 0.0

    async def _call(self, name: str) -> None:
        self.calls.append(name)
        if (behaviour := self.does.get(name)) is not None:
            await behaviour(self)

    async def prepare(self, plan: RecordingPlan) -> str:
        self.plan = plan
        await self._call("prepare")
        return "a recorder of the tests"

    async def start(self) -> str:
        await self._call("start")
        self.recording = True
        self.asked_at = asyncio.get_running_loop().time()
        self.path = Path(self.plan.folder) / f"{self.plan.session}_{self.name}.mkv"
        return str(self.path)

    async def status(self) -> RecorderStatus:
        await self._call("status")
        now = asyncio.get_running_loop().time()
        if self.grows:
            self.size += round(100 * (now - self.asked_at))
        self.asked_at = now
        return RecorderStatus(self.recording, bytes=self.size, path=str(self.path))

    async def stop(self) -> str:
        await self._call("stop")
        if not self.recording:
            return ""
        self.recording = False
        self.path.write_bytes(b"x" * 100)
        return str(self.path)

    async def close(self) -> None:
        await self._call("close")
