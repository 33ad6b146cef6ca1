"""scenarios/greeting: what the robot does, in order, while its scripted session runs (paper, section 4.3)."""

from __future__ import annotations

from itertools import groupby

from rise_engine.kernel.records import FINAL, FailureRecord
from tests.kernel.harness import Session, read
from tests.scenarios.conftest import Play
from tests.scenarios.played import SCENARIOS

GREETINGS = {
    "Hello! How nice that you are here.",
    "Hi there! Good to see you.",
    "Good day to you, and welcome!",
    "Oh, hello! I was hoping for a visitor.",
}


def test_the_order_of_the_acts(play: Play) -> None:
    session = play("greeting")
    session.check_sound()
    acts = ["a sign" if act in ("R_Nod", "R_Smile") else act for act in session.acts(without="R_FollowGaze")]
    assert acts == [
        # A visitor comes, is greeted once, says hello again, leaves;
        *("R_Notice", "R_Greeting", "R_Introduction", "a sign", "R_LookAhead"),
        # comes back in time to be remembered, says hello, leaves;
        *("R_Notice", "a sign", "R_LookAhead"),
        # after a while somebody else comes, is greeted, and leaves during the introduction.
        *("R_Notice", "R_Greeting", "R_Introduction", "R_LookAhead"),
    ]


def test_the_robot_does_not_go_on_talking_to_somebody_who_has_left(play: Play) -> None:
    session = play("greeting")
    introductions = session.of("task", function="startCommunicationRobotAct", behavior="R_Introduction")
    assert [record["status"] for record in introductions if record["status"] in FINAL] == ["SUCCEEDED", "CANCELED"]
    assert session.actions("R_Introduction", "canceled") == ["1 Speech"]
    assert session.actions("R_Introduction", "skipped") == ["2 Wait", "3 Speech", "4 Emotion", "5 Speech"]


def test_the_greeting_is_one_of_several_and_never_the_same_twice_running(play: Play) -> None:
    said = [message for message in play("greeting").said() if message in GREETINGS]
    assert len(said) == 2
    assert said[0] != said[1]


def test_the_introduction_follows_the_greeting(play: Play) -> None:
    session = play("greeting")
    said = session.said()
    assert said[0] in GREETINGS
    assert said[1].startswith("My name is Floka")
    assert said[3] == "I am pleased to meet you, Anna!"
    assert session.actions("R_Introduction")[:5] == ["1 Speech", "2 Wait", "3 Speech", "4 Emotion", "5 Speech"]


def test_the_states_of_the_rule(play: Play) -> None:
    session = play("greeting")
    assert session.states("Greeting") == [
        "Start",
        "Nobody",
        *("Visitor comes", "Visitor is here", "Greet", "Introduce", "Visitor is here", "Visitor has left"),
        *("Visitor comes", "Visitor is here", "Visitor has left"),
        "Nobody",
        *("Visitor comes", "Visitor is here", "Greet", "Introduce", "Visitor has left"),
        "Nobody",
        "Closed",
    ]
    assert [record["status"] for record in session.of("rule", name="Greeting")][-1] == "ended"
    for helper in ("Gaze", "Listening"):
        assert [record["status"] for record in session.of("rule", name=helper)][-1] == "stopped"


def test_other_words_are_no_greeting(play: Play) -> None:
    session = play("greeting")
    assert "what a nice place" in session.values("H_last_words")
    first_greeting = session.time_of("event", topic="/H_greets")
    assert first_greeting >= 8


def test_the_gaze_follows_the_person_and_returns_to_the_default_pose(play: Play) -> None:
    session = play("greeting")
    looks = [
        (record["parameters"]["pointx"], record["parameters"]["pointy"])
        for record in session.of("action", type="LookAt", status="started")
    ]
    assert [point for point, _ in groupby(looks)] == [
        *((1.5, 0), (1.5, 0.4), (2, 0)),
        *((1.5, 0.4), (2, 0)),
        *((1.5, -0.3), (2, 0)),
    ]


def test_the_gaze_runs_while_the_robot_speaks(play: Play) -> None:
    session = play("greeting")
    begins = session.time_of("task", behavior="R_Introduction", status="ACTIVE")
    ends = session.time_of("task", behavior="R_Introduction", status="SUCCEEDED")
    meanwhile = [
        record for record in session.of("action", act="R_FollowGaze", status="succeeded") if begins < record["t"] < ends
    ]
    assert len(meanwhile) > 3


def test_what_is_known_of_the_visitor_is_forgotten_ten_seconds_after_they_left(play: Play) -> None:
    session = play("greeting")
    greeted = [(record["value"], round(record["t"])) for record in session.of("memory", key="person_greeted")]
    assert [value for value, _ in greeted] == [False, True, False, True, False]
    left = [record["t"] for record in session.of("rule", name="Greeting", state="Visitor has left")]
    forgot = [record["t"] for record in session.of("rule", name="Greeting", state="Nobody")][1:]
    assert [round(t, 3) for t in forgot] == [round(left[1] + 10, 3), round(left[2] + 10, 3)]
    assert session.values("person_name") == [None, "Anna", None, None]


def test_the_gaze_follows_again_each_time_that_a_lost_robot_is_back_and_nobody_is_asked() -> None:
    session = Session(read(SCENARIOS / "greeting"))
    session.robot("connected")
    session.rule("Greeting")
    session.assign("person_near = true")
    for _ in range(3):
        session.wait(0.5)
        assert [goal for goal in session.goals.values() if goal.type == "LookAt"]
        session.robot("lost")
        assert not session.goals
        session.wait(20)
        session.robot("connected")
        session.wait(3)
        assert [goal for goal in session.goals.values() if goal.type == "LookAt"], "the gaze stands still"
    failures = [record.status for record in session.records if isinstance(record, FailureRecord)]
    assert "asked" not in failures and failures.count("repeated") >= 3
