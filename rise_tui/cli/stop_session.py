"""The stop of a session from a program that is not its console."""

from __future__ import annotations

import asyncio

from rise_engine.base.errors import RiseError
from rise_engine.run.client import connect

STOP_SECONDS = 5.0


def stop_session(socket: str, who: str) -> str:
    """Stop everything in a session. Returns why it was not reached, or nothing. Blocks.

    :param socket: its name or its socket. :param who: the name in its record. It attaches as an observer.
    """

    async def stop() -> None:
        async with connect(socket, who, role="observer") as attached:
            await attached.stop_all()

    try:
        asyncio.run(asyncio.wait_for(stop(), STOP_SECONDS))
    except (RiseError, OSError, TimeoutError) as error:
        return str(error) or "no answer"
    return ""
