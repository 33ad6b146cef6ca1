"""`rise-engine run`: interrupts, readers that go away, disks that are full."""

from __future__ import annotations

import asyncio
import io
import logging
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from rise_engine.cli.session import headless_session
from rise_engine.cli.session.headless_session import RunOptions, run_session
from rise_engine.cli.session.transcript import Output, ThreadedOutput
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, AnyInput, RobotChanged, StopReport, Submit
from rise_engine.kernel.records import AnyRecord, MemoryRecord, NoteRecord
from rise_engine.ports.robot import ReportCallback
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.task_file import TimedTask
from tests.cli.processes import ENGINE, FAST, Live, engine, records
from tests.forked import Forked, run_engine
from tests.patience import PATIENCE
from tests.run.engine.samples import GREETING, assert_one_ending_each, scenario, start
from tests.virtual_time import VirtualLoop, monotonic

pytestmark = pytest.mark.slow


def options(first: tuple[Submit, ...], speed: float | None, **more: Any) -> RunOptions:
    """`speed` None: in virtual time."""
    session = SessionOptions(str(GREETING), speed=speed or 1.0, first_tasks=first)
    return RunOptions(scenario(GREETING), session, virtual=speed is None, **more)


# --- signals and pipes ---


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupt_stops_the_robot_first(study: Path, which: signal.Signals) -> None:
    with Live("run", study, "--act", "Greet", "--rule", "Clock", "--json") as live:  # the rule goes on
        live.until("action", status="accepted")
        live.signal(which)
        assert live.rest() == 130
        assert [r["status"] for r in live.records if r["kind"] == "stop"] == ["requested", "latched"]
        assert live.records[-1]["kind"] == "session" and live.records[-1]["reason"] == "interrupted"
        assert_one_ending_each(live.records)
        assert live.errors() == ""


def test_an_interrupt_while_waiting_for_standard_input(study: Path) -> None:
    with Live("run", study, "--tasks", "-", "--json") as live:
        live.until("robot", status="connected")
        live.signal()
        assert live.rest() == 130
        assert [r["status"] for r in live.records if r["kind"] == "stop"] == ["requested", "latched"]
        assert live.records[-1]["reason"] == "interrupted" and live.errors() == ""
    with Live("run", study, "--tasks", "-", *FAST) as live:  # reads all of it before anything starts
        live.write(f"# {'x' * 300_000}")  # more than a pipe holds: when it is written, somebody is reading
        live.signal()
        assert live.rest() == 130
        assert live.records == [] and live.errors() == ""


def test_no_standard_input_is_an_empty_one(study: Path) -> None:
    for speed in ("max", "1"):
        line = f"{shlex.quote(ENGINE)} run {shlex.quote(str(study))} --tasks - --json --speed {speed} <&-"
        closed = subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=PATIENCE, check=False)
        empty = run_engine("run", study, "--tasks", "-", "--json", "--speed", speed)
        for done in (closed, empty):
            assert (done.returncode, done.stderr) == (0, "")
            assert records(done.stdout)[-1]["reason"] == "nothing is left to do"


def test_an_interrupt_when_nothing_runs_stops_all_the_same(study: Path) -> None:
    with Live("run", study, "--rule", "Wait for it", "--until", "1000", "--json") as live:
        live.until("rule", status="entered")
        live.signal()
        assert live.rest() == 130
        assert [r["status"] for r in live.records if r["kind"] == "stop"] == ["requested", "latched"]


def test_a_second_interrupt_ends_at_once(study: Path) -> None:
    with Live("run", study, "--act", "Greet", "--json", "--fault", "Speech=hang") as live:
        live.until("action", status="accepted")
        live.signal()
        live.until("stop", status="latched")
        live.signal()
        assert live.rest() == 130
        assert live.records[-1]["kind"] == "stop"


HANGS = ("--act", "Greet", "--json", "--mode", "real", "--robot", "generic", "--fault", "Speech=hang")


def test_a_real_robot_is_left_as_it_is_only_by_a_third_interrupt(study: Path) -> None:
    with Live("run", study, *HANGS) as live:
        live.until("action", status="accepted")
        live.signal()
        live.until("stop", status="latched")
        live.signal()
        assert live.process.stderr is not None
        for line in live.process.stderr:  # two of one kind at once are one
            if "press ctrl+c again to leave at once, although it may still be moving" in line:
                break
        live.signal()
        assert live.rest() == 6
        assert live.records[-1]["kind"] == "stop"


def test_a_real_robot_is_stopped_whatever_else_ends(study: Path) -> None:
    """A logout sends SIGTERM and several SIGHUPs at once; and with `2>&1 | tee`, ctrl+c ends who reads the errors."""
    with Live("run", study, *HANGS) as live:
        live.until("action", status="accepted")
        assert live.process.stderr is not None
        live.process.stderr.close()
        live.signal()
        live.until("stop", status="requested")
        for which in (signal.SIGHUP, signal.SIGTERM, signal.SIGINT):
            live.signal(which)
        assert live.rest() == 6
        assert [r["status"] for r in live.records if r["kind"] == "stop"] == ["requested", "latched"]
        assert live.records[-1]["kind"] == "session" and live.records[-1]["reason"] == "interrupted"


def test_a_reader_that_goes_away_ends_the_session_quietly(study: Path) -> None:
    for speed in ("50", "max"):
        process = Forked("run", study, "--rule", "Clock", "--until", "40000", "--speed", speed, "--json")
        assert process.stdout is not None and process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(PATIENCE) == 141
        assert process.stderr.read() == ""
        process.stderr.close()


def test_a_reader_that_goes_away_hides_no_robot_that_still_moves(study: Path) -> None:
    what = ("--act", "Greet", "--rule", "Clock", "--until", "40000", "--speed", "20", "--json")
    process = Forked("run", study, *what, "--fault", "Speech=hang")
    assert process.stdout is not None and process.stderr is not None
    next(line for line in process.stdout if '"accepted"' in line)
    process.stdout.close()
    with process.stderr:
        assert process.wait(PATIENCE) == 6
        assert "the session has ended" in process.stderr.read()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("speed", ["max", "1"])
def test_a_full_disk_ends_the_session(study: Path, speed: str) -> None:
    for options in ((), ("--json",)):
        command = ["run", study, "--act", "Greet", "--rule", "Clock", "--until", "1000", "--speed", speed]
        with Path("/dev/full").open("wb") as full:
            done = run_engine(*command, *options, stdout=full)
        assert done.returncode == 70
        (line,) = done.stderr.splitlines()
        assert line.startswith("error: a record could not be written (OSError: ")


class _Robot:
    """Notes when it is told to stop, and answers."""

    def __init__(self) -> None:
        self.stopped = 0
        self._report: ReportCallback = lambda report: None

    def connect(self, report: ReportCallback) -> None:
        self._report = report
        report(RobotChanged(status="connected"))

    def start(self, goal: StartAction) -> None:
        self._report(ActionReport(action=goal.action, status="accepted"))

    def cancel(self, action: str) -> None:
        self._report(ActionReport(action=action, status="canceled"))

    def stop_all(self) -> None:
        self.stopped += 1
        self._report(StopReport(confirmed=("all",)))

    def close(self) -> None:
        pass


def test_after_a_standstill_no_line_is_done_that_was_due_before(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Ctrl+z for a minute; then the acts of that minute would begin one after another. A stop is never too late."""
    functions = [(1.0, "startCommunicationRobotAct"), (2.0, "stopAll"), (62.0, "startCommunicationRobotAct")]
    script = tuple(TimedTask(at, Submit(function=what, behavior="Greet"), "plan", 1) for at, what in functions)

    async def run() -> int:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        loop.call_later(0.7, loop.advance, 60.0)
        return await headless_session._run_connected(options((), 1.0, script=script, json=True), None)

    monkeypatch.setattr(headless_session, "make_robot", lambda *arguments: _Robot())
    monkeypatch.setattr("rise_engine.run.server.hub.time", monotonic)  # as it does, the time of day goes on
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        assert runner.run(run()) == 0
    done = records(capfd.readouterr().out)
    assert [r["text"] for r in done if r["kind"] == "note" and r["source"] == "engine"][-2:] == [
        "the engine stood still for 60 s: what happened then is recorded late",
        "plan:1: startCommunicationRobotAct Greet was not done: it was due 60 s ago",
    ]
    assert {(r["function"], r["t"] > 61) for r in done if r["kind"] == "task"} == {
        ("stopAll", False),
        ("startCommunicationRobotAct", True),
    }


@pytest.mark.parametrize("as_json", [True, False])
@pytest.mark.parametrize("speed", [None, 10.0])
def test_a_record_that_cannot_be_written_stops_the_robot(
    speed: float | None, as_json: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    robot = _Robot()
    monkeypatch.setattr(headless_session, "make_robot", lambda *arguments: robot)
    line = Output._format_record

    def too_deep(self: Output, record: AnyRecord) -> bytes | None:
        if isinstance(record, MemoryRecord):
            raise RecursionError("maximum recursion depth exceeded")
        return line(self, record)

    monkeypatch.setattr(Output, "_format_record", too_deep)
    first = (start("Greet"), Submit(function="assignValue", behavior="n = 1", source="test"))
    assert run_session(options(first, speed, until=1000.0, json=as_json)) == 70
    assert robot.stopped == 1
    out, err = capfd.readouterr()
    assert err == (
        "error: a record could not be written (RecursionError: maximum recursion depth exceeded); "
        "the session was ended\n"
    )
    assert "latched" in out and "a record could not be written" in out.splitlines()[-1]


@pytest.mark.parametrize("speed", [None, 10.0])
def test_an_engine_that_fails_says_so_and_loses_no_output(
    speed: float | None,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    handle = Kernel.handle

    def fails(self: Kernel, fact: AnyInput) -> object:
        if isinstance(fact, Submit):
            raise AssertionError("a mistake")
        return handle(self, fact)

    monkeypatch.setattr(Kernel, "handle", fails)
    with caplog.at_level(logging.CRITICAL):
        assert run_session(options((start("Greet"),), speed, json=True)) == 70
    out, err = capfd.readouterr()
    assert "a mistake in this program" in err
    assert records(out)[-1]["kind"] == "robot"


def test_half_characters_are_recorded_with_an_escape(study: Path) -> None:
    strange = study.rename(study.with_name(os.fsdecode(b"study\xff")))
    for options in ((), ("--json",)):
        done = engine("run", strange, "--act", "Greet", "--speed", "max", *options)
        assert (done.returncode, done.stderr) == (0, "")
        assert ("study\\\\udcff" if options else "study\\udcff") in done.stdout


def test_a_reader_that_takes_its_time_gets_everything(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ThreadedOutput, "CLOSE_SECONDS", 0.1)
    read, write = os.pipe()
    with os.fdopen(write, "wb") as pipe, os.fdopen(read, "rb") as reader:
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(pipe, "utf-8"))
        output = ThreadedOutput(json=False)
        for number in range(3000):
            output(NoteRecord(number, 0.0, "", f"note {number} " + "x" * 40, "engine"))
        got: list[bytes] = []

        def slowly() -> None:
            time.sleep(0.5)
            while len(got) < 3000:
                got.append(reader.readline())

        thread = threading.Thread(target=slowly)
        thread.start()
        output.close(lambda: False)
        thread.join(10)
        assert output.failure is None and b"note 2999 " in got[-1]
