"""The decisions of several wizards on the same cues: the one who ran the session, and those who judged it later.

A decision is a wizard's first request after a cue that is not a filler, mark or note: an act, an event, a rule, a
value, speech, a stop. A request before the cue counts if its act answered the cue. No request until the next cue is a
decision, too (`NOTHING`). Free speech is `say`, whatever its words.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from msgspec import Struct, field

from rise_engine.base.errors import SessionError
from rise_engine.expression import Assignment, LanguageError
from rise_engine.kernel.behaviors import (
    BehaviorError,
    EventRaise,
    is_object,
    read_object,
    read_step_back,
    started_rule,
)
from rise_engine.kernel.records import ControlRecord, CueRecord, Mark, MistakeRecord, TaskRecord
from rise_engine.results.analysis.course import interruption_between
from rise_engine.results.analysis.model import InterruptionKind, SessionData, SessionFacts, actor_of
from rise_engine.scenario.model import Scenario, normal_topic
from rise_engine.session.folder import read_info
from rise_engine.session.scenario_copies import load_session_scenario
from rise_engine.session.shadow import (
    NO_ANSWERS,
    SHADOW_FOLDER,
    Shadow,
    ShadowCue,
    ShadowEnd,
    ShadowHeader,
    ShadowKey,
    ShadowMark,
    ShadowPause,
    read_shadows,
)

_ROUNDED = 0.001
"""Maximum difference in seconds between two times of one cue."""
NOTHING = "(nothing)"
"""The decision of a wizard who requested nothing until the cue was over."""
ACT, SAY, EVENT, SET = "startCommunicationRobotAct", "say", "raiseEventTopic", "assignValue"
_WORDS = {
    "stopCommunicationRobotAct": "stop",
    "stopInteractionRule": "stop rule",
    "deleteValue": "delete",
    "cancelTask": "cancel a task",
    "stopAll": "stop all",
    "goOn": "go on",
    "repeatAct": "repeat the failed act",
    "stopRuleOfAct": "stop the rule of the failed act",
}
_WHY_INTERRUPTED: dict[InterruptionKind, str] = {"outage": "no engine", "standstill": "standstill", "stop": "stopped"}
_WITHOUT_NAME = frozenset({"cancelTask", "stopAll", "goOn", "repeatAct", "stopRuleOfAct"})
"""Functions whose behaviour is a task's number, or empty."""


class Decision(Struct, frozen=True):
    """The decision of one wizard on one cue."""

    label: str
    latency: float | None = None
    """Seconds from the cue to the key. None: there was no key, or the time is meaningless (see `why`)."""
    why: str = ""
    """Why there is no latency: `paused`, `another speed`, `before the cue`, `no engine`, `standstill`, `stopped`."""


class JudgedCue(Struct, frozen=True, kw_only=True):
    """One cue with the decisions on it."""

    facts: SessionFacts
    number: int
    """The number of the cue in its session, from 1. Undone cues are counted but omitted."""
    at: float
    decisions: dict[str, Decision]
    """By the wizard's name, without wizards who did not see the cue."""


class MarkedAct(Struct, frozen=True, kw_only=True):
    """A request of the session's wizard, with all wizards' marks of mistakes."""

    facts: SessionFacts
    task: int
    act: str
    marks: dict[str, Mark]
    """By name. `none`: they saw it and found no mistake."""


class JudgedSession(Struct, kw_only=True):
    """One session with its judges."""

    live: str
    """The wizard who ran it. Several are joined by ` + `."""
    cues: list[JudgedCue] = field(default_factory=list)
    undone: int = 0
    """The number of undone cues, which do not count."""
    acts: list[MarkedAct] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)


class _Window(Struct):
    """The time from a cue to the next one."""

    seq: int
    at: float
    number: int
    shown: float
    """The time of its record, at which a second wizard sees it."""
    decision: Decision | None = None
    undone: bool = False


def decision_label(scenario: Scenario | None, function: str, behavior: str) -> str:
    """Describe a decision in a few words without typed values.

    :param scenario: the session's scenario; None if it cannot be read.
    :param function: the task's function.
    :param behavior: the task's behaviour.
    """
    match function:
        case _ if function == ACT:
            return behavior
        case _ if function == SAY:
            return SAY
        case _ if function == EVENT:
            return f"event {_topic(behavior)}"
        case "startInteractionRule":
            return f"rule {started_rule(behavior)}"
        case _ if function == SET:
            is_key = scenario is not None and any(
                (each.function, each.task_behavior) == (function, behavior) for each in scenario.keys.values()
            )
            return f"set {' '.join(behavior.split()) if is_key else _assigned(behavior)}"
        case "stepBack":
            try:
                return f"step back {read_step_back(behavior).rule}"
            except BehaviorError:
                return "step back"
    word = _WORDS.get(function, function)
    return word if function in _WITHOUT_NAME else f"{word} {behavior}".strip()


def _topic(behavior: str) -> str:
    if is_object(behavior):
        try:
            behavior = read_object(behavior, EventRaise, "an event").event
        except BehaviorError:
            return "?"
    return f"/{normal_topic(behavior)}"


def _assigned(behavior: str) -> str:
    try:
        return Assignment.parse(behavior).key
    except LanguageError:
        return "?"


def judge_session(data: SessionData, names: Mapping[str, str] | None = None) -> JudgedSession:
    """Collect the decisions on each cue of a session.

    :param data: the session, read at the level `full`; decisions only show their labels.
    :param names: the code of each wizard; None: their own names.
    """
    scenario = _scenario_of(data.folder)
    shadows, problems = read_shadows(data.folder)
    named = dict(names or {})
    windows = _windows(data, scenario)
    live = _live_names(data)
    session = JudgedSession(live=" + ".join(named.get(each, each) for each in live))
    if scenario is None:
        session.remarks.append(f"{data.facts.session} has no scenario that can be read: fillers count as answers")
    problems += [f"{data.facts.session}: {problem}" for each in shadows for problem in each.problems]
    session.remarks += [each.replace(str(data.folder), data.facts.session) for each in problems]
    if len(live) > 1:
        session.remarks.append(
            f"{len(live)} wizards ran {data.facts.session}; their actions count as those of one wizard"
        )
    if data.facts.speed != 1:
        text = f"{session.live} ran {data.facts.session} at {data.facts.speed:g} times real time"
        session.remarks.append(f"{text}: no latencies of that wizard")
    shown = {window.seq: window.shown for window in windows}
    foreign = {each.path: why for each in shadows if (why := _why_of_another(each, shown))}
    shadows = [each for each in shadows if each.path not in foreign]
    session.remarks += [f"{data.facts.session}: {why}" for why in foreign.values()]
    session.undone = sum(window.undone for window in windows)
    judges = _judges_by_name(shadows, live, named, session, data.facts.session)
    cues = {window.seq: window.at for window in windows}
    judged = {name: _shadow_decisions(shadow, scenario, cues) for name, shadow in judges.items()}
    for window in windows:
        if window.undone:
            continue
        decisions = {session.live: window.decision or Decision(NOTHING)}
        for name, found in judged.items():
            if (decision := found.get(window.seq)) is not None:
                decisions[name] = decision
        session.cues.append(JudgedCue(facts=data.facts, number=window.number, at=window.at, decisions=decisions))
    session.acts = _marked_acts(data, scenario, judges, named)
    return session


def wizards_of(data: SessionData) -> list[str]:
    """Return the names of all who ran, judged or marked a session."""
    marking = (_person(each.source) for each in data.records if isinstance(each, MistakeRecord))
    judging = (each.header.wizard for each in read_shadows(data.folder)[0])
    return list(dict.fromkeys([*_live_names(data), *judging, *marking]))


def _scenario_of(folder: Path) -> Scenario | None:
    try:
        return load_session_scenario(folder, read_info(folder), [])
    except SessionError:
        return None


# --- who ran it -------------------------------------------------------------------------------------------------------


def _person(source: str) -> str:
    return source.partition(":")[2].partition("#")[0]


def _live_names(data: SessionData) -> list[str]:
    """Return the wizards who requested anything, in order; if there are none, those who had control."""
    acted = dict.fromkeys(
        _person(each.source)
        for each in data.records
        if isinstance(each, TaskRecord) and actor_of(each.source) == "wizard" and each.function not in NO_ANSWERS
    )
    held = dict.fromkeys(
        _person(each.holder)
        for each in data.records
        if isinstance(each, ControlRecord) and each.holder and each.holder.startswith("wizard:")
    )
    return list(acted or held) or ["wizard"]


def _windows(data: SessionData, scenario: Scenario | None) -> list[_Window]:
    keys = {key.task: key.at for key in data.keys}
    early = {act.cue: act.origin for act in data.acts if act.before_cue}
    asked: dict[int, TaskRecord] = {}
    windows: list[_Window] = []
    for record in data.records:
        if isinstance(record, CueRecord) and record.status == "marked":
            window = _Window(record.seq, record.at, len(windows) + 1, record.t)
            if (before := asked.get(early.get(window.number) or 0)) is not None and _decides(before, scenario):
                label = decision_label(scenario, before.function, before.behavior)
                window.decision = Decision(label, why="before the cue")
            windows.append(window)
        elif isinstance(record, CueRecord) and record.status == "undone" and windows:
            windows[-1].undone = True
        elif isinstance(record, TaskRecord) and record.id not in asked:
            asked[record.id] = record
            if windows and windows[-1].decision is None and _decides(record, scenario):
                pressed = keys.get(record.id, record.t)
                if pressed >= windows[-1].at:
                    label = decision_label(scenario, record.function, record.behavior)
                    latency = round(pressed - windows[-1].at, 6)
                    kind = interruption_between(data.interruptions, windows[-1].at, pressed)
                    why = _WHY_INTERRUPTED[kind] if kind else _why_speed(data.facts.speed)
                    windows[-1].decision = Decision(label, None if why else latency, why)
    return windows


def _why_speed(speed: float) -> str:
    return "" if speed == 1 else "another speed"


def _decides(record: TaskRecord, scenario: Scenario | None) -> bool:
    if actor_of(record.source) != "wizard" or record.function in NO_ANSWERS:
        return False
    if record.function != ACT or scenario is None:
        return True
    settings = scenario.settings_of(record.behavior)
    return settings.answers and not settings.filler


# --- who judged it ----------------------------------------------------------------------------------------------------


def _why_of_another(shadow: Shadow, shown: Mapping[int, float]) -> str:
    """Return why a shadow belongs to another session: it was shown another cue. Empty: it does not.

    :param shown: the session time of each cue's record, by its `seq`.
    """
    for line in shadow.lines:
        if isinstance(line, ShadowCue) and abs(shown.get(line.cue, -1.0) - line.t) > _ROUNDED:
            has = f"has it at {shown[line.cue]:.3f} s" if line.cue in shown else "has no such cue"
            return (
                f"{SHADOW_FOLDER}/{shadow.path.name} shows cue {line.cue} at {line.t:.3f} s, and the journal {has}: it "
                "is of another session, and left out"
            )
    return ""


def _judges_by_name(
    shadows: list[Shadow], live: list[str], names: Mapping[str, str], session: JudgedSession, name: str
) -> dict[str, Shadow]:
    """Return the judges by name. Of a wizard's several shadows, the last complete one counts; otherwise the last."""
    found: dict[str, Shadow] = {}
    for shadow in shadows:
        judge = names.get(shadow.header.wizard, shadow.header.wizard)
        if shadow.header.wizard in live:
            judge = f"{judge} (again)"
        if judge in found:
            session.remarks.append(f"{judge} judged {name} more than once; the last complete time counts")
        if judge not in found or shadow.complete or not found[judge].complete:
            found[judge] = shadow
    for judge, shadow in found.items():
        if not shadow.complete:
            session.remarks.append(f"{judge} did not see {name} to its end; later cues are missing, not unanswered")
        if shadow.header.speed != 1:
            session.remarks.append(f"{judge} judged {name} at {shadow.header.speed:g} times its speed: no latencies")
    return found


def _shadow_decisions(shadow: Shadow, scenario: Scenario | None, cues: Mapping[int, float]) -> dict[int, Decision]:
    """Return the decisions by the `seq` of each cue that was answered or shown to its end.

    :param cues: when each cue was marked, by its `seq`.
    """
    decisions: dict[int, Decision] = {}
    cue: ShadowCue | None = None
    paused = False
    for line in shadow.lines:
        match line:
            case ShadowCue():
                if cue is not None and line.cue != cue.cue:
                    decisions.setdefault(cue.cue, Decision(NOTHING))
                decisions.pop(line.cue, None)  # the cue was shown again, so earlier keys no longer count
                cue, paused = line, False
            case ShadowPause():
                paused = True
            case ShadowKey() if line.answers and cue is not None and line.cue == cue.cue:
                why = "paused" if paused else _why_speed(shadow.header.speed)
                latency = None if why else round(line.t - cues.get(cue.cue, cue.t), 6)
                label = decision_label(scenario, line.function, line.behavior)
                decisions.setdefault(cue.cue, Decision(label, latency, why))
            case ShadowEnd() if cue is not None:
                decisions.setdefault(cue.cue, Decision(NOTHING))
    return decisions


# --- mistakes ---------------------------------------------------------------------------------------------------------


def _marked_acts(
    data: SessionData, scenario: Scenario | None, judges: Mapping[str, Shadow], names: Mapping[str, str]
) -> list[MarkedAct]:
    """Return the wizard's keys that led to acts, and all other marked requests, with all wizards' marks."""
    coders: dict[str, dict[int, Mark]] = {}
    for record in data.records:
        if isinstance(record, MistakeRecord):
            person = _person(record.source)
            coders.setdefault(names.get(person, person), {})[record.task] = record.mark
    until: dict[str, float] = {}
    for judge, shadow in judges.items():
        marks = {line.task: line.mark for line in shadow.lines if isinstance(line, ShadowMark)}
        if marks:
            coders[judge] = marks
            until[judge] = (
                float("inf")
                if shadow.complete
                else max(line.t for line in shadow.lines if not isinstance(line, ShadowHeader))
            )
    if not coders:
        return []
    of_acts = {key.act: key.task for key in reversed(data.keys) if key.act is not None}
    coders = {coder: {of_acts.get(task, task): mark for task, mark in marks.items()} for coder, marks in coders.items()}
    marked = {task for marks in coders.values() for task in marks}
    acts = {key.task for key in data.keys if key.act is not None and key.function not in NO_ANSWERS}
    requests: dict[int, TaskRecord] = {}
    for each in data.records:
        if isinstance(each, TaskRecord) and (each.id in acts or each.id in marked):
            requests.setdefault(each.id, each)
    return [
        MarkedAct(
            facts=data.facts,
            task=task,
            act=decision_label(scenario, requests[task].function, requests[task].behavior),
            marks={
                coder: marks.get(task, "none")
                for coder, marks in coders.items()
                if requests[task].t <= until.get(coder, float("inf"))
            },
        )
        for task in sorted(requests)
    ]
