"""A program's side of a session: what `rise_engine.client.connect` gives."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any, TypeVar

from rise_engine.client.socket import SocketClient
from rise_engine.errors import RiseError
from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import FINAL, AnyRecord
from rise_engine.kernel.view import SessionView, TaskView
from rise_engine.protocol.client import (
    AttachReply,
    ClientInput,
    ControlVerb,
    EndRefused,
    EngineGone,
    Heartbeat,
    JournalStatus,
    LinkLost,
    Resync,
    Role,
    UpdateOrResync,
)
from rise_engine.scenario.model import Scenario

T = TypeVar("T")


class Rejected(RiseError):
    """The session did not accept what was asked for; the text says why."""


class Session:
    """A session that this program is attached to, as `async with connect(...) as session`.

    Every method that asks for something returns when the session has taken it (and it is on the disk), and raises
    Rejected when it has not. All raise LinkLost when this connection was cut (attach again), and EngineGone when the
    session is over. What came of an accepted task at once is in `view` when its method returns.
    """

    def __init__(self, session: str | os.PathLike[str], name: str, *, role: Role = "node") -> None:
        self._client = SocketClient(session, name, role)
        self._attached: AttachReply | None = None
        self._changed = asyncio.Event()
        self._record_queues: list[asyncio.Queue[AnyRecord | None]] = []
        self._following: asyncio.Task[None] | None = None
        self._ended_by: EngineGone | None = None
        self.journal_status = JournalStatus()
        self.heartbeat = Heartbeat()
        """How the record of the session stands; while `trouble` is set, the session is paused."""

    async def __aenter__(self) -> Session:
        """Attach. Raises EngineGone when no such session runs."""
        self._attached = await self._client.attach()
        self.journal_status = self._attached.journaling
        self._following = asyncio.create_task(self._follow(self._client.records()))
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None:
        if self._following is not None:
            self._following.cancel()
            with suppress(asyncio.CancelledError):
                await self._following
        await self._client.close()

    # --- what there is to see -----------------------------------------------------------------------------------

    @property
    def hello(self) -> AttachReply:
        """What the session said at the beginning: its mode, robot, seed, folder, and how it calls this program."""
        if self._attached is None:
            raise RuntimeError("use the session within `async with`")
        return self._attached

    @property
    def scenario(self) -> Scenario:
        return self.hello.scenario

    @property
    def view(self) -> SessionView:
        """The present state; it changes while the program waits for anything. For looking only."""
        return self.hello.view

    def now(self) -> float:
        """The session's time in seconds."""
        return self._client.now()

    def records(self) -> AsyncIterator[AnyRecord]:
        """Every record from this call on, until the session ends. Iterating raises LinkLost when this connection is
        cut, EngineGone when the engine goes without an end."""
        queue: asyncio.Queue[AnyRecord | None] = asyncio.Queue()
        self._record_queues.append(queue)
        return self._records_from(queue)

    async def _records_from(self, queue: asyncio.Queue[AnyRecord | None]) -> AsyncIterator[AnyRecord]:
        try:
            while not (self._ended_by is not None and queue.empty()):
                record = await queue.get()
                if record is not None:
                    yield record
            if not self.view.ended:
                raise self._ended_by
        finally:
            self._record_queues.remove(queue)

    async def until(self, true: Callable[[SessionView], T], seconds: float | None = None) -> T:
        """Wait until `true(view)` is true.

        :param true: looks at the state; called again whenever that has changed.
        :param seconds: how long to wait at most; None: as long as the session lasts.
        :return: what `true` gave.
        :raises TimeoutError: after so many seconds.
        :raises EngineGone: when the session ends before, or this connection (`LinkLost`).
        """
        async with asyncio.timeout(seconds):
            while True:
                found = true(self.view)
                if found:
                    return found
                if self._ended_by is not None:
                    raise self._ended_by
                self._changed.clear()
                await self._changed.wait()

    async def finished(self, task: int, seconds: float | None = None) -> TaskView:
        """Wait until a task has come to its end; its `status` says to which."""

        def ended(view: SessionView) -> TaskView | None:
            found = view.tasks.get(task)
            return found if found is not None and found.status in FINAL else None

        found = await self.until(ended, seconds)
        assert found is not None
        return found

    # --- what there is to do ------------------------------------------------------------------------------------

    async def start(self, act: str, calling_type: str = "") -> int:
        """Start an act; gives the task's id, for `finished`. It may wait for its turn."""
        return await self.submit("startCommunicationRobotAct", act, calling_type)

    async def stop(self, act: str) -> int:
        """Stop an act that runs or waits."""
        return await self.submit("stopCommunicationRobotAct", act)

    async def start_rule(self, rule: str) -> int:
        return await self.submit("startInteractionRule", rule)

    async def stop_rule(self, rule: str) -> int:
        return await self.submit("stopInteractionRule", rule)

    async def raise_event(self, topic: str) -> int:
        """Raise an event. Whether a rule took it is in its record."""
        return await self.submit("raiseEventTopic", topic)

    async def set(self, key: str, value: Any) -> int:
        """Set a key of the working memory to a JSON value."""
        return await self.submit("assignValue", json.dumps({key: value}, ensure_ascii=False))

    async def delete(self, key: str) -> int:
        """Delete a key of the working memory."""
        return await self.submit("deleteValue", key)

    async def stop_all(self) -> int:
        """Stop everything, at once; nothing starts until somebody releases the stop. Every role may do this."""
        return await self.submit("stopAll")

    async def release_stop(self) -> int:
        return await self.submit("releaseStop")

    async def submit(self, function: str, behavior: str = "", calling_type: str = "") -> int:
        """Submit a task.

        :param function: what to do, by its name in the record: `raiseEventTopic`, `assignValue`, ...
        :param behavior: to what: an act, a rule, a topic, an assignment.
        :param calling_type: `Blocking`, `None` or `Interrupt` instead of the act's own.
        :return: the task's id, for `finished`.
        :raises Rejected: with the engine's sentence.
        """
        task = await self._send(Submit(function=function, behavior=behavior, calling_type=calling_type))
        return task or 0

    async def note(self, text: str) -> None:
        """Add a remark to the record."""
        await self._send(Note(text=text))

    async def control(self, verb: ControlVerb) -> None:
        """As a wizard: take control, ask for it, give it to who asked, release it. Raises Rejected."""
        reply = await self._client.control(verb)
        if not reply.accepted:
            raise Rejected(reply.reason)

    async def end(self, reason: str = "") -> None:
        """Stop the robot, end the session, and wait until it has ended. Raises Rejected."""
        try:
            await self._client.close(end_session=True, reason=reason)
        except EndRefused as error:
            raise Rejected(str(error)) from None
        if self._following is not None:
            await asyncio.wait([self._following])

    # --- within -------------------------------------------------------------------------------------------------

    async def _send(self, message: ClientInput) -> int | None:
        reply = await self._client.send(message)
        if not reply.accepted:
            raise Rejected(reply.reason)
        task = reply.task
        if task is not None:  # its records have come before the answer; here they are taken in
            await self.until(lambda view: task in view.tasks)
        return task

    async def _follow(self, updates: AsyncIterator[Sequence[UpdateOrResync]]) -> None:
        over: EngineGone = LinkLost("this program has left the session")
        try:
            async for batch in updates:
                for update in batch:
                    if isinstance(update, JournalStatus):
                        self.journal_status = update
                        continue
                    if isinstance(update, Heartbeat):
                        self.heartbeat = update
                        continue
                    if isinstance(update, Resync):  # which nobody asked for
                        continue
                    self.view.apply(update)
                    for queue in self._record_queues:
                        queue.put_nowait(update)
                self._changed.set()
            over = EngineGone("the session has ended")
        except EngineGone as error:
            over = error
        finally:
            self._ended_by = over
            self._changed.set()
            for queue in self._record_queues:
                queue.put_nowait(None)
