"""What only wizards ask for: free speech, cues, fillers, mistakes; and the times of every act."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import RobotChanged, SessionRecovered, SessionStarted, Submit
from rise_engine.kernel.records import (
    ActionRecord,
    CueRecord,
    KeptRecord,
    MistakeRecord,
    SessionRecord,
    TaskRecord,
    TimingRecord,
)
from rise_engine.kernel.snapshot import Snapshot
from rise_engine.kernel.view import CueView

from .harness import Session, dialog, gaze, pause, read, speech, view_of, write
from .test_rules import do, on, rule, state

ACTS = (
    dialog("Answer", speech(1))
    + dialog("Look", gaze(1))
    + dialog("Hm", speech(1, "Hm."))
    + dialog("LetMeSee", speech(1, "Let me see."))
    + dialog("Nod", pause(1, 300))
)
TOML = "".join(f'[act.{name}]\nfiller = true\ncalling_type = "None"\n' for name in ("Hm", "LetMeSee", "Nod"))
RULES = rule(
    "Main",
    state("a", ways=on("next", "b"))
    + state("b", do("startCommunicationRobotAct", "Answer"), ways=on("Answer_end", "a")),
)


def session(folder: Path, toml: str = TOML) -> Session:
    found = Session(read(write(folder, acts=ACTS, rules=RULES, memory={"name": "Ada"}, toml=toml)))
    found.robot("connected")
    found.lines()
    return found


@pytest.fixture
def s(tmp_path: Path) -> Session:
    return session(tmp_path)


def of(s: Session, kind: type) -> list[Any]:
    return [record for record in s.records if isinstance(record, kind)]


def press(s: Session, function: str, behavior: str = "", *, pressed: float | None = None, calling: str = "") -> None:
    task = Submit(function=function, behavior=behavior, calling_type=calling, source="wizard:w", pressed=pressed)
    s.do(task)


# --- free speech ---


def test_free_speech_is_an_act_of_one_sentence(s: Session) -> None:
    assert s.submit("say", "Please put {the} fork down.").status == "PENDING"
    goal = s.goals["1/say"]
    assert goal.type == "Speech"
    assert goal.parameters == {"message": "Please put {the} fork down."}, "braces are said as they are"
    assert s.submit("say", "And the knife.").status == "PENDING"
    assert list(s.goals) == ["1/say"], "one sentence at a time"
    s.report("1/say")
    assert [goal.parameters["message"] for goal in s.goals.values()] == ["And the knife."]
    actions = of(s, ActionRecord)
    assert {(record.act, record.action) for record in actions} == {("say", "say")}
    view = view_of(s)
    assert view.running == [2] and view.tasks[1].status == "SUCCEEDED"
    assert "say" not in view.acts and "And the knife." not in view.acts


@pytest.mark.parametrize(
    ("text", "calling", "why"),
    [
        ("", "", "nothing to say"),
        ("   ", "", "nothing to say"),
        ("x" * 2001, "", "at most 2000 characters"),
        ("Hello", "None", "`Blocking` or `Interrupt`"),
    ],
)
def test_what_cannot_be_said(s: Session, text: str, calling: str, why: str) -> None:
    task = s.submit("say", text, calling)
    assert task.status == "REJECTED" and why in task.reason
    assert not s.goals


def test_nothing_is_said_while_everything_is_stopped(s: Session) -> None:
    s.submit("stopAll")
    for function in ("say", "nextFiller"):
        assert s.submit(function, "Hello" if function == "say" else "").status == "REJECTED"


def test_a_robot_without_voice_says_nothing(tmp_path: Path) -> None:
    folder = write(tmp_path, acts=dialog("Nod", pause(1, 300)))
    (folder / "robots").mkdir()
    (folder / "robots" / "mute.toml").write_text('driver = "simulated"\n[actions.LookAt]\n', encoding="utf-8")
    (folder / "scenario.toml").write_text('robot = "mute"\n', encoding="utf-8")
    task = Session(read(folder)).submit("say", "Hello")
    assert task.status == "REJECTED" and "cannot speak" in task.reason


def test_free_speech_can_be_cancelled_by_its_task(s: Session) -> None:
    s.submit("say", "Hello")
    s.submit("say", "Answer")
    assert s.submit("stopCommunicationRobotAct", "Answer").status == "REJECTED", "what is said is no act's name"
    s.submit("cancelTask", "2")
    s.submit("cancelTask", "1")
    s.report("1/say", "canceled")
    assert [record.status for record in of(s, TaskRecord) if record.function == "say"][-2:] == ["CANCELED", "CANCELED"]


# --- interrupting ---


def test_interrupt_stops_what_runs_and_goes_first(s: Session) -> None:
    s.act("Answer")
    s.act("Answer")
    s.submit("say", "Stop, please", "Interrupt")
    assert s.cancels == ["1/1"] and list(s.goals) == ["1/1"], "it waits until the robot has confirmed"
    s.report("1/1", "canceled")
    assert [goal.parameters["message"] for goal in s.goals.values()] == ["Stop, please"]
    s.report("3/say")
    assert list(s.goals) == ["2/1"], "what waited goes on waiting, and then comes"


def test_an_act_may_interrupt_too_and_leaves_other_channels_alone(s: Session) -> None:
    s.act("Look", "None")
    s.act("Hm", "None")
    s.act("Answer", "Interrupt")
    assert s.cancels == ["2/1"]
    s.report("2/1", "canceled")
    assert set(s.goals) == {"1/1", "3/1"}


# --- cues ---


def test_a_cue_is_filled_and_answered(s: Session) -> None:
    s.t = 10.0
    s.submit("markCue", "asks again")
    s.t = 11.5
    s.submit("nextFiller")
    s.t = 13.0
    s.act("Answer")
    s.report("3/1", "canceled")
    s.t = 14.0
    s.report("4/1")
    s.act("Answer")
    cues = [(cue.status, cue.source, cue.text, cue.task, cue.since) for cue in of(s, CueRecord)]
    assert cues == [
        ("marked", "wizard:w", "asks again", None, None),
        ("filled", "wizard:w", "", 3, 1.5),
        ("answered", "wizard:w", "", 4, 3.0),
    ]
    assert view_of(s).cue == CueView(10.0, "wizard:w", filled=11.5, answered=13.0, task=4)


def test_a_cue_counts_from_the_press_of_its_key(s: Session) -> None:
    s.t = 10.0
    press(s, "markCue", pressed=9.0)
    press(s, "raiseEventTopic", "/x", pressed=9.5)
    press(s, "assignValue", "visits = 1", pressed=12.0)
    press(s, "nonsense", pressed=9.6)
    s.act("Answer")
    cues = [(cue.status, cue.at, cue.key_at, cue.since) for cue in of(s, CueRecord)]
    assert cues == [("marked", 9.0, 9.0, None), ("answered", 10.0, None, 1.0)]
    tasks = [(each.function, each.key_at) for each in of(s, TaskRecord)]
    assert tasks[:4] == [("markCue", 9.0), ("raiseEventTopic", 9.5), ("assignValue", 10.0), ("nonsense", 9.6)]
    assert {key_at for _, key_at in tasks[4:]} == {None}, "no key asked for it"
    assert view_of(s).cue == CueView(9.0, "wizard:w", answered=10.0, task=5)


def test_a_cue_is_taken_back(s: Session) -> None:
    assert s.submit("undoCue").reason.startswith("no cue is open")
    s.submit("markCue")
    s.t = 1.0
    assert s.submit("undoCue").status == "SUCCEEDED"
    assert view_of(s).cue is None
    s.act("Answer")
    assert [cue.status for cue in of(s, CueRecord)] == ["marked", "undone"], "nothing is answered"
    assert s.submit("undoCue").status == "REJECTED"


CUE_RULE = (
    '<InteractionRule name="R" initial="ask"><State id="ask"><transition eventTopic="/go" target="listen"/></State>'
    '<State id="listen"><transition eventTopic="/cue" target="heard"><function startCommunicationRobotAct="Answer"/>'
    '</transition></State><State id="heard"/></InteractionRule>'
)


def early_cue(folder: Path, toml: str) -> Session:
    """A cue that is marked before the rule waits for it."""
    s = Session(read(write(folder, acts=ACTS, rules=CUE_RULE, toml=toml)))
    s.rule("R")
    press(s, "markCue")
    return s


def test_a_cue_that_is_too_early_is_lost_unless_it_is_kept(tmp_path: Path) -> None:
    s = early_cue(tmp_path / "lost", "")
    s.submit("raiseEventTopic", "/go")
    assert s.states == {"R": "listen"}
    assert not of(s, KeptRecord)
    s = early_cue(tmp_path / "kept", '[cue]\nkeep = "3s"')
    s.wait(2.9)
    s.submit("raiseEventTopic", "/go")
    assert s.states == {}
    assert [(kept.topic, kept.status) for kept in of(s, KeptRecord)] == [("/cue", "kept"), ("/cue", "taken")]
    marked, raised, act = (
        next(task for task in of(s, TaskRecord) if task.function == name)
        for name in ("markCue", "raiseEventTopic", "startCommunicationRobotAct")
    )
    assert (raised.source, raised.behavior, raised.cause) == ("engine", "/cue", marked.id)
    assert act.cause == raised.id


@pytest.mark.parametrize(
    ("function", "ended"),
    [("undoCue", ["taken-back"]), ("stopAll", ["taken-back"]), ("markCue", ["taken-back", "kept", "expired"])],
)
def test_a_kept_cue_ends(tmp_path: Path, function: str, ended: list[str]) -> None:
    s = early_cue(tmp_path, '[cue]\nkeep = "3s"')
    s.wait(2)
    press(s, function)
    s.wait(3.1)
    assert [kept.status for kept in of(s, KeptRecord)] == ["kept", *ended]


# --- fillers ---


def test_the_turn_goes_on_after_a_filler_that_was_started_by_its_own_key(s: Session) -> None:
    s.act("LetMeSee")
    s.finish_all()
    s.submit("nextFiller")
    assert view_of(s).latest_act_of(("Hm", "LetMeSee", "Nod")) == "Nod"


def test_a_scenario_without_fillers_says_so(tmp_path: Path) -> None:
    task = session(tmp_path, "").submit("nextFiller")
    assert task.status == "REJECTED" and "has no filler" in task.reason


AUTO = TOML + "[fillers]\nauto_after = 3\n"


@pytest.mark.parametrize(
    ("toml", "meanwhile", "started"),
    [
        (TOML, [], []),
        (AUTO, [], ["Hm"]),
        (AUTO, [("startCommunicationRobotAct", "Answer")], []),
        (AUTO, [("startCommunicationRobotAct", "LetMeSee")], []),
        (AUTO, [("stopAll", "")], []),
        (AUTO, [("say", "Just a moment")], []),
        (AUTO, [("assignValue", "x = 1")], ["Hm"]),
    ],
)
def test_a_filler_comes_by_itself_only_when_the_scenario_says_so(
    tmp_path: Path, toml: str, meanwhile: list[tuple[str, str]], started: list[str]
) -> None:
    s = session(tmp_path, toml)
    s.submit("markCue")
    s.wait(1.0)
    for function, behavior in meanwhile:
        s.submit(function, behavior)
    s.finish_all()
    s.wait(1.9)
    assert not [record for record in of(s, TaskRecord) if record.source == "engine"], "too early"
    s.wait(0.2)
    assert [
        record.behavior for record in of(s, TaskRecord) if record.source == "engine" and record.status == "PENDING"
    ] == started
    s.wait(10)
    s.finish_all()
    assert len(
        [record for record in of(s, TaskRecord) if record.source == "engine" and record.status == "PENDING"]
    ) == len(started), "once"


# --- mistakes ---


def test_a_mistake_is_linked_to_its_act_and_can_be_taken_back(s: Session) -> None:
    s.act("Answer")
    s.finish_all()
    s.submit("say", "Hello")
    for behavior in ("1 late", "2 wrong", "1 double", "2 none"):
        assert s.submit("markMistake", behavior).status == "SUCCEEDED"
    marks = [(record.task, record.act, record.mark, record.source) for record in of(s, MistakeRecord)]
    assert marks == [
        (1, "Answer", "late", "wizard:w"),
        (2, "say", "wrong", "wizard:w"),
        (1, "Answer", "double", "wizard:w"),
        (2, "say", "none", "wizard:w"),
    ]
    view = view_of(s)
    assert (view.tasks[1].mark, view.tasks[2].mark) == ("double", "")


@pytest.mark.parametrize("behavior", ["", "1", "1 bad", "x late", "7 late", "-1 late", f"{'9' * 30} late"])
def test_marks_that_mean_nothing_are_rejected(s: Session, behavior: str) -> None:
    s.act("Answer")
    assert s.submit("markMistake", behavior).status == "REJECTED"
    assert not of(s, MistakeRecord)


@pytest.mark.parametrize(
    ("function", "behavior"),
    [
        ("raiseEventTopic", "/next"),
        ("assignValue", "task = 2"),
        ("assignValue", "task = nobody_knows + 1"),  # a note about the key stands before its record
        ("deleteValue", "name"),
        ("startInteractionRule", "Main"),
        ("markCue", ""),
        ("stopAll", ""),
    ],
)
def test_whatever_a_wizard_does_can_have_been_a_mistake(s: Session, function: str, behavior: str) -> None:
    press(s, function, behavior)
    press(s, "markMistake", "1 early")
    (mark,) = of(s, MistakeRecord)
    assert (mark.task, mark.act, mark.mark) == (1, "", "early")
    assert view_of(s).tasks[1].mark == "early"
    press(s, "markMistake", "2 late")
    assert of(s, TaskRecord)[-1].status == "REJECTED", "a mark is no deed"


def test_what_was_refused_or_done_by_others_is_no_mistake_of_a_wizard(s: Session) -> None:
    press(s, "startInteractionRule", "Nobody")
    s.do(Submit(function="raiseEventTopic", behavior="/next", source="ros:camera"))
    for id in (1, 2):
        press(s, "markMistake", f"{id} wrong")
    assert not of(s, MistakeRecord)


# --- failed acts ---


def failed(s: Session) -> list[int]:
    """As every console sees them; the kernel must agree."""
    seen = view_of(s).failed
    assert set(seen) == set(s.kernel.wizard_marks.state.failed_acts)
    return seen


def test_a_failed_act_stays_until_somebody_goes_on_without_it(s: Session) -> None:
    s.act("Answer")
    s.report("1/1", "failed", "no voice")
    s.submit("say", "Hello")
    s.report("2/say", "failed", "no voice")
    assert failed(s) == [1, 2]
    assert s.submit("goOn", "1").status == "SUCCEEDED"
    assert failed(s) == [2]
    for behavior in ("1", "7", "", "x", "-2"):
        assert s.submit("goOn", behavior).status == "REJECTED", behavior
    assert failed(s) == [2]


def test_a_failed_act_that_succeeds_after_all_needs_no_answer(s: Session) -> None:
    s.act("Answer")
    s.report("1/1", "failed", "no voice")
    s.act("Hm")
    s.finish_all()
    assert failed(s) == [1], "another act makes nothing good"
    s.act("Answer")
    assert failed(s) == [1], "it has only begun"
    s.report("3/1", "failed", "no voice")
    assert failed(s) == [3], "of one act the latest counts"
    s.act("Answer")
    s.submit("stopCommunicationRobotAct", "Answer")
    s.report("4/1", "canceled")
    assert failed(s) == [3], "who stops it has not answered"
    s.act("Answer")
    s.finish_all()
    assert failed(s) == []


# --- times ---


def test_every_act_leaves_its_times(s: Session) -> None:
    s.t = 10.0
    s.submit("markCue")
    s.t = 11.0
    press(s, "startCommunicationRobotAct", "Answer", pressed=10.95)
    s.t = 11.2
    s.report("2/1", "accepted")
    s.t = 13.0
    s.report("2/1")
    assert of(s, TimingRecord)[-1] == TimingRecord(
        *(of(s, TimingRecord)[-1].seq, 13.0, "", 2, "Answer", "SUCCEEDED", 10.0, 10.95, 11.0, 11.0, 11.2, 13.0),
        source="wizard:w",
        voice_at=11.2,
    )
    press(s, "say", "Well done", pressed=99.0)
    s.report("3/say", "failed", "no voice")
    last = of(s, TimingRecord)[-1]
    assert (last.act, last.status) == ("say", "ABORTED")
    assert last.key_at == 13.0, "no key was pressed after what it led to: two clocks never agree quite"
    assert last.cue_at is None, "the cue was answered by the act before"
    assert last.robot_at is None
    view = view_of(s)
    assert (view.tasks[2].cue_at, view.tasks[2].key_at, view.tasks[2].robot_at) == (10.0, 10.95, 11.2)


def test_an_act_that_a_rule_starts_in_answer_to_a_key_has_the_key_s_time(s: Session) -> None:
    s.rule("Main")
    s.t = 4.0
    press(s, "raiseEventTopic", "next", pressed=3.9)
    s.finish_all()
    assert [record.key_at for record in of(s, TimingRecord)] == [3.9]
    s.t = 9.0
    s.do(RobotChanged(status="degraded"))
    s.event("next")
    s.finish_all()
    assert [record.key_at for record in of(s, TimingRecord)] == [3.9, None]


# --- across a crash ---


def test_the_snapshot_keeps_what_wizards_count_on(tmp_path: Path) -> None:
    s = session(tmp_path, AUTO)
    s.do(SessionStarted(participant="P07", condition="hesitation"))
    s.submit("nextFiller")
    s.submit("markCue")
    s.submit("say", "Hello")
    snapshot = msgspec.json.decode(msgspec.json.encode(s.kernel.snapshot()), type=Snapshot)
    again = Session(s.scenario, kernel=Kernel.restore(s.scenario, snapshot))
    again.timers = dict(s.timers)
    again.do(SessionRecovered())
    last = [record for record in again.records if isinstance(record, SessionRecord)][-1]
    assert (last.participant, last.condition) == ("P07", "hesitation")
    assert again.submit("markMistake", "4 early").status == "SUCCEEDED"
    assert again.submit("nextFiller").reason == "LetMeSee"
