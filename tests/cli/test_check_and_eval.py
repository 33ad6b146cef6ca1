"""`rise-engine check`, `eval`, `schema`, `robots`: what they print, and their exit statuses."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from msgspec import structs

from rise_engine.cli.session.transcript import Transcript, clock_text
from rise_engine.kernel.record_words import ACTIONS_IN_MS, parameters_text
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    CheckRecord,
    OutcomeRecord,
    RecordingRecord,
    RobotRecord,
    RuleRecord,
    SessionRecord,
    StopRecord,
    SyncRecord,
    TaskRecord,
)
from rise_engine.scenario.reading.action_declarations import core_actions
from tests.chance import some
from tests.cli.processes import ENGINE, engine, folder
from tests.cli.started_anew import run_all
from tests.forked import run_engine

pytestmark = pytest.mark.slow

BAD = '<Dialog name="Bad">\n  <Speach><actionID>1</actionID></Speach>\n</Dialog>'


def test_a_clean_scenario(tmp_path: Path) -> None:
    done = engine("check", folder(tmp_path / "s"))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("no errors or warnings (3 acts, 3 rules, 1 memory key, robot generic)")


def test_a_scenario_can_be_given_by_its_toml_file(tmp_path: Path) -> None:
    assert engine("check", folder(tmp_path / "s") / "scenario.toml").returncode == 0
    wrong = engine("check", tmp_path / "s" / "memory.json")
    assert wrong.returncode == 2 and "scenario.toml" in wrong.stderr


def test_errors_have_a_location_a_code_and_a_summary(tmp_path: Path) -> None:
    done = engine("check", folder(tmp_path / "s", bad=BAD))
    assert done.returncode == 1
    *findings, summary = done.stdout.splitlines()
    assert any(line.startswith("acts/bad.xml:2:3: error ") and "Speech" in line for line in findings)
    assert summary.startswith("1 error, 0 warnings")


def test_warnings_alone_are_no_error(tmp_path: Path) -> None:
    lonely = '<InteractionRule name="Lonely" initial="A"><State id="A"><transition eventTopic="/never" target="A"/>' \
        "</State></InteractionRule>"  # fmt: skip
    study = folder(tmp_path / "s")
    (study / "rules" / "lonely.xml").write_text(lonely)
    done = engine("check", study)
    assert done.returncode == 0
    assert ": warning " in done.stdout and "0 errors, 1 warning" in done.stdout
    assert engine("run", study, "--speed", "max").returncode == 0


def test_check_as_json(tmp_path: Path) -> None:
    done = engine("check", folder(tmp_path / "s", bad=BAD), "--json")
    assert done.returncode == 1
    document = json.loads(done.stdout)
    assert document["errors"] == 1 and document["warnings"] == 0
    (finding,) = document["findings"]
    assert set(finding) == {"file", "line", "column", "end_line", "end_column", "severity", "code", "message"}
    assert (finding["file"], finding["line"], finding["column"]) == ("acts/bad.xml", 2, 3)
    assert json.loads(engine("check", folder(tmp_path / "t"), "--json").stdout) == {
        "errors": 0, "warnings": 0, "findings": [], "silenced": [],
    }  # fmt: skip


def test_check_for_another_robot(tmp_path: Path) -> None:
    study = folder(
        tmp_path / "s",
        brows='<Dialog name="Brows"><Animation><actionID>1</actionID><value>eyebrows_raise</value></Animation>'
        "</Dialog>",
    )
    assert engine("check", study, "--robot", "floka").returncode == 0
    assert engine("check", study, "--robot", "pepper").returncode == 1
    unknown = engine("check", study, "--robot", "peper")
    assert unknown.returncode == 1 and "`pepper`" in unknown.stdout


def test_a_driver_that_is_not_installed_is_found_the_evening_before(tmp_path: Path) -> None:
    study = folder(tmp_path / "s", toml='robot = "lab"')
    (study / "robots").mkdir()
    (study / "robots" / "lab.toml").write_text(
        'title = "Lab"\ndriver = "ros3"\n[actions.Speech]\n[actions.LookAt]\n', "utf-8"
    )
    for mode, status, severity in (("real", 1, "error"), ("debug", 0, "warning")):
        done = engine("check", study, "--mode", mode)
        assert done.returncode == status, done.stdout
        assert f"{severity} robot-profile: the robot driver 'ros3' is not installed" in done.stdout
        assert "did you mean `ros2`?" in done.stdout


@pytest.mark.parametrize("arguments", [("check",), ("run", "--act", "Greet", "--speed", "max")])
def test_neither_screen_nor_robot_is_imported_without_need_and_no_event_loop_to_check(
    tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    command, *options = arguments
    program = "import sys\nfrom rise_engine.cli import main\nmain.main(sys.argv[1:], standalone_mode=False)\n"
    watched = {"textual", "rich", "rclpy", "rise_tui"} | ({"asyncio"} if command == "check" else set())
    program = f"import atexit, sys\natexit.register(lambda: print({watched} & set(sys.modules)))\n{program}"
    arguments = ("-c", program, command, str(folder(tmp_path / "s")), *options)
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "set()"


# --- eval ---


@pytest.mark.parametrize(
    ("expression", "memory", "lines"),
    [
        ("n > 3 and not done", '{"n": 5}', ["value      true", "read as    (n > 3) and (not done)", "no done"]),
        ("n * 2", '{"n": 21}', ["value      42", "type       integer", "condition  true"]),
        ("name", '{"name": "Anna"}', ['value      "Anna"', "type       string"]),
        ("not n > 3", '{"n": 2}', ["value      true", "read as    not (n > 3)"]),
        ("1 / 0", "{}", ["value      Infinity", "type       number"]),
        ("nobody", "{}", ["value      null", "type       null", "condition  false"]),
    ],
)
def test_eval(expression: str, memory: str, lines: list[str]) -> None:
    done = engine("eval", expression, "--memory", memory)
    assert done.returncode == 0
    for line in lines:
        assert line in done.stdout


@pytest.mark.parametrize(
    ("arguments", "value"),
    [(("-1",), "-1"), (("-2^2",), "-4"), (("-(n)", "--memory", '{"n": 2}'), "-2"), (("--1",), "1"),
     (("--memory={}", "-height"), "0"), (("--memory", '{"h": 2}', "--", "--h"), "2")],
)  # fmt: skip
def test_an_expression_may_begin_with_a_minus(arguments: tuple[str, ...], value: str) -> None:
    done = engine("eval", *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines()[0] == f"value      {value}"


def test_an_unknown_option_of_eval_is_told_with_the_nearest() -> None:
    for arguments in (("n", "--memroy", "{}"), ("-1", "--memroy={}")):
        done = engine("eval", *arguments)
        assert done.returncode == 2 and "--memroy" in done.stderr and "--memory" in done.stderr
    assert engine("eval", "-h").stdout.startswith("Usage:")
    assert engine("eval").returncode == 2
    assert engine("eval", "-1", "-2").returncode == 2
    assert engine("eval", "-1", "--memory").returncode == 2


def test_eval_marks_the_column_of_a_mistake() -> None:
    done = engine("eval", "n > 3 AND m")
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr.splitlines()[:2] == ["n > 3 AND m", "      ^"]
    assert "`and`" in done.stderr


def test_eval_that_fails_at_run_time() -> None:
    done = engine("eval", "name < 3", "--memory", '{"name": "Anna"}')
    assert done.returncode == 1 and "error:" in done.stderr
    assert "read as    name < 3" in done.stdout


def test_eval_as_json() -> None:
    document = json.loads(engine("eval", "n + m", "--memory", '{"n": 1.5}', "--json").stdout)
    assert (document["value"], document["type"], document["missing"]) == (1.5, "number", ["m"])
    refused = engine("eval", "n >", "--json")
    assert refused.returncode == 1 and json.loads(refused.stdout)["column"] == 4


def test_eval_with_a_memory_file(tmp_path: Path) -> None:
    memory = tmp_path / "memory.json"
    memory.write_text('{"WorkingMemory": [{"n": 1}, {"m": 2}]}')
    for way in (str(memory), f"@{memory}"):
        assert "value      3" in engine("eval", "n + m", "--memory", way).stdout


@pytest.mark.parametrize("memory", ["nowhere.json", "{n: 1}", "[1]", '{"n": 1, "n": 2}', '{"n": NaN}'])
def test_a_memory_that_cannot_be_read(memory: str) -> None:
    done = engine("eval", "n", "--memory", memory)
    assert done.returncode == 2 and "--memory" in done.stderr and "Traceback" not in done.stderr


# --- schema, robots, the rest ---


def test_schemas(tmp_path: Path) -> None:
    from lxml import etree

    study = folder(tmp_path / "s")
    for kind, file in (("cra", "acts/greet.xml"), ("rules", "rules/rules.xml")):
        for arguments in ((), (str(study),)):
            done = engine("schema", *arguments, "--kind", kind)
            schema = etree.RelaxNG(etree.fromstring(done.stdout.encode()))
            schema.assertValid(etree.parse(str(study / file)))
    assert engine("schema", folder(tmp_path / "t", bad=BAD), "--kind", "cra").returncode == 1
    assert engine("schema", "--kind", "cra", "--robot", "peper").returncode == 1


def test_robots() -> None:
    text = engine("robots").stdout
    for name in ("floka", "generic", "nao", "pepper"):
        assert f"\n{name}: " in f"\n{text}"
    assert "PointAt, done as LookAt" in text
    rows = json.loads(engine("robots", "--json").stdout)["robots"]
    assert all(not row["findings"] and row["installed"] for row in rows)


def test_a_closed_pipe_ends_quietly() -> None:
    read, write = os.pipe()
    os.close(read)
    done = run_engine("robots", stdout=write)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


# --- terminals and names that are not UTF-8 ---

ENCODINGS: tuple[dict[str, str], ...] = (
    {},
    {"LC_ALL": "C"},
    {"PYTHONIOENCODING": "latin-1"},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"PYTHONIOENCODING": "ascii"},
)
HELLO = '<Dialog name="你好"><Speech><actionID>1</actionID><message>你好</message></Speech></Dialog>'
GREET = ("--act", "Greet", "--set", 'name="\\u4f60"', "--speed", "max")


@pytest.mark.search
@pytest.mark.parametrize("environment", some(ENCODINGS, 3), ids=str)
def test_terminals_and_names_that_are_not_utf_8(tmp_path: Path, environment: dict[str, str]) -> None:
    odd = folder(tmp_path / "odd")
    try:
        (odd / "acts" / os.fsdecode(b"b\xff.xml")).write_text(BAD)
    except OSError:
        pytest.skip("this file system has no such names")
    study = folder(tmp_path / "s", hello=HELLO)
    plain, as_json, refused, value, euro, missing, run, run_json, robots, schema = run_all(
        environment,
        ("check", odd),
        ("check", odd, "--json"),
        ("run", odd, "--speed", "max"),
        ("eval", '"你"'),
        ("eval", "n €"),
        ("check", tmp_path / "你"),
        ("run", study, *GREET),
        ("run", study, *GREET, "--json"),
        ("robots", "--json"),
        ("schema", study, "--kind", "cra"),
    )
    for done in (plain, as_json):
        assert (done.returncode, done.stderr) == (1, b"")
        assert b"\\udcff.xml" in done.stdout
    assert json.loads(as_json.stdout)["findings"][0]["file"] == "acts/b\\udcff.xml"
    assert refused.returncode == 1 and b"Traceback" not in refused.stderr and b"\\udcff.xml" in refused.stderr
    assert (value.returncode, value.stderr) == (0, b"")
    assert value.stdout.startswith(b"value")
    assert euro.returncode == 1 and b"Traceback" not in euro.stderr and b"error:" in euro.stderr
    assert missing.returncode == 2 and b"there is no folder" in missing.stderr
    for done in (run, run_json):
        assert (done.returncode, done.stderr) == (0, b"")
        assert b"\xe4\xbd\xa0" in done.stdout or (done is run and b"\\u4f60" in done.stdout)
    assert robots.returncode == schema.returncode == 0


def test_closed_streams_are_no_trouble(tmp_path: Path) -> None:
    study = folder(tmp_path / "s")
    for redirected in (">&-", "2>&-", "<&- >&- 2>&-"):
        line = f"{shlex.quote(ENGINE)} check {shlex.quote(str(study))} {redirected}"
        assert subprocess.run(["sh", "-c", line], capture_output=True, timeout=60, check=False).returncode == 0


# --- the readable transcript ---


def test_a_rule_that_stays_and_what_this_version_does_not_know() -> None:
    transcript = Transcript()
    stays = RuleRecord(1, 2.0, "", "R", "stayed", "S", "S", "/topic")
    assert (transcript.line_for(stays) or "").split("  ", 1)[0] == "00:02.0"
    assert (transcript.line_for(stays) or "").endswith("stays in S on /topic")
    new: Any = "levitating"
    records: list[AnyRecord] = [
        SessionRecord(seq=1, t=0, wall="", status=new),
        TaskRecord(1, 0, "", 1, "dance", "Waltz", "", "", new),
        ActionRecord(1, 0, "", 1, "A", "1", "Speech", {}, new),
        RuleRecord(1, 0, "", "R", new, None),
        RobotRecord(1, 0, "", new),
        StopRecord(1, 0, "", new),
    ]
    for record in records:
        assert "levitating" in (transcript.line_for(record) or "")
    begun = TaskRecord(1, 0, "", 1, "startCommunicationRobotAct", "Waltz", "Blocking", "", "ACTIVE")
    transcript.line_for(begun)
    transcript.line_for(structs.replace(begun, status=new, t=1))
    assert "succeeded, 2.0 s" in (transcript.line_for(structs.replace(begun, status="SUCCEEDED", t=2)) or "")


@pytest.mark.parametrize(
    ("record", "line"),
    [
        (CheckRecord(1, 2.0, "", "lights", "The lamp is on", "passed", "", "", "wizard:a"),
         "check passed The lamp is on, says wizard:a"),
        (CheckRecord(1, 2.0, "", "disk", "", "skipped", "3 GB free", "one session", "wizard:a"),
         "check skipped disk: 3 GB free, one session, says wizard:a"),
        (OutcomeRecord(1, 2.0, "", "complete", "", "wizard:a"), "session counts as complete says wizard:a"),
        (OutcomeRecord(1, 2.0, "", "aborted", "a fire drill", "wizard:a"),
         "session counts as aborted a fire drill, says wizard:a"),
        (RecordingRecord(1, 2.0, "", "camera", "running", "/a.mkv", 1048576, "", "node:c"),
         "recording running camera: /a.mkv, 1,048,576 bytes"),
        (RecordingRecord(1, 2.0, "", "camera", "stalled", "/a.mkv", None, "the disk is full", "node:c"),
         "recording stalled camera: the disk is full"),
        (SyncRecord(1, 2.0, "", 3, "flash", "at the end", "node:c"), "sync mark 3 flash at the end"),
        (SessionRecord(1, 2.0, "", status="recovered", scenario="S", mode="real", robot="nao", downtime=12.34),
         "session recovered after 12.3 s without engine S, mode real, robot nao, seed 0"),
    ],
)  # fmt: skip
def test_what_is_reported_about_a_session(record: AnyRecord, line: str) -> None:
    assert " ".join((Transcript().line_for(record) or "").split()[1:]) == line


def test_times_and_parameters_in_short() -> None:
    assert [clock_text(t) for t in (0, 3.25, 59.99, 60, 3600, 3661.5)] == [
        "00:00.0", "00:03.2", "00:59.9", "01:00.0", "1:00:00.0", "1:01:01.5",
    ]  # fmt: skip
    assert clock_text(1e300) == clock_text(float("inf"))
    assert parameters_text({"message": "Hi", "rate": 0.8}, in_ms=True) == '"Hi" rate=0.8'
    assert (
        parameters_text({"pointx": 1, "pointy": 0, "pointz": 2.5, "duration": 100}, in_ms=True) == "(1, 0, 2.5) 100 ms"
    )


def test_a_duration_is_in_ms_only_for_actions_that_declare_it_so() -> None:
    in_ms = {name for name, spec in core_actions().items() if (p := spec.parameters.get("duration")) and p.unit == "ms"}
    assert in_ms == ACTIONS_IN_MS
    assert parameters_text({"duration": 7}, in_ms=False) == "duration=7"
