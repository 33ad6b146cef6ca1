"""For programs: take part in a running session (docs/how-to/drive-a-session-from-a-program.md).

`connect` gives the session. What `Client` means for consoles stands in `rise_engine.run.protocol.client`.
"""

from __future__ import annotations

import os

from rise_engine.run.client.session import Session
from rise_engine.run.protocol.client import EngineGone, LinkLost, Rejected, Role

__all__ = ["EngineGone", "LinkLost", "Rejected", "Session", "connect"]


def connect(session: str | os.PathLike[str], name: str, *, role: Role = "node") -> Session:
    """A running session, for `async with`.

        import asyncio
        from rise_engine.run.client import connect

        async def main() -> None:
            async with connect("greeting", name="gaze-tracker") as session:
                await session.raise_event("/H_greets")

        asyncio.run(main())

    :param session: its name (`rise-engine sessions` lists them; the six digits may be left out), or the path of its
        socket.
    :param name: stands in the record as the source of everything that this program does: `node:gaze-tracker`.
    :param role: `node`, a program, which may submit at any time; `observer`, which only watches, adds notes and stops
        everything; or `wizard`, which may hold control.
    :return: the session; entering it attaches, leaving it detaches, and the session goes on.
    :raises EngineGone: on entering, when no such session runs or it does not admit this program.
    """
    return Session(session, name, role=role)
