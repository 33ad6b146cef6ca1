"""A session whose engine has gone and that another one goes on with, and who holds control (issue 3, section 4)."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.base.errors import RiseError
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import ControlChanged, SessionRecovered
from rise_engine.kernel.records import ENDINGS, ActionRecord, ControlRecord, SessionRecord

from .harness import Session, dialog, gaze, pause, read, speech, write

LOST = "the engine was restarted while it ran"
ACTS = (
    dialog("Talk", speech(1), gaze(2), speech(3, "And", "1,2"))
    + dialog("Wait", pause(1, 5000), speech(2, "Well", "1"))
    + dialog("Both", pause(1, 5000), gaze(2))
    + dialog("Nod", gaze(1))
    + dialog("Broken", gaze(1), speech(2, "{nobody}"))
)
RULES = """<InteractionRule name="Clock" initial="Tick">
  <State id="Tick"><transition after="10s" target="Tock"/><transition eventTopic="/Talk_end" target="Over"/></State>
  <State id="Tock"><transition eventTopic="/back" target="Tick"/></State>
  <State id="Over"/>
</InteractionRule>"""


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return Session(read(write(tmp_path, acts=ACTS, rules=RULES, memory={"mood": "good"})))


def recover(session: Session) -> list[str]:
    session.lines()
    session.do(SessionRecovered(versions={"rise-tui": "0.3"}, reason="the engine was killed"))
    return session.lines()


def assert_one_ending_each(session: Session) -> None:
    ended = [f"{r.task}/{r.action}" for r in session.records if isinstance(r, ActionRecord) and r.status in ENDINGS]
    begun = {f"{r.task}/{r.action}" for r in session.records if isinstance(r, ActionRecord)}
    assert sorted(ended) == sorted(begun)


def test_the_record_says_that_it_was_recovered_and_with_what(session: Session) -> None:
    first, *_ = session.do(SessionRecovered(versions={"rise-tui": "0.3"}, reason="killed"))
    assert isinstance(first, SessionRecord)
    assert (first.status, first.versions, first.reason) == ("recovered", {"rise-tui": "0.3"}, "killed")
    assert (first.scenario_hash, first.seed) == (session.scenario.hash, 1)


def test_what_ran_is_lost_once_and_not_repeated(session: Session) -> None:
    session.act("Talk")
    session.report("1/1", "accepted")
    goals = list(session.goals)
    assert recover(session) == [
        f"action Talk/1 lost ({LOST})",
        "action Talk/3 skipped (action 1 lost)",
        f"action Talk/2 lost ({LOST})",
        f"task act Talk ABORTED (action 1 (Speech) lost: {LOST})",
        "event /Talk_end -> None",
    ]
    assert not session.goals and not session.kernel.is_busy
    assert session.cancels == [], "what an earlier engine has left is for people to decide about (semantics 9.3)"
    assert session.timers == {}  # their limits are gone, too
    for goal in goals:  # a robot that speaks up later changes nothing
        session.report(goal, "succeeded")
    assert session.lines() == []
    assert_one_ending_each(session)


def test_what_was_being_cancelled_is_lost_too(session: Session) -> None:
    session.act("Nod")
    session.submit("stopCommunicationRobotAct", "Nod")
    assert recover(session) == [
        f"action Nod/1 lost ({LOST})",
        "task act Nod CANCELED (stopped by wizard:w)",
    ]
    assert session.timers == {}


def test_waiting_acts_go_on(session: Session) -> None:
    session.act("Talk", "Blocking")
    session.act("Nod", "Blocking")
    session.act("Wait", "Blocking")
    assert recover(session)[-3:-1] == ["task act Nod ACTIVE", "action Nod/1 started"]
    session.finish_all()
    assert session.lines()[-2:] == ["task act Wait ACTIVE", "action Wait/1 started"]
    session.wait(5)
    session.finish_all()
    assert not session.kernel.is_busy
    assert_one_ending_each(session)


def test_an_act_that_begins_by_the_recovery_cancels_what_it_has_begun(session: Session) -> None:
    """Only what the earlier engine left is for people to decide about."""
    session.act("Talk", "Blocking")
    session.act("Broken", "Blocking")
    assert recover(session)[-3:-1] == [
        "action Broken/1 started",
        "action Broken/2 failed (the memory has no value for 'nobody')",
    ]
    assert session.cancels == ["2/1"]
    session.report("2/1", "canceled")
    assert not session.kernel.is_busy
    assert_one_ending_each(session)


def test_an_act_that_waits_and_moves_loses_only_what_the_robot_did(session: Session) -> None:
    """Its act fails by that, so the wait is cancelled, as with every action that fails."""
    session.act("Both")
    assert recover(session) == [
        f"action Both/2 lost ({LOST})",
        "action Both/1 canceled (action 2 lost)",
        f"task act Both ABORTED (action 2 (LookAt) lost: {LOST})",
    ]
    assert session.timers == {}
    assert_one_ending_each(session)


def test_the_latch_holds_and_the_robot_is_asked_again(session: Session) -> None:
    session.submit("stopAll")
    session.confirm_stop("body")
    stops = session.robot_stops
    assert recover(session) == ["stop latched [] ['generic']"], "nobody has heard what began in the meantime"
    assert session.kernel.stop.status == "latched" and session.robot_stops == stops + 1
    assert session.act("Nod").status == "REJECTED"
    session.confirm_stop("body")
    assert session.lines("stop")[-1] == "stop latched ['body'] []"
    assert session.submit("releaseStop").status == "SUCCEEDED"
    assert session.act("Nod").status == "PENDING"


def test_an_emergency_stop_holds_until_the_engine_hears_that_it_is_let_go(session: Session) -> None:
    session.estop("estop:/door")
    session.confirm_stop("body")
    recover(session)
    stops = session.robot_stops
    session.estop("estop:/door")
    assert session.robot_stops == stops, "it is known"
    assert session.submit("releaseStop").reason == "the emergency stop at /door has not been let go"
    session.estop("estop:/door", pressed=False)
    assert session.submit("releaseStop").status == "SUCCEEDED"


def test_a_stop_without_answer_is_asked_for_again(session: Session) -> None:
    session.act("Talk")
    session.submit("stopAll")
    session.wait(1)
    recover(session)
    assert session.robot_stops == 2
    assert session.kernel.stop.status == "requested"
    assert list(session.timers.values()) == [session.t + 3]  # only the new limit
    session.wait(3)
    assert session.kernel.stop.status == "latched"
    assert session.lines("stop") == ["stop latched [] ['generic']"]
    assert_one_ending_each(session)


def test_a_kernel_from_a_snapshot_is_recovered_the_same(session: Session) -> None:
    session.rule("Clock")
    session.act("Talk")
    session.act("Wait", "Blocking")
    other = Kernel.restore(session.scenario, session.kernel.snapshot())
    assert other.handle(SessionRecovered(t=1.0)) == session.kernel.handle(SessionRecovered(t=1.0))
    assert other.snapshot() == session.kernel.snapshot()


WAITS = SessionRecovered(waits_for_wizard=True)
TAKEN = ControlChanged(status="taken", by="wizard:anna", holder="wizard:anna")


@pytest.mark.parametrize("snapshot", [False, True])
def test_a_session_that_waits_for_a_wizard_begins_nothing_and_no_time_runs_out(
    session: Session, snapshot: bool
) -> None:
    session.rule("Clock")
    session.act("Talk")  # Clock takes its end
    session.act("Wait")
    session.do(WAITS)
    session.act("Nod", "None")
    session.lines()
    session.wait(3600)
    assert not session.goals and session.lines() == [], "it does not time out, because it has not begun"
    assert session.kernel.is_busy and [task.behavior for task in session.kernel.scheduler.waiting] == ["Wait", "Nod"]
    if snapshot:
        session.kernel = Kernel.restore(session.scenario, session.kernel.snapshot())
    session.do(SessionRecovered())  # another engine: it still waits
    session.do(replace(TAKEN, status="released", holder=None))
    assert not session.goals
    session.do(TAKEN)
    assert session.lines("task") == ["task act Wait ACTIVE", "task act Nod ACTIVE"]
    session.wait(5)
    assert len(session.goals) == 2
    session.finish_all()
    assert_one_ending_each(session)


def test_an_act_whose_wait_ends_meanwhile_goes_on_with_control(session: Session) -> None:
    session.act("Wait")
    session.do(WAITS)
    session.wait(60)
    assert not session.goals and session.kernel.is_busy
    session.do(TAKEN)
    assert [*session.goals] == ["1/2"]


def test_all_acts_that_run_go_on_before_the_line_does(tmp_path: Path) -> None:
    """Also when the first of them ends at once, and makes room for an act that needs the channel of another one."""
    acts = dialog("Short", pause(1, 1000), pause(2, 0, "1")) + dialog("Look", pause(1, 1000), gaze(2, "1"))
    session = Session(read(write(tmp_path, acts=acts + dialog("Nod", gaze(1)))))
    session.act("Short", "Blocking")
    session.act("Look", "None")
    session.do(WAITS)
    session.act("Nod", "Blocking")
    session.wait(5)
    session.lines()
    session.do(TAKEN)
    begun = [line for line in session.lines() if "started" in line]
    assert begun == ["action Short/2 started", "action Look/2 started"]
    assert session.cancels == ["2/2"], "then Nod is next"
    session.report("2/2", "canceled")
    assert session.lines()[-1] == "action Nod/1 started"


def test_a_stop_reaches_what_waits_for_a_wizard(session: Session) -> None:
    session.act("Wait")
    session.act("Talk")
    session.do(WAITS)
    session.lines()
    session.submit("stopAll")
    assert "task act Talk CANCELED (stop-all by wizard:w)" in session.lines() and session.robot_stops == 1
    session.confirm_stop("body")
    session.submit("releaseStop")  # by a program: a wizard with control would have let it go on
    session.act("Nod")
    assert not session.goals
    session.do(TAKEN)
    assert session.goals


def test_what_is_lost_is_cancelled_so_that_its_order_cannot_go_out_later(session: Session) -> None:
    session.act("Talk")
    session.robot("lost")
    assert session.cancels == ["1/1", "1/2"], "each once"


@pytest.mark.parametrize("status", ["taken", "asked", "given", "released"])
def test_control_is_recorded_and_changes_nothing(session: Session, status: str) -> None:
    session.act("Talk")
    before = session.kernel.snapshot()
    holder = None if status == "released" else "wizard:anna"
    [record] = session.do(ControlChanged(status=status, by="wizard:bert", holder=holder))  # type: ignore[arg-type]
    assert isinstance(record, ControlRecord)
    assert (record.status, record.by, record.holder) == (status, "wizard:bert", holder)
    after = session.kernel.snapshot()
    assert (after.seq, after.acts, after.timers, after.stop) == (
        before.seq + 1,
        before.acts,
        before.timers,
        before.stop,
    )


TIMES = """<InteractionRule name="R" initial="S"><State id="S">
  {}<transition after="2s" target="Short"/><transition after="9s" target="Long"/>
</State><State id="Short"/><State id="Long"/></InteractionRule>"""


def test_a_snapshot_is_refused_with_a_scenario_that_was_changed(tmp_path: Path) -> None:
    """A transition written in before another one would have taken over its timer."""
    s = Session(read(write(tmp_path / "a", rules=TIMES.format(""))))
    s.rule("R")
    snapshot = s.kernel.snapshot()
    again = Session(s.scenario, kernel=Kernel.restore(s.scenario, snapshot))
    again.timers, again.t = dict(s.timers), s.t
    again.wait(3)
    assert "entered Short" in str(again.lines())
    changed = read(write(tmp_path / "b", rules=TIMES.format('<transition after="5s" target="Long"/>')))
    with pytest.raises(RiseError, match="not those that the snapshot was taken with"):
        Kernel.restore(changed, snapshot)


@pytest.mark.parametrize(
    "rules", ["", TIMES.format('<transition eventTopic="e" target="S"/>'), TIMES.replace('S"', 'T"')]
)
def test_without_files_what_is_missing_is_said(tmp_path: Path, rules: str) -> None:
    """Scenarios that were made in a program have no hash."""
    s = Session(replace(read(write(tmp_path / "a", rules=TIMES.format(""))), hash=""))
    s.rule("R")
    other = replace(read(write(tmp_path / "b", rules=rules.format(""))), hash="")
    with pytest.raises(RiseError, match="another scenario"):
        Kernel.restore(other, s.kernel.snapshot())
