"""A whole day with participants at one console: what goes wrong on it, and what is in the files in the evening."""

from __future__ import annotations

import csv
import json
import os
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import rmtree
from typing import Any

import pytest

from rise_engine.kernel.records import MemoryRecord, TaskRecord
from rise_engine.session.folder import JOURNAL, read_info
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.replay import compare_replay
from tests.chance import searched
from tests.forked import run_engine
from tests.tui.study_files import write_study
from tests.tui.terminals import Terminal, kill_engines, terminal

pytestmark = [pytest.mark.pty, pytest.mark.slow, *searched]

DESIGN = """title = "Side and task"
id = "sides"
seed = 20261122
n = 8
scenario = "scenario"
mode = "real"
robot = "generic"

[factors.side]
kind = "between"
levels.left.memory = { side = "left" }
levels.right.memory = { side = "right" }

[factors.task]
kind = "within"
levels.one.memory = { task = 1 }
levels.three.memory = { task = 3 }

[assignment]
hidden = true

[consent]
needed = ["study"]

[[check]]
id = "lamp"
ask = "The lamp is on"

[[check]]
id = "debrief"
ask = "They were debriefed"
when = "after"
"""
MEMORY = {"left": ("side", "left"), "right": ("side", "right"), "one": ("task", 1), "three": ("task", 3)}
"""What each level of the design sets, written down once more: the test is no reader of the design."""
NOT_YET = "P05"
PEOPLE = "participant,consent_study,status,comment\n" + "".join(
    f"P{number:02},{'' if f'P{number:02}' == NOT_YET else '2026-11-02'},,\n" for number in range(1, 11)
)
SMALL = (80, 24)
RIGHT = b"\x1b[C"
CHOICES = {"complete": 1, "aborted": 2, "excluded": 3}


class Day:
    """Somebody at a console, who does one thing after the other and waits for what the screen says."""

    def __init__(self, it: Terminal) -> None:
        self.it = it

    def open(self, participant: str) -> None:
        """Find somebody, and press Enter on them."""
        self.it.still()
        self.it.press(b"/")
        self.it.until_screen("a participant, a state")
        self.it.press(participant.encode() + b"\r")
        self.it.until_screen(f"find {participant}  1 of")
        self.it.still()
        self.it.press(b"\r")

    def leave(self) -> None:
        """Close what is open, and show everybody again."""
        self.it.still()
        self.it.press(b"\x1b")
        self.it.still()
        self.it.press(b"\x1b")
        self.it.until_screen("next: ")

    def begin(self, participant: str, run: int) -> None:
        self.open(participant)
        self.it.until_screen(f"─  {participant} ")
        self.it.until_screen("enter runs")
        self.it.until_screen("hidden until the session begins")
        self.it.press(b"\r")
        self.it.until_screen("lamp: answer with y or n")
        self.it.press(b"y")
        self.it.until_screen(f"enter: begin the session of {participant} in REAL")
        self.it.still(0.8)  # an Enter that is held down counts once
        self.it.press(b"\r")
        self.it.until_screen(f"{participant} run {run} · ")  # and here, at last, the condition
        self.it.until_screen("LIVE")

    def end(self, participant: str, run: int, outcome: str = "complete", reason: str = "") -> None:
        self.it.press(b"\x03")
        self.it.until_screen("End the session (ctrl+x)")
        self.it.press(b"\x18")
        self.it.until_screen("debrief: answer with y or n")
        self.it.still(0.8)  # a key that is held down is no answer
        self.it.press(b"y")
        self.it.until_screen("enter: say how the session counts")
        self.it.still(0.8)
        self.it.press(b"\r")
        self.it.until_screen("Type end and press enter")
        for _ in range(CHOICES[outcome]):
            self.it.press(RIGHT)
            self.it.still()
        self.it.until_screen(f"● {outcome}")
        self.it.press(b"\r")
        self.it.still()
        self.it.press(reason.encode() + b"\r")
        self.it.still()
        self.it.press(b"end\r")
        self.it.until_screen(f"{participant}, run {run}: {outcome}")
        self.it.until_screen("SESSION REPORT")
        self.it.still()
        self.it.press(b"\x1b")
        self.it.until_screen("PARTICIPANTS")

    def session(self, participant: str, run: int) -> None:
        self.begin(participant, run)
        self.it.press(b"g")  # the robot greets
        self.it.until_screen("Greet")
        self.end(participant, run)


@contextmanager
def planned_study() -> Iterator[tuple[Path, str]]:
    home = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    folder = Path(home, "sides")
    folder.mkdir()
    write_study(folder, DESIGN, PEOPLE)
    try:
        yield folder, home
    finally:
        kill_engines(home)
        rmtree(home, ignore_errors=True)


def command(it: Terminal, *arguments: str) -> str:
    """`rise-engine`, as typed in another window."""
    done = run_engine(*arguments, env=it.environment)
    done.check_returncode()
    return done.stdout


def play_the_day(folder: Path, home: str) -> dict[str, Any]:
    """What the study says of itself in the evening."""
    with terminal("--config", str(folder), "--wizard", "anna", home=home, size=SMALL) as it:
        day = Day(it)
        it.until_screen("next: P01")
        day.session("P01", 1)
        day.session("P01", 2)
        day.open("P01")  # who has been there before
        it.until_screen("P01: is complete; nothing is to come")
        day.leave()

        day.begin("P02", 1)  # its engine crashes
        os.kill(it.engines()[0], signal.SIGKILL)
        it.until_screen("ENGINE GONE")
        it.press(b"\x03")
        it.until_screen("Back to the study (b)")
        it.press(b"b")
        it.until_screen("◐ unfinished")
        day.open("P02")
        it.until_screen("did not end")
        it.still()
        it.press(b"r")
        it.until_screen("P02 run 1")
        it.until_screen("LIVE")
        day.end("P02", 1)
        day.session("P02", 2)

        day.session("P03", 1)
        day.begin("P03", 2)  # the console is killed
        os.kill(it.process.pid, signal.SIGKILL)
        it.ended()
    with terminal("--config", str(folder), home=home, size=SMALL) as it:
        day = Day(it)
        it.until_screen("P03 run 2")
        it.until_screen("anna")
        day.end("P03", 2)

        day.begin("P04", 1)
        day.end("P04", 1, "aborted", "felt unwell")
        command(it, "study", "exclude", str(folder), "P04", "did not come back")
        day.open(NOT_YET)
        it.until_screen(f"{NOT_YET} has not consented")
        day.leave()
        day.begin("P06", 1)
        day.end("P06", 1, "aborted", "the robot was silent")
        day.session("P06", 1)  # once more
        day.session("P06", 2)
        for participant in ("P07", "P08", "P09", "P10"):
            day.session(participant, 1)
            day.session(participant, 2)
        it.until_screen("8 of 8 complete")
        status: dict[str, Any] = json.loads(command(it, "study", "status", str(folder), "--json"))
        it.press(b"\x03")
        it.until("to come back to the study")
        return status


def plan_rows(folder: Path) -> dict[int, dict[str, str]]:
    with (folder / "plan.csv").open(encoding="utf-8", newline="") as file:
        return {int(row["slot"]): row for row in csv.DictReader(file)}


def memory_when_it_began(session: Path) -> dict[str, Any]:
    """The memory before anybody asked for anything: the start values, and what the study has set."""
    memory: dict[str, Any] = {}
    for record in read_journal(session / JOURNAL).read_records():
        if isinstance(record, TaskRecord):
            break
        if isinstance(record, MemoryRecord):
            memory[record.key] = record.value
    return memory


def test_a_whole_day_leaves_what_was_planned() -> None:
    with planned_study() as (folder, home):
        status = play_the_day(folder, home)
        states = {each["participant"]: each["state"] for each in status["participants"]}
        assert states.pop("P04") == "excluded" and states.pop(NOT_YET) == "no-consent"
        assert set(states.values()) == {"complete"} and len(states) == 8
        slots = {each["participant"]: each["slot"] for each in status["participants"] if each["slot"]}
        assert sorted(slots[name] for name in states) == list(range(1, 9))  # the lost slot was given again
        rows = plan_rows(folder)
        assert [rows[slot]["side"] for slot in range(1, 9)].count("left") == 4
        seen: dict[tuple[str, int], list[str]] = {}
        for session in sorted((folder / "sessions").iterdir()):
            info = read_info(session)
            assert info.slot is not None
            row = rows[info.slot]
            levels = [row["side"], row["order"].split()[info.run - 1]]
            assert info.condition == "+".join(levels)
            memory = memory_when_it_began(session)
            assert [(MEMORY[level][0], memory[MEMORY[level][0]]) for level in levels] == [
                MEMORY[each] for each in levels
            ]
            assert compare_replay(session).identical
            assert info.participant in session.name
            seen.setdefault((info.participant, info.run), []).append(session.name)
        again = {who: names for who, names in seen.items() if len(names) > 1}
        assert list(again) == [("P06", 1)] and len(again["P06", 1]) == 2
        assert len(seen) == 2 * 8 + 1  # and the one of P04
