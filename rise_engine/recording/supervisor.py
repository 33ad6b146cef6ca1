"""What works the recorders of a running session: it starts, watches and stops each by itself."""

from __future__ import annotations

import asyncio

from rise_engine.recording.companion import CompanionRequest


async def supervise(request: CompanionRequest, finish: asyncio.Event) -> None:
    """Record a session until it ends or is to end.

    :param request: what records it.
    :param finish: set when everything is to be stopped.
    """
    await finish.wait()
