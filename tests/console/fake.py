"""An engine that does what a test says: remembers what it was sent, and plays records."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from pathlib import Path
from typing import Any

from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    MemoryRecord,
    RobotRecord,
    RuleRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.link.client import ClientInput, EngineGone, Hello, Reply
from rise_engine.scenario import load
from rise_engine.scenario.model import Scenario
from rise_engine.view import View
from rise_tui.launch import Launcher, Prepared, Settings

DEMO = str(Path(__file__).parent / "data" / "demo")


def demo() -> Scenario:
    scenario = load(DEMO).scenario
    assert scenario is not None
    return scenario


class FakeClient:
    """Implements `rise_engine.link.client.Client`."""

    def __init__(self, scenario: Scenario, *, mode: str = "debug") -> None:
        self.scenario = scenario
        self.mode = mode
        self.time = 83.0
        self.sent: list[Submit] = []
        self.closed: list[bool] = []
        self.answers = True
        """Whether a submitted task gets its reply at once."""
        self.reject = ""
        self.gone = ""
        self._seq = 0
        self._tasks = 0
        self._queue: asyncio.Queue[Sequence[AnyRecord] | None] = asyncio.Queue()
        self._view = View()
        self._attached = False
        self._answer = asyncio.Event()
        start: list[AnyRecord] = [RobotRecord(0, 0.0, "", status="connected", detail="")]
        start += [
            MemoryRecord(0, 0.0, "", key, value, None, "file", created=True) for key, value in scenario.memory.items()
        ]
        for record in start:
            self.emit(record, at=0.0)

    # --- what a test does ---

    def emit(self, *records: AnyRecord, at: float | None = None) -> None:
        """Play records; they get their numbers and times here."""
        for record in records:
            self._seq += 1
            record.seq, record.t = self._seq, self.time if at is None else at
        if self._attached:
            self._queue.put_nowait(list(records))
        else:
            for record in records:
                self._view.apply(record)

    def task(self, function: str, behavior: str, status: str = "ACTIVE", **more: Any) -> int:
        """A new task, with one record for each state on its way."""
        self._tasks += 1
        source = more.pop("source", "wizard:anna")
        for state in ["PENDING", "ACTIVE", status] if status not in ("PENDING", "ACTIVE", "REJECTED") else [status]:
            if state == "PENDING" and status != "PENDING":
                continue
            reason = more.get("reason", "") if state == status else ""
            fields: dict[str, Any] = {"ref": more.get("ref"), "position": more.get("position")}
            self.emit(
                TaskRecord(0, 0.0, "", self._tasks, function, behavior, "Blocking", source, state, reason, **fields)
            )  # type: ignore[arg-type]
        return self._tasks

    def act(self, name: str, status: str = "ACTIVE", **more: Any) -> int:
        return self.task("startCommunicationRobotAct", name, status, **more)

    def end_task(self, id: int, name: str, status: str = "SUCCEEDED", reason: str = "") -> None:
        what = "startCommunicationRobotAct"
        self.emit(TaskRecord(0, 0.0, "", id, what, name, "Blocking", "wizard:anna", status, reason))  # type: ignore[arg-type]

    def action(self, task: int, act: str, id: str, kind: str, status: str, **parameters: Any) -> None:
        self.emit(ActionRecord(0, 0.0, "", task, act, id, kind, parameters, status))  # type: ignore[arg-type]

    def rule(self, name: str, status: str, state: str | None, **more: Any) -> None:
        self.emit(RuleRecord(0, 0.0, "", name, status, state, **more))  # type: ignore[arg-type]

    def stop(self, status: str, confirmed: tuple[str, ...] = (), unconfirmed: tuple[str, ...] = ()) -> None:
        self.emit(
            StopRecord(0, 0.0, "", status=status, confirmed=confirmed, unconfirmed=unconfirmed, source="wizard:anna")
        )  # type: ignore[arg-type]

    def answer(self) -> None:
        """Let everything that waits for its reply have it; a test has played the records."""
        self._answer.set()

    def end(self, reason: str) -> None:
        self.gone = reason
        self._queue.put_nowait(None)

    def asked(self) -> list[tuple[str, str]]:
        """What was sent: function and behavior."""
        return [(message.function, message.behavior) for message in self.sent]

    # --- Client ---

    async def attach(self) -> Hello:
        self._attached = True
        return Hello(self.scenario, self.mode, self.scenario.robot.name, 1, self._view)

    async def records(self) -> AsyncIterator[Sequence[AnyRecord]]:
        while (batch := await self._queue.get()) is not None:
            yield batch
        raise EngineGone(self.gone)

    async def send(self, message: ClientInput) -> Reply:
        if self.gone:
            raise EngineGone(self.gone)
        assert not isinstance(message, Note)
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

    async def close(self, *, end_session: bool = True) -> None:
        self.closed.append(end_session)


class FakeLauncher(Launcher):
    """Gives prepared clients, and remembers what it was asked to start."""

    def __init__(self, *clients: FakeClient, prepared: Prepared | None = None) -> None:
        self.clients = list(clients)
        self.started: list[Settings] = []
        self.prepared_with: list[Settings] = []

        def prepare(settings: Settings) -> Prepared:
            self.prepared_with.append(settings)
            return prepared if prepared is not None else self.clients[0].scenario

        def start(scenario: Scenario, settings: Settings) -> FakeClient:
            self.started.append(settings)
            return self.clients[min(len(self.started), len(self.clients)) - 1]

        super().__init__(prepare, start)
