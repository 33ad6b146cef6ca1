"""scenarios/lablinking: what the robot does, in order, while its scripted session runs (paper, section 5.2.1)."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

from tests.scenarios.conftest import Play
from tests.scenarios.played import Played, command, process

TASKS = {
    n: [f"R_Task{n}_Intro", f"R_Task{n}_Step1", f"R_Task{n}_Step2", f"R_Task{n}_Step3", f"R_Task{n}_Step4"]
    for n in range(1, 5)
}


def test_the_order_of_the_acts(play: Play) -> None:
    session = play("lablinking")
    session.check_sound()
    intro3, first3, *rest3 = TASKS[3]
    assert session.acts() == [
        "R_Welcome",
        # The second step is repeated, after an apology.
        *TASKS[1][:3],
        *("R_Apology", "R_Task1_Step2"),
        *TASKS[1][3:],
        "R_Praise",
        # Noise, from the pause after the second step to the one after the fourth: the robot hesitates before it speaks.
        *TASKS[2][:3],
        *("R_Hesitation", "R_Task2_Step3", "R_Hesitation", "R_Task2_Step4"),
        "R_Praise",
        # The wizard fills a pause; the next instruction cuts the filler off.
        *(intro3, first3, "R_Filler_LetMeSee", *rest3),
        "R_Praise",
        *TASKS[4],
        "R_Praise",
        "R_Goodbye",
    ]


def test_the_states_of_the_main_rule(play: Play) -> None:
    expected = ["Start", "Welcome", "After the welcome"]
    for n in range(1, 5):
        for step in ("introduction", "step 1", "step 2", "step 3", "step 4"):
            expected += [f"Task {n}, {step}", f"After task {n}, {step}"]
            if (n, step) == (1, "step 2"):
                expected += [f"Task {n}, {step}", f"After task {n}, {step}"]
    session = play("lablinking")
    assert session.states("Table setting") == [*expected, "Goodbye", "Finished"]
    assert session.of("rule", name="Table setting")[-1]["status"] == "ended"


def test_the_small_rules_raise_one_event_and_end(play: Play) -> None:
    session = play("lablinking")
    nexts = session.of("rule", name="Next", status="ended")
    assert len(nexts) == len(session.of("rule", name="Next", status="started")) == 22
    assert len(session.of("rule", name="Repeat", status="ended")) == 1
    assert len(session.of("event", topic="/next", taken_by="Table setting")) == 21


def test_next_while_the_robot_speaks_does_nothing(play: Play) -> None:
    session = play("lablinking")
    assert [topic for topic in session.unhandled() if topic in ("/next", "/repeat")] == ["/next"]
    assert session.states("Table setting")[2] == "After the welcome"
    early = session.of("event", topic="/next", taken_by=None)[0]["t"]
    assert early < session.time_of("task", behavior="R_Welcome", status="SUCCEEDED")


def test_a_repeated_instruction_is_said_again_word_by_word(play: Play) -> None:
    said = play("lablinking").said()
    assert said.count("Now take the spoon.") == 2
    apology = said.index("I am sorry, that was not very clear.")
    assert said[apology - 2 : apology] == said[apology + 2 : apology + 4]


def test_an_instruction_is_multimodal(play: Play) -> None:
    session = play("lablinking")
    assert session.actions("R_Task1_Step1") == [
        *("1 LookAt", "2 Speech", "3 Animation"),
        "4 Wait",
        *("5 Speech", "6 PointAt", "7 LookAt"),
        "8 LookAt",
    ]


def test_the_pause_inside_an_instruction_is_longer_during_noise(play: Play) -> None:
    session = play("lablinking")
    pauses = {
        act: session.of("action", act=act, action="4", status="started")[0]["parameters"]["duration"]
        for act in ("R_Task2_Step2", "R_Task2_Step3", "R_Task2_Step4", "R_Task3_Step1")
    }
    assert pauses == {"R_Task2_Step2": 600, "R_Task2_Step3": 2500, "R_Task2_Step4": 2500, "R_Task3_Step1": 600}


def test_without_hesitation_only_the_record_shows_the_noise(play: Play) -> None:
    session = play("lablinking", "--condition", "no hesitation")
    assert session.values("distraction") == [False, True, False]
    assert "R_Hesitation" not in session.acts()
    assert set(session.values("pause_ms")) == {600}


def test_an_instruction_interrupts_a_filler(play: Play) -> None:
    session = play("lablinking")
    assert session.of("task", behavior="R_Filler_LetMeSee")[-1]["status"] == "CANCELED"
    pressed = session.of("task", function="startInteractionRule", behavior="Next", status="SUCCEEDED")
    step = session.time_of("task", behavior="R_Task3_Step2", status="ACTIVE")
    assert min(abs(step - record["t"]) for record in pressed) < 0.5


def test_praise_never_has_the_same_words_twice_running(play: Play) -> None:
    session = play("lablinking")
    praises = session.of("action", act="R_Praise", action="2", status="started")
    said = [record["parameters"]["message"] for record in praises]
    assert len(said) == 4
    assert all(one != other for one, other in pairwise(said))


def test_the_memory_tells_where_the_session_is(play: Play) -> None:
    session = play("lablinking")
    assert session.values("task") == [0, 1, 2, 3, 4, 0]
    assert session.values("step")[:7] == [0, 0, 1, 2, 2, 3, 4]
    assert session.values("participant_number") == [1, 7]
    assert session.values("study_finished") == [False, False, True]


def test_after_a_stop_the_main_rule_goes_on_at_the_beginning_of_the_task(tmp_path: Path) -> None:
    script = tmp_path / "tasks.jsonl"
    tasks = [
        ("assignValue", "task = 3", 0),
        ("startInteractionRule", "Table setting", 1),
        ("startInteractionRule", "Next", 20),
        ("stopAll", "", 22),
        ("releaseStop", "", 30),
        ("startInteractionRule", "Table setting", 31),
    ]
    lines = [
        {"function_type": function, "domain_task_behavior": behavior, "at": at} for function, behavior, at in tasks
    ]
    script.write_text("\n".join(map(json.dumps, lines)), encoding="utf-8")
    session = Played(process(command("lablinking", script=script)).stdout)
    begun = ["Start", "Task 3, introduction", "After task 3, introduction"]
    assert session.states("Table setting") == [*begun, "Task 3, step 1", *begun]
    assert session.acts() == ["R_Task3_Intro", "R_Task3_Step1", "R_Task3_Intro"]
    assert [record["status"] for record in session.of("stop")] == ["requested", "latched", "released"]
