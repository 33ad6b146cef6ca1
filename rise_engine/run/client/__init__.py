"""The interface for programs that take part in a running session (docs/how-to/drive-a-session-from-a-program.md).

`connect` returns the session. `rise_engine.run.protocol.client` has the `Client` for consoles.
"""

from __future__ import annotations

import os

from rise_engine.run.client.session import Session
from rise_engine.run.protocol.client import EngineGone, LinkLost, Rejected, Role

__all__ = ["EngineGone", "LinkLost", "Rejected", "Session", "connect"]


def connect(session: str | os.PathLike[str], name: str, *, role: Role = "node") -> Session:
    """Return a running session for `async with`.

        import asyncio
        from rise_engine.run.client import connect

        async def main() -> None:
            async with connect("greeting", name="gaze-tracker") as session:
                await session.raise_event("/H_greets")

        asyncio.run(main())

    :param session: its name (`rise-engine sessions` lists them; the six digits are optional), or the path of its
        socket.
    :param name: the source of everything that this program does, in the record: `node:gaze-tracker`.
    :param role: `node`, a program, which may submit at any time; `observer`, which only watches, adds notes and stops
        everything; or `wizard`, which may have control.
    :return: the session; entering it attaches, leaving it detaches, and the session continues.
    :raises EngineGone: on entering, if no such session runs or it does not admit this program.
    """
    return Session(session, name, role=role)
