"""`rise-engine run` with tasks from a file or from standard input."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.processes import FAST, Live, act, engine, folder, records, task
from tests.run.engine.samples import assert_one_ending_each

pytestmark = pytest.mark.slow


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


# --- what a file is played with ---

CONDITIONS = '[conditions.calm]\nmemory = { name = "you" }\n[conditions.loud]\nmemory = { name = "YOU" }\n'


def test_a_file_says_faults_seed_and_condition(tmp_path: Path) -> None:
    study = folder(tmp_path / "study", CONDITIONS)
    script = tmp_path / "way.jsonl"
    head = '# what it shows\n{"condition": "loud"}\n{"seed": 7}\n{"fault": "LookAt=fail@1"}\n{"fault": "vanish@20"}\n'
    script.write_text(head + act("Greet", at=1) + "\n")
    done = engine("run", study, "--tasks", script, "--until", "30", *FAST)
    assert done.returncode == 0
    same = ["--condition", "loud", "--seed", "7", "--fault", "LookAt=fail@1", "--fault", "vanish@20"]
    script.write_text(act("Greet", at=1) + "\n")
    assert engine("run", study, "--tasks", script, "--until", "30", *same, *FAST).stdout == done.stdout
    script.write_text(head + act("Greet", at=1) + "\n")
    other = engine(
        "run", study, "--tasks", script, "--condition", "calm", "--seed", "8", "--fault", "Speech=fail", *FAST
    )
    session = records(other.stdout)[0]
    assert (session["condition"], session["seed"]) == ("calm", 8), "what the command line says counts more"
    failed = [r["type"] for r in records(other.stdout) if r["kind"] == "action" and "simulated fault" in r["reason"]]
    assert failed[0] == "Speech", "and its faults come beside the file's"
    assert [r["status"] for r in records(other.stdout) if r["kind"] == "robot"] == ["connected"], "it was over before"


def test_what_is_about_the_whole_session_stands_alone_and_first(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "bad.jsonl"
    lines = [
        '{"fault": 3}',
        '{"seed": -1}',
        '{"seed": true}',
        '{"seed": 1, "fault": "Speech=fail"}',
        '{"condition": " "}',
        '{"seed": 4}',
        '{"seed": 5}',
        act("Greet"),
        '{"fault": "Speech=fail"}',
        '{"fualt": "Speech=fail"}',
    ]
    script.write_text("\n".join(lines))
    done = engine("run", study, "--tasks", script, *FAST)
    assert done.returncode == 2 and done.stdout == ""
    for line, sentence in (
        (1, "`fault` must be a text"),
        (2, "`seed` must be a whole number"),
        (3, "`seed` must be a whole number"),
        (4, "must be alone"),
        (5, "`condition` must be a text"),
        (7, "there is a seed already"),
        (9, "write it before the first task"),
        (10, "did you mean `fault`?"),
    ):
        assert any(each.startswith(f"{script}:{line}:") and sentence in each for each in done.stderr.splitlines()), line
    assert f"{script}:6:" not in done.stderr and f"{script}:8:" not in done.stderr


def test_faults_of_a_file_are_refused_with_a_real_robot_and_unknown_ones_always(study: Path, tmp_path: Path) -> None:
    script = tmp_path / "way.jsonl"
    script.write_text('{"fault": "Speech=fail"}\n')
    real = engine("run", study, "--tasks", script, "--mode", "real", *FAST)
    assert real.returncode == 2 and "add --mode debug" in real.stderr and real.stdout == ""
    script.write_text('{"fault": "Speech=fial"}\n')
    assert "did you mean 'fail'?" in engine("run", study, "--tasks", script, *FAST).stderr
    script.write_text('{"condition": "calm"}\n')
    assert "no condition" in engine("run", study, "--tasks", script, *FAST).stderr


def test_a_session_that_runs_takes_no_faults(study: Path) -> None:
    with Live("run", study, "--tasks", "-", "--speed", "20", "--json") as live:
        live.until("robot", status="connected")
        live.write('{"fault": "Speech=fail"}')
        live.write(act("Greet"))
        live.until("task", behavior="Greet", status="SUCCEEDED")
        live.end_input()
        assert live.rest() == 2
        assert "which already runs" in live.errors()
