"""An engine with a journal: nothing goes out that could still be lost, and nothing safe waits for a disk."""

from __future__ import annotations

import asyncio
import errno
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from rise_engine.base.files import Disk
from rise_engine.base.suspend import suspended_seconds
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import (
    ActionReport,
    EstopReport,
    Note,
    RobotChanged,
    SessionRecovered,
    StopReport,
    Submit,
)
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    NoteRecord,
    OpenGoal,
    SessionRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.ports.robot import ReportCallback
from rise_engine.run.engine.clock import RealClock, VirtualClock
from rise_engine.run.engine.command_runner import CommandRunner
from rise_engine.run.engine.engine import Engine
from rise_engine.run.protocol.client import JournalStatus, Reply, UnrecordedStop
from rise_engine.run.server.hub import SessionHub
from rise_engine.scenario.model import Act, Action
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import InputLine, encode_header, read_line
from tests.patience import PATIENCE
from tests.run.engine.disks import FullDisk, StallingDisk
from tests.run.engine.samples import GREETING, act, call, gaze, scenario, speech, start

STOP = Submit(function="stopAll", source="wizard:anna")
STARTING = ("PENDING", "ACTIVE")


class Robot:
    """Remembers what it was asked; ends nothing by itself."""

    def __init__(self) -> None:
        self.report: ReportCallback = lambda report: None
        self.calls: list[str] = []

    def connect(self, report: ReportCallback) -> None:
        self.report = report
        report(RobotChanged(status="connected"))

    def start(self, goal: StartAction) -> None:
        self.calls.append(f"start {goal.action}")

    def cancel(self, action: str) -> None:
        self.calls.append(f"cancel {action}")

    def stop_all(self) -> None:
        self.calls.append("stop")

    def end_stop(self) -> None:
        self.calls.append("end of stop")

    def adopt_estop(self, held_by: Sequence[str]) -> None:
        self.calls.append(f"pressed {held_by[0]}")

    def last_seen(self) -> float | None:
        return None

    def adopt(self, goals: Sequence[StartAction]) -> None:
        self.calls.append("adopt")

    def cancel_open_goals(self, part: str) -> None:
        self.calls.append(f"cancel open {part}".strip())

    def release_open_goals(self, part: str) -> None:
        self.calls.append(f"release {part}".strip())

    def close(self) -> None:
        self.calls.append("close")


class Session:
    def __init__(self, path: Path, disk: Disk, *acts: Act, begin: bool = True) -> None:
        loop = asyncio.get_running_loop()
        self.turned = asyncio.Event()
        self.path = path
        self.robot = Robot()
        self.records: list[AnyRecord] = []
        self.replies: list[Reply] = []
        self.journalings: list[JournalStatus] = []

        def changed() -> None:
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(self._look)

        self.journal = Journal(path, changed=changed, disk=disk, retry=0.001)
        self.journal.append(encode_header("test"))
        which = scenario(*(acts or (GREETING,)))
        self.engine = Engine(
            which, self.robot, RealClock(loop), 0, sinks=[self.records.append], journal=self.journal
        )  # fmt: skip
        self.engine.on_journal_status = self.journalings.append
        if begin:
            self.engine.start()

    def _look(self) -> None:
        self.engine.flush_durable()
        self.turned.set()

    async def until(self, true: Callable[[], Any]) -> None:
        while not true():
            self.turned.clear()
            await asyncio.wait_for(self.turned.wait(), PATIENCE)

    async def later(self, seconds: float) -> None:
        passed = asyncio.Event()
        self.engine.clock.call_at(self.engine.clock.now() + seconds, passed.set)
        await passed.wait()

    def ask(self, fact: Submit) -> None:
        self.engine.accept(fact, self.replies.append)

    def of(self, kind: type) -> list[Any]:
        return [record for record in self.records if isinstance(record, kind)]

    def lines(self) -> list[Any]:
        return [read_line(line) for line in self.path.read_bytes().splitlines()]


@asynccontextmanager
async def session(tmp_path: Path, disk: Disk, *acts: Act) -> AsyncIterator[Session]:
    it = Session(tmp_path / "journal.jsonl", disk, *acts)
    await it.until(lambda: it.of(SessionRecord))
    try:
        yield it
    finally:
        it.engine.abandon()
        await asyncio.to_thread(it.journal.close, 5.0)


async def test_what_went_out_is_on_the_disk(tmp_path: Path) -> None:
    async with session(tmp_path, Disk()) as it:
        it.ask(start("Greet"))
        await it.until(lambda: it.replies)
        assert it.replies == [Reply(True, "", 1)]
        assert it.robot.calls == ["start 1/1"]
        on_disk = [line for line in it.lines() if not hasattr(line, "journal")]
        assert [line for line in on_disk if not isinstance(line, InputLine)][: len(it.records)] == it.records
        assert [line.n for line in on_disk if isinstance(line, InputLine)] == [1, 2, 3]


async def test_a_caller_that_fails_takes_nothing_from_the_others(tmp_path: Path) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        disk.go.clear()
        it.engine.accept(Note(text="one"), lambda reply: [][0])
        it.ask(start("Greet"))
        disk.go.set()
        await it.until(lambda: it.replies)
        assert it.robot.calls == ["start 1/1"]


async def test_while_the_disk_hangs_a_stop_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        disk.go.clear()
        it.ask(start("Greet"))
        assert await asyncio.to_thread(disk.waits.wait, 10)
        it.ask(STOP)
        it.robot.report(StopReport(confirmed=("pepper/speech",), unstoppable=("pepper/face",)))
        monkeypatch.setattr(type(it.journal), "lag", property(lambda journal: 8.0))
        it.engine.flush_durable()
        now = it.journalings[-1]
        assert (now.behind, now.trouble) == (8.0, "")
        assert now.sentence == (
            "stop was sent to the robot by wizard:anna; CANNOT BE STOPPED: pepper/face; confirmed by pepper/speech"
        )
        monkeypatch.undo()
        disk.go.set()
        await it.until(lambda: [record for record in it.of(StopRecord) if record.status == "latched"])
        assert not [call for call in it.robot.calls if call.startswith("start")]
        await it.until(lambda: it.engine.journal_status.stop is None)


async def test_an_action_whose_record_took_too_long_does_not_begin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with session(tmp_path, Disk()) as it:
        monkeypatch.setattr("rise_engine.run.engine.engine.MAX_LATE_SECONDS", -1.0)
        it.ask(start("Greet"))
        await it.until(lambda: [record for record in it.of(TaskRecord) if record.status == "ABORTED"])
        assert it.robot.calls == []
        reasons = {record.reason for record in it.of(ActionRecord) if record.status == "canceled"}
        assert reasons == {"it was recorded 0 s late, so it was not begun"}


@pytest.mark.parametrize("before", ["nothing", "an act"])
async def test_nothing_that_has_waited_behind_a_late_act_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str
) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        if before == "an act":
            it.ask(start("Greet"))
            await it.until(lambda: it.robot.calls)
        disk.go.clear()
        monkeypatch.setattr("rise_engine.run.engine.engine.MAX_LATE_SECONDS", 0.05)
        for _ in range(3):
            it.ask(start("Greet"))
        if before == "an act":
            it.robot.report(ActionReport(action="1/1", status="failed"))
        asked = it.engine.clock.now()
        await it.later(0.1)
        disk.go.set()
        await it.until(lambda: it.engine.idle)
        assert it.robot.calls == (["start 1/1"] if before == "an act" else [])
        ended = [record for record in it.of(TaskRecord) if record.status == "CANCELED" and record.t > asked]
        assert len(ended) == 2
        assert any(note.text == "2 waiting acts cancelled: the record was up to 0 s late" for note in it.of(NoteRecord))


@pytest.mark.parametrize(
    "also",
    [
        act("Side", gaze("1")),  # its only action does not begin
        act("Side", Action("1", (call("Wait", duration=10),))),  # it begins, and ends
    ],
)
async def test_what_was_recorded_in_time_waits_on_when_something_beside_it_is_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, also: Act
) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk, act("Talk", speech("1")), also) as it:
        it.ask(start("Talk"))
        it.ask(start("Talk"))
        await it.until(lambda: len(it.replies) == 2)
        disk.go.clear()
        monkeypatch.setattr("rise_engine.run.engine.engine.MAX_LATE_SECONDS", 0.05)
        it.ask(start("Side", "None"))
        await it.later(0.1)
        disk.go.set()
        await it.until(lambda: [r for r in it.of(TaskRecord) if r.behavior == "Side" and r.status not in STARTING])
        assert [task.id for task in it.engine.kernel.scheduler.waiting] == [2]
        assert not [note for note in it.of(NoteRecord) if "cancelled" in note.text]


async def test_what_was_on_its_way_to_the_disk_during_a_suspend_does_not_begin_afterwards(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Session time stood still, so it is not late by that."""
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        disk.go.clear()
        it.ask(start("Greet"))
        before = suspended_seconds()
        monkeypatch.setattr("rise_engine.run.engine.engine.suspended_seconds", lambda: before + 3600)
        disk.go.set()
        await it.until(lambda: [record for record in it.of(ActionRecord) if record.status == "canceled"])
        assert it.robot.calls == []
        assert {"it was recorded 3600 s late, so it was not begun"} < {r.reason for r in it.of(ActionRecord)}


async def test_what_waits_for_a_wizard_is_not_cancelled_because_it_is_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It begins by their word, and not before."""
    monkeypatch.setattr("rise_engine.run.engine.engine.MAX_LATE_SECONDS", -1.0)
    async with session(tmp_path, Disk()) as it:
        it.engine.accept(SessionRecovered(waits_for_wizard=True))
        it.ask(start("Greet"))
        await it.until(lambda: it.replies)
        assert len(it.engine.kernel.scheduler.waiting) == 1


async def test_each_late_action_says_how_late_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rise_engine.run.engine.engine.MAX_LATE_SECONDS", 0.05)
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        disk.go.clear()
        it.engine.post(Note(text="in flight"))
        assert await asyncio.to_thread(disk.waits.wait, 10)
        it.engine.post(Note(text="long ago"))
        await it.later(1.6)
        it.ask(start("Greet"))
        await it.later(0.1)
        disk.go.set()
        await it.until(lambda: [record for record in it.of(ActionRecord) if record.status == "canceled"])
        reasons = {record.reason for record in it.of(ActionRecord) if record.status == "canceled"}
        assert reasons <= {f"it was recorded {seconds} s late, so it was not begun" for seconds in (0, 1)}


async def test_a_disk_that_hung_is_noted_as_an_interruption(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with session(tmp_path, Disk()) as it:
        for lag in (6.0, 0.0, 1.0, 6.0, 0.0):  # the first one: the engine itself stood still
            monkeypatch.setattr(Journal, "lag", lag)
            it.engine.flush_durable()  # as it is called all the time
        await it.until(lambda: it.of(NoteRecord))
        (note,) = it.of(NoteRecord)
        assert note.text == "recording was interrupted and goes on now: the disk took 6 s" and note.stood >= 6.0


async def test_what_is_lost_before_it_was_recorded_never_goes_out(tmp_path: Path) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        disk.go.clear()
        it.ask(start("Greet"))
        assert await asyncio.to_thread(disk.waits.wait, 10)
        it.robot.report(RobotChanged(status="lost"))
        it.robot.report(RobotChanged(status="connected"))
        disk.go.set()
        await it.until(lambda: [record for record in it.of(TaskRecord) if record.status == "ABORTED"])
        assert it.robot.calls == []


async def test_nothing_goes_out_while_the_disk_stalls_but_the_loop_goes_on(tmp_path: Path) -> None:
    """J04."""
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        seen = len(it.records)
        disk.go.clear()
        it.ask(start("Greet"))
        assert await asyncio.to_thread(disk.waits.wait, 10)
        it.engine.flush_durable()
        assert (it.replies, it.robot.calls, len(it.records)) == ([], [], seen)
        disk.go.set()
        await it.until(lambda: it.replies)
        assert it.robot.calls == ["start 1/1"]
        assert len(it.records) > seen


async def test_what_is_safe_does_not_wait_for_the_disk(tmp_path: Path) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        it.ask(start("Greet"))
        await it.until(lambda: it.replies)
        disk.go.clear()
        it.ask(STOP)
        assert it.robot.calls == ["start 1/1", "cancel 1/1", "stop"], "at once"
        assert it.of(StopRecord) == []
        disk.go.set()
        await it.until(lambda: it.of(StopRecord))


async def test_an_action_that_is_stopped_before_it_is_recorded_never_begins(tmp_path: Path) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        disk.go.clear()
        it.ask(start("Greet"))
        it.ask(STOP)
        it.robot.report(StopReport(confirmed=("all",)))
        disk.go.set()
        await it.until(lambda: [record for record in it.of(StopRecord) if record.status == "latched"])
        assert it.robot.calls == ["stop"]
        ended = {record.action: record.status for record in it.of(ActionRecord) if record.status != "started"}
        assert ended == {"1": "canceled", "2": "skipped", "3": "skipped"}
        assert it.of(TaskRecord)[-1].status in ("CANCELED", "SUCCEEDED")


async def test_a_full_disk_pauses_the_session(tmp_path: Path) -> None:
    """J03: never on, unrecorded; what the robot says meanwhile is kept with its time."""
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        it.ask(start("Greet"))
        await it.until(lambda: it.replies)
        disk.number = errno.ENOSPC
        it.robot.report(ActionReport(action="1/1", status="accepted"))
        await it.until(lambda: it.engine.paused)
        seen = len(it.records)
        assert it.journalings[-1].trouble == "the disk is full"
        it.ask(start("Greet"))
        assert it.replies[-1] == Reply(False, "nothing can be recorded, so the session is paused: the disk is full")
        it.robot.report(ActionReport(action="1/1", status="succeeded"))
        at = it.engine.clock.now()
        it.engine.flush_durable()
        assert len(it.records) == seen
        disk.number = None
        await it.until(lambda: it.of(NoteRecord))
        assert not it.journalings[-1].trouble
        ended = [record for record in it.of(ActionRecord) if record.status == "succeeded"]
        assert len(ended) == 1 and ended[0].t <= at
        (note,) = it.of(NoteRecord)
        assert note.text == "recording was interrupted and goes on now: the disk is full"
        assert 0 < note.stood <= note.t, "a wait across it is in no median"
        it.ask(start("Greet"))
        await it.until(lambda: it.replies[-1].accepted)
        numbers = [record.seq for record in it.records]
        assert numbers == list(range(1, len(numbers) + 1))


async def test_stop_reaches_the_robot_also_when_nothing_can_be_recorded(tmp_path: Path) -> None:
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        it.ask(start("Greet"))
        await it.until(lambda: it.replies)
        disk.number = errno.EIO
        it.robot.report(ActionReport(action="1/1", status="accepted"))
        await it.until(lambda: it.engine.paused)
        it.ask(STOP)
        assert it.robot.calls[-1] == "stop"
        it.robot.report(StopReport(confirmed=("pepper/body",), unconfirmed=("pepper/speech",)))
        it.robot.report(
            StopReport(confirmed=("pepper/speech",), unconfirmed=("pepper/body",), unstoppable=("pepper/face",))
        )
        assert it.journalings[-1].trouble == "the disk reports an error"
        assert it.journalings[-1].sentence == (
            "the disk reports an error; stop was sent to the robot by wizard:anna; CANNOT BE STOPPED: pepper/face; "
            "NOT confirmed by pepper/body; confirmed by pepper/speech"
        ), "the last answer counts"
        assert len(it.replies) == 1, "the stop is answered when it is recorded"
        disk.number = None
        await it.until(lambda: len(it.replies) == 2)
        await it.until(lambda: [record for record in it.of(StopRecord) if record.status == "latched"])
        assert it.of(StopRecord)[0].source == "wizard:anna"


@pytest.mark.parametrize(
    "stop", [lambda it: it.ask(STOP), lambda it: it.robot.report(EstopReport(source="estop:/door", pressed=True))]
)
async def test_what_had_not_gone_out_before_a_stop_never_starts(
    tmp_path: Path, stop: Callable[[Session], None]
) -> None:
    """The disk refuses the step that starts an act, the robot is stopped and confirms; then the disk has room again."""
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        disk.number = errno.ENOSPC
        it.ask(start("Greet"))
        await it.until(lambda: it.engine.paused)
        stop(it)
        it.robot.report(StopReport(confirmed=("all",)))
        disk.number = None
        await it.until(lambda: [record for record in it.of(StopRecord) if record.status == "latched"])
        await it.until(lambda: it.of(TaskRecord)[-1].status in ("CANCELED", "SUCCEEDED"))
        assert not [call for call in it.robot.calls if call.startswith("start")]
        ended = {record.action: (record.status, record.reason) for record in it.of(ActionRecord)}
        assert ended["1"] == ("canceled", "it had not begun yet")


async def test_a_stop_is_carried_out_also_if_the_disk_is_back_in_that_moment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The journal's thread says so between two looks of the engine."""
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        disk.number = errno.EIO
        it.ask(start("Greet", "None"))
        it.ask(start("Greet", "None"))
        await it.until(lambda: it.engine.paused)
        looks = iter([True, True])
        with monkeypatch.context() as patch:
            patch.setattr(Engine, "paused", property(lambda engine: next(looks, False)))
            it.ask(STOP)
        disk.number = None
        assert "stop" in it.robot.calls and "start 1/1" not in it.robot.calls


async def test_a_stop_that_the_disk_refuses_first_is_told(tmp_path: Path) -> None:
    """Nobody sees its record, but everybody sees that the robot was told to stop, and what it answered."""
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        it.ask(start("Greet"))
        await it.until(lambda: it.replies)
        disk.number = errno.ENOSPC
        it.ask(STOP)
        it.robot.report(StopReport(confirmed=("pepper/speech",)))
        await it.until(lambda: it.engine.paused)
        it.engine.flush_durable()
        it.robot.report(StopReport(confirmed=("pepper/speech", "pepper/body")))
        assert it.journalings[-1].sentence == (
            "the disk is full; stop was sent to the robot by wizard:anna; confirmed by pepper/speech, pepper/body"
        )
        disk.number = None


async def test_the_answer_to_a_recorded_stop_is_told_while_the_disk_is_full(tmp_path: Path) -> None:
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        it.ask(STOP)
        await it.until(lambda: it.of(StopRecord))
        disk.number = errno.ENOSPC
        it.robot.report(Note(text="full"))
        await it.until(lambda: it.engine.paused)
        it.engine.flush_durable()
        assert it.journalings[-1].stop is None
        it.robot.report(StopReport(unconfirmed=("pepper/body",)))
        assert it.journalings[-1].stop == UnrecordedStop("wizard:anna", True, unconfirmed=("pepper/body",))
        disk.number = None
        await it.until(lambda: it.of(StopRecord)[-1].status == "latched")
        it.engine.flush_durable()
        assert it.journalings[-1].stop is None


async def test_a_stop_that_was_released_while_the_disk_hung_is_not_told(tmp_path: Path) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        disk.go.clear()
        it.ask(STOP)
        it.robot.report(StopReport(confirmed=("pepper/speech",)))
        it.ask(Submit(function="releaseStop", source="node:x"))
        assert it.engine._find_unrecorded_stop() is None
        disk.go.set()
        await it.until(lambda: it.robot.calls == ["stop", "end of stop"])


async def test_the_robot_is_told_of_a_release_when_it_is_recorded(tmp_path: Path) -> None:
    """Until then every console shows STOPPED, and what others begin is still stopped, or told."""
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        it.ask(STOP)
        it.robot.report(StopReport(confirmed=("pepper/speech",)))
        await it.until(lambda: it.of(StopRecord) and it.of(StopRecord)[-1].status == "latched")
        disk.go.clear()
        it.ask(Submit(function="releaseStop", source="wizard:anna"))
        it.engine.flush_durable()
        assert it.robot.calls == ["stop"]
        disk.go.set()
        await it.until(lambda: it.of(StopRecord)[-1].status == "released")
        assert it.robot.calls == ["stop", "end of stop"]


@pytest.mark.parametrize("paused", [False, True])
async def test_the_release_of_an_earlier_stop_does_not_end_a_later_one(tmp_path: Path, paused: bool) -> None:
    disk = FullDisk() if paused else StallingDisk()
    async with session(tmp_path, disk) as it:
        it.ask(STOP)
        it.robot.report(StopReport(confirmed=("pepper/speech",)))
        await it.until(lambda: it.of(StopRecord) and it.of(StopRecord)[-1].status == "latched")
        if isinstance(disk, FullDisk):
            disk.number = errno.ENOSPC
        else:
            disk.go.clear()
        it.ask(Submit(function="releaseStop", source="wizard:anna"))
        if paused:
            await it.until(lambda: it.engine.paused)
        it.ask(STOP)
        if isinstance(disk, FullDisk):
            disk.number = None
        else:
            disk.go.set()
        await it.until(lambda: [record.status for record in it.of(StopRecord)].count("requested") == 2)
        assert "end of stop" not in it.robot.calls


def test_the_robot_knows_which_emergency_stops_were_pressed_for_an_earlier_engine() -> None:
    robot = Robot()
    CommandRunner(robot, scenario(GREETING), VirtualClock(), lambda input: None).connect((), ["estop:/door"])
    assert robot.calls == ["pressed estop:/door"]


def test_a_robot_hears_of_its_emergency_stop_although_its_adapter_knows_nothing_of_others() -> None:
    alone = type("Alone", (), {name: its for name, its in vars(Robot).items() if name != "end_stop"})
    robot = alone()
    CommandRunner(robot, scenario(GREETING), VirtualClock(), lambda input: None).connect((), ["estop:/door"])
    assert robot.calls == ["pressed estop:/door"]


async def test_a_rule_begins_nothing_after_an_end_that_cannot_be_recorded(tmp_path: Path) -> None:
    """Its timer is due while the disk is full: no act runs, so the robot is not busy."""
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        disk.number = errno.ENOSPC
        it.robot.report(Note(text="full"))
        await it.until(lambda: it.engine.paused)
        it.engine.post(start("Greet"))
        it.engine.end("enough")
        assert it.robot.calls == ["stop"]
        disk.number = None
        await it.until(lambda: it.of(StopRecord))
        it.robot.report(StopReport(confirmed=("pepper/speech",)))
        await it.until(lambda: it.engine.ended)
        assert not [call for call in it.robot.calls if call.startswith("start")]


async def test_a_session_that_begins_on_a_full_disk_begins_when_there_is_room(tmp_path: Path) -> None:
    disk = FullDisk(errno.ENOSPC)
    it = Session(tmp_path / "journal.jsonl", disk, begin=False)
    await it.until(lambda: it.engine.paused)
    it.engine.start()
    it.ask(STOP)
    assert it.robot.calls == ["stop"]
    disk.number = None
    await it.until(lambda: it.of(StopRecord))
    assert isinstance(it.records[0], SessionRecord)
    assert it.records[0].status == "started"
    it.engine.abandon()
    await asyncio.to_thread(it.journal.close, 5.0)


async def test_what_is_open_is_cancelled_also_before_a_recovery_is_recorded(tmp_path: Path) -> None:
    it = Session(tmp_path / "journal.jsonl", FullDisk(errno.ENOSPC), begin=False)
    await it.until(lambda: it.engine.paused)
    hub = SessionHub(it.engine)
    it.engine.start()
    it.robot.report(RobotChanged(status="degraded", open=(OpenGoal("pepper/body", "1/1", "Nod", "it is slow"),)))
    wizard = hub.attach("anna", "wizard")
    hub.submit(wizard, start("Greet"), it.replies.append)
    assert it.replies == [Reply(False, "the session has not begun yet")]
    hub.submit(wizard, Submit(function="cancelOpenGoals"), it.replies.append)
    assert it.robot.calls == ["cancel open"]
    it.engine.abandon()
    await asyncio.to_thread(it.journal.close, 1.0)


async def test_what_is_open_is_cancelled_also_when_nothing_can_be_recorded(tmp_path: Path) -> None:
    disk = FullDisk()
    cancel = Submit(function="cancelOpenGoals", source="engine")
    async with session(tmp_path, disk) as it:
        disk.number = errno.ENOSPC
        it.robot.report(ActionReport(action="1/1", status="accepted"))
        await it.until(lambda: it.engine.paused)
        it.ask(cancel)
        assert not it.replies[-1].accepted, "nothing is open"
        it.robot.report(RobotChanged(status="degraded", open=(OpenGoal("pepper/body", "1/1", "Nod", "it is slow"),)))
        it.ask(cancel)
        assert it.robot.calls == ["cancel open"] and len(it.replies) == 1
        disk.number = None
        await it.until(lambda: len(it.replies) == 2)
        assert it.replies[-1].accepted


async def test_the_end_stops_the_robot_also_when_nothing_can_be_recorded(tmp_path: Path) -> None:
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        it.ask(start("Greet"))
        await it.until(lambda: it.replies)
        disk.number = errno.ENOSPC
        it.robot.report(ActionReport(action="1/1", status="accepted"))
        await it.until(lambda: it.engine.paused)
        it.engine.end("enough")
        assert it.robot.calls[-1] == "stop"
        assert it.journalings[-1].sentence.endswith("stop was sent to the robot by engine")
        disk.number = None


async def test_an_emergency_stop_reaches_the_robot_also_when_nothing_can_be_recorded(tmp_path: Path) -> None:
    disk = FullDisk()
    async with session(tmp_path, disk) as it:
        disk.number = errno.EIO
        it.robot.report(ActionReport(action="1/1", status="accepted"))
        await it.until(lambda: it.engine.paused)
        it.robot.report(EstopReport(source="estop:/door", pressed=True))
        assert it.robot.calls == ["stop"]
        assert it.journalings[-1].sentence.endswith("stop was sent to the robot by estop:/door")
        disk.number = None
        await it.until(lambda: it.of(StopRecord))
        assert it.of(StopRecord)[0].held_by == ("estop:/door",)


async def test_the_end_is_recorded_before_the_session_is_over(tmp_path: Path) -> None:
    disk = StallingDisk()
    async with session(tmp_path, disk) as it:
        ended = asyncio.Event()
        it.engine.on_ended(ended.set)
        disk.go.clear()
        it.engine.end("enough")
        assert not it.engine.ended
        it.ask(start("Greet"))
        assert it.replies == [Reply(False, "the session has ended")]
        disk.go.set()
        await asyncio.wait_for(ended.wait(), PATIENCE)
        last = it.lines()[-1]
        assert isinstance(last, SessionRecord) and (last.status, last.reason) == ("ended", "enough")


async def test_a_text_that_is_none_is_refused_before_anything_happens(tmp_path: Path) -> None:
    async with session(tmp_path, Disk()) as it:
        it.ask(Submit(function="raiseEventTopic", behavior="/caf\udce9", source="wizard:anna"))
        assert it.replies == [Reply(False, "it has characters that are not text (half of a pair)")]
        it.ask(start("Greet"))
        await it.until(lambda: len(it.replies) == 2)
