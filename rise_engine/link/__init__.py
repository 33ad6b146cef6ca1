"""How anybody outside takes part in a session, and the door for programs:

    from rise_engine.link import connect

    async with connect("lablinking", name="gaze-tracker") as session:
        await session.raise_event("/H_arrived")

Importing this costs nothing; what it needs is loaded when it is used (docs/how-to/drive-a-session-from-a-program.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import os

    from rise_engine.link.client import Role
    from rise_engine.link.program import Session

__all__ = ["connect"]


def connect(session: str | os.PathLike[str], name: str, *, role: Role = "node") -> Session:
    """A running session, for `async with`.

    `session` is its name (`rise-engine sessions` lists them; the six digits may be left out), or the path of its
    socket. `name` stands in the record as the source of everything that this program does: `node:gaze-tracker`.
    """
    from rise_engine.link.program import Session

    return Session(session, name, role=role)
