"""One check of each kind, as consoles and commands make it: in real time, with real files and processes."""

from __future__ import annotations

import asyncio
from datetime import timedelta
from pathlib import Path
from threading import Event

import pytest
from msgspec.structs import replace

from rise_engine.checks.devices import check_last_session
from rise_engine.checks.outcome import CheckContext, CheckOutcome, Finding
from rise_engine.checks.runner import append_checked, call_in_background, limit_seconds, report_check, run_check
from rise_engine.kernel.inputs import CheckReport
from rise_engine.study.model import StudyCheck
from rise_engine.study.study_log import read_log
from tests.checks.robots import ACTIONS
from tests.checks.samples import NOW, context, is_gone, real_study, study
from tests.session.journals import Made

pytestmark = pytest.mark.slow

DRIVERS = """
import os, sys, time
from rise_engine.kernel.inputs import RobotChanged
print("a driver greets")

class Hanging:
    def __init__(self, profile, clock, seed, faults=()):
        print("made", profile.name, flush=True)
        os.system("echo said by a child of it")
    def connect(self, report):
        open(os.environ["HANGS"], "w").write(str(os.getpid()))
        time.sleep(10_000)
    def close(self):
        pass

class Crashing(Hanging):
    def connect(self, report):
        os._exit(9)

class Raising(Hanging):
    def connect(self, report):
        raise RuntimeError("the cable is out")

class Fine(Hanging):
    def connect(self, report):
        report(RobotChanged(status="connected", detail="Lamp on a wire"))
"""


@pytest.fixture
def drivers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Drivers that are installed, as far as a child can see; where the one that hangs leaves its process."""
    folder = tmp_path / "installed" / "drivers_of_test-1.0.dist-info"
    folder.mkdir(parents=True)
    entries = "".join(
        f"{name.lower()} = drivers_of_test:{name}\n" for name in ("Hanging", "Crashing", "Raising", "Fine")
    )
    (folder / "entry_points.txt").write_text(f"[rise.drivers]\n{entries}")
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: drivers-of-test\nVersion: 1.0\n")
    (folder.parent / "drivers_of_test.py").write_text(DRIVERS)
    monkeypatch.setenv("PYTHONPATH", str(folder.parent))
    monkeypatch.setenv("HANGS", str(tmp_path / "hangs"))
    return tmp_path / "hangs"


def with_driver(path: Path, driver: str) -> CheckContext:
    made = real_study(path, "")
    robots = path / "scenario" / "robots"
    robots.mkdir()
    (robots / "lamp.toml").write_text(f'title = "Lamp"\ndriver = "{driver}"\n{ACTIONS}')
    return context(made, robot="lamp", participant="P01", run=1)


def pid_in(file: Path) -> int:
    """The process that a driver has written there; 0: none yet."""
    return int(file.read_text() or 0) if file.exists() else 0


ROBOT = StudyCheck("robot", auto="robot")
TEXT = "the robot answers and offers every action that the scenario uses"


async def test_a_driver_that_answers_and_prints_what_it_likes(tmp_path: Path, drivers: Path) -> None:
    outcome = await run_check(ROBOT, with_driver(tmp_path / "lab", "fine"))
    assert outcome == CheckOutcome("robot", TEXT, "passed", "Lamp on a wire: 2 actions offered")


async def test_a_driver_that_hangs_is_ended_at_the_limit(tmp_path: Path, drivers: Path) -> None:
    check = StudyCheck("robot", auto="robot", limit=4.0)
    outcome = await run_check(check, with_driver(tmp_path / "lab", "hanging"))
    assert outcome == CheckOutcome("robot", TEXT, "failed", reason="there was no answer within 4 s")
    assert pid_in(drivers) == 0 or is_gone(pid_in(drivers))  # 0: on a busy machine it did not come so far


async def test_who_gives_up_ends_the_driver_that_hangs(tmp_path: Path, drivers: Path) -> None:
    task = asyncio.create_task(run_check(ROBOT, with_driver(tmp_path / "lab", "hanging")))
    while not pid_in(drivers):  # noqa: ASYNC110  # another process writes it
        await asyncio.sleep(0.01)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    while not is_gone(pid_in(drivers)):  # noqa: ASYNC110
        await asyncio.sleep(0.01)


async def test_a_driver_that_crashes_is_a_failed_check(tmp_path: Path, drivers: Path) -> None:
    outcome = await run_check(ROBOT, with_driver(tmp_path / "lab", "crashing"))
    assert outcome.result == "failed"
    assert outcome.reason == "the check itself failed (exit status 9): said by a child of it"
    outcome = await run_check(ROBOT, with_driver(tmp_path / "two", "raising"))
    assert outcome.reason == "the check itself failed (exit status 1): RuntimeError: the cable is out"


async def test_a_study_that_is_real_is_not_ready_with_a_simulated_robot(tmp_path: Path) -> None:
    """What each of the two says in either mode: test_robot.py."""
    of = context(real_study(tmp_path, ""), participant="P01")
    sentence = "the robot generic is only simulated, and the mode is real"
    assert (await run_check(ROBOT, of)).reason.startswith(sentence)
    assert (await run_check(StudyCheck("sound", auto="sound"), replace(of, mode="debug"))).result == "passed"


def test_a_study_without_a_session_has_nothing_to_replay(tmp_path: Path) -> None:
    assert check_last_session(tmp_path / "sessions") == Finding(True, "there is no earlier session")


async def test_the_last_session_replays(tmp_path: Path) -> None:
    made = Made(tmp_path, ended=True)
    check, of = StudyCheck("replay", auto="replay"), context(study(tmp_path))
    outcome = await run_check(check, of)
    assert outcome.result == "passed" and outcome.value.startswith(f"{made.folder.name}: identical, ")
    journal = made.folder / "journal.jsonl"
    journal.write_bytes(journal.read_bytes().replace(b"the neck is stuck", b"the neck is stick"))
    found = check_last_session(made.folder.parent)
    assert (found.passed, found.value) == (False, made.folder.name)
    assert found.reason.startswith("the last session ")


async def test_what_is_read_of_the_study(tmp_path: Path) -> None:
    made = real_study(tmp_path, "")
    of = context(made, participant="P01", run=1)

    async def look(kind: str, of: CheckContext = of) -> tuple[str, str]:
        outcome = await run_check(StudyCheck(kind, auto=kind), of)
        return outcome.result, outcome.value or outcome.reason

    assert await look("consent") == ("passed", "study 2026-11-01")
    assert await look("participant") == ("passed", "P01, run 1 of 1")
    assert await look("scenario") == ("passed", f"`scenario` is as it was on {read_log(tmp_path)[0].at[:10]}")
    assert await look("wizard") == ("passed", "anna")
    assert (await look("disk", of))[0] == "passed"
    early = replace(of, now=lambda: NOW - timedelta(days=2))
    assert (await look("clock", early))[0] == "failed"

    second, third = (replace(of, participant=name) for name in ("P02", "P03"))
    assert await look("participant", second) == ("failed", "P02 is excluded: participants.csv says so")
    result, reason = await look("consent", third)
    assert (result, reason) == ("failed", "P03: consent_study has no date; see participants.csv (line 4)")


async def test_a_study_that_cannot_be_read_is_a_failed_check(tmp_path: Path) -> None:
    made = real_study(tmp_path, "")
    (tmp_path / "study.toml").write_text("title = ")
    outcome = await run_check(StudyCheck("consent", auto="consent"), context(made))
    assert outcome.result == "failed" and "study.toml:1" in outcome.reason


async def test_a_kind_of_another_version_fails_with_a_sentence(tmp_path: Path) -> None:
    outcome = await run_check(StudyCheck("moon", auto="moon"), context(study(tmp_path)))
    assert outcome == CheckOutcome("moon", "moon", "failed", reason="this version cannot look at 'moon'")


async def test_an_asked_check_asks_at_once(tmp_path: Path) -> None:
    outcome = await run_check(StudyCheck("lamp", ask="The lamp is on"), context(study(tmp_path)))
    assert outcome == CheckOutcome("lamp", "The lamp is on", "asked", question="The lamp is on")


def test_limits() -> None:
    checks = [StudyCheck("a", auto="robot"), StudyCheck("b", run=("x",)), StudyCheck("c", auto="disk")]
    assert [limit_seconds(check) for check in checks] == [60.0, 30.0, 15.0]
    assert limit_seconds(StudyCheck("d", run=("x",), limit=120.0)) == 120.0


# --- in the background ----------------------------------------------------------------------------------------------


async def test_what_never_ends_holds_up_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rise_engine.checks.runner.ENDING_SECONDS", 0.05)
    never, told = Event(), []

    def work(cancelled: Event) -> None:
        cancelled.wait()
        told.append(True)
        never.wait()

    with pytest.raises(TimeoutError):
        await call_in_background(work, 0.05)
    assert told


async def test_the_loop_goes_on_meanwhile() -> None:
    begun, go_on = Event(), Event()

    def work(cancelled: Event) -> str:
        begun.set()
        go_on.wait()
        return "done"

    task = asyncio.create_task(call_in_background(work, 600.0))
    while not begun.is_set():  # noqa: ASYNC110  # another thread sets it
        await asyncio.sleep(0)
    go_on.set()
    assert await task == "done"


async def test_what_work_raises_is_raised() -> None:
    def work(cancelled: Event) -> None:
        raise ZeroDivisionError("a slip")

    with pytest.raises(ZeroDivisionError, match="a slip"):
        await call_in_background(work, 600.0)


def test_a_program_ends_although_a_disk_never_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rise_engine.checks.runner.ENDING_SECONDS", 0.05)

    async def look() -> None:
        with pytest.raises(TimeoutError):
            await call_in_background(lambda cancelled: Event().wait(), 0.01)

    asyncio.run(look())  # would wait for the threads of its own executor, for ever


# --- what is kept ---------------------------------------------------------------------------------------------------


def test_a_report_says_who_answered() -> None:
    outcome = CheckOutcome("lamp", "The lamp is on", "passed", "dimmed")
    assert report_check(outcome, "wizard:anna") == CheckReport(
        id="lamp", text="The lamp is on", result="passed", value="dimmed", source="wizard:anna"
    )
    with pytest.raises(ValueError, match="lamp has not been answered"):
        report_check(CheckOutcome("lamp", "The lamp is on", "asked", question="The lamp is on"))


def test_what_came_of_a_check_stands_in_the_log_of_the_study(tmp_path: Path) -> None:
    check = StudyCheck("lamp", ask="The lamp is on")
    report = CheckReport(id="lamp", text="The lamp is on", result="failed", reason="bulb", source="wizard:anna")
    append_checked(check, context(study(tmp_path)), report)
    debrief = StudyCheck("debrief", ask="Debriefed", when="after")
    append_checked(debrief, context(study(tmp_path), session="2026_P07"), CheckReport(id="debrief", result="passed"))
    first, second = read_log(tmp_path)
    assert (first.kind, first.at) == ("checked", "2026-11-22T10:00:00.000+01:00")
    assert first.fields == {
        "id": "lamp", "when": "before", "text": "The lamp is on", "result": "failed", "value": "", "reason": "bulb",
        "source": "wizard:anna", "participant": "P07", "run": 2, "purpose": "counted",
    }  # fmt: skip
    assert (second.get("when"), second.get("session")) == ("after", "2026_P07")


def test_what_stays_good_for_others_is_nobodys(tmp_path: Path) -> None:
    camera = StudyCheck("camera", run=("./calibrate",), valid=86_400.0)
    append_checked(camera, context(study(tmp_path)), CheckReport(id="camera", result="passed"))
    (entry,) = read_log(tmp_path)
    assert "participant" not in entry.fields and "run" not in entry.fields
