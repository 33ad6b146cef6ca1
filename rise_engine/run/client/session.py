"""A program's view of a session: the result of `rise_engine.run.client.connect`."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any, TypeVar

from rise_engine.kernel.inputs import CheckReport, Note, OutcomeReport, RecordingReport, Submit, SyncMark
from rise_engine.kernel.records import FINAL, AnyRecord, CheckResult, OutcomeStatus, RecordingStatus
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import SessionView
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import (
    AttachReply,
    ClientInput,
    ClientUpdate,
    ControlVerb,
    EngineGone,
    Heartbeat,
    JournalStatus,
    LinkLost,
    Rejected,
    Role,
    ShadowStatus,
)
from rise_engine.scenario.model import Scenario

T = TypeVar("T")


class Session:
    """A session that this program is attached to, as `async with connect(...) as session`.

    Every method with a request returns when the session has accepted it (and it is on the disk), and raises Rejected
    otherwise. All raise LinkLost if this connection was cut (attach again), and EngineGone if the session is over. When
    a method returns, the immediate effects of its task are in `view`.

        import asyncio
        from rise_engine.run.client import Rejected, connect

        async def main() -> None:
            async with connect("greeting", name="gaze-tracker") as session:
                await session.set("person_near", True)
                assert session.view.memory["person_near"].value is True
                task = await session.start("R_Smile")
                ended = await session.wait_for_task(task, seconds=30)
                await session.add_note(f"the smile ended as {ended.status}")
                try:
                    await session.start("R_Smiel")
                except Rejected as error:
                    print(error)

        asyncio.run(main())
    """

    def __init__(self, session: str | os.PathLike[str], name: str, *, role: Role = "node") -> None:
        """Make the session; `rise_engine.run.client.connect` does this.

        :param session: the name of a running session, or the path of its socket.
        :param name: the program's name in the record.
        :param role: `node`, `observer` or `wizard`.
        """
        self._client = SocketClient(session, name, role)
        self._attached: AttachReply | None = None
        self._changed = asyncio.Event()
        self._record_queues: list[asyncio.Queue[AnyRecord | None]] = []
        self._following: asyncio.Task[None] | None = None
        self._ended_by: EngineGone | None = None
        self.journal_status = JournalStatus()
        """The state of the session's record; while `trouble` is set, the session is paused."""
        self.heartbeat = Heartbeat()
        """The session's latest sign of life, and its robot's."""

    async def __aenter__(self) -> Session:
        """Attach. Raises EngineGone if no such session runs, or it does not admit this program."""
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

    # --- the state ----------------------------------------------------------------------------------------------

    @property
    def attach_reply(self) -> AttachReply:
        """The session's answer to attaching: its mode, robot, seed, folder, and its name for this program.

        :raises RuntimeError: outside of `async with`.
        """
        if self._attached is None:
            raise RuntimeError("use the session within `async with`")
        return self._attached

    @property
    def scenario(self) -> Scenario:
        """The running scenario: its acts, rules, start memory and robot."""
        return self.attach_reply.scenario

    @property
    def view(self) -> SessionView:
        """The present state, read-only. It changes whenever the program waits."""
        return self.attach_reply.view

    def now(self) -> float:
        """Return the session's time: seconds since it began, as precisely as this computer's clock knows it."""
        return self._client.now()

    def records(self) -> AsyncIterator[AnyRecord]:
        """Yield every record from this call on, until the session ends. Each call has its own iterator.

        :return: for `async for`; records wait without a limit until they are taken.
        :raises LinkLost: while iterating, if this connection is cut.
        :raises EngineGone: while iterating, if the engine goes without an end.
        """
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

    async def wait_until(self, condition: Callable[[SessionView], T | None], seconds: float | None = None) -> T:
        """Wait until `condition(view)` is true.

        :param condition: called with the state, again after every change.
        :param seconds: maximum time to wait; None: as long as the session lasts.
        :return: the result of `condition`.
        :raises TimeoutError: the time is over.
        :raises EngineGone: the session ends before, or this connection (`LinkLost`).
        """
        async with asyncio.timeout(seconds):
            while True:
                found = condition(self.view)
                if found:
                    return found
                if self._ended_by is not None:
                    raise self._ended_by
                self._changed.clear()
                await self._changed.wait()

    async def wait_for_task(self, task: int, seconds: float | None = None) -> TaskView:
        """Wait until a task has ended.

        :param task: its id, from `start` or `submit`.
        :param seconds: maximum time to wait; None: as long as the session lasts.
        :return: the task; its `status` says how it ended: SUCCEEDED, ABORTED, CANCELED or REJECTED.
        :raises TimeoutError: the time is over.
        :raises EngineGone: the session ends before, or this connection (`LinkLost`).
        """

        def find_ended(view: SessionView) -> TaskView | None:
            found = view.tasks.get(task)
            return found if found is not None and found.status in FINAL else None

        return await self.wait_until(find_ended, seconds)

    # --- requests -----------------------------------------------------------------------------------------------

    async def start(self, act: str, calling_type: str = "") -> int:
        """Start an act. It may wait for its turn.

        :param act: its name.
        :param calling_type: `Blocking`, `None` or `Interrupt` instead of the act's own.
        :return: the task's id, for `wait_for_task`.
        :raises Rejected: there is no such act, or everything is stopped.
        """
        return await self.submit("startCommunicationRobotAct", act, calling_type)

    async def stop(self, act: str) -> int:
        """Stop an act that runs or waits.

        :param act: its name.
        :return: the id of the task that stops it.
        :raises Rejected: it neither runs nor waits.
        """
        return await self.submit("stopCommunicationRobotAct", act)

    async def start_rule(self, rule: str) -> int:
        """Start an interaction rule. Its present state is `view.rules[rule].state`.

        :param rule: its name.
        :return: the id of the task, which ends with the rule.
        :raises Rejected: there is no such rule, or it runs already.
        """
        return await self.submit("startInteractionRule", rule)

    async def stop_rule(self, rule: str) -> int:
        """Stop an interaction rule.

        :param rule: its name.
        :return: the id of the task that stops it.
        :raises Rejected: it does not run.
        """
        return await self.submit("stopInteractionRule", rule)

    async def raise_event(self, topic: str) -> int:
        """Raise an event. Its record shows whether a rule took it.

        :param topic: as the rules name it: `/H_arrived`.
        :return: the task's id.
        :raises Rejected: the event has no name.
        """
        return await self.submit("raiseEventTopic", topic)

    async def set(self, key: str, value: Any) -> int:
        """Set a key of the working memory; a missing key is created.

        :param key: its name.
        :param value: a JSON value: None, a Boolean, a number, a text, or lists and dicts of these.
        :return: the task's id.
        :raises Rejected: the memory cannot hold that key or value.
        """
        return await self.submit("assignValue", json.dumps({key: value}, ensure_ascii=False))

    async def delete(self, key: str) -> int:
        """Delete a key of the working memory.

        :param key: its name.
        :return: the task's id.
        :raises Rejected: there is no such key.
        """
        return await self.submit("deleteValue", key)

    async def stop_all(self) -> int:
        """Stop everything immediately. Nothing starts until the stop is released. Every role may do this.

        :return: the task's id. `view.stop` shows what the robot has confirmed.
        """
        return await self.submit("stopAll")

    async def release_stop(self) -> int:
        """Let acts and rules start again after a stop.

        :return: the task's id.
        :raises Rejected: only the wizard who has control may do this, and programs in the scenario's `[control]
            may_release`.
        """
        return await self.submit("releaseStop")

    async def submit(self, function: str, behavior: str = "", calling_type: str = "") -> int:
        """Submit a task.

        :param function: what to do, by its name in the record: `raiseEventTopic`, `assignValue`, ...
        :param behavior: its object: an act, a rule, a topic, an assignment.
        :param calling_type: `Blocking`, `None` or `Interrupt` instead of the act's own.
        :return: the task's id, for `wait_for_task`.
        :raises Rejected: with the engine's sentence.
        """
        task = await self._send(Submit(function=function, behavior=behavior, calling_type=calling_type))
        return task or 0

    async def add_note(self, text: str) -> None:
        """Add a remark to the record.

        :param text: the remark, in one or more lines.
        :raises Rejected: nothing can be recorded.
        """
        await self._send(Note(text=text))

    async def report_check(
        self, check: str, result: CheckResult, *, text: str = "", value: str = "", reason: str = ""
    ) -> None:
        """Record the result of a check before or after the session.

        :param check: its id in study.toml.
        :param result: `passed`, `failed` or `skipped`.
        :param text: what was checked.
        :param value: what was found.
        :param reason: why it failed, or was skipped.
        :raises Rejected: nothing can be recorded; always for an observer.
        """
        await self._send(CheckReport(id=check, text=text, result=result, value=value, reason=reason))

    async def report_outcome(self, status: OutcomeStatus, reason: str = "") -> None:
        """Record how the session counts. The last report is valid.

        :param status: `complete`, `aborted` or `excluded`.
        :param reason: why, for the record.
        :raises Rejected: only the wizard who has control may do this, and programs; never an observer.
        """
        await self._send(OutcomeReport(status=status, reason=reason))

    async def report_recording(
        self, name: str, status: RecordingStatus, *, path: str = "", bytes: int | None = None, reason: str = ""
    ) -> None:
        """Record the state of a recorder of the session.

        :param name: its name: `camera`.
        :param status: `started`, `running`, `stalled`, `stopped` or `failed`.
        :param path: the path of its file.
        :param bytes: the file's present size; None: unknown.
        :param reason: why it has stalled or failed.
        :raises Rejected: nothing can be recorded; always for an observer.
        """
        await self._send(RecordingReport(name=name, status=status, path=path, bytes=bytes, reason=reason))

    async def mark_sync(
        self, number: int, medium: str, text: str = "", *, at: float | None = None, within: float | None = None
    ) -> None:
        """Record a mark that recordings show.

        :param number: the mark's; `view.sync` has the number of the last one.
        :param medium: how it is seen or heard: `sound`, `flash`.
        :param text: any remark about it.
        :param at: session time in seconds at which it began; None: now.
        :param within: maximum error of that in seconds; None: unknown.
        :raises Rejected: nothing can be recorded; always for an observer.
        """
        await self._send(SyncMark(number=number, medium=medium, text=text, at=at, within=within))

    async def change_control(self, verb: ControlVerb) -> None:
        """Change who has control, as a wizard.

        :param verb: `take` it (whoever has it), `ask` the holder for it, `give` it to the asker, or `release` it.
        :raises Rejected: with the engine's sentence; always for a `node` or an `observer`.
        """
        reply = await self._client.change_control(verb)
        if not reply.accepted:
            raise Rejected(reply.reason)

    async def end(self, reason: str = "") -> None:
        """Stop the robot, end the session, and wait until it has ended.

        :param reason: why, for the record.
        :raises Rejected: only the wizard who has control may do this, and programs; never an observer.
        """
        try:
            await self._client.close(end_session=True, reason=reason)
        except Rejected as error:
            raise Rejected(str(error)) from None
        if self._following is not None:
            await asyncio.wait([self._following])

    # --- following the session ------------------------------------------------------------------------------------

    async def _send(self, message: ClientInput) -> int | None:
        reply = await self._client.send(message)
        if not reply.accepted:
            raise Rejected(reply.reason)
        task = reply.task
        if task is not None:  # the records came before the reply; wait until they are applied here
            await self.wait_until(lambda view: task in view.tasks)
        return task

    async def _follow(self, updates: AsyncIterator[Sequence[ClientUpdate]]) -> None:
        ended_by: EngineGone = LinkLost("this program has left the session")
        try:
            async for batch in updates:
                for update in batch:
                    if isinstance(update, JournalStatus):
                        self.journal_status = update
                        continue
                    if isinstance(update, Heartbeat):
                        self.heartbeat = update
                        continue
                    if isinstance(update, ShadowStatus):  # only for a shadow
                        continue
                    self.view.apply(update)
                    for queue in self._record_queues:
                        queue.put_nowait(update)
                self._changed.set()
            ended_by = EngineGone("the session has ended")
        except EngineGone as error:
            ended_by = error
        finally:
            self._ended_by = ended_by
            self._changed.set()
            for queue in self._record_queues:
                queue.put_nowait(None)
