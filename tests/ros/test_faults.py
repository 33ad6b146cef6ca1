"""What can go wrong between the engine and a robot, one test for each row of the table A01-A29: whole sessions (engine,
kernel, `Ros2Robot`) on a wire in memory, in virtual time. Here a single goal, up to its result (A01-A16);
`test_cancel_faults.py` has A17-A22 and A29, `test_middleware_faults.py` A23-A28, `test_faults_dds.py` what needs real
processes.

For every row: each action that was started has exactly one ending, its act ends and says so once, nothing waits without
a limit, and the record tells why (`Bench.check`).
"""

from __future__ import annotations

from collections.abc import Callable

import pytest
from msgspec import Struct
from rise_adapters.ros2.actions.client import ABORTED, CANCELED, SUCCEEDED

from rise_engine.kernel.records import RobotRecord
from tests.ros.badrobot import Plan
from tests.ros.bench import GAZE, LONG, SPEECH, TASK, Bench, heard
from tests.ros.memory import MemoryWire

# --- one goal to its end --------------------------------------------------------------------------------------------


class Row(Struct, frozen=True):
    """What the robot does with a goal, and what the record says of it."""

    plan: Plan
    ending: str
    at: float
    """When, in seconds of session time."""
    note: str = ""
    """The only note; empty: there is none."""
    is_stopped: bool = False
    """Whether the robot is told to stop it, once. (Otherwise it is told nothing.)"""
    deadlines: dict[str, float] = {}
    fault: Callable[[MemoryWire], object] = lambda wire: None
    """What becomes of messages on their way."""


UNKNOWN = f"lost: server-restarted: {SPEECH} no longer knows it; was the robot's wrapper restarted?"
NEVER_SENT = f"timed-out: no-result: {SPEECH} says that it has ended, and its result did not come within 2 s"
LATE = f"timed-out: no-result: it should have taken 2.8 s, and {SPEECH} had not ended it 2 s later"
LIMIT = "timed-out: the robot reported no ending in time"
AFTER_OURS = "late: the result of 2/1 (succeeded) came 15.2 s after its end (timed-out); it changes nothing"
AFTER_LIMIT = (
    "late: 2/1 succeeded (succeeded-during-cancel: the robot finished it although it was asked to stop), "
    "after its time was over"
)
ROWS = {
    "a05 its acceptance is lost, and the status topic says it": Row(
        Plan(), "succeeded", 1, fault=lambda wire: wire.drop("*/send_goal", what="reply")
    ),
    "a08 unknown is never a success": Row(Plan(end=0), UNKNOWN, 1.3),
    # rclpy does this when `execute` returns something of a wrong type:
    "a09 its result is never sent": Row(Plan(answers=False), NEVER_SENT, 3, is_stopped=True),
    "a09 it hangs": Row(Plan(end=None), LATE, 4.8, is_stopped=True, deadlines={"result": 2}),
    "a09 it hangs, and the kernel's limit decides": Row(Plan(end=None), LIMIT, 18.4, is_stopped=True),
    "a10 its result comes after our time-out": Row(
        Plan(seconds=20, cancel="ignore"), LATE, 4.8, AFTER_OURS, is_stopped=True, deadlines={"result": 2}
    ),
    "a10 its result comes after the kernel's limit": Row(
        Plan(seconds=20, cancel="ignore"), LIMIT, 18.4, AFTER_LIMIT, is_stopped=True
    ),
    "a11 its result comes twice": Row(
        Plan(),
        "succeeded",
        1,
        "duplicate: the result of 2/1 came twice; the second one is ignored",
        fault=lambda wire: wire.duplicate("*/get_result", 3, what="reply"),
    ),
    "a11 its acceptance comes twice": Row(
        Plan(),
        "succeeded",
        1,
        f"duplicate: {SPEECH} answered twice whether it accepts 2/1",
        fault=lambda wire: wire.duplicate("*/send_goal", what="reply"),
    ),
    "a13 aborted": Row(Plan(end=ABORTED), "failed: aborted: the robot gave it up and did not say why", 1),
    "a13 aborted, and why": Row(
        Plan(end=ABORTED, result={"reason": "the motor is hot"}), "failed: aborted: the motor is hot", 1
    ),
    "a13 a success that the result denies": Row(
        Plan(result={"reason": "no voice is installed"}), "failed: robot-error: no voice is installed", 1
    ),
    "a16 no feedback": Row(Plan(seconds=10), "succeeded", 10),
    "a16 feedback as expected": Row(
        Plan(seconds=5, feedback_every=0.5, status=False), "succeeded", 5, deadlines={"feedback": 1}
    ),
    "a16 no feedback where it is expected": Row(
        Plan(seconds=5, status=False),
        f"lost: silent: {SPEECH} has sent no feedback for 1 s",
        1,
        is_stopped=True,
        deadlines={"feedback": 1},
    ),
}


@pytest.mark.parametrize("name", ROWS)
def test_one_goal_to_its_end(name: str) -> None:
    row = ROWS[name]
    bench = Bench([row.plan], **row.deadlines)  # type: ignore[arg-type]
    row.fault(bench.wire)
    bench.act()
    bench.run(50)
    assert bench.ending(TASK) == row.ending and bench.ended_at(TASK) == pytest.approx(row.at, abs=0.1)
    assert bench.history(TASK) == ["started", "accepted", row.ending.partition(":")[0]]
    assert bench.notes() == [row.note][: bool(row.note)]
    assert bench.speech.cancels == (bench.speech.received if row.is_stopped else []) and not bench.speech.running()
    is_good = row.ending == "succeeded"
    assert bench.task() == ("SUCCEEDED" if is_good else "ABORTED")
    assert (bench.memory("ends"), bench.memory("failed")) == (1, 0 if is_good else 1)
    bench.check()


# --- no server ------------------------------------------------------------------------------------------------------


def test_a01_no_server_at_all() -> None:
    bench = Bench(robot=False)
    bench.act()
    bench.run(4.9)
    assert bench.ending(TASK) == "" and bench.robot_statuses() == []
    bench.run(5.5)
    assert bench.ending(TASK).startswith("failed: server-missing: nothing offers /pepper/rise/speech")
    assert bench.task() == "ABORTED" and heard(bench, "Greet_end") == heard(bench, "Greet_failed") == 1
    lost = bench.of(RobotRecord)
    assert [record.status for record in lost] == ["lost"]
    assert lost[0].detail.startswith("server-missing") and SPEECH in lost[0].detail and GAZE in lost[0].detail
    bench.act()  # from now on nobody waits for it
    assert bench.task() == "ABORTED" and "server-missing" in bench.ending("5/1")
    bench.check()


def test_a01_one_server_of_two() -> None:
    bench = Bench(robot=False)
    bench.robot_appears(SPEECH)
    bench.run(6)
    assert bench.robot_statuses() == ["degraded"]
    assert bench.of(RobotRecord)[0].detail == f"nothing offers {GAZE}"
    bench.act("Both")
    bench.run(20)
    assert bench.ending("2/2") == (f"failed: server-missing: nothing offers {GAZE}; is the robot's wrapper running?")
    assert bench.ended_at("2/2") == pytest.approx(11, abs=0.1)
    assert bench.ending("2/1") == "succeeded"
    bench.robot_appears(GAZE, node="/head")
    bench.run(22)
    assert bench.robot_statuses() == ["degraded", "connected"]
    bench.check()


def test_a02_the_server_appears_after_the_goal_was_due() -> None:
    bench = Bench(robot=False)
    bench.act()
    bench.run(2)
    bench.robot_appears()
    bench.run(5)
    assert len(bench.speech.received) == len(bench.speech.executed) == 1
    assert bench.history(TASK) == ["started", "accepted", "succeeded"]
    assert bench.ended_at(TASK) == pytest.approx(3, abs=0.1)
    assert bench.robot_statuses() == ["connected"]
    bench.check()


# --- acceptance -----------------------------------------------------------------------------------------------------


def test_a03_rejected() -> None:
    bench = Bench([Plan(accept=False)])
    bench.act("Chain")
    bench.run(1)
    assert bench.ending(TASK) == f"failed: rejected: {SPEECH} refused it"
    assert bench.history("2/2") == ["skipped"]
    assert bench.task("Chain") == "ABORTED" and heard(bench, "Chain_end") == 1
    bench.act("Anyway")  # what depends on it can be made to follow all the same
    bench.run(5)
    assert bench.ending("5/1").startswith("failed: rejected") and bench.ending("5/2") == "succeeded"
    assert bench.task("Anyway") == "SUCCEEDED"
    assert bench.speech.cancels == []
    bench.check()


def test_a04_no_acceptance_and_one_that_comes_too_late() -> None:
    bench = Bench([Plan(accept_after=3, seconds=60, status=False), Plan()])
    bench.act()
    bench.run(2.5)
    assert bench.ending(TASK) == f"timed-out: no-accept: {SPEECH} did not say within 2 s whether it accepts it"
    assert bench.ended_at(TASK) == pytest.approx(2, abs=0.01)
    bench.run(3.2)
    assert bench.speech.goals[bench.speech.received[0]].status == CANCELED
    bench.run(30)
    assert bench.speech.running() == []
    bench.act()
    bench.run(40)
    assert bench.ending("5/1") == "succeeded"
    bench.check()


def test_a04_a_late_acceptance_is_cancelled_at_once() -> None:
    """Where the early cancel has not reached the robot."""
    bench = Bench([Plan(accept_after=3.5, seconds=60, status=False)])
    lost = bench.wire.drop("*/cancel_goal", what="request")
    bench.act()
    bench.run(3.4)
    lost.stop()
    bench.run(3.5)
    assert bench.speech.cancels == bench.speech.received
    assert any(
        note.startswith(f"late: {SPEECH} took 2/1 1.5 s after its end (timed-out); it is cancelled at once")
        for note in bench.notes()
    )
    bench.run(10)
    assert bench.speech.running() == []
    bench.check()


def test_a04_the_goal_callback_raised() -> None:
    """The server lives and answers nothing about this goal, ever."""
    bench = Bench([Plan(accept=None, runs=False, status=False, cancel="silent")])
    bench.act()
    bench.run(60)
    assert bench.ending(TASK).startswith("timed-out: no-accept")
    assert bench.robot_statuses() == ["connected", "degraded"]
    assert bench.of(RobotRecord)[1].detail.startswith(f"{SPEECH} may still be doing Speech (it has not answered")
    assert 10 <= len(bench.speech.cancels) <= 16, "it is asked again, and not often"
    assert [note.split(":")[0] for note in bench.notes()] == ["still-running"]
    bench.check()


def test_a05_the_acceptance_is_lost_and_the_robot_does_it() -> None:
    bench = Bench([Plan(seconds=60, status=False), Plan()])
    bench.wire.drop("*/send_goal", what="reply", times=1)
    bench.act()
    bench.run(1)
    assert bench.speech.running()
    bench.wire.kill("/robot")
    bench.run(3)
    assert bench.ending(TASK).startswith("timed-out: no-accept")
    bench.wire.forget("/robot")
    bench.run(6)
    assert bench.speech.running() and bench.speech.cancels == []
    bench.wire.heal("/robot")
    bench.run(8)
    assert bench.speech.cancels[0] == bench.speech.received[0]
    assert bench.speech.running() == []
    assert bench.robot_statuses() == ["connected", "degraded", "lost", "connected"]
    bench.act()
    bench.run(20)
    assert bench.ending("5/1") == "succeeded"
    bench.check()


# --- the server dies ------------------------------------------------------------------------------------------------


def test_a06_killed_in_the_middle() -> None:
    bench = Bench([LONG])
    bench.act()
    bench.run(1)
    bench.wire.kill("/robot")
    bench.run(11)
    assert bench.ending(TASK) == ""
    bench.wire.forget("/robot")  # the lease is over
    bench.run(11.3)
    assert bench.ending(TASK).startswith("lost: server-gone")
    assert bench.robot_statuses() == ["connected", "lost"] and bench.task() == "ABORTED"
    bench.check()


def test_a06_killed_and_the_transport_never_tells() -> None:
    bench = Bench([LONG], result=3)
    bench.act()
    bench.run(1)
    bench.wire.kill("/robot")
    bench.run(10)
    assert bench.ending(TASK).startswith("timed-out: no-result")
    assert bench.ended_at(TASK) == pytest.approx(2.8 + 3, abs=0.1)
    bench.check()


def test_a06_killed_and_only_the_kernels_limit_is_left() -> None:
    bench = Bench([LONG])
    bench.act()
    bench.run(1)
    bench.wire.kill("/robot")
    bench.run(40)
    assert bench.ending(TASK) == "timed-out: the robot reported no ending in time"
    bench.check()


def test_a07_terminated_in_the_middle() -> None:
    bench = Bench([LONG])
    bench.act("Both")
    bench.run(0.5)
    bench.robot_leaves()
    assert bench.run_until(lambda: bench.ending(TASK)) <= 0.25
    assert bench.ending(TASK).startswith("lost: server-gone")
    assert bench.robot_statuses() == ["connected", "lost"]
    bench.run(3)
    bench.check()


def test_a07_one_of_two_servers() -> None:
    bench = Bench(robot=False)
    bench.plans[SPEECH] = [LONG]
    mouth, _ = bench.robot_appears(SPEECH, node="/mouth"), bench.robot_appears(GAZE, node="/head")
    bench.act("Anyway")
    bench.run(1)
    mouth.close()
    bench.run(5)
    assert bench.ending(TASK) == f"lost: server-gone: the server of {SPEECH} went away during the action"
    assert bench.ending("2/2") == "succeeded"
    assert bench.robot_statuses() == ["connected", "degraded"]
    bench.check()


@pytest.mark.parametrize("gap", [0.0, 0.1, 1.0])
def test_a08_restarted_and_it_knows_nothing(gap: float) -> None:
    bench = Bench([LONG])
    bench.act()
    bench.run(1)
    bench.robot_leaves()
    bench.run(1 + gap)
    bench.plans[SPEECH] = [Plan()]
    bench.robot_appears()
    bench.run(7)
    assert bench.ending(TASK).startswith("lost: server-")
    assert bench.ended_at(TASK) < 6.1 and bench.task() == "ABORTED"
    assert bench.speech.executed == []
    bench.act()
    bench.run(12)
    assert bench.task() == "SUCCEEDED"
    bench.check()


def test_a08_killed_and_restarted_while_the_old_one_still_shows() -> None:
    """As with SIGKILL and DDS: for ten seconds there seem to be two."""
    bench = Bench([LONG])
    bench.act()
    bench.run(1)
    bench.wire.kill("/robot")
    bench.run(2)
    old = bench.node
    bench.plans[SPEECH] = [Plan()]
    bench.robot_appears(node="/robot_again")
    bench.run(2.5)
    assert bench.ending(TASK).startswith("lost: server-restarted")
    bench.act()
    bench.run(4)
    assert bench.history("5/1") == ["started"], "it waits until it is clear which one it goes to"
    assert old is not None
    old.close()
    bench.run(8)
    assert bench.ending("5/1") == "succeeded" and len(bench.speech.executed) == 1
    bench.check()


def test_a08_a_second_robot_that_does_not_know_the_goal_does_not_let_the_first_one_go_on() -> None:
    """Both are asked for the result, and the one that does not know answers first."""
    bench = Bench([LONG])
    bench.act()
    bench.run(1)
    first = bench.speech
    bench.robot_appears(node="/robot_again")
    bench.run(8)
    assert bench.ending(TASK).startswith("lost: server-restarted")
    assert first.cancels == first.received, "whoever has it is told to stop"
    bench.check()


# --- results --------------------------------------------------------------------------------------------------------


def test_a12_the_result_of_an_older_goal() -> None:
    """A client with one slot for each name takes it for the result of the goal that runs now."""
    bench = Bench([Plan(seconds=0.5, status=False), LONG], result=1)
    held = bench.wire.hold("*/get_result", what="reply", times=1)
    bench.act()
    bench.run(5)
    assert bench.ending(TASK).startswith("timed-out")
    bench.act()
    bench.run(6)
    held.release()
    bench.run(6.5)
    assert bench.history("5/1") == ["started", "accepted"]
    assert [note for note in bench.notes() if note.startswith("late: the result of 2/1 (succeeded)")]
    bench.stop_act()
    bench.run(10)
    bench.check()


# --- feedback -------------------------------------------------------------------------------------------------------


def test_a14_feedback_after_the_result() -> None:
    bench = Bench([Plan(feedback_after=5)])
    bench.act()
    bench.run(5)
    before = len(bench.records)
    bench.run(6)
    assert len(bench.records) == before and bench.notes() == []
    assert bench.history(TASK) == ["started", "accepted", "succeeded"]
    bench.check()


def test_a15_a_flood_of_feedback() -> None:
    quiet, flooded = Bench([Plan(seconds=3)]), Bench([Plan(seconds=3, feedback_every=0.001)])
    for bench in (quiet, flooded):
        bench.act()
        bench.run(5)
        bench.check()
    assert len(flooded.wire.messages("*/feedback")) > 2900
    assert len(flooded.records) == len(quiet.records), "feedback changes nothing and is kept nowhere"


def test_success_is_the_only_success() -> None:
    """A guard for the tests above and in the other files: with a robot that does right, all is well."""
    bench = Bench([Plan(end=SUCCEEDED)])
    bench.act("Chain")
    bench.run(5)
    assert bench.history("2/1") == bench.history("2/2") == ["started", "accepted", "succeeded"]
    assert bench.notes() == [] and bench.robot_statuses() == ["connected"] and bench.task("Chain") == "SUCCEEDED"
    bench.check()
