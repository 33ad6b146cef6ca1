"""scenarios/lab_opening: what the robot does, in order, while its scripted session runs (paper, section 5.1.2)."""

from __future__ import annotations

from rise_engine.kernel.records import FINAL
from tests.scenarios.conftest import Play

WELCOME = ("R_Welcome", "R_Introduction")
ANSWERED = ("R_Thinking", "R_Answer")


def test_the_order_of_the_acts(play: Play) -> None:
    session = play("lab_opening")
    session.check_sound()
    assert session.acts() == [
        # The first guest asks about a room, and three things that are not about a room: one is answered in time, one
        # by the answer node's own words, one not at all.
        *(*WELCOME, "R_Kitchen", *ANSWERED, *ANSWERED, "R_Thinking", "R_NoAnswer", "R_ControlRoom"),
        *("R_Goodbye", "R_LookAhead"),
        # The second leaves before the robot has said where they are.
        *(*WELCOME, "R_LookAhead"),
        # The third leaves without a word.
        *(*WELCOME, "R_Studio", "R_LookAhead"),
    ]


def test_the_states_of_the_rules(play: Play) -> None:
    session = play("lab_opening")
    assert session.states("Opening") == [
        "Nobody",
        *("Welcome", "Introduction", "Conversation", "Goodbye", "Pause", "Default pose", "Nobody"),
        *("Welcome", "Introduction", "Default pose", "Nobody"),
        *("Welcome", "Introduction", "Conversation", "Default pose", "Nobody"),
        "Closed",
    ]
    assert session.of("rule", name="Opening")[-1]["status"] == "ended"
    assert session.states("Conversation") == [
        *("Listening", "Kitchen", "Listening", "Thinking", "Answering", "Listening", "Thinking", "Answering"),
        *("Listening", "Thinking", "No answer", "Listening", "Control room", "Listening", "Over"),
        *("Listening", "Studio", "Listening", "Over"),
    ]
    assert [each["status"] for each in session.of("rule", name="Conversation")].count("ended") == 2


def test_the_answer_is_said_as_it_stands_in_the_memory(play: Play) -> None:
    session = play("lab_opening")
    assert session.said().count("There are three of us: Pepper, NAO and me.") == 1
    answers = session.values("GeneratedAnswer")
    # Empty at the start, and again at each question.
    assert answers == [
        *("", "", "There are three of us: Pepper, NAO and me."),
        *("", "I cannot think of an answer just now.", ""),
    ]


def test_the_answer_cuts_the_thinking_off(play: Play) -> None:
    session = play("lab_opening")
    ends = [record["status"] for record in session.of("task", behavior="R_Thinking") if record["status"] in FINAL]
    assert ends == ["CANCELED", "SUCCEEDED", "SUCCEEDED"]


def test_no_answer_for_fifteen_seconds(play: Play) -> None:
    session = play("lab_opening")
    asked = [record["t"] for record in session.of("rule", name="Conversation", state="Thinking", status="entered")]
    gave_up = session.time_of("rule", name="Conversation", state="No answer", status="entered")
    assert round(gave_up - asked[-1], 3) == 15


def test_what_is_counted(play: Play) -> None:
    session = play("lab_opening")
    assert session.values("visits") == [0, 1, 2, 3]
    assert session.values("questions") == [0, 1, 2, 3]
    assert session.values("questions_without_answer") == [0, 1, 2]


def test_a_last_look_is_no_new_guest(play: Play) -> None:
    session = play("lab_opening")
    looks = session.of("event", topic="/gaze/robot")
    assert [record["taken_by"] for record in looks] == ["Opening", None, "Opening", "Opening"]


def test_the_robot_does_not_go_on_talking_to_somebody_who_has_left(play: Play) -> None:
    session = play("lab_opening")
    introductions = session.of("task", function="startCommunicationRobotAct", behavior="R_Introduction")
    ends = [record["status"] for record in introductions if record["status"] in FINAL]
    assert ends == ["SUCCEEDED", "CANCELED", "SUCCEEDED"]


def test_a_head_points_with_its_gaze(play: Play) -> None:
    session = play("lab_opening")
    pointing = session.of("action", act="R_Kitchen", type="PointAt", status="succeeded")
    assert len(pointing) == 1
    assert pointing[0]["parameters"]["pointy"] == 3
