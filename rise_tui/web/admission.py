"""Who may wait at the port, and for how long: the machine's other users can reach it, and must not fill it.

A connection waits until it has sent a request with the token. Those that wait are few, each only for a short time, and
one user's cannot push out another's: when there are too many, the one that has waited longest goes. Whoever has the
token sends it at once, and stays.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

MOST_WAITING_SECONDS = 10.0
"""For which a connection may wait."""
MOST_WAITING = 64
MOST_WAITING_OF_USER = 16
"""Of those that wait, of one user of the machine who is not the one that serves."""

UserLookup = Callable[[tuple[str, int], tuple[str, int]], int | None]
"""The number of the user at the other end, by the addresses of both ends; None: nobody knows."""


class Admission:
    """All connections of one server."""

    def __init__(self, who_is: UserLookup | None = None, own: int | None = None) -> None:
        self._who_is = who_is or user_of_connection
        self._own = os.getuid() if own is None else own
        self._waiting: dict[PendingConnection, int | None] = {}

    @property
    def waiting(self) -> int:
        return len(self._waiting)

    def add(self, visitor: PendingConnection) -> None:
        """Somebody has connected; perhaps another one has to go for that."""
        self._waiting[visitor] = None
        if self.waiting > MOST_WAITING_OF_USER:  # to look who it is takes time, and matters only when there are many
            self._waiting[visitor] = user = self._who_is(*visitor.ends)
            theirs = [each for each, other in self._waiting.items() if other == user]
            if user not in (None, 0, self._own) and len(theirs) > MOST_WAITING_OF_USER:
                self._reject(theirs[0])
        if self.waiting > MOST_WAITING:
            self._reject(next(iter(self._waiting)))

    def admit(self, transport: asyncio.BaseTransport | None) -> None:
        """What has come on this connection had the token."""
        if (visitor := next((each for each in self._waiting if each.transport is transport), None)) is not None:
            self.remove(visitor)

    def remove(self, visitor: PendingConnection) -> None:
        """It waits no longer."""
        self._waiting.pop(visitor, None)

    def time_out(self, visitor: PendingConnection) -> None:
        """Its time is over, unless it has shown the token."""
        if visitor in self._waiting:
            self._reject(visitor)

    def _reject(self, visitor: PendingConnection) -> None:
        self.remove(visitor)
        visitor.abort()


class PendingConnection(asyncio.Protocol):
    """One connection: passes everything on to the web server's own protocol, and tells the door."""

    def __init__(self, door: Admission, inner: Any) -> None:
        """`inner`: the protocol that aiohttp makes for a connection."""
        self._admission, self._inner = door, inner
        self.transport: asyncio.Transport | None = None
        self._timer: asyncio.TimerHandle | None = None

    @property
    def ends(self) -> tuple[tuple[str, int], tuple[str, int]]:
        """The addresses of this end and the other."""
        assert self.transport is not None
        here, there = (self.transport.get_extra_info(name) or ("", 0) for name in ("sockname", "peername"))
        return (str(here[0]), int(here[1])), (str(there[0]), int(there[1]))

    def abort(self) -> None:
        if self.transport is not None:
            self.transport.abort()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        self._timer = asyncio.get_running_loop().call_later(MOST_WAITING_SECONDS, self._admission.time_out, self)
        self._inner.connection_made(transport)
        self._admission.add(self)

    def connection_lost(self, error: Exception | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._admission.remove(self)
        self._inner.connection_lost(error)

    def data_received(self, data: bytes) -> None:
        self._inner.data_received(data)

    def eof_received(self) -> bool | None:
        return bool(self._inner.eof_received())

    def pause_writing(self) -> None:
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        self._inner.resume_writing()


def user_of_connection(
    here: tuple[str, int], there: tuple[str, int], table: Path = Path("/proc/net/tcp")
) -> int | None:
    """Who has the other end of a connection within this machine; None where the system does not tell."""
    wanted = [_proc_address(there), _proc_address(here)]
    try:
        for line in table.read_text(encoding="ascii").splitlines()[1:]:
            fields = line.split()
            if fields[1:3] == wanted:
                return int(fields[7])
    except (OSError, ValueError, IndexError):
        pass
    return None


def _proc_address(end: tuple[str, int]) -> str:
    """An address as Linux lists it: its bytes in the machine's order, and the port."""
    address, port = end
    try:
        number = int.from_bytes(bytes(map(int, address.split("."))), sys.byteorder)
    except ValueError:
        return ""
    return f"{number:08X}:{port:04X}"
