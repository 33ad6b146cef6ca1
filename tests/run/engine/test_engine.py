"""The engine on virtual time: one step after the other, and nobody who can break it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import pytest

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, Note, RobotChanged, StopReport, Submit
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    NoteRecord,
    OpenGoal,
    RobotRecord,
    SessionRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.ports.robot import ReportCallback
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.run.protocol.client import Reply
from rise_engine.scenario.model import Scenario
from tests.run.engine.samples import GREETING, act, assert_one_ending_each, endings, scenario, speech, start


class InstantRobot:
    """A robot that answers inside the call, which is allowed."""

    def __init__(self) -> None:
        self.report: ReportCallback = lambda report: None
        self.calls: list[str] = []
        self.raises: dict[str, Exception] = {}
        self.answers = True

    def _called(self, name: str) -> None:
        self.calls.append(name)
        if name in self.raises:
            raise self.raises[name]

    def connect(self, report: ReportCallback) -> None:
        self.report = report
        self._called("connect")
        report(RobotChanged(status="connected"))

    def start(self, goal: StartAction) -> None:
        self._called("start")
        if self.answers:
            self.report(ActionReport(action=goal.action, status="accepted"))
            self.report(ActionReport(action=goal.action, status="succeeded"))

    def cancel(self, action: str) -> None:
        self._called("cancel")
        self.report(ActionReport(action=action, status="canceled"))

    def stop_all(self) -> None:
        self._called("stop_all")
        self.report(StopReport(confirmed=("all",)))

    def close(self) -> None:
        self._called("close")


class Session:
    def __init__(self, which: Scenario, robot: Any = None, faults: tuple[str, ...] = (), seed: int = 0) -> None:
        self.clock = VirtualClock()
        self.records: list[AnyRecord] = []
        self.robot = robot or make_robot(which.robot, "debug", self.clock, seed, faults)
        self.engine = Engine(which, self.robot, self.clock, seed, sinks=[self.records.append])
        self.engine.start()

    def run(self, until: Callable[[], bool] | None = None) -> None:
        while (until is None or not until()) and self.clock.advance():
            pass

    def end(self) -> list[AnyRecord]:
        self.engine.end("over")
        self.run(lambda: self.engine.ended)
        assert self.engine.ended
        return self.records

    def of(self, kind: type) -> list[Any]:
        return [record for record in self.records if isinstance(record, kind)]


def answered(engine: Engine, fact: Submit | Note) -> Reply:
    """Without a journal, the answer is there at once."""
    replies: list[Reply] = []
    engine.accept(fact, replies.append)
    return replies[0]


def test_a_session_from_its_first_record_to_its_last() -> None:
    s = Session(scenario(GREETING))
    reply = answered(s.engine, start("Greet"))
    assert reply.accepted and reply.task == 1
    s.run()
    records = s.end()
    assert [record.seq for record in records] == list(range(1, len(records) + 1))
    first, last = records[0], records[-1]
    assert isinstance(first, SessionRecord) and first.status == "started"
    assert set(first.versions) == {"rise-tui", "python"}
    assert isinstance(last, SessionRecord) and last.status == "ended" and last.reason == "over"
    assert_one_ending_each(records)
    assert endings(records) == {"1/1": 1, "1/2": 1, "1/3": 1}
    assert [record.t for record in records] == sorted(record.t for record in records)
    assert all(record.wall.startswith("1970-01-01T00:00:") for record in records)


@pytest.mark.parametrize("source", ["wizard:test", "ros:camera"])
def test_who_assigns_what_reads_a_key_without_value_gets_the_task(source: str) -> None:
    s = Session(scenario(GREETING))
    reply = answered(s.engine, Submit(function="assignValue", behavior="sum = nobody_knows + 1", source=source))
    assert reply.accepted and reply.task == 1
    assert any(isinstance(record, NoteRecord) and "'nobody_knows'" in record.text for record in s.records)


def test_a_rejected_task_says_why_and_names_the_nearest() -> None:
    s = Session(scenario(GREETING))
    reply = answered(s.engine, start("Gret"))
    assert not reply.accepted
    assert "Greet" in reply.reason
    assert reply.task == 1
    assert answered(s.engine, Note(text="hm", source="wizard:test")).accepted
    assert isinstance(s.records[-1], NoteRecord)


def test_a_robot_that_answers_inside_the_call_never_nests_a_step() -> None:
    chain = act("Chain", *(speech(str(n), wait=(str(n - 1),) if n else ()) for n in range(300)))
    s = Session(scenario(chain), InstantRobot())
    s.engine.accept(start("Chain"))
    assert sum(endings(s.records).values()) == 300
    assert [record.seq for record in s.records] == list(range(1, len(s.records) + 1))
    assert s.of(TaskRecord)[-1].status == "SUCCEEDED"


def test_a_robot_that_raises_in_start_fails_that_action_and_nothing_else(caplog: pytest.LogCaptureFixture) -> None:
    robot = InstantRobot()
    s = Session(scenario(GREETING), robot)
    robot.raises["start"] = RuntimeError("cable cut")
    with caplog.at_level(logging.CRITICAL):
        s.engine.accept(start("Greet"))
    failed = [record for record in s.of(ActionRecord) if record.status == "failed"]
    assert "cable cut" in failed[0].reason
    assert s.of(TaskRecord)[-1].status == "ABORTED"
    assert_one_ending_each(s.records)
    del robot.raises["start"]
    s.engine.accept(start("Greet"))
    assert s.of(TaskRecord)[-1].status == "SUCCEEDED"


@pytest.mark.parametrize("call", ["connect", "cancel", "stop_all", "close"])
def test_a_robot_that_raises_anywhere_does_not_end_the_session(call: str, caplog: pytest.LogCaptureFixture) -> None:
    robot = InstantRobot()
    robot.raises[call] = OSError("no route")
    with caplog.at_level(logging.CRITICAL):
        s = Session(scenario(GREETING), robot)
        robot.answers = False
        s.engine.accept(start("Greet"))
        s.engine.accept(Submit(function="stopAll", source="wizard:test"))
        s.run(lambda: s.engine.idle)
        records = s.end()
    assert isinstance(records[-1], SessionRecord)
    assert_one_ending_each(records)
    if call == "connect":
        assert any(isinstance(r, RobotRecord) and r.status == "lost" and "no route" in r.detail for r in records)
    if call == "stop_all":
        assert any(isinstance(r, StopRecord) and r.unconfirmed == ("generic",) for r in records)


def test_a_sink_that_raises_is_dropped_and_recorded(caplog: pytest.LogCaptureFixture) -> None:
    s = Session(scenario(GREETING))
    calls: list[int] = []

    def broken(record: AnyRecord) -> None:
        calls.append(record.seq)
        raise OSError("disk full")

    s.engine.subscribe(broken)
    with caplog.at_level(logging.CRITICAL):
        s.engine.accept(start("Greet"))
    assert len(calls) == 1
    assert any(isinstance(r, NoteRecord) and "disk full" in r.text for r in s.records)
    s.run()
    assert s.of(TaskRecord)[-1].status == "SUCCEEDED"


def test_a_sink_may_post_but_not_accept() -> None:
    s = Session(scenario(GREETING))

    def echo(record: AnyRecord) -> None:
        if isinstance(record, NoteRecord) and record.text == "ping":
            with pytest.raises(RuntimeError, match="post"):
                s.engine.accept(Note(text="no"))
            s.engine.post(Note(text="pong"))

    s.engine.subscribe(echo)
    s.engine.accept(Note(text="ping"))
    assert [record.text for record in s.of(NoteRecord)] == ["ping", "pong"]


def test_ending_while_something_runs_stops_the_robot_first() -> None:
    s = Session(scenario(GREETING))
    s.engine.accept(start("Greet"))
    records = s.end()
    stops = s.of(StopRecord)
    assert [stop.status for stop in stops] == ["requested", "latched"]
    assert stops[-1].confirmed and not stops[-1].unconfirmed
    assert isinstance(records[-1], SessionRecord) and records[-1].status == "ended"
    assert_one_ending_each(records)
    assert not answered(s.engine, start("Greet")).accepted, "after the end nothing is accepted"


def test_ending_with_a_robot_that_never_answers_waits_for_the_kernels_deadline_only() -> None:
    s = Session(scenario(GREETING), faults=("Speech=hang",))
    s.engine.accept(start("Greet"))
    records = s.end()
    assert_one_ending_each(records)
    assert s.of(StopRecord)[-1].unconfirmed == ("generic/speech",)
    assert s.clock.now() < 10


def test_before_the_end_everything_that_is_open_is_stopped_at_once() -> None:
    """Recorders need up to 19 s to finish, and the robot must not go on so long."""
    s = Session(scenario(GREETING), InstantRobot())
    s.engine.post(RobotChanged(status="degraded", open=(OpenGoal("pepper/base", "1/1", "Drive", "no answer"),)))
    s.engine.stop_before_end()
    assert s.robot.calls == ["connect", "stop_all"]


def test_ending_now_gives_every_action_an_ending() -> None:
    s = Session(scenario(GREETING), faults=("Speech=hang",))
    s.engine.accept(start("Greet"))
    s.engine.end_now("at once")
    assert s.engine.ended
    assert_one_ending_each(s.records)


def test_a_kernel_that_fails_leaves_the_robot_still(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    robot = InstantRobot()
    s = Session(scenario(GREETING), robot)
    ended: list[bool] = []
    s.engine.on_ended(lambda: ended.append(True))

    def fails(fact: object) -> Any:
        raise AssertionError("a mistake")

    monkeypatch.setattr(s.engine._kernel, "handle", fails)
    with caplog.at_level(logging.CRITICAL), pytest.raises(AssertionError):
        s.engine.accept(start("Greet"))
    assert robot.calls[-2:] == ["stop_all", "close"]
    assert s.engine.ended and isinstance(s.engine.failure, AssertionError) and ended == [True]
