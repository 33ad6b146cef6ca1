"""Programs of a study: what comes of them, whatever they do."""

from __future__ import annotations

import asyncio
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from rise_engine.checks.programs import first_line, run_program
from rise_engine.checks.runner import run_check
from rise_engine.study.checks import program_problem
from rise_engine.study.model import StudyCheck
from tests.checks.samples import context, is_gone, script, study

pytestmark = pytest.mark.slow


def program(*run: str, **more: float) -> StudyCheck:
    return StudyCheck("tracker", run=run, limit=more.get("limit"))


async def look(folder: Path, *run: str, **more: float) -> tuple[str, str, str]:
    check = program(*run, **more)
    outcome = await run_check(check, context(study(folder, check)))
    assert (outcome.id, outcome.question) == ("tracker", "")
    return outcome.result, outcome.value, outcome.reason


def until(holds: Callable[[], bool]) -> None:
    """Wait for something that another process does."""
    while not holds():
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("lines", "came"),
    [
        pytest.param(("echo", 'echo "  0.4 degrees "', "echo more"), ("passed", "0.4 degrees", ""),
                     id="exit status 0 has passed, and its first line is the value"),
        pytest.param(("exit 0",), ("passed", "", ""), id="no output has passed too"),
        pytest.param(("echo no tracker on USB", "exit 3"),
                     ("failed", "no tracker on USB", "./check.sh ended with exit status 3"),
                     id="another status has failed, with what the program said"),
        pytest.param(("echo it burns >&2", "exit 1"), ("failed", "", "./check.sh ended with exit status 1: it burns"),
                     id="where it says nothing, its errors are told"),
        pytest.param(("exit 1",), ("failed", "", "./check.sh ended with exit status 1, and it said nothing"),
                     id="where it has no errors either, that is told"),
        pytest.param((r"printf '\033]0;owned\007 ok\377\000 fine\n'",), ("passed", "·]0;owned· ok�· fine", ""),
                     id="what a terminal would obey is taken out"),
        pytest.param(("head -c 3000000 /dev/zero | tr '\\0' x", "echo", "exit 0"), ("passed", "x" * 199 + "…", ""),
                     id="a long line is cut, and a flood does no harm"),
        pytest.param(("cat", "echo read"), ("passed", "read", ""), id="it reads nothing"),
        pytest.param(("echo early", "exec >&- 2>&-", "sleep 0.2", "exit 4"),
                     ("failed", "early", "./check.sh ended with exit status 4"),
                     id="one that closes its output is waited for"),
        pytest.param(("kill -SEGV $$",), ("failed", "", "SIGSEGV ended ./check.sh, and it said nothing"),
                     id="a signal is named"),
    ],
)  # fmt: skip
async def test_what_comes_of_a_program(tmp_path: Path, lines: tuple[str, ...], came: tuple[str, str, str]) -> None:
    assert await look(tmp_path, script(tmp_path, "check.sh", *lines)) == came


async def test_it_knows_whom_it_is_for_and_runs_in_the_folder_of_the_study(tmp_path: Path) -> None:
    name = script(tmp_path, "check.sh", 'echo "$RISE_STUDY $RISE_PARTICIPANT $RISE_RUN $1 $(pwd)"')
    assert await look(tmp_path, name, "a b; echo no") == ("passed", f"lab P07 2 a b; echo no {tmp_path}", "")


@pytest.fixture
def late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit is over as soon as there is the file `late`: however long a busy machine takes until then."""
    monkeypatch.setattr("rise_engine.checks.programs.monotonic", lambda: 60.0 * (tmp_path / "late").exists())


@pytest.mark.usefixtures("late")
async def test_a_hang_ends_at_the_limit_with_all_that_it_has_started(tmp_path: Path) -> None:
    pids = ("sleep 1000 &", "echo $! > child", "echo $$ > parent")
    name = script(tmp_path, "check.sh", "echo looking", *pids, "touch late", "wait")
    result, value, reason = await look(tmp_path, name, limit=60.0)
    assert (result, value) == ("failed", "looking")
    assert reason == "./check.sh did not end within 60 s, and was ended"
    until(lambda: all(is_gone(int((tmp_path / each).read_text())) for each in ("parent", "child")))


@pytest.mark.usefixtures("late")
async def test_one_that_does_not_listen_is_ended_by_force(tmp_path: Path) -> None:
    name = script(
        tmp_path, "check.sh", "trap '' TERM", "echo $$ > parent", "touch late", "while true; do sleep 1; done"
    )
    result, _, reason = await look(tmp_path, name, limit=60.0)
    assert (result, reason) == ("failed", "./check.sh did not end within 60 s, and was ended")
    until(lambda: is_gone(int((tmp_path / "parent").read_text())))


async def test_what_it_leaves_running_does_not_hold_up_its_result(tmp_path: Path) -> None:
    name = script(tmp_path, "check.sh", "sleep 1000 &", "echo $! > child", "echo started")
    try:
        assert await look(tmp_path, name, limit=600.0) == ("passed", "started", "")
        assert not is_gone(int((tmp_path / "child").read_text()))
    finally:
        os.kill(int((tmp_path / "child").read_text()), signal.SIGKILL)


async def test_who_gives_up_leaves_nothing_running(tmp_path: Path) -> None:
    name = script(tmp_path, "check.sh", "sleep 1000 &", "echo $! > child", "mv child started", "wait")
    check = program(name)
    task = asyncio.create_task(run_check(check, context(study(tmp_path, check))))
    while not (tmp_path / "started").exists():  # noqa: ASYNC110  # another process makes it
        await asyncio.sleep(0.01)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    until(lambda: is_gone(int((tmp_path / "started").read_text())))


def test_what_cannot_be_started_is_said_before_it_is_tried(tmp_path: Path) -> None:
    script(tmp_path, "check.sh", executable=False)
    (tmp_path / "tools").mkdir()
    (tmp_path / "empty").touch(mode=0o755)
    windows = tmp_path / "windows.sh"
    windows.write_bytes(b"#!/bin/sh\r\necho ok\r\n")
    windows.chmod(0o755)
    odd = tmp_path / "odd.sh"
    odd.write_text("#!/usr/bin/no-such-shell\n")
    odd.chmod(0o755)
    for run, problem in {
        ("./check.sh",): f"./check.sh may not be executed: chmod +x {tmp_path}/check.sh",
        ("./chek.sh",): "there is no program ./chek.sh in the study's folder; did you mean `check.sh`?",
        ("./tools",): "./tools is a folder, not a program",
        ("check.sh",): "check.sh is in the study's folder, and is not a program of this computer: write ./check.sh",
        ("no-such-program",): "there is no program no-such-program on this computer",
        ("./empty",): "./empty is empty",
        ("./windows.sh",): "./windows.sh has line ends of Windows, which hide its interpreter: save it with "
        "line ends of Unix",
        ("./odd.sh",): "the first line of ./odd.sh names an interpreter that is not there: /usr/bin/no-such-shell",
        ("sh", "a\0b"): "a program and its arguments cannot have a NUL in them",
        (): "`run` names no program",
        ("sh", "-c", "true"): "",
    }.items():
        assert program_problem(run, tmp_path) == problem


async def test_what_cannot_be_started_is_a_failed_check(tmp_path: Path) -> None:
    result, value, reason = await look(tmp_path, "./nothing.sh")
    assert (result, value, reason) == ("failed", "", "there is no program ./nothing.sh in the study's folder")


async def test_what_only_the_system_can_know_is_a_failed_check_too(tmp_path: Path) -> None:
    binary = tmp_path / "tracker"
    binary.write_bytes(b"\x01\x02\x03\n\x00")
    binary.chmod(0o755)
    assert await look(tmp_path, "./tracker") == (
        "failed",
        "",
        "./tracker cannot be started: its first line must name an interpreter, such as #!/bin/sh",
    )


def test_a_program_is_given_what_it_is_to_read(tmp_path: Path) -> None:
    end = run_program(["cat"], tmp_path, 60.0, given=b"a word")
    assert (end.status, end.output, end.problem) == (0, b"a word", "")


def test_a_folder_that_has_gone_is_named(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    assert run_program(["true"], gone, 60.0).problem == f"true cannot be started: there is no folder {gone}"


def test_the_first_line_that_says_anything() -> None:
    assert first_line(b"\n \r\n\xff\n") == "�"
    assert first_line(b"") == ""
