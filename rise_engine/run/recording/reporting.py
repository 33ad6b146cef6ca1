"""What a companion says to its session: in order, whenever the session can be reached, and never in anybody's way."""

from __future__ import annotations

import asyncio
from collections import deque
from contextlib import suppress

from rise_engine.run.client import EngineGone, LinkLost, Session, connect
from rise_engine.run.protocol.client import Rejected
from rise_engine.run.recording.one_recorder import RecordingState

AGAIN_SECONDS = 1.0
"""Between two tries to say something that the session did not take, or to attach again."""
LAST_SECONDS = 1.0
"""For what is still to be said at the end."""


class SessionReports:
    """The way to a running session. `run` keeps it open; `session` is there while it is."""

    def __init__(self, socket: str, name: str) -> None:
        """
        :param socket: of the session.
        :param name: who reports, in the record.
        """
        self.socket, self.name = socket, name
        self.session: Session | None = None
        """The session, while this program is attached."""
        self.attached, self.over = asyncio.Event(), asyncio.Event()
        """Set when it was reached for the first time; and when it has ended, or its engine has gone."""
        self._waiting: deque[tuple[str, RecordingState] | str] = deque()
        self._news, self._said = asyncio.Event(), asyncio.Event()
        self._said.set()

    def recording(self, name: str, state: RecordingState) -> None:
        """Say how a recording stands."""
        self._put((name, state))

    def note(self, text: str) -> None:
        """Add a remark."""
        self._put(text)

    def _put(self, what: tuple[str, RecordingState] | str) -> None:
        self._waiting.append(what)
        self._news.set()
        self._said.clear()

    async def flush(self) -> None:
        """Wait until everything is said, or LAST_SECONDS are over, or nobody is there any more."""
        tasks = [asyncio.create_task(each.wait()) for each in (self._said, self.over)]
        await asyncio.wait(tasks, timeout=LAST_SECONDS, return_when=asyncio.FIRST_COMPLETED)
        for task in tasks:
            task.cancel()

    async def run(self) -> None:
        """Attach, and again when the connection was cut, until the session is over."""
        while True:
            try:
                async with connect(self.socket, self.name) as session:
                    self.session = session
                    self.attached.set()
                    await self._talk(session)
            except LinkLost:
                await asyncio.sleep(AGAIN_SECONDS)
            except EngineGone:
                break
            finally:
                self.session = None
        self.over.set()

    async def _talk(self, session: Session) -> None:
        """Say everything. Raises EngineGone when the session is over, LinkLost when the connection was cut."""
        ending = asyncio.create_task(session.wait_until(lambda view: view.ended))
        try:
            while not ending.done():
                while self._waiting and not ending.done():
                    if await self._say(session):
                        self._waiting.popleft()
                    else:
                        await asyncio.sleep(AGAIN_SECONDS)
                if not self._waiting:
                    self._said.set()
                self._news.clear()
                news = asyncio.create_task(self._news.wait())
                await asyncio.wait({news, ending}, return_when=asyncio.FIRST_COMPLETED)
                news.cancel()
            ending.result()
            raise EngineGone("the session has ended")
        finally:
            ending.cancel()
            with suppress(asyncio.CancelledError, EngineGone):
                await ending

    async def _say(self, session: Session) -> bool:
        """Whether the session has taken what comes first."""
        first = self._waiting[0]
        try:
            if isinstance(first, str):
                await session.add_note(first)
            else:
                name, state = first
                await session.report_recording(
                    name, state.status, path=state.path, bytes=state.bytes, reason=state.reason
                )
        except Rejected:  # nothing can be recorded now, or the session is just beginning
            return False
        return True
