"""What can go wrong when a robot is to stop one goal, or all: A17-A22 and A29 of the table in `test_faults.py`."""

from __future__ import annotations

import pytest
from rise_adapters.ros2.actions.client import ABORTED, CANCELED

from tests.ros.badrobot import Plan
from tests.ros.bench import LONG, SPEECH, TASK, Bench, heard

# --- cancelling -----------------------------------------------------------------------------------------------------


def test_a17_cancelled_while_it_waits_for_acceptance() -> None:
    bench = Bench([Plan(accept_after=1, seconds=60, status=False)])
    bench.act()
    bench.run(0.5)
    bench.stop_act()
    bench.run(0.9)
    assert bench.ending(TASK) == ""
    bench.run(1.2)
    assert bench.ending(TASK) == "canceled" and bench.task() == "CANCELED"
    assert bench.speech.cancels == bench.speech.received and bench.speech.running() == []
    bench.check()


def test_a17_cancelled_while_it_waits_and_never_accepted() -> None:
    bench = Bench([Plan(accept=None, seconds=60, status=False)])
    bench.act()
    bench.run(0.5)
    bench.stop_act()
    bench.run(5)
    assert bench.ending(TASK).startswith("timed-out: no-accept") and bench.task() == "CANCELED"
    assert bench.speech.running() == []
    bench.check()


def test_a17_cancelled_while_it_waits_for_a_server() -> None:
    bench = Bench(robot=False)
    bench.act()
    bench.run(1)
    bench.stop_act()
    assert bench.ending(TASK) == "canceled: it had not been sent yet"
    bench.robot_appears()
    bench.run(10)
    assert bench.speech.received == []
    bench.check()


@pytest.mark.parametrize("how", ["refuse", "reject"])
def test_a18_the_cancel_is_refused(how: str) -> None:
    bench = Bench([Plan(seconds=8, cancel=how)])  # type: ignore[arg-type]
    bench.act()
    bench.run(1)
    bench.stop_act()
    bench.run(4.9)
    assert bench.ending(TASK) == ""
    assert bench.notes() == [f"cancel-refused: {SPEECH} does not stop 2/1; it goes on"]
    bench.run(5.1)
    assert bench.ending(TASK) == (f"failed: cancel-refused: {SPEECH} refused to cancel it; it may still be running")
    assert bench.task() == "CANCELED" and heard(bench, "Greet_stopped") == 1
    bench.run(20)
    assert any("late: the result of 2/1 (succeeded)" in note for note in bench.notes())
    bench.check()


def test_a19_the_cancel_is_accepted_and_it_succeeds() -> None:
    bench = Bench([Plan(seconds=2, cancel="ignore")])
    bench.act()
    bench.run(1)
    bench.stop_act()
    bench.run(5)
    assert bench.ending(TASK).startswith("succeeded: succeeded-during-cancel")
    assert bench.task() == "CANCELED" and heard(bench, "Greet_stopped") == 1
    bench.check()


def test_a20_the_cancel_is_never_answered() -> None:
    bench = Bench([Plan(end=None, cancel="silent")])
    bench.act()
    bench.run(1)
    bench.stop_act()
    bench.run(10)
    assert bench.ending(TASK) == f"lost: cancel-unanswered: {SPEECH} did not answer within 4 s"
    assert bench.ended_at(TASK) == pytest.approx(5, abs=0.01)
    bench.run(60)
    assert 15 <= len(bench.speech.cancels) <= 20, "it is asked again, and not often"
    assert [note.split(":")[0] for note in bench.notes()] == ["still-running"]
    bench.check()


def test_a20_the_cancel_is_accepted_and_nothing_follows() -> None:
    bench = Bench([Plan(end=None, cancel="ignore")])
    bench.act()
    bench.run(1)
    bench.stop_act()
    bench.run(10)
    assert bench.ending(TASK).startswith("lost: cancel-unconfirmed")
    bench.check()


def test_a21_a_cancel_that_comes_after_the_end() -> None:
    bench = Bench([Plan(seconds=1, status=False)])
    bench.wire.delay("*/get_result", 0.5, what="reply", times=1)
    bench.act()
    bench.run(1.2)
    bench.stop_act()
    bench.run(5)
    assert bench.ending(TASK).startswith("succeeded: succeeded-during-cancel")
    assert bench.notes() == [] and bench.task() == "CANCELED"
    bench.check()


def test_a21_the_result_was_lost_and_the_cancel_finds_out() -> None:
    bench = Bench([Plan(seconds=1, status=False)])
    bench.wire.drop("*/get_result", what="reply", times=1)
    bench.act()
    bench.run(2)
    bench.stop_act()
    bench.run(2.1)
    assert bench.ending(TASK).startswith("succeeded")
    bench.check()


def test_a22_a_cancel_of_a_goal_that_the_server_does_not_know() -> None:
    bench = Bench([LONG])
    bench.act()
    bench.run(1)
    bench.robot_leaves()
    bench.robot_appears()
    bench.stop_act()
    bench.run(1.5)
    assert bench.ending(TASK).startswith("lost: server-restarted")
    assert bench.notes() == [] and bench.task() == "CANCELED"
    bench.check()


def test_somebody_else_cancels_it() -> None:
    bench = Bench([Plan(seconds=1, end=CANCELED)])
    bench.act()
    bench.run(5)
    assert bench.ending(TASK) == f"canceled: canceled: somebody else stopped it at {SPEECH}"
    assert bench.task() == "ABORTED"
    bench.check()


# --- stop -----------------------------------------------------------------------------------------------------------

BAD = {
    "a03": Plan(accept=False),
    "a04": Plan(accept_after=3, seconds=60, status=False),
    "a04-never": Plan(accept=None, runs=False, status=False),
    "a05": Plan(accept=None, seconds=60, status=False),
    "a09": Plan(answers=False, seconds=0.3),
    "a09-hang": Plan(end=None),
    "a13": Plan(end=ABORTED),
    "a15": Plan(seconds=60, feedback_every=0.01),
    "a17": Plan(accept_after=1, seconds=60, status=False),
    "a18": Plan(seconds=60, cancel="refuse"),
    "a18-code": Plan(seconds=60, cancel="reject"),
    "a19": Plan(seconds=1.5, cancel="ignore"),
    "a20": Plan(seconds=60, cancel="silent"),
    "good": Plan(seconds=60),
}
CANNOT_STOP = {"a18", "a18-code", "a20"}


@pytest.mark.parametrize("at", [0.0, 0.2, 0.7])
@pytest.mark.parametrize("fault", BAD)
def test_a29_stop_in_the_middle_of_it(fault: str, at: float) -> None:
    bench = Bench([BAD[fault]], [LONG])
    bench.act("Both")
    bench.act("Both")
    bench.run(at)
    bench.stop_all()
    bench.run(at + 2.6)
    assert len(bench.stops()) == 1, "the stop is answered within its limit"
    stop = bench.stops()[0]
    assert "pepper/look_at" in stop.confirmed
    assert len(stop.confirmed) + len(stop.unconfirmed) == 2
    if fault in CANNOT_STOP and bench.speech.received:
        assert stop.unconfirmed[0].startswith("pepper/speech (")
    elif "pepper/speech" in stop.confirmed:
        assert not bench.speech.running(), "what is called stopped is"
    bench.run(at + 8)
    assert bench.ending("2/1") and bench.ending("2/2")
    if fault not in CANNOT_STOP:
        assert not bench.speech.running()
    assert not bench.gaze.running()
    assert bench.task("Both") in ("CANCELED", "ABORTED")
    bench.check()


@pytest.mark.parametrize("fault", ["killed", "terminated", "restarted", "cut", "shut down"])
def test_a29_stop_while_the_robot_is_away(fault: str) -> None:
    bench = Bench([LONG], [LONG])
    bench.act("Both")
    bench.run(1)
    if fault == "killed":
        bench.wire.kill("/robot")
    elif fault == "terminated":
        bench.robot_leaves()
    elif fault == "restarted":
        bench.robot_leaves()
        bench.robot_appears()
    elif fault == "cut":
        bench.wire.forget("/robot")
    else:
        bench.transport.break_down()
    bench.stop_all()
    bench.run(3.6)
    assert len(bench.stops()) == 1
    stop = bench.stops()[0]
    reason = {"killed": "asked, no answer", "restarted": ""}.get(fault, "gone")
    if reason:
        assert stop.unconfirmed == (f"pepper/look_at ({reason})", f"pepper/speech ({reason})")
    else:
        assert stop.confirmed == ("pepper/look_at", "pepper/speech")
    bench.run(7)
    bench.check()


def test_a29_a_robot_that_answers_again_is_connected_again_without_another_act() -> None:
    """What it was asked while it stood still is lost: with a short lease it has taken this side for dead meanwhile."""
    bench = Bench()
    bench.run(1)
    lost = bench.wire.drop("*", what="request")
    bench.stop_all()
    bench.run(6)
    assert bench.stops()[0].unconfirmed == ("pepper/look_at (asked, no answer)", "pepper/speech (asked, no answer)")
    assert bench.robot_statuses() == ["connected", "degraded"]
    lost.stop()
    bench.run(8.5)
    assert bench.robot_statuses() == ["connected", "degraded", "connected"]
    assert set(bench.speech.cancels) == {bytes(16)}, "the stop is in force, so it is asked to stop again"
    bench.check()


def test_a_server_that_moves_again_after_the_first_report_is_asked_again() -> None:
    bench = Bench([LONG])
    bench.act()
    bench.run(1)
    lost = bench.wire.drop("*/cancel_goal")
    bench.stop_all()
    bench.run(6)
    assert "pepper/speech" in bench.stops()[-1].unconfirmed[-1]
    lost.stop()
    bench.run(16)
    assert bench.stops()[-1].unconfirmed == () and bench.speech.running() == []
    bench.check()
