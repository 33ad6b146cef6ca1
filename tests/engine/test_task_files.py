"""`rise-engine run` with tasks from a file or from standard input."""

from __future__ import annotations

from pathlib import Path

import pytest

from .processes import FAST, Live, act, engine, records, task
from .samples import assert_one_ending_each

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
