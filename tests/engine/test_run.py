"""`rise-engine run`, as a user runs it."""

from __future__ import annotations

import io
import json
import logging
import os
import shlex
import signal
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from rise_engine.cli import run as run_module
from rise_engine.cli.output import Output, ThreadedOutput
from rise_engine.cli.run import RunOptions
from rise_engine.cli.run import run as run_session
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, AnyInput, RobotChanged, StopReport, Submit
from rise_engine.kernel.records import AnyRecord, MemoryRecord, NoteRecord
from rise_engine.ports.robot import ReportCallback
from rise_engine.protocol.session_options import SessionOptions

from .processes import ENGINE, Live, engine, folder, records
from .samples import GREETING, assert_one_ending_each, scenario, start

pytestmark = pytest.mark.slow

FAST = ("--speed", "max", "--json")


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return folder(tmp_path / "study")


def task(function: str, behavior: str = "", **more: object) -> str:
    return json.dumps({"function_type": function, "domain_task_behavior": behavior, **more})


def act(name: str, **more: object) -> str:
    return task("startCommunicationRobotAct", name, **more)


def options(first: tuple[Submit, ...], speed: float | None, **more: Any) -> RunOptions:
    """`speed` None: in virtual time."""
    session = SessionOptions(str(GREETING), speed=speed or 1.0, first_tasks=first)
    return RunOptions(scenario(GREETING), session, virtual=speed is None, **more)


# --- what it prints ---


def test_an_act_from_start_to_end(study: Path) -> None:
    done = engine("run", study, "--act", "Greet", *FAST)
    assert (done.returncode, done.stderr) == (0, "")
    found = records(done.stdout)
    assert found[0]["kind"] == "session" and found[0]["status"] == "started" and found[0]["mode"] == "debug"
    assert found[0]["scenario_hash"] and set(found[0]["versions"]) == {"rise-tui", "python"}
    assert found[-1]["kind"] == "session" and found[-1]["status"] == "ended"
    assert_one_ending_each(found)
    spoken = [
        r["parameters"]["message"]
        for r in found
        if r["kind"] == "action" and r["status"] == "started" and r["type"] == "Speech"
    ]
    assert spoken == ["Hello, Anna!", "How are you?"]
    assert all({"seq", "t", "wall", "kind"} <= set(record) for record in found)


def test_the_transcript(study: Path) -> None:
    done = engine("run", study, "--act", "Greet", "--speed", "max")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert any(line.startswith("00:00.0") and '"Hello, Anna!"' in line and line.endswith("started") for line in lines)
    assert any("Greet" in line and "succeeded, " in line for line in lines)
    assert not any("accepted" in line for line in lines)


def test_the_same_twice_is_the_same_byte_for_byte(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "s.jsonl"
    script.write_text(
        "\n".join([act("Chat", at=n * 1.7) for n in range(8)] + [act("Greet", at=3, calling_type="None")])
    )
    command = ("run", study, "--tasks", script, "--speed", "max", "--json", "--fault", "Speech=slow:1.5@3")
    assert engine(*command, "--seed", 7).stdout == engine(*command, "--seed", 7).stdout
    said = [
        [
            r["parameters"]["message"]
            for r in records(engine(*command, "--seed", seed).stdout)
            if r["kind"] == "action" and r["act"] == "Chat" and r["status"] == "started"
        ]
        for seed in (7, 8, 9, 10)
    ]
    assert len({tuple(each) for each in said}) > 1, "the seed matters"
    for each in said:
        assert all(first != second for first, second in pairwise(each))


def test_real_time_says_the_same_as_virtual_time(study: Path) -> None:
    def what(speed: str) -> list[tuple[str, ...]]:
        done = engine("run", study, "--act", "Greet", "--speed", speed, "--json")
        return [(r["kind"], r.get("status", ""), r.get("action", "")) for r in records(done.stdout)]

    assert sorted(what("20")) == sorted(what("max"))


@pytest.mark.parametrize("speed", ["20", "max"])
def test_tasks_of_one_moment_go_in_the_order_of_their_lines(study: Path, tmp_path: Path, speed: str) -> None:
    script = tmp_path / "s.jsonl"
    topics = [f"/{number}" for number in range(40)]
    script.write_text("".join(task("raiseEventTopic", topic, at=0.1) + "\n" for topic in topics))
    done = engine("run", study, "--tasks", script, "--speed", speed, "--json")
    assert [r["topic"] for r in records(done.stdout) if r["kind"] == "event"] == topics


def test_first_set_then_rules_then_acts_then_tasks(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "s.jsonl"
    script.write_text(
        "# a comment\n\n" + task("raiseEventTopic", "/go", at=2) + "\n" + task("assignValue", "n = 1", at=0) + "\r\n"
    )
    done = engine(
        "run", study, "--act", "Chat", "--rule", "Wait for it", "--set", "name=Ben", "--set", "n=0", "--tasks", script,
        *FAST,
    )  # fmt: skip
    assert done.returncode == 0
    assert "Ben was taken as a text" in done.stderr
    tasks = [(r["t"], r["function"], r["source"]) for r in records(done.stdout) if r["kind"] == "task"]
    order = list(dict.fromkeys((t, function) for t, function, source in tasks if not source.startswith("rule:")))
    assert order[:5] == [
        (0.0, "assignValue"),
        (0.0, "startInteractionRule"),
        (0.0, "startCommunicationRobotAct"),
        *[(t, f) for t, f in order[3:5]],
    ]
    assert [source for t, f, source in tasks if f == "raiseEventTopic"] == ["file"]
    memory = [(r["key"], r["value"]) for r in records(done.stdout) if r["kind"] == "memory"]
    assert memory[-3:] == [("name", "Ben"), ("n", 0), ("n", 1)]
    assert any("Hello, Ben!" in line for line in done.stdout.splitlines())


@pytest.mark.parametrize(
    ("setting", "value"),
    [("n=2", 2), ("n=2.5", 2.5), ('n="it\'s \\"so\\""', 'it\'s "so"'), ("n=null", None), ('n={"a": [1, {"b": true}]}',
     {"a": [1, {"b": True}]}), ("n=", ValueError), ("=2", ValueError), ("n", ValueError), ("n=[1", ValueError),
     ("n=NaN", "NaN"), ("n=Anna Maria", "Anna Maria"), ('n={"a": 1, "a": 2}', ValueError), ("n=01", ValueError)],
)  # fmt: skip
def test_set(study: Path, setting: str, value: object) -> None:
    done = engine("run", study, "--set", setting, *FAST)
    if value is ValueError:
        assert done.returncode == 2 and done.stdout == "" and "--set" in done.stderr
    else:
        assert done.returncode == 0
        assert next(r["value"] for r in reversed(records(done.stdout)) if r["kind"] == "memory") == value


# --- when it ends ---


def test_idle_means_that_waiting_rules_do_not_keep_it_alive(study: Path) -> None:
    done = engine("run", study, "--rule", "Wait for it", *FAST)
    assert done.returncode == 0
    assert records(done.stdout)[-1]["t"] == 0


def test_until_a_time(study: Path) -> None:
    done = engine("run", study, "--rule", "Clock", "--until", "35", *FAST)
    assert done.returncode == 0
    found = records(done.stdout)
    assert found[-1]["t"] == 35 and found[-1]["status"] == "ended"
    assert len([r for r in found if r["kind"] == "rule" and r["trigger"] == "after 10s"]) == 3


def test_the_latest_until(study: Path) -> None:
    done = engine("run", study, "--until", "2592000", *FAST)
    assert (done.returncode, done.stderr) == (0, "")
    assert records(done.stdout)[-1]["wall"] == "1970-01-31T00:00:00.000+00:00"


def test_until_a_time_in_the_middle_of_an_act_stops_the_robot_first(study: Path) -> None:
    found = records(engine("run", study, "--act", "Greet", "--until", "0.5", *FAST).stdout)
    assert_one_ending_each(found)
    assert [r["status"] for r in found if r["kind"] == "stop"] == ["requested", "latched"]
    assert found[-1]["kind"] == "session"


def test_what_would_never_be_idle_ends_with_a_message(study: Path) -> None:
    done = engine("run", study, "--rule", "Clock", *FAST)
    assert done.returncode == 4 and "--until" in done.stderr
    assert records(done.stdout)[-1]["status"] == "ended"


def test_circles_without_any_time_passing_end_with_a_message(study: Path) -> None:
    done = engine("run", study, "--rule", "Circle", *FAST, "--until", "1")
    assert done.returncode == 4 and "circles" in done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert found[-1]["status"] == "ended"
    assert_one_ending_each(found)


# --- exit statuses ---


def test_a_refused_scenario(tmp_path: Path) -> None:
    study = folder(tmp_path / "bad", bad='<Dialog name="Bad"><Speach><actionID>1</actionID></Speach></Dialog>')
    done = engine("run", study, *FAST)
    assert done.returncode == 1 and done.stdout == ""
    assert "acts/bad.xml:1:" in done.stderr and "Speech" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--act", "Gret"), "`Greet`"),
        (("--rule", "Wait for  it"), "`Wait for it`"),
        (("--speed", "0"), "above 0"),
        (("--speed", "fast"), "above 0"),
        (("--until", "-1"), "0 or more"),
        (("--until", "nan"), "0 or more"),
        (("--until", "1e300"), "30 days"),
        (("--until", "2592001"), "30 days"),
        (("--speed", "1e300"), "up to 1000000"),
        (("--seed", "x"), "seed"),
        (("--fault", "Speach=fail"), "'Speech'"),
        (("--fault", "Speech=explode"), "unknown kind"),
        (("--tasks", "nowhere.jsonl"), "nowhere.jsonl"),
        (("--mode", "dry"), "debug"),
        (("--wat",), "--wat"),
    ],
)
def test_wrong_usage_is_refused_before_anything_starts(study: Path, arguments: tuple[str, ...], said: str) -> None:
    done = engine("run", study, *FAST, *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_missing_folder(tmp_path: Path) -> None:
    for command in ("run", "check"):
        done = engine(command, tmp_path / "nowhere")
        assert done.returncode == 2 and "there is no folder" in done.stderr


def test_strict(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "s.jsonl"
    script.write_text(act("Gret"))
    loose = engine("run", study, "--tasks", script, *FAST)
    assert loose.returncode == 0
    assert f"{script}:1: warning" in loose.stderr and "`Greet`" in loose.stderr
    assert [r["status"] for r in records(loose.stdout) if r["kind"] == "task"] == ["REJECTED"]
    assert engine("run", study, "--tasks", script, "--strict", *FAST).returncode == 3
    assert engine("run", study, "--act", "Greet", "--strict", *FAST).returncode == 0
    aborted = engine("run", study, "--act", "Greet", "--strict", "--fault", "Speech=fail", *FAST)
    assert aborted.returncode == 3


# --- faults ---


@pytest.mark.parametrize(
    ("fault", "ended", "outcome"),
    [
        ("Speech=reject", "failed", "ABORTED"),
        ("Speech=fail@2", "failed", "ABORTED"),
        ("LookAt=slow:4", "succeeded", "SUCCEEDED"),
        ("Speech=hang", "timed-out", "ABORTED"),
        ("LookAt=hang", "timed-out", "ABORTED"),
        ("vanish@0.5", "lost", "ABORTED"),
        ("vanish@0.5-1", "lost", "ABORTED"),
        ("*=fail", "failed", "ABORTED"),
    ],
)
@pytest.mark.parametrize("speed", ["max", "200"])
def test_whatever_goes_wrong_every_action_ends_exactly_once(
    study: Path, fault: str, ended: str, outcome: str, speed: str
) -> None:
    done = engine("run", study, "--act", "Greet", "--json", "--speed", speed, "--fault", fault)
    assert done.returncode == 0, done.stderr
    found = records(done.stdout)
    assert_one_ending_each(found)
    assert ended in [r["status"] for r in found if r["kind"] == "action"]
    assert [r["status"] for r in found if r["kind"] == "task"][-1] == outcome


def test_a_hanging_part_does_not_confirm_a_stop(study: Path) -> None:
    found = records(engine("run", study, "--act", "Greet", "--until", "1", "--fault", "Speech=hang", *FAST).stdout)
    latched = next(r for r in found if r["kind"] == "stop" and r["status"] == "latched")
    assert latched["unconfirmed"] == ["generic/speech"] and "generic/gaze" in latched["confirmed"]
    assert_one_ending_each(found)


# --- task files ---


def test_every_mistake_of_a_task_file_is_told_before_anything_starts(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "bad.jsonl"
    script.write_text(
        "\n".join(
            [
                act("Greet"),
                "{not json",
                '{"function_type": "startComunicationRobotAct", "domain_task_behavior": "Greet"}',
                '{"function_typ": "stopAll"}',
                act("Greet", at=-1),
                act("Greet", calling_type="blocking"),
                '{"function_type": "stopAll", "function_type": "stopAll"}',
                "[1]",
                task("raiseEventTopic"),
                act("Greet", at="soon"),
                act("Greet", at=True),
            ]
        )
    )
    done = engine("run", study, "--tasks", script, *FAST)
    assert done.returncode == 2 and done.stdout == ""
    told = done.stderr.splitlines()
    for line in range(2, 12):
        assert any(each.startswith(f"{script}:{line}:") for each in told), (line, told)
    assert "`startCommunicationRobotAct`" in done.stderr and "`function_type`" in done.stderr
    assert not any(each.startswith(f"{script}:1:") for each in told)


def test_tasks_that_are_not_text(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "bad.jsonl"
    script.write_bytes(b"\xff\xfe{}")
    done = engine("run", study, "--tasks", script, *FAST)
    assert done.returncode == 2 and "UTF-8" in done.stderr


def test_a_whole_script_from_standard_input_in_virtual_time(study: Path) -> None:
    lines = "\n".join([act("Chat", at=5), act("Greet", at=1)])
    done = engine("run", study, "--tasks", "-", *FAST, stdin=lines)
    started = [
        (r["t"], r["behavior"]) for r in records(done.stdout) if r["kind"] == "task" and r["status"] == "PENDING"
    ]
    assert started == [(1, "Greet"), (5, "Chat")]
    assert engine("run", study, "--tasks", "-", *FAST, stdin="{").returncode == 2


def test_standard_input_as_it_comes(study: Path) -> None:
    with Live("run", study, "--tasks", "-", "--speed", "20", "--json") as live:
        live.until("robot", status="connected")
        live.write(act("Greet"))
        live.until("task", behavior="Greet", status="SUCCEEDED")
        live.write("# what next?\n\n" + task("nonsense"))
        live.write(task("assignValue", "n = 1"))
        live.until("memory", key="n")
        live.write(act("Chat", at=0))
        live.until("task", behavior="Chat", status="ACTIVE")
        live.end_input()
        assert live.rest() == 2, "one line could not be used"
        assert live.records[-1]["kind"] == "session"
        assert "-:4: error: unknown function_type `nonsense`" in live.errors()
        assert_one_ending_each(live.records)


def test_the_end_of_standard_input_ends_the_session_when_all_is_done(study: Path) -> None:
    with Live("run", study, "--tasks", "-", "--speed", "20", "--json") as live:
        live.until("robot")
        live.write(act("Greet"))
        live.until("action", status="started")
        live.end_input()
        assert live.rest() == 0
        assert [r["status"] for r in live.records if r["kind"] == "task"][-1] == "SUCCEEDED"


# --- signals and pipes ---


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_stops_the_robot_first(study: Path, which: signal.Signals) -> None:
    with Live("run", study, "--act", "Greet", "--json") as live:
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
        for redirected in ("<&-", "</dev/null"):
            line = f"{shlex.quote(ENGINE)} run {shlex.quote(str(study))} --tasks - --json --speed {speed} {redirected}"
            done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=20, check=False)
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


def test_a_reader_that_goes_away_ends_the_session_quietly(study: Path) -> None:
    for speed in ("50", "max"):
        command = [ENGINE, "run", str(study), "--rule", "Clock", "--until", "40000", "--speed", speed, "--json"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL)
        assert process.stdout is not None and process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(30) == 141
        assert process.stderr.read() == b""
        process.stderr.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("speed", ["max", "1"])
def test_a_full_disk_ends_the_session(study: Path, speed: str) -> None:
    for options in ((), ("--json",)):
        command = [ENGINE, "run", str(study), "--act", "Greet", "--rule", "Clock", "--until", "1000", "--speed", speed]
        with Path("/dev/full").open("wb") as full:
            done = subprocess.run(
                [*command, *options], stdout=full, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, timeout=60,
                check=False,
            )  # fmt: skip
        assert done.returncode == 70
        (line,) = done.stderr.decode().splitlines()
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


@pytest.mark.parametrize("as_json", [True, False])
@pytest.mark.parametrize("speed", [None, 10.0])
def test_a_record_that_cannot_be_written_stops_the_robot(
    speed: float | None, as_json: bool, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    robot = _Robot()
    monkeypatch.setattr(run_module, "make_robot", lambda *arguments: robot)
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


# --- robots ---


def test_a_new_robot_and_a_new_action_are_files(tmp_path: Path) -> None:
    study = folder(
        tmp_path / "study",
        toml='robot = "trolley"\n[actions.Beep]\nchannels = ["horn"]\nparameters.times = { type = "integer" }\n',
        drive='<Dialog name="Serve"><Drive><actionID>1</actionID><place>table</place></Drive>'
        "<Beep><actionID>2</actionID><waitForActions>1</waitForActions><times>2</times></Beep></Dialog>",
    )
    (study / "robots").mkdir()
    (study / "robots" / "trolley.toml").write_text(
        'title = "Trolley"\n[actions.Speech]\n[actions.LookAt]\n'
        '[actions.Drive]\nchannels = ["base"]\nseconds = 4\n'
        'parameters.place = { type = "name", required = true, names = ["door", "table"] }\n'
    )
    done = engine("run", study, "--act", "Serve", *FAST)
    assert done.returncode == 0, done.stderr
    found = records(done.stdout)
    ended = [
        (r["t"], r["type"], r["parameters"]) for r in found if r["kind"] == "action" and r["status"] == "succeeded"
    ]
    assert ended[0] == (4.0, "Drive", {"place": "table"}) and ended[1][1:] == ("Beep", {"times": 2})
    assert "trolley: Trolley" in engine("robots", study).stdout
    schema = engine("schema", study, "--kind", "cra").stdout
    assert '"Drive"' in schema and '"Beep"' in schema


@pytest.mark.parametrize("robot", ["generic", "floka", "nao", "pepper"])
def test_every_robot_that_comes_with_it_runs(study: Path, robot: str) -> None:
    assert engine("check", study, "--robot", robot).returncode == 0
    done = engine("run", study, "--act", "Greet", "--robot", robot, "--strict", *FAST)
    assert done.returncode == 0
    assert records(done.stdout)[0]["robot"] == robot


def test_a_head_points_with_its_gaze(tmp_path: Path) -> None:
    study = folder(
        tmp_path / "study",
        point='<Dialog name="There"><PointAt><actionID>1</actionID><pointx>1</pointx><pointy>0</pointy>'
        "<pointz>1</pointz><hand>left</hand></PointAt></Dialog>",
    )
    found = records(engine("run", study, "--act", "There", "--robot", "floka", "--strict", *FAST).stdout)
    started = next(r for r in found if r["kind"] == "action")
    assert (started["type"], started["sent_as"]) == ("PointAt", "LookAt")
    refused = engine("run", study, "--act", "There", "--robot", "floka", "--fault", "PointAt=fail", *FAST)
    assert refused.returncode == 2 and "LookAt=fail" in refused.stderr


def test_mode_real(tmp_path: Path) -> None:
    study = folder(tmp_path / "study", toml='mode = "real"\nrobot = "arm"\n')
    (study / "robots").mkdir()
    (study / "robots" / "arm.toml").write_text('driver = "ros7"\n[actions.Speech]\n[actions.LookAt]\n')
    done = engine("run", study, *FAST)
    assert done.returncode == 1 and "'ros7' is not installed" in done.stderr and done.stdout == ""
    assert engine("run", study, "--mode", "debug", "--act", "Greet", *FAST).returncode == 0
    warned = engine("run", study, "--robot", "generic", *FAST)
    assert warned.returncode == 0 and "nothing leaves this machine" in warned.stderr
    found = records(warned.stdout)
    assert found[0]["mode"] == "real"
    assert any(r["kind"] == "note" and "nothing leaves this machine" in r["text"] for r in found)
