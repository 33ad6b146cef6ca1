"""Tasks, the scheduler, stop-all, the memory by tasks (semantics.md 3, semantics.md 7)."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.kernel.scheduler import FULL, MAX_ACTS

from .harness import Session, dialog, gaze, pause, read, speech, write
from .test_rules import do, on, rule, state

ACTS = (
    dialog("A", speech(1))
    + dialog("B", speech(1))
    + dialog("C", speech(1))
    + dialog("Look", gaze(1))
    + dialog("Think", pause(1, 1000))
)


@pytest.fixture
def s(tmp_path: Path) -> Session:
    rules = rule("R", state("a", ways=on("e", "a") + on("A_end", "a")))
    return Session(read(write(tmp_path, acts=ACTS, rules=rules, memory={"n": 4, "name": "Ada"})))


def test_a_queue_has_an_end(s: Session) -> None:
    for _ in range(MAX_ACTS - 1):
        s.act("A")
    assert s.submit("say", "Hello").status == "PENDING"
    for task in (s.act("B"), s.submit("say", "Hello")):
        assert (task.status, task.reason) == ("REJECTED", FULL)
    s.report("1/1")
    assert s.act("B").status == "PENDING", "an end makes room"


def test_blocking_acts_run_one_at_a_time_in_order(s: Session) -> None:
    for name in "ABC":
        s.act(name)
    assert list(s.goals) == ["1/1"]
    assert s.lines("task") == [
        "task act A PENDING",
        "task act A ACTIVE",
        "task act B PENDING",
        "task act C PENDING",
    ]
    s.report("1/1")
    assert list(s.goals) == ["2/1"]
    s.report("2/1", "failed")
    assert list(s.goals) == ["3/1"], "a failure does not hold up the queue"


def test_a_waiting_task_can_be_removed(s: Session) -> None:
    s.rule("R")
    s.act("B")
    s.act("A")
    s.submit("cancelTask", "3")
    lines = s.lines("task", "event")
    assert "task act A CANCELED (cancelled by wizard:w)" in lines
    assert "event /A_end -> R" in lines, "who waits for its end must not wait for ever"
    s.report("2/1")
    assert not s.kernel.is_busy


@pytest.mark.parametrize(
    ("function", "behavior", "reason"),
    [
        ("startCommunicationRobotAct", "a", "there is no act 'a'; did you mean 'A'?"),
        ("startCommunicationRobotAct", "Lock", "there is no act 'Lock'; did you mean 'Look'?"),
        ("stopCommunicationRobotAct", "A", "A is neither running nor waiting"),
        ("startInteractionRule", "Q", "there is no rule 'Q'"),
        ("stopInteractionRule", "R", "rule 'R' is not running"),
        ("raiseEventTopic", " ", "the event has no name"),
        ("deleteValue", "nam", "the memory has no key 'nam'; did you mean 'name'?"),
        ("cancelTask", "99", "no task 99 is running or waiting"),
        ("moveTask", "1 0", "no task 1 is waiting"),
        ("moveTask", "1", "write the task's id and its new place, as in `17 0`"),
        ("moveTask", "1 ²", "write the task's id and its new place, as in `17 0`"),
        ("moveTask", "1 " + "9" * 5000, "write the task's id and its new place, as in `17 0`"),
        ("moveTask", "1 -1", "write the task's id and its new place, as in `17 0`"),
        ("releaseStop", "", "nothing is stopped"),
        (
            "startComunicationRobotAct",
            "A",
            "there is no function 'startComunicationRobotAct'; did you mean 'startCommunicationRobotAct'?",
        ),
    ],
)
def test_what_cannot_be_done_is_rejected_with_the_reason(s: Session, function: str, behavior: str, reason: str) -> None:
    task = s.submit(function, behavior)
    assert (task.status, task.reason) == ("REJECTED", reason)


def test_a_rejected_start_has_the_calling_type_it_would_have_had(s: Session) -> None:
    s.submit("stopAll")
    assert [s.act("A").calling_type, s.act("A", "Blocking").calling_type, s.act("A", "None").calling_type] == [
        "Blocking",
        "Blocking",
        "None",
    ]


@pytest.mark.parametrize("goal", ["²/1", "9" * 30 + "/1", "x", "", "1/", "1/9"])
def test_reports_of_goals_that_nobody_gave_are_ignored(s: Session, goal: str) -> None:
    s.act("A")
    s.lines()
    s.report(goal)
    assert s.lines() == []


def test_a_word_that_is_no_key_is_a_text_and_that_is_noted(s: Session) -> None:
    s.assign("mood = hapy")
    assert s.memory["mood"] == "hapy"
    assert [line for line in s.lines("note") if "hapy" in line]
    s.assign("mood = name")
    s.assign("mood = 'sad'")
    assert s.lines("note") == []


def test_an_unknown_calling_type_is_rejected(s: Session) -> None:
    assert s.act("A", "blocking").status == "REJECTED"


# --- None and Blocking ---


@pytest.mark.parametrize(
    ("acts", "goals", "cancels", "then"),
    [
        pytest.param("A Look:None", ["1/1", "2/1"], [], [], id="beside a blocking one on other channels"),
        pytest.param("A B:None", ["1/1"], [], ["2/1"], id="after a blocking one that has its channel"),
        pytest.param("A:None B", ["1/1"], ["1/1"], ["2/1"], id="interrupted by a blocking one that needs its channel"),
        pytest.param("Look:None A", ["1/1", "2/1"], [], [], id="left alone by one on other channels"),
        pytest.param("A B:None C", ["1/1"], [], ["3/1", "2/1"], id="not in between two that need its channel"),
    ],
)
def test_a_none_act_runs(s: Session, acts: str, goals: list[str], cancels: list[str], then: list[str]) -> None:
    """`then`: what the robot gets after each ending."""
    for act in acts.split():
        s.act(*act.split(":"))
    assert (list(s.goals), s.cancels) == (goals, cancels)
    for goal in then:
        (ends,) = s.goals
        s.report(ends, "canceled" if cancels else "succeeded")
        assert list(s.goals) == [goal]
    assert ("task act A CANCELED (interrupted by B)" in s.lines("task")) == bool(cancels)


def test_an_act_has_its_own_default_calling_type(tmp_path: Path) -> None:
    s = Session(read(write(tmp_path, acts=ACTS, toml='[act.Look]\ncalling_type = "None"\n')))
    s.act("A")
    task = s.act("Look")
    assert task.calling_type == "None"
    assert len(s.goals) == 2


# --- stop-all ---


def test_stop_all_ends_everything_and_latches(s: Session) -> None:
    s.rule("R")
    s.act("A")
    s.act("B")
    s.act("Think", "None")
    s.lines()
    s.submit("stopAll")
    assert s.robot_stops == 1
    assert s.states == {}
    assert s.lines("task", "stop", "rule") == [
        "task stopAll  SUCCEEDED",
        "stop requested [] []",
        "rule R stopped a",
        "task rule R CANCELED (stop-all by wizard:w)",
        "task act B CANCELED (stop-all by wizard:w)",
        "task act Think CANCELED (stop-all by wizard:w)",
    ]
    s.report("2/1", "canceled")
    s.confirm_stop("sim/speech")
    assert s.lines("task", "stop") == [
        "task act A CANCELED (stop-all by wizard:w)",
        "stop latched ['sim/speech'] []",
    ]
    assert not s.kernel.is_busy
    for task in (s.act("A"), s.rule("R")):
        assert (task.status, task.reason) == ("REJECTED", "everything is stopped; release the stop first")
    assert s.assign("n = 5").status == "SUCCEEDED", "the memory can still be edited"
    assert s.submit("releaseStop").status == "SUCCEEDED"
    assert s.act("A").status == "PENDING"


def test_a_stop_that_the_robot_does_not_answer_says_so(s: Session) -> None:
    s.act("A")
    s.submit("stopAll")
    assert s.submit("releaseStop").reason == "the robot has not answered the stop yet"
    s.wait(10)
    assert s.lines("stop") == ["stop requested [] []", "stop latched [] ['generic']"]
    assert not s.kernel.is_busy


def test_stop_all_can_be_pressed_again(s: Session) -> None:
    s.submit("stopAll")
    s.confirm_stop()
    s.submit("stopAll")
    assert s.robot_stops == 2
    s.confirm_stop("a")
    assert s.lines("stop")[-1] == "stop latched ['a'] []"


def test_an_emergency_stop_stops_everything_and_holds_the_stop_until_it_is_let_go(s: Session) -> None:
    door, desk = "estop:/door", "estop:/desk"
    s.act("A")
    s.estop(desk, pressed=False)
    assert s.lines("task", "stop") == ["task act A PENDING", "task act A ACTIVE"], "nothing was pressed"
    s.estop(door)
    s.estop(door)
    assert s.lines("task", "stop") == [
        "task stopAll  SUCCEEDED",
        "stop requested [] [] by estop:/door [estop:/door]",
    ]
    assert s.robot_stops == 1 and s.act("A").reason.startswith("everything is stopped")
    s.report("1/1", "canceled")
    s.confirm_stop("sim")
    s.estop(desk)
    s.confirm_stop("sim")
    s.estop(door, pressed=False)
    assert s.submit("releaseStop").reason == "the emergency stop at /desk has not been let go"
    s.estop(desk, pressed=False)
    assert s.lines("stop") == [
        "stop latched ['sim'] [] [estop:/door]",
        "stop requested [] [] by estop:/desk [estop:/door] [estop:/desk]",
        "stop latched ['sim'] [] [estop:/door] [estop:/desk]",
        "stop let-go [] [] by estop:/door [estop:/desk]",
        "stop let-go [] [] by estop:/desk",
    ]
    assert s.kernel.stop.latched, "that it is let go releases nothing"
    assert s.submit("releaseStop").status == "SUCCEEDED"


def test_an_answer_after_the_limit_is_still_recorded(s: Session) -> None:
    s.submit("stopAll")
    s.wait(3)
    s.confirm_stop("late")
    assert s.lines("stop")[-1] == "stop latched ['late'] []"


def test_a_chain_of_events_does_not_survive_a_stop(tmp_path: Path) -> None:
    rules = rule(
        "R", state("a", ways=on("A_end", "b")), state("b", do("startCommunicationRobotAct", "B"), on("x", "a"))
    )
    s = Session(read(write(tmp_path, acts=ACTS, rules=rules)))
    s.rule("R")
    s.act("A")
    s.submit("stopAll")
    s.report("2/1", "canceled")
    assert s.goals == {}


# --- memory ---


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ('{"x": 1}', "x", 1),
        ('{"x": {"a": [1, null]}}', "x", {"a": [1, None]}),
        ("n = n + 1", "n", 5),
        ("n = n / 2", "n", 2),
        ("n = n / 8", "n", 0.5),
        ("name = 'Bob'", "name", "Bob"),
        ("name = Bob", "name", "Bob"),
        ("copy = name", "copy", "Ada"),
        ("flag = n > 3 and true", "flag", True),
    ],
)
def test_assigning(s: Session, text: str, key: str, value: object) -> None:
    assert s.assign(text).status == "SUCCEEDED"
    assert s.memory[key] == value
    assert type(s.memory[key]) is type(value)


@pytest.mark.parametrize("text", ["", "n", "n =", "= 3", '{"x": NaN}', '{"x": 1, "x": 2}', "{x: 1}", "n == 3"])
def test_an_assignment_that_cannot_be_read_is_rejected(s: Session, text: str) -> None:
    before = dict(s.memory)
    assert s.assign(text).status == "REJECTED"
    assert s.memory == before


def test_every_change_has_source_old_and_new_value(s: Session) -> None:
    s.assign("n = 5")
    s.submit("deleteValue", "n")
    from rise_engine.kernel.records import MemoryRecord

    changes = [r for r in s.records if isinstance(r, MemoryRecord)]
    assert [(r.key, r.value, r.old, r.source, r.deleted) for r in changes] == [
        ("n", 4, None, "file", False),
        ("name", "Ada", None, "file", False),
        ("n", 5, 4, "wizard:w", False),
        ("n", None, 5, "wizard:w", True),
    ]
    assert "n" not in s.memory


@pytest.mark.parametrize("text", ["n = nobody + 1", "n = nobody / nobody", "n = nobody + name"])
def test_a_key_that_does_not_exist_is_noted_with_the_assignment_that_reads_it(s: Session, text: str) -> None:
    s.assign(text)
    assert [line for line in s.lines("note") if "'nobody'" in line and text in line]
    s.assign("n = nobody + 2")
    assert s.lines("note") == [], "once"
