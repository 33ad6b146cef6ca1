"""A day with participants at the console, as processes on a terminal: from the first one's checks to the next one."""

from __future__ import annotations

import json
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import rmtree
from time import monotonic

import pytest

from tests.patience import PATIENCE
from tests.tui.study_files import write_study
from tests.tui.terminals import Terminal, alive, kill_engines, terminal

pytestmark = pytest.mark.pty

SMALL = (80, 24)


@contextmanager
def study() -> Iterator[tuple[Path, str]]:
    """A study, and the home of its consoles; what still runs at the end is ended."""
    home = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    folder = Path(home, "forks")
    folder.mkdir()
    write_study(folder)
    try:
        yield folder, home
    finally:
        kill_engines(home)
        rmtree(home, ignore_errors=True)


def entries(folder: Path, kind: str) -> list[dict[str, object]]:
    lines = (folder / "study.jsonl").read_text("utf-8").splitlines()
    return [each for each in map(json.loads, lines) if each["kind"] == kind]


def until(it: Terminal, holds: Callable[[], object], what: str) -> None:
    """What the console's engine does beside it."""
    deadline = monotonic() + PATIENCE
    while not holds():
        assert monotonic() < deadline, what
        it.read(0.1)


def begin(it: Terminal, participant: str) -> None:
    """The checks of who is selected, and the session."""
    it.press(b"\r")
    it.until_screen("enter runs 2 checks")
    it.until_screen(f"participant  {participant}")
    it.still()
    it.press(b"\r")
    it.until_screen("lamp: answer with y or n")
    it.press(b"y")
    it.until_screen(f"enter: begin the session of {participant} in REAL")
    it.still(0.8)  # an Enter that is held down counts once
    it.press(b"\r")
    it.until_screen(f"{participant} run 1")
    it.until_screen("LIVE")


def end(it: Terminal, outcome: bytes = b"\x1b[C", reason: bytes = b"") -> None:
    """From the session to its outcome, and back to the study."""
    it.press(b"\x03")
    it.until_screen("End the session (ctrl+x)")
    it.press(b"\x18")
    it.until_screen("debrief: answer with y or n")
    it.press(b"y")
    it.until_screen("enter: record the outcome")
    it.press(b"\r")
    it.until_screen("Type end and press enter")
    for key in (*[b"\x1b[C"] * outcome.count(b"\x1b[C"), b"\r"):
        it.press(key)
        it.still()
    it.press(reason + b"\r")
    it.still()
    it.press(b"end\r")
    it.until_screen("SESSION REPORT")
    it.until_screen("esc closes")
    it.still()
    it.press(b"\x1b")
    it.until_screen("SESSION REPORT", gone=True)


def test_a_day_from_the_first_participant_to_the_next() -> None:
    with study() as (folder, home), terminal("--config", str(folder), home=home, size=SMALL) as it:
        it.until_screen("next: P01")
        it.press(b"\r")
        it.until_screen("Who are you?")
        it.press(b"anna\r")
        it.until_screen("enter runs 2 checks")
        it.press(b"\x1b")
        it.until_screen("nothing has been started for P01")
        assert entries(folder, "taken") == []
        begin(it, "P01")
        assert [each["participant"] for each in entries(folder, "taken")] == ["P01"]
        it.press(b"\x03")
        it.until_screen("Detach (d)")
        it.press(b"d")
        it.until("come back with: ")
        assert it.ended() == 0
        (engine,) = it.engines()
        with terminal("--config", str(folder), home=home, size=SMALL) as again:
            again.until_screen("P01 run 1")
            again.until_screen("anna")  # as before: a login is nobody's name
            end(again)
            again.until_screen("P01, run 1: complete")
            again.until_screen("next: P02")
            until(again, lambda: not alive(engine), "the engine did not end")
            (outcome,) = entries(folder, "outcome")
            assert (outcome["participant"], outcome["status"], outcome["source"]) == ("P01", "complete", "wizard:anna")
            begin(again, "P02")
            os.kill(again.engines()[0], signal.SIGKILL)
            again.until_screen("ENGINE GONE")
            again.press(b"\x03")
            again.until_screen("Back to the study (b)")
            again.press(b"b")
            again.until_screen("◐ unfinished")
            again.still()
            again.press(b"/")
            again.until_screen("a participant, a state")
            again.press(b"P02\r")
            again.still()
            again.press(b"\r")
            again.until_screen("did not end")
            again.press(b"r")
            again.until_screen("P02 run 1")
            again.until_screen("the session goes on")
            end(again, b"\x1b[C\x1b[C", b"the engine was killed")
            again.until_screen("P02, run 1: aborted")
            again.press(b"\x03")
            again.until("to come back to the study: ")
            assert again.ended() == 0
        outcomes = ["complete", "aborted"]
        until(it, lambda: [each["status"] for each in entries(folder, "outcome")] == outcomes, "no outcome in the log")
        assert len(entries(folder, "taken")) == 2 and len(list((folder / "sessions").iterdir())) == 2


def test_what_a_study_says_itself_is_refused_on_the_command_line() -> None:
    with study() as (folder, home), terminal("--config", str(folder), "--mode", "debug", home=home) as it:
        it.until("--mode: a study says this itself")
        assert it.ended() == 2
