"""Trials, beside what docs/reference/exports.md says of them, computed from the journal's records alone."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.expression import Expression
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    CueRecord,
    EventRecord,
    FailureRecord,
    MemoryRecord,
    MistakeRecord,
    RuleRecord,
    SessionRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.kernel.wizard_marks import UNMARKABLE
from rise_engine.results.analysis.model import CodedAnnotation, SessionData
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.analysis.trials import trials_of
from rise_engine.scenario.explore_settings import TrialSettings
from tests.chance import seeds

from .samples import WIZARD, everything, play_session, recovered_session, task

ACTS = {"startCommunicationRobotAct", "say"}
ASIDES = {"Hm", "Think"}
SPEAKING = {"Greet", "Answer", "Ask", "Thanks", "Hm"}
NO_REACTIONS = {*UNMARKABLE, "markCue", "undoCue", "nextFiller", "stopAll", "releaseStop", "stepBack"}
NO_REACTIONS |= {"stopCommunicationRobotAct", "stopInteractionRule", "cancelTask", "moveTask"}
CONTINUED = {"resumed, without onEntry", "stepped back, without onEntry"}
BY_STATE = TrialSettings(state="Visit/*", columns=(Expression.parse("visits"), Expression.parse("noise")))
BY_KEY = TrialSettings(key=Expression.parse("noise"), columns=(Expression.parse("noise"),))


class Text:
    """What the page says, read word for word."""

    def __init__(self, records: list[AnyRecord], settings: TrialSettings) -> None:
        self.records, self.settings = records, settings
        self.tasks = {record.id: record for record in reversed(records) if isinstance(record, TaskRecord)}
        self.fillers = {each.task for each in records if isinstance(each, CueRecord) and each.status == "filled"}

    def rows(self) -> list[dict[str, Any]]:
        return [self.row(*span) for span in self.spans()]

    def spans(self) -> list[tuple[float, float, str]]:
        found: list[tuple[float, float, str]] = []
        start, rule, value, stopped = None, "", None, ""
        for record in self.records:
            ended_by, begins = "", False
            if isinstance(record, RuleRecord) and self.settings.state:
                if record.status == "entered" and record.trigger in CONTINUED:
                    if start is None and stopped == record.name:
                        (start, _, _), rule, stopped = found.pop(), "Visit", ""
                elif record.status == "entered" and record.name == "Visit":
                    ended_by, begins = "trial", True
                elif record.status in ("ended", "stopped", "faulted") and record.name == rule:
                    ended_by, stopped = "rule", record.name if record.status == "stopped" else ""
            if isinstance(record, MemoryRecord) and not self.settings.state and record.key == "noise":
                now = None if record.deleted else record.value
                if now != value and record.source not in ("file", "study", "condition"):
                    ended_by, begins = "key" if now is None else "trial", now is not None
                value = now
            if ended_by:
                if start is not None:
                    found.append((start, record.t, ended_by))
                start, rule = (record.t, "Visit") if begins else (None, "")
        if start is not None:
            found.append((start, self.records[-1].t, "record"))
        return found

    def row(self, start: float, end: float, ended_by: str) -> dict[str, Any]:
        before = float("inf") if ended_by == "record" else end
        spoken = [(v, n) for n, each in self.acts() if start <= each.t < before and (v := self.voice_at(n)) is not None]
        asked_at, asking = min(spoken, default=(None, None))
        asked_end = self.speech_end(asking) if asking is not None else None
        since = start if asked_at is None else asked_at
        until = float("inf") if ended_by == "record" else end
        cue_at = min((t for t in self.cues() if since <= t <= until and t > start), default=None)
        since = cue_at if cue_at is not None else asked_at
        key_at = min((t for t in self.keys() if since is not None and since <= t <= end), default=None)
        heard = cue_at if cue_at is not None else key_at
        until = heard if heard is not None else before
        since = asked_end if asked_end is not None else asked_at
        prompts = [n for n, _ in self.acts() if n != asking and since is not None]
        prompts = [n for n in prompts if since <= (self.voice_at(n) or -1.0) < until]
        onsets = [v for n, _ in self.acts() if (v := self.onset(n)) is not None and heard is not None and v >= heard]
        return {
            "start": start,
            "end": end,
            "ended_by": ended_by,
            "values": {each.text: self.value(each.text, before) for each in self.settings.columns},
            "asked_at": asked_at,
            "asked_end": asked_end,
            "cue_at": cue_at,
            "key_at": key_at,
            "robot_next_at": min(onsets, default=None),
            "prompts": len(prompts),
            "events": tuple(topic for t, topic in self.events() if start < t <= end),
            "repairs": sum(start < t <= end for t in self.repairs()),
            "interrupted": self.interrupted(start, end),
            "participant_interrupted": self.interrupted(asked_end, heard),
            "wizard_interrupted": self.interrupted(cue_at, key_at),
            "stops": sum(start < each.t <= end for each in self.records if self.is_stop(each)),
            "failures": sum(start < each.t <= end for each in self.records if self.is_failure(each)),
            "marks": sorted(
                mark for t, mark, left in self.marks() if (start <= t < before if left else start < t <= end)
            ),
        }

    def acts(self) -> list[tuple[int, TaskRecord]]:
        found = [(n, each) for n, each in sorted(self.tasks.items()) if each.function in ACTS]
        return [(n, each) for n, each in found if n not in self.fillers and each.behavior not in ASIDES]

    def actions(self, act: int) -> list[ActionRecord]:
        return [each for each in self.records if isinstance(each, ActionRecord) and each.task == act]

    def voice_at(self, act: int) -> float | None:
        return next((each.t for each in self.actions(act) if each.type == "Speech" and each.status == "accepted"), None)

    def onset(self, act: int) -> float | None:
        if self.tasks[act].function == "say" or self.tasks[act].behavior in SPEAKING:
            return self.voice_at(act)
        return next((each.t for each in self.actions(act) if each.status == "accepted"), None)

    def speech_end(self, act: int) -> float | None:
        spoken = [each for each in self.actions(act) if each.type == "Speech"]
        ends = {each.action: each.t for each in spoken if each.status == "succeeded"}
        return max(ends.values()) if {each.action for each in spoken} == ends.keys() else None

    def cues(self) -> list[float]:
        marked: list[float] = []
        for record in self.records:
            if isinstance(record, CueRecord) and record.status == "marked":
                marked.append(record.t if record.key_at is None else record.key_at)
            elif isinstance(record, CueRecord) and record.status == "undone":
                marked.pop()
        return marked

    def root(self, number: int) -> int:
        while (cause := self.tasks[number].cause) is not None:
            number = cause
        return number

    def keys(self) -> list[float]:
        found = []
        for number, record in self.tasks.items():
            refused = any(isinstance(e, TaskRecord) and e.id == number and e.status == "REJECTED" for e in self.records)
            is_aside = record.function in ACTS and (number in self.fillers or record.behavior in ASIDES)
            if record.source != WIZARD or refused or is_aside or record.function in NO_REACTIONS:
                continue
            if record.cause is not None:  # another request brought it along
                continue
            found.append(record.t if record.key_at is None else record.key_at)
        return found

    def events(self) -> list[tuple[float, str]]:
        return [(e.t, e.topic) for e in self.records if isinstance(e, EventRecord) and e.source == WIZARD]

    def repairs(self) -> list[float]:
        found = [each.t for each in self.records if isinstance(each, FailureRecord) and each.status == "repeated"]
        found += [each.t for each in self.records if isinstance(each, CueRecord) and each.status == "undone"]
        back = [e for e in self.records if isinstance(e, RuleRecord) and e.status == "entered"]
        found += [each.t for each in back if (each.trigger or "").startswith("stepped back")]
        begun = {each.id for each in self.records if isinstance(each, TaskRecord) and each.status == "ACTIVE"}
        ended = [e for e in self.records if isinstance(e, TaskRecord) and e.status == "CANCELED" and e.function in ACTS]
        found += [each.t for each in ended if each.id in begun and self.is_stopped_by_wizard(each)]
        return found

    def is_stopped_by_wizard(self, record: TaskRecord) -> bool:
        if not record.reason.startswith("interrupted by "):
            return re.search(r"\bby wizard:", record.reason) is not None and not record.reason.startswith("stop-all ")
        if record.id in self.fillers or record.behavior in ASIDES:
            return False
        name = record.reason.removeprefix("interrupted by ")
        later = [
            (n, each)
            for n, each in self.tasks.items()
            if n > record.id and each.function in ACTS and each.t <= record.t
        ]
        by = max((n for n, each in later if name == ("say" if each.function == "say" else each.behavior)), default=None)
        return by is not None and self.tasks[self.root(by)].source == WIZARD

    def interrupted(self, start: float | None, end: float | None) -> str | None:
        if start is None or end is None:
            return None
        if any(isinstance(e, SessionRecord) and e.status == "recovered" and start < e.t <= end for e in self.records):
            return "outage"
        stopped: float | None = None
        for record in self.records:
            if isinstance(record, StopRecord) and record.status == "released":
                if stopped is not None and stopped < end and start < record.t:
                    return "stop"
                stopped = None
            elif stopped is None and self.is_stop(record):
                stopped = record.t
        return "stop" if stopped is not None and stopped < end else None

    def is_stop(self, record: AnyRecord) -> bool:
        return isinstance(record, StopRecord) and record.status == "requested" and record.source != "engine"

    def is_failure(self, record: AnyRecord) -> bool:
        if isinstance(record, TaskRecord):
            return record.status == "ABORTED" and record.function != "startInteractionRule"
        return isinstance(record, RuleRecord) and record.status == "faulted"

    def marks(self) -> list[tuple[float, str, bool]]:
        last = {each.task: each.mark for each in self.records if isinstance(each, MistakeRecord)}
        found = [(self.tasks[n], mark) for n, mark in last.items() if mark != "none"]
        return [(each.t, mark, each.function in ACTS) for each, mark in found]

    def value(self, key: str, before: float) -> Any:
        value = None
        for each in self.records:
            if isinstance(each, MemoryRecord) and each.key == key and each.t < before:
                value = None if each.deleted else each.value
        return value


def compared(folder: Path, settings: TrialSettings) -> list[dict[str, Any]]:
    """The rows of a session, which both say."""
    data = read_session(folder)
    assert data.scenario is not None
    data = replace(data, scenario=replace(data.scenario, trials=settings))
    text = Text(list(data.records), settings)
    expected = text.rows()
    told = [{name: getattr(trial, name) for name in row} for trial, row in zip(trials_of(data), expected, strict=True)]
    for row in told:
        row["marks"] = sorted(row["marks"])
    assert told == expected
    for trial in trials_of(data):
        for name in ("duration_s", "participant_s", "wizard_s", "key_s", "prompts", *trial.values):
            assert (trial.number(name) is None) is (trial.why_no_number(name) is not None), name
    return told


def random_script(seed: int) -> list[tuple[float, Submit]]:
    """What a hasty wizard does in a visit."""
    draw = random.Random(seed)
    at, script = 0.5, [(0.5, task("startInteractionRule", "Visit", pressed=0.45))]
    deeds = [
        *(("markCue", ""), ("markCue", ""), ("markCue", ""), ("undoCue", ""), ("say", "Hello"), ("stepBack", "Visit")),
        *(("startCommunicationRobotAct", name) for name in ("Answer", "Ask", "Thanks", "Nod", "Hm", "Point")),
        *(("raiseEventTopic", topic) for topic in ("/tea", "/bye", "/off")),
        *(("stopCommunicationRobotAct", "Answer"), ("stopAll", ""), ("releaseStop", '{"Visit": "wait"}')),
        *(("assignValue", f"noise = {each}") for each in ("1", "2", "null")),
        *(("startInteractionRule", "Visit"), ("markMistake", f"{draw.randrange(1, 9)} late")),
    ]
    for _ in range(draw.randrange(4, 26)):
        at = round(at + draw.choice([0.0, 0.3, 1.2, 3.0, 5.0]), 3)
        function, behavior = draw.choice(deeds)
        pressed = None if function == "markMistake" else max(0.0, round(at - draw.choice([0.0, 0.04]), 3))
        script.append((at, task(function, behavior, pressed=pressed)))
    return script


@pytest.mark.search
def test_random_sessions_have_the_trials_that_the_page_says(tmp_path: Path) -> None:
    trials = measured = 0
    for seed in seeds(16):
        script = random_script(seed)
        folder = play_session(
            tmp_path / f"{seed}", script, scenario=None, until=script[-1][0] + 3.0, ends=seed % 2 == 0
        )
        for settings in (BY_STATE, BY_KEY):
            rows = compared(folder, settings)
            trials += len(rows)
            measured += sum(row["asked_end"] is not None and row["cue_at"] is not None for row in rows)
    assert trials > 70 and measured > 2


@pytest.mark.parametrize("play", [play_session, recovered_session])
def test_a_session_of_everything(tmp_path: Path, play: Any) -> None:
    folder = play(tmp_path / "sessions")
    assert [row["ended_by"] for row in compared(folder, BY_STATE)][-1] in ("rule", "record")


def read(folder: Path, level: Any = "full") -> SessionData:
    return read_session(folder, level=level)


def test_what_is_measured(tmp_path: Path) -> None:
    folder = play_session(
        tmp_path / "sessions",
        [
            (1.0, task("startInteractionRule", "Visit")),
            (10.0, task("raiseEventTopic", "/tea", pressed=9.9)),
            (20.0, task("markCue", pressed=20.0)),
            (21.5, task("startCommunicationRobotAct", "Answer", pressed=21.25)),
        ],
        until=40.0,
    )
    data = read(folder)
    tea = trials_of(data)[-1]
    assert (tea.start, tea.robot_said, tea.asked_at) == (10.0, "Would you like some tea?", 10.02)
    assert tea.asked_end is not None and tea.participant_s == pytest.approx(20.0 - tea.asked_end)
    assert (tea.wizard_s, tea.wizard_asked) == (1.25, "startCommunicationRobotAct Answer")
    assert tea.robot_next_at is not None and 22.0 < tea.robot_next_at < 23.0
    assert tea.number("participant_s") == tea.participant_s and tea.number("visits") == 1 and tea.number("start") == 10
    for value, is_other in (("3", True), (True, True), (3, False)):
        told = replace(tea, values={"score": value})
        expected = (None, "value") if is_other else (value, None)
        assert (told.number("score"), told.why_no_number("score")) == expected
    stopped = replace(tea, participant_interrupted="stop")
    assert (stopped.number("participant_s"), stopped.why_no_number("participant_s")) == (None, "stop")
    assert stopped.number("visits") == 1, "what is no time is counted"
    for changed, whys in (
        ({"cue_at": None}, {"participant_s": "cue", "wizard_s": "cue"}),
        ({"key_at": None}, {"wizard_s": "key", "key_s": "key"}),
        ({"key_at": None, "stepped_back": True}, {"wizard_s": "back", "key_s": "back"}),
        ({"asked_end": None}, {"participant_s": "end", "key_s": "end"}),
        ({"asked_end": None, "asked_cut": True}, {"participant_s": "cut", "key_s": "cut"}),
        ({"asked_end": None, "interrupted": "outage"}, {"participant_s": "outage", "key_s": "outage"}),
        ({"asked_at": None, "asked_end": None}, {"participant_s": "silent", "key_s": "silent"}),
        ({"values": {"score": None}}, {"score": "unset"}),
    ):
        told = replace(tea, **changed)
        names = ("participant_s", "wizard_s", "key_s", "prompts", "score")
        assert {name: why for name in names if (why := told.why_no_number(name)) is not None} == whys
    assert (tea.speech_at, tea.why_no_number("speech_s")) == (None, "speech"), "nobody has annotated it"
    spans = ((9.0, True), (12.5, False), (16.0, True), (18.0, True))
    coded = tuple(
        CodedAnnotation(tier="P", begin=at, end=at + 1, value="", speech=is_speech) for at, is_speech in spans
    )
    spoken = trials_of(replace(data, coded=coded))[-1]
    assert spoken.speech_at == 16.0 and spoken.number("speech_s") == pytest.approx(16.0 - tea.asked_end)
    stopped = replace(spoken, speech_interrupted="stop")
    assert (stopped.number("speech_s"), stopped.why_no_number("speech_s")) == (None, "stop")


def test_an_event_says_when_the_participant_speaks_unless_somebody_has_annotated_it(tmp_path: Path) -> None:
    heard = [task("raiseEventTopic", "/speech_begins", source="detector") for _ in range(3)]
    script = [(1.0, task("startInteractionRule", "Visit")), (10.0, task("raiseEventTopic", "/tea", pressed=9.9))]
    folder = play_session(tmp_path / "sessions", [*script, *zip((9.5, 15.0, 17.0), heard, strict=True)], until=40.0)
    data = read(folder)
    assert trials_of(data)[-1].speech_at is None, "the scenario does not name the event"
    data = replace(data, scenario=replace(data.scenario, trials=replace(BY_STATE, speech="speech_begins")))
    tea = trials_of(data)[-1]
    assert (tea.start, tea.speech_at, tea.key_at) == (10.0, 15.0, None)
    assert tea.asked_end is not None and tea.number("speech_s") == pytest.approx(15.0 - tea.asked_end)
    coded = (CodedAnnotation(tier="P", begin=16.0, end=17.0, value="", speech=True),)
    assert trials_of(replace(data, coded=coded))[-1].speech_at == 16.0


def test_nothing_is_measured_from_speech_whose_end_nobody_knows(tmp_path: Path) -> None:
    """The engine dies while the robot asks. The robot fell silent at a time that nobody knows, long before the cue."""
    asks = [(1.0, task("startInteractionRule", "Visit")), (10.0, task("raiseEventTopic", "/tea", pressed=9.9))]
    folder = recovered_session(tmp_path / "lab", at=11.0, script=[*asks, (20.0, task("markCue", pressed=20.0))])
    tea = next(each for each in trials_of(read(folder)) if each.start == 10.0)
    assert (tea.robot_said, tea.asked_at, tea.cue_at) == ("Would you like some tea?", 10.02, 20.0)
    assert (tea.asked_end, tea.participant_s, tea.key_s) == (None, None, None)
    compared(folder, BY_STATE)


def test_a_trial_that_begins_while_everything_is_stopped_has_no_length(tmp_path: Path) -> None:
    script = [
        *((1.0, task("stopAll")), (2.0, task("assignValue", "noise = 1")), (4.0, task("releaseStop"))),
        (6.0, task("assignValue", "noise = 2")),
    ]
    folder = play_session(tmp_path / "sessions", script, until=10.0)
    data = read(folder)
    assert data.scenario is not None
    first = trials_of(replace(data, scenario=replace(data.scenario, trials=BY_KEY)))[0]
    assert (first.start, first.stops, first.why_no_number("duration_s")) == (2.0, 0, "stop")


def test_nothing_is_measured_from_a_question_that_was_cut_off(tmp_path: Path) -> None:
    script = [
        (1.0, task("startInteractionRule", "Visit")),
        (10.0, task("raiseEventTopic", "/tea", pressed=9.9)),
        (10.9, task("stopCommunicationRobotAct", "Ask")),
        (12.0, task("markCue", pressed=12.0)),
    ]
    folder = play_session(tmp_path / "sessions", script, until=20.0)
    tea = trials_of(read(folder))[-1]
    assert (tea.robot_said, tea.asked_at, tea.asked_end, tea.cue_at) == ("Would you like some tea?", 10.02, None, 12.0)
    assert (tea.participant_s, tea.why_no_number("participant_s")) == (None, "cut")
    compared(folder, BY_STATE)


@pytest.mark.parametrize(
    ("function", "behavior", "counts"),
    [
        ("startCommunicationRobotAct", "Hm", False),
        ("startInteractionRule", "Bridge", True),
        ("raiseEventTopic", "/hm", True),
    ],
)
def test_a_filler_is_no_reaction_of_the_wizard_and_no_correction(
    tmp_path: Path, function: str, behavior: str, counts: bool
) -> None:
    """Otherwise wizards would look faster, and would correct more, in the condition with fillers. A key that moves a
    rule is a reaction, also if the robot only nods at first."""
    for name, text in {**QUIZ, **BRIDGE}.items():
        (tmp_path / "quiz" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "quiz" / name).write_text(text, "utf-8")
    script = [(0.5, task("startInteractionRule", "Listen")), (1.0, task("startInteractionRule", "Quiz"))]
    script += [(8.0, task("markCue", pressed=8.0)), (12.0, task("markCue", pressed=12.0))]
    script += [(12.5, task(function, behavior, pressed=12.4)), (12.8, task("say", "Good", pressed=12.7))]
    data = read(play_session(tmp_path / "sessions", script, scenario=tmp_path / "quiz", until=30.0, faults=()))
    assert [each.status for each in data.acts if each.act == "Hm"] == ["CANCELED"]
    trial = next(each for each in trials_of(data) if each.start == 12.0)
    assert (data.repairs.total, trial.repairs) == (0, 0)
    assert next((key.at, key.function) for key in data.keys if key.at > 12.0) == (12.4, function)
    assert (trial.key_at, trial.wizard_asked) == ((12.4, f"{function} {behavior}") if counts else (12.7, "say Good"))


@pytest.mark.parametrize("back", ["stop", "step"])
def test_a_trial_goes_on_after_a_stop_or_a_step_back_without_asking_again(tmp_path: Path, back: str) -> None:
    for name, text in QUIZ.items():
        (tmp_path / "quiz" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "quiz" / name).write_text(text, "utf-8")
    script = [(1.0, task("startInteractionRule", "Quiz")), (6.0, task("markCue", pressed=6.0))]
    script += [(9.0, task("stopAll")), (12.0, task("releaseStop", '{"Quiz": "wait"}'))] if back == "stop" else []
    script += [(9.0, task("stepBack", '{"rule": "Quiz", "enter": false}'))] if back == "step" else []
    script += [(15.0, task("markCue", pressed=15.0))]
    data = read(play_session(tmp_path / "sessions", script, scenario=tmp_path / "quiz", until=30.0, faults=()))
    found = trials_of(data)
    assert [(each.start, each.end) for each in found[:2]] == [(1.0, 6.0), (6.0, 15.0)] and len(found) == 3
    assert (found[1].cue_at, found[1].stops, found[1].repairs) == (15.0, back == "stop", back == "step")
    assert found[1].key_at is None  # a stop is no reaction to the participant


def test_a_rule_that_begins_in_the_state_of_a_trial_begins_one(tmp_path: Path) -> None:
    """Also without its onEntry, and after a wizard has stopped it: that is another trial, and no stop of everything."""
    for name, text in QUIZ.items():
        (tmp_path / "quiz" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "quiz" / name).write_text(text, "utf-8")
    again = '{"rule": "Quiz", "state": "Ask", "enter": false}'
    script = [(1.0, task("startInteractionRule", "Quiz")), (8.0, task("stopInteractionRule", "Quiz", pressed=8.0))]
    script += [(20.0, task("startInteractionRule", again)), (25.0, task("markCue", pressed=25.0))]
    data = read(play_session(tmp_path / "sessions", script, scenario=tmp_path / "quiz", until=30.0, faults=()))
    found = trials_of(data)
    assert [(each.start, each.end, each.cue_at, each.key_at) for each in found[:2]] == [
        (1.0, 8.0, None, None),
        (20.0, 25.0, 25.0, None),
    ]


PAUSING = (
    '<InteractionRule name="Quiz" initial="Ask"><State id="Ask"><transition after="3s" target="Pause"/></State>'
    '<State id="Pause"><transition eventTopic="/cue" target="Ask"/></State></InteractionRule>'
)


@pytest.mark.parametrize("choice", ["wait", "enter"])
def test_a_stop_in_a_later_state_of_a_trial_does_not_end_it(tmp_path: Path, choice: str) -> None:
    for name, text in {**QUIZ, "rules/r.xml": PAUSING}.items():
        (tmp_path / "quiz" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "quiz" / name).write_text(text, "utf-8")
    script = [(1.0, task("startInteractionRule", "Quiz")), (6.0, task("stopAll"))]
    script += [(9.0, task("releaseStop", json.dumps({"Quiz": choice}))), (15.0, task("markCue", pressed=15.0))]
    data = read(play_session(tmp_path / "sessions", script, scenario=tmp_path / "quiz", until=30.0, faults=()))
    first = trials_of(data)[0]
    assert (first.start, first.end, first.cue_at, first.stops) == (1.0, 15.0, 15.0, 1)


QUIZ = {
    "scenario.toml": 'title = "Quiz"\n[trials]\nstate = "Ask"\n',
    "acts/a.xml": '<Dialog name="Ask"><Speech><actionID>1</actionID><message>Well?</message></Speech></Dialog>',
    "rules/r.xml": '<InteractionRule name="Quiz" initial="Ask"><State id="Ask">'
    '<onEntry><function startCommunicationRobotAct="Ask"/></onEntry>'
    '<transition eventTopic="/cue" target="Ask"/></State></InteractionRule>',
}


BRIDGE = {
    "scenario.toml": QUIZ["scenario.toml"] + '[act.Hm]\nfiller = true\ncalling_type = "None"\n',
    "acts/b.xml": '<Dialog name="Hm"><Speech><actionID>1</actionID><message>Hm, let me</message></Speech></Dialog>',
    "rules/b.xml": '<InteractionRules><InteractionRule name="Bridge" initial="S"><State id="S"><onEntry>'
    '<function startCommunicationRobotAct="Hm"/></onEntry></State></InteractionRule>'
    '<InteractionRule name="Listen" initial="S"><State id="S"><transition eventTopic="/hm" target="T"/></State>'
    '<State id="T"><onEntry><function startCommunicationRobotAct="Hm"/></onEntry></State></InteractionRule>'
    "</InteractionRules>",
}


def test_a_cue_that_begins_the_next_trial_is_that_of_the_trial_which_it_ends(tmp_path: Path) -> None:
    """Otherwise the dependent variable would have a value in the last trial alone."""
    for name, text in QUIZ.items():
        (tmp_path / "quiz" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "quiz" / name).write_text(text, "utf-8")
    script = [(1.0, task("startInteractionRule", "Quiz"))]
    script += [(at, task("markCue", pressed=at)) for at in (6.0, 13.0, 21.0)]
    data = read(play_session(tmp_path / "sessions", script, scenario=tmp_path / "quiz", until=30.0, faults=()))
    found = trials_of(data)
    assert [(each.start, each.end, each.cue_at) for each in found[:3]] == [
        (1.0, 6.0, 6.0),
        (6.0, 13.0, 13.0),
        (13.0, 21.0, 21.0),
    ]
    assert [each.cue_at for each in found[3:]] == [None]
    assert all(each.participant_s is not None and 2 < each.participant_s < 8 for each in found[:3])


def test_a_level_tells_trials_what_it_tells(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions", everything())
    for level, name in (("full", "Zelda Quux"), ("shared", None)):
        told = [trial.values["person_name"] for trial in trials_of(read(folder, level))]
        assert told and all((each == name) is (level == "full") for each in told), told
        assert "Zelda" not in str(trials_of(read(folder, level))) or level == "full"


def test_without_a_scenario_or_trials_there_are_none(tmp_path: Path) -> None:
    data = read(play_session(tmp_path / "sessions"))
    assert data.scenario is not None and trials_of(data)
    assert trials_of(replace(data, scenario=None)) == ()
    assert trials_of(replace(data, scenario=replace(data.scenario, trials=None))) == ()
