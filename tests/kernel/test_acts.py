"""CRAs: the action graph, failure, cancel, variants, parameters (semantics.md 2)."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from rise_engine.kernel.records import ActionRecord

from .harness import Session, dialog, gaze, pause, read, speech, write

LISTING_1 = """<Dialog name = "R_Greeting">
  <Speech><actionID>1</actionID><message>Dear Reader, my name is Floka!</message></Speech>
  <LookAt><actionID>2</actionID><waitForActions>1</waitForActions>
    <pointx>0</pointx><pointy>0</pointy><pointz>10</pointz><roll>0.5</roll></LookAt>
  <Emotion><actionID>3</actionID><waitForActions>1</waitForActions><value>1</value><duration>1000</duration></Emotion>
  <Speech><actionID>4</actionID><waitForActions>3</waitForActions>
    <message>I hope you will enjoy this day!</message></Speech>
</Dialog>"""


def session(tmp_path: Path, acts: str, **more: object) -> Session:
    return Session(read(write(tmp_path, acts=acts, **more)))  # type: ignore[arg-type]


def test_the_greeting_of_listing_1_runs_on_three_levels(tmp_path: Path) -> None:
    s = session(tmp_path, LISTING_1)
    s.act("R_Greeting")
    assert list(s.goals) == ["1/1"]
    assert s.goals["1/1"].parameters == {"message": "Dear Reader, my name is Floka!"}
    s.report("1/1", "accepted")
    s.report("1/1")
    assert list(s.goals) == ["1/2", "1/3"]
    assert s.goals["1/2"].parameters == {"pointx": 0, "pointy": 0, "pointz": 10, "roll": 0.5}
    assert s.goals["1/3"].parameters == {"value": 1, "duration": 1000}
    s.report("1/3")
    assert list(s.goals) == ["1/2", "1/4"]
    s.report("1/4")
    assert s.kernel.is_busy, "the gaze still runs, so the act does"
    s.report("1/2")
    assert not s.kernel.is_busy
    assert s.lines("task") == [
        "task act R_Greeting PENDING",
        "task act R_Greeting ACTIVE",
        "task act R_Greeting SUCCEEDED",
    ]


@pytest.mark.parametrize("ending", ["failed", "canceled", "timed-out", "lost"])
def test_a_bad_ending_ends_the_act(tmp_path: Path, ending: str) -> None:
    s = session(tmp_path, dialog("A", speech(1), gaze(2), speech(3, wait="1")))
    s.act("A")
    s.report("1/1", ending, "why")
    assert s.cancels == ["1/2"]
    s.report("1/2", "canceled")
    lines = s.lines("action", "task")
    assert f"action A/1 {ending} (why)" in lines
    assert f"action A/3 skipped (action 1 {ending})" in lines
    assert lines[-1] == f"task act A ABORTED (action 1 (Speech) {ending}: why)"


@pytest.mark.parametrize("status", ["accepted", "succeeded", "failed", "canceled", "lost"])
def test_a_wait_is_no_goal_of_the_robot(tmp_path: Path, status: str) -> None:
    s = session(tmp_path, dialog("A", pause(1, 1500)))
    s.act("A")
    s.lines()
    s.report("1/1", status)
    assert s.lines() == []
    s.wait(1.5)
    assert s.lines("action") == ["action A/1 succeeded"]


def test_cancelling_stops_what_runs_and_skips_the_rest(tmp_path: Path) -> None:
    s = session(tmp_path, dialog("A", speech(1), pause(2, 500), speech(3, wait="1")))
    s.act("A")
    s.submit("cancelTask", "1")
    assert s.cancels == ["1/1"]
    assert s.kernel.is_busy, "the robot has not confirmed yet"
    s.report("1/1", "canceled")
    assert s.lines("action", "task")[2:] == [
        "action A/1 started",
        "action A/2 started",
        "task cancelTask 1 SUCCEEDED",
        "action A/2 canceled (cancelled by wizard:w)",
        "action A/3 skipped (cancelled by wizard:w)",
        "action A/1 canceled",
        "task act A CANCELED (cancelled by wizard:w)",
    ]


def test_a_cancel_that_is_never_confirmed_has_a_limit(tmp_path: Path) -> None:
    s = session(tmp_path, dialog("A", speech(1)))
    s.act("A")
    s.submit("stopCommunicationRobotAct", "A")
    s.wait(5)
    assert "action A/1 lost (the robot did not confirm the cancel within 5 s)" in s.lines("action")
    assert not s.kernel.is_busy


def test_an_action_that_never_ends_times_out_and_is_cancelled(tmp_path: Path) -> None:
    s = session(tmp_path, dialog("A", speech(1)))
    s.act("A")
    s.wait(120)
    assert s.cancels == ["1/1"]
    assert "action A/1 timed-out (the robot reported no ending in time)" in s.lines("action")
    s.report("1/1", "succeeded")
    assert s.lines() == [], "a late result changes nothing"


def test_losing_the_robot_loses_what_it_did(tmp_path: Path) -> None:
    s = session(tmp_path, dialog("A", speech(1), speech(2, wait="1")))
    s.act("A")
    s.robot("lost", "cable")
    assert s.lines("action")[-2:] == ["action A/1 lost (cable)", "action A/2 skipped (action 1 lost)"]
    s.act("A")
    assert s.lines("action")[0] == "action A/1 failed (the robot is not connected: cable)"
    s.robot("connected")
    s.act("A")
    assert list(s.goals) == ["3/1"]


@pytest.mark.parametrize(
    ("text", "memory", "spoken"),
    [
        ("Hello {name}!", {"name": "Ada"}, "Hello Ada!"),
        ("You are number {n}.", {"n": 7.0}, "You are number 7."),
        ("{a}{b}", {"a": 0.5, "b": True}, "0.5true"),
        ("Hello {name|there}!", {}, "Hello there!"),
        ("Hello {name|}!", {}, "Hello !"),
        ("{person.name}", {"person": {"name": "Ada"}}, "Ada"),
        ("{{not a key}}", {}, "{not a key}"),
    ],
)
def test_memory_values_are_filled_in(tmp_path: Path, text: str, memory: dict[str, object], spoken: str) -> None:
    s = session(tmp_path, dialog("A", speech(1, text)), memory=memory)
    s.act("A")
    assert s.goals["1/1"].parameters["message"] == spoken


def test_a_missing_key_fails_the_action_and_is_named(tmp_path: Path) -> None:
    s = session(tmp_path, dialog("A", speech(1, "Hello {nobody}")))
    s.act("A")
    assert s.lines("action") == ["action A/1 failed (the memory has no value for 'nobody')"]
    assert not s.goals


def test_a_bare_key_stands_for_a_number(tmp_path: Path) -> None:
    point = "<pointx>person_x</pointx><pointy>0</pointy><pointz>{z}</pointz>"
    s = session(
        tmp_path,
        f'<Dialog name="A"><LookAt><actionID>1</actionID>{point}</LookAt></Dialog>',
        memory={"person_x": 1.5, "z": 2},
    )
    s.act("A")
    assert s.goals["1/1"].parameters == {"pointx": 1.5, "pointy": 0, "pointz": 2}


def test_a_value_of_the_wrong_type_fails_the_action(tmp_path: Path) -> None:
    point = "<pointx>x</pointx><pointy>0</pointy><pointz>0</pointz>"
    s = session(
        tmp_path, f'<Dialog name="A"><LookAt><actionID>1</actionID>{point}</LookAt></Dialog>', memory={"x": "left"}
    )
    s.act("A")
    (record,) = [r for r in s.records if isinstance(r, ActionRecord)]
    assert record.status == "failed"
    assert "pointx" in record.reason
    assert "left" in record.reason


VARIANTS = """<Dialog name="A"><Variants><actionID>1</actionID>
  <Speech><message>one</message></Speech><Speech><message>two</message></Speech><Speech><message>three</message></Speech>
</Variants></Dialog>"""


def test_variants_never_repeat_and_all_come_up(tmp_path: Path) -> None:
    scenario = read(write(tmp_path, acts=VARIANTS))
    spoken = []
    s = Session(scenario, seed=3)
    for n in range(60):
        s.act("A")
        spoken.append(s.goals[f"{n + 1}/1"].parameters["message"])
        s.finish_all()
    assert all(a != b for a, b in itertools.pairwise(spoken))
    assert set(spoken) == {"one", "two", "three"}
    again = Session(scenario, seed=3)
    for n in range(60):
        again.act("A")
        assert again.goals[f"{n + 1}/1"].parameters["message"] == spoken[n]
        again.finish_all()


def test_a_chain_of_ten_thousand_ends_without_recursion(tmp_path: Path) -> None:
    chain = [pause(1, 0)] + [pause(n, 0, wait=str(n - 1)) for n in range(2, 10_001)]
    s = session(tmp_path, dialog("A", *chain))
    s.act("A")
    assert s.lines("task")[-1] == "task act A SUCCEEDED"


def test_a_head_without_hands_points_with_its_gaze(tmp_path: Path) -> None:
    point = "<pointx>1</pointx><pointy>0</pointy><pointz>0</pointz><hand>left</hand>"
    s = session(
        tmp_path, f'<Dialog name="A"><PointAt><actionID>1</actionID>{point}</PointAt></Dialog>', toml='robot = "floka"'
    )
    s.act("A")
    assert s.goals["1/1"].type == "LookAt"
    assert s.goals["1/1"].parameters == {"pointx": 1, "pointy": 0, "pointz": 0}, "a gaze has no hand"
    (record,) = [r for r in s.records if isinstance(r, ActionRecord)]
    assert (record.type, record.sent_as) == ("PointAt", "LookAt")
