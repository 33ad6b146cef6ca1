"""An engine that does what a test says: remembers what it was sent, and plays records."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    ControlRecord,
    MemoryRecord,
    NoteRecord,
    RobotRecord,
    RuleRecord,
    SessionRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol.client import (
    AttachReply,
    ClientInput,
    ClientUpdate,
    ControlVerb,
    EngineGone,
    Heartbeat,
    JournalStatus,
    LinkLost,
    Reply,
    Role,
    UnrecordedStop,
)
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_tui.config.launch import Launcher, LoadedScenario, RecoveredClient, ReportProgress, StudySource

DEMO = str(Path(__file__).parent / "data" / "demo")


@cache
def demo() -> Scenario:
    """Read once: nothing changes a scenario."""
    scenario = load(DEMO).scenario
    assert scenario is not None
    return scenario


class FakeClient:
    """Implements `rise_engine.run.protocol.client.Client`."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        mode: str = "debug",
        you: str = "wizard:anna",
        role: Role = "wizard",
        holder: str | None = "wizard:anna",
        replay: bool = False,
        folder: str = "/home/lab/rise-sessions/2026-11-21_141503_demo-study_debug",
    ) -> None:
        self.scenario = scenario
        self.mode = mode
        self.you, self.role, self.replay, self.folder = you, role, replay, folder
        self.journaling = JournalStatus()
        self.time = 83.0
        self.sent: list[Submit] = []
        self.notes: list[Note] = []
        self.reports: list[ClientInput] = []
        """What else was sent: checks, outcomes."""
        self.verbs: list[ControlVerb] = []
        self.take_overs = 0
        self.attached = 0
        self.unreachable = 0
        """How many attempts to attach fail as LinkLost from now on."""
        self.closed: list[bool] = []
        self.answers = True
        """Whether a submitted task gets its reply at once."""
        self.reject = ""
        self.gone = ""
        self._seq = 0
        self._tasks = 0
        self._queue: asyncio.Queue[Sequence[ClientUpdate] | EngineGone | None] = asyncio.Queue()
        self._view = SessionView()
        self._attached = False
        self._answer = asyncio.Event()
        start: list[AnyRecord] = [RobotRecord(0, 0.0, "", status="connected", detail="")]
        start += [
            MemoryRecord(0, 0.0, "", key, value, None, "file", created=True) for key, value in scenario.memory.items()
        ]
        if holder is not None:
            start.append(ControlRecord(0, 0.0, "", status="taken", by=holder, holder=holder))
        for record in start:
            self.emit(record, at=0.0)

    # --- what a test does ---

    def emit(self, *records: AnyRecord, at: float | None = None) -> None:
        """Play records; they get their numbers and times here."""
        for record in records:
            self._seq += 1
            record.seq, record.t = self._seq, self.time if at is None else at
        for record in records:
            self._view.apply(record)
        if self._attached:
            self._queue.put_nowait(list(records))

    def task(self, function: str, behavior: str, status: str = "ACTIVE", **more: Any) -> int:
        """A new task, with one record for each state on its way; what is done at once has one."""
        self._tasks += 1
        source = more.pop("source", "wizard:anna")
        lasts = function.startswith("start") or function == "say"
        for state in ["ACTIVE", status] if lasts and status not in ("PENDING", "ACTIVE", "REJECTED") else [status]:
            reason = more.get("reason", "") if state == status else ""
            fields: dict[str, Any] = {"ref": more.get("ref"), "position": more.get("position")}
            self.emit(
                TaskRecord(0, 0.0, "", self._tasks, function, behavior, "Blocking", source, state, reason, **fields)
            )  # type: ignore[arg-type]
        return self._tasks

    def act(self, name: str, status: str = "ACTIVE", **more: Any) -> int:
        return self.task("startCommunicationRobotAct", name, status, **more)

    def task_record(self, id: int, function: str, behavior: str, status: str) -> None:
        """What becomes of a task."""
        self.emit(TaskRecord(0, 0.0, "", id, function, behavior, "Blocking", "wizard:anna", status))  # type: ignore[arg-type]

    def end_task(self, id: int, name: str, status: str = "SUCCEEDED", reason: str = "") -> None:
        what = "startCommunicationRobotAct"
        self.emit(TaskRecord(0, 0.0, "", id, what, name, "Blocking", "wizard:anna", status, reason))  # type: ignore[arg-type]

    def action(self, task: int, act: str, id: str, kind: str, status: str, **parameters: Any) -> None:
        self.emit(ActionRecord(0, 0.0, "", task, act, id, kind, parameters, status))  # type: ignore[arg-type]

    def rule(self, name: str, status: str, state: str | None, **more: Any) -> None:
        self.emit(RuleRecord(0, 0.0, "", name, status, state, **more))  # type: ignore[arg-type]

    def stop(
        self, status: str, confirmed: tuple[str, ...] = (), unconfirmed: tuple[str, ...] = (), **more: Any
    ) -> None:
        more = {"source": "wizard:anna", **more}
        self.emit(StopRecord(0, 0.0, "", status=status, confirmed=confirmed, unconfirmed=unconfirmed, **more))  # type: ignore[arg-type]

    def answer(self) -> None:
        """Let everything that waits for its reply have it; a test has played the records."""
        self._answer.set()

    def control_record(self, status: str, by: str, holder: str | None) -> None:
        self.emit(ControlRecord(0, 0.0, "", status=status, by=by, holder=holder))  # type: ignore[arg-type]

    def journal(self, *, trouble: str = "", behind: float = 0.0, stop: UnrecordedStop | None = None) -> None:
        """How the record stands, from now on."""
        self.journaling = JournalStatus(durable=self._seq, behind=behind, trouble=trouble, stop=stop)
        if self._attached:
            self._queue.put_nowait([self.journaling])

    def pulse(self, robot_seen: float | None) -> None:
        """A sign of life."""
        if self._attached:
            self._queue.put_nowait([Heartbeat(robot_seen)])

    def cut(self) -> None:
        """Only this connection is cut; what is sent on it waits for ever."""
        self._attached = False
        self._queue.put_nowait(LinkLost("this console was too slow"))

    def end(self, reason: str) -> None:
        """The engine goes without an end."""
        self.gone = reason
        self._queue.put_nowait(EngineGone(reason))

    def end_in_order(self, reason: str) -> None:
        self.emit(SessionRecord(0, 0.0, "", status="ended", reason=reason))
        self._queue.put_nowait(None)

    def asked(self) -> list[tuple[str, str]]:
        """What was sent: function and behavior."""
        return [(message.function, message.behavior) for message in self.sent]

    # --- Client ---

    async def attach(self) -> AttachReply:
        self.attached += 1
        if self.unreachable:
            self.unreachable -= 1
            raise LinkLost("not yet")
        if self.gone:
            raise EngineGone(self.gone)
        self._attached = True
        return self.attach_reply()

    def attach_reply(self) -> AttachReply:
        """The state now."""
        return AttachReply(
            self.scenario,
            self.mode,
            self.scenario.robot.name,
            1,
            deepcopy(self._view),
            you=self.you,
            role=self.role,
            folder=self.folder,
            replay=self.replay,
            journaling=self.journaling,
        )

    async def records(self) -> AsyncIterator[Sequence[ClientUpdate]]:
        while (batch := await self._queue.get()) is not None:
            if isinstance(batch, EngineGone):
                raise batch
            yield batch

    async def send(self, message: ClientInput) -> Reply:
        if self.gone:
            raise EngineGone(self.gone)
        if isinstance(message, Note):
            self.notes.append(message)
            if self.reject:
                return Reply(False, self.reject)
            self.emit(NoteRecord(0, 0.0, "", message.text, message.source))
            return Reply(True)
        if not isinstance(message, Submit):
            if self.reject:
                return Reply(False, self.reject)
            self.reports.append(message)
            return Reply(True)
        self.sent.append(message)
        if not self.answers:
            await self._answer.wait()
        if self.reject:
            return Reply(False, self.reject)
        if self._answer.is_set():
            return Reply(True)
        status = "ACTIVE" if message.function.startswith("start") else "SUCCEEDED"
        return Reply(True, task=self.task(message.function, message.behavior, status, ref=message.ref))

    def now(self) -> float:
        return self.time

    async def change_control(self, verb: ControlVerb) -> Reply:
        """Remembers it, and does what an engine does about taking, asking, giving and releasing."""
        self.verbs.append(verb)
        if self.reject:
            return Reply(False, self.reject)
        holder = {"take": self.you, "ask": self._view.control, "give": self._view.asked, "release": None}[verb]
        status = {"take": "taken", "ask": "asked", "give": "given", "release": "released"}[verb]
        self.control_record(status, self.you, holder)
        return Reply(True)

    async def take_over(self) -> Reply:
        """Remembers it."""
        self.take_overs += 1
        return Reply(False, self.reject) if self.reject else Reply(True)

    async def close(self, *, end_session: bool = False) -> None:
        self.closed.append(end_session)
        if not end_session:  # the connection is gone, and with it the records
            self._queue.put_nowait(None)


class FakeLauncher(Launcher):
    """Gives prepared clients, and remembers what it was asked to start."""

    def __init__(
        self,
        *clients: FakeClient,
        prepared: LoadedScenario | None = None,
        recover: Callable[[AttachReply, ReportProgress], RecoveredClient] | None = None,
        find_study: Callable[[AttachReply], StudySource | None] = lambda attach_reply: None,
    ) -> None:
        self.clients = list(clients)
        self.started: list[SessionOptions] = []
        self.prepared = prepared
        """What a folder is read as; None: the scenario that runs."""
        self.prepared_with: list[SessionOptions] = []

        def prepare(settings: SessionOptions) -> LoadedScenario:
            self.prepared_with.append(settings)
            return self.prepared if self.prepared is not None else self.clients[0].scenario

        def start(scenario: Scenario, settings: SessionOptions) -> FakeClient:
            self.started.append(settings)
            return self.clients[min(len(self.started), len(self.clients)) - 1]

        super().__init__(start, prepare, recover, find_study)
