"""A program's side of a session: what `rise_engine.run.client.connect` gives."""

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

    Every method that asks for something returns when the session has taken it (and it is on the disk), and raises
    Rejected when it has not. All raise LinkLost when this connection was cut (attach again), and EngineGone when the
    session is over. What came of an accepted task at once is in `view` when its method returns.

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
        """As `rise_engine.run.client.connect`, which makes it.

        :param session: the name of a running session, or the path of its socket.
        :param name: who the program is, in the record.
        :param role: `node`, `observer` or `wizard`.
        """
        self._client = SocketClient(session, name, role)
        self._attached: AttachReply | None = None
        self._changed = asyncio.Event()
        self._record_queues: list[asyncio.Queue[AnyRecord | None]] = []
        self._following: asyncio.Task[None] | None = None
        self._ended_by: EngineGone | None = None
        self.journal_status = JournalStatus()
        """How the record of the session stands; while `trouble` is set, the session is paused."""
        self.heartbeat = Heartbeat()
        """The session's latest sign of life, and its robot's."""

    async def __aenter__(self) -> Session:
        """Attach. Raises EngineGone when no such session runs, or it does not admit this program."""
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
    def attach_reply(self) -> AttachReply:
        """What the session said at the beginning: its mode, robot, seed, folder, and how it calls this program.

        :raises RuntimeError: outside of `async with`.
        """
        if self._attached is None:
            raise RuntimeError("use the session within `async with`")
        return self._attached

    @property
    def scenario(self) -> Scenario:
        """What the session runs: its acts, rules, start memory and robot."""
        return self.attach_reply.scenario

    @property
    def view(self) -> SessionView:
        """The present state; it changes while the program waits for anything. For looking only."""
        return self.attach_reply.view

    def now(self) -> float:
        """The session's time: seconds since it began, as well as this computer's clock knows it."""
        return self._client.now()

    def records(self) -> AsyncIterator[AnyRecord]:
        """Every record from this call on, until the session ends. Each call gives an iterator of its own.

        :return: for `async for`; what is not taken waits, without a limit.
        :raises LinkLost: while iterating, when this connection is cut.
        :raises EngineGone: while iterating, when the engine goes without an end.
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

        :param condition: looks at the state; called again whenever that has changed.
        :param seconds: how long to wait at most; None: as long as the session lasts.
        :return: what `condition` gave.
        :raises TimeoutError: after so many seconds.
        :raises EngineGone: when the session ends before, or this connection (`LinkLost`).
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
        """Wait until a task has come to its end.

        :param task: its id, as `start` and `submit` give it.
        :param seconds: how long to wait at most; None: as long as the session lasts.
        :return: the task; its `status` says how it ended: SUCCEEDED, ABORTED, CANCELED or REJECTED.
        :raises TimeoutError: after so many seconds.
        :raises EngineGone: when the session ends before, or this connection (`LinkLost`).
        """

        def find_ended(view: SessionView) -> TaskView | None:
            found = view.tasks.get(task)
            return found if found is not None and found.status in FINAL else None

        return await self.wait_until(find_ended, seconds)

    # --- what there is to do ------------------------------------------------------------------------------------

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
        """Raise an event. Whether a rule took it is in its record.

        :param topic: as the rules name it: `/H_arrived`.
        :return: the task's id.
        :raises Rejected: the event has no name.
        """
        return await self.submit("raiseEventTopic", topic)

    async def set(self, key: str, value: Any) -> int:
        """Set a key of the working memory; it is made when it is not there.

        :param key: its name.
        :param value: what JSON can hold: None, a truth value, a number, a text, or lists and dicts of these.
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
        """Stop everything, at once; nothing starts until somebody releases the stop. Every role may do this.

        :return: the task's id. `view.stop` says what the robot has confirmed.
        """
        return await self.submit("stopAll")

    async def release_stop(self) -> int:
        """Let acts and rules start again after a stop.

        :return: the task's id.
        :raises Rejected: only the wizard who holds control may, and programs that `[control] may_release` of the
            scenario names.
        """
        return await self.submit("releaseStop")

    async def submit(self, function: str, behavior: str = "", calling_type: str = "") -> int:
        """Submit a task.

        :param function: what to do, by its name in the record: `raiseEventTopic`, `assignValue`, ...
        :param behavior: to what: an act, a rule, a topic, an assignment.
        :param calling_type: `Blocking`, `None` or `Interrupt` instead of the act's own.
        :return: the task's id, for `wait_for_task`.
        :raises Rejected: with the engine's sentence.
        """
        task = await self._send(Submit(function=function, behavior=behavior, calling_type=calling_type))
        return task or 0

    async def add_note(self, text: str) -> None:
        """Add a remark to the record.

        :param text: what to remark, in one or more lines.
        :raises Rejected: nothing can be recorded.
        """
        await self._send(Note(text=text))

    async def report_check(
        self, check: str, result: CheckResult, *, text: str = "", value: str = "", reason: str = ""
    ) -> None:
        """Put on record what came of something that was looked at before or after the session.

        :param check: its id, as study.toml names it.
        :param result: `passed`, `failed` or `skipped`.
        :param text: what was looked at.
        :param value: what was found.
        :param reason: why it failed, or was skipped.
        :raises Rejected: nothing can be recorded; always for an observer.
        """
        await self._send(CheckReport(id=check, text=text, result=result, value=value, reason=reason))

    async def report_outcome(self, status: OutcomeStatus, reason: str = "") -> None:
        """Put on record how the session is to count. The last word counts.

        :param status: `complete`, `aborted` or `excluded`.
        :param reason: why, for the record.
        :raises Rejected: only the wizard who holds control may, and programs; never an observer.
        """
        await self._send(OutcomeReport(status=status, reason=reason))

    async def report_recording(
        self, name: str, status: RecordingStatus, *, path: str = "", bytes: int | None = None, reason: str = ""
    ) -> None:
        """Put on record how something stands that records the session.

        :param name: what it is called: `camera`.
        :param status: `started`, `running`, `stalled`, `stopped` or `failed`.
        :param path: of its file.
        :param bytes: how large that is now; None: not known.
        :param reason: why it has stalled or failed.
        :raises Rejected: nothing can be recorded; always for an observer.
        """
        await self._send(RecordingReport(name=name, status=status, path=path, bytes=bytes, reason=reason))

    async def mark_sync(
        self, number: int, medium: str, text: str = "", *, at: float | None = None, within: float | None = None
    ) -> None:
        """Put on record that a mark was given which recordings show.

        :param number: of the mark; `view.sync` has that of the last one.
        :param medium: by what it is seen or heard: `sound`, `flash`.
        :param text: anything about it.
        :param at: session time in seconds at which it began; None: now.
        :param within: seconds by which that is wrong at most; None: not known.
        :raises Rejected: nothing can be recorded; always for an observer.
        """
        await self._send(SyncMark(number=number, medium=medium, text=text, at=at, within=within))

    async def change_control(self, verb: ControlVerb) -> None:
        """Do something about who holds control, as a wizard.

        :param verb: `take` it (whoever has it), `ask` the holder for it, `give` it to who asked, or `release` it.
        :raises Rejected: with the engine's sentence; always for a `node` or an `observer`.
        """
        reply = await self._client.change_control(verb)
        if not reply.accepted:
            raise Rejected(reply.reason)

    async def end(self, reason: str = "") -> None:
        """Stop the robot, end the session, and wait until it has ended.

        :param reason: why, for the record.
        :raises Rejected: only the wizard who holds control may, and programs; never an observer.
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
        if task is not None:  # its records have come before the answer; here they are taken in
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
                    if isinstance(update, ShadowStatus):  # only of a shadow
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
