"""The facts of a session's report, counted from its data: acts, rules, mistakes, faults. No words, no drawings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise

from msgspec import Struct

from rise_engine.kernel.records import (
    ENGINE,
    ActionStatus,
    ControlRecord,
    FailureRecord,
    Mark,
    RobotRecord,
    RuleRecord,
    StopRecord,
)
from rise_engine.results.analysis.model import ActorKind, Interruption, Phase, PlayedAct, SessionData
from rise_engine.results.analysis.outages import interruption_between, seconds_without_engine
from rise_engine.results.analysis.statistics import Share, Summary, summarise
from rise_engine.results.report.latency import LatencyFacts, LatencyPart, answers, latencies

MARKS: tuple[Mark, ...] = ("wrong", "late", "early", "double")
FREE_SPEECH = "say"
_NOT_DONE: tuple[ActionStatus, ...] = ("failed", "timed-out", "lost")


class ActFacts(Struct, frozen=True):
    """All requests of one act."""

    name: str
    begun: int
    """How often its turn came."""
    by: dict[ActorKind, int]
    """How often each kind of actor caused it."""
    statuses: dict[str, int]
    """How the requested ones ended."""
    length: Summary | None
    """Seconds from its turn to its end, for those that succeeded and that nothing interrupted."""
    response: Summary | None
    """Seconds from a cue, for those that answered one."""
    marks: dict[str, int]
    """The mistakes that wizards marked on them."""
    fillers: int = 0


class StateFacts(Struct, frozen=True):
    """How often and how long a rule was in a state."""

    rule: str
    state: str
    visits: int
    seconds: float
    """The sum of all visits in session time."""
    each: Summary | None
    """The visits that nothing interrupted."""
    stepped_back: int = 0
    outage_s: float = 0.0
    """Seconds without an engine during the visits, in which session time stood still."""


class MistakeFacts(Struct, frozen=True):
    """Mistakes, as wizards marked them and as the record shows them."""

    marks: dict[str, int]
    """All marks by kind of mistake."""
    marked: Share
    """The share of wizards' keys that were marked, or whose acts were."""
    rejected: int
    """Acts that were requested and refused."""
    canceled: int
    """Acts that were stopped before their end."""
    actions_failed: dict[str, int]
    """Actions by kind of failure: failed, timed-out, lost."""
    aborted: int
    """Acts that failed."""
    failures: int
    """Failed acts that needed somebody's decision."""
    rules_faulted: int
    stops: int
    robot_lost: int
    robot_degraded: int
    """How often a connected robot went on to answer only in part."""
    control_changes: int
    """How often control passed from one person to another."""


class SessionFigures(Struct, frozen=True):
    """Everything that is counted in one session."""

    latency: LatencyFacts
    by_source: tuple[LatencyPart, ...]
    """Responses by actor, the most frequent first."""
    acts: tuple[ActFacts, ...]
    states: tuple[StateFacts, ...]
    mistakes: MistakeFacts
    actors: dict[ActorKind, int]
    """Acts whose turn came, by who caused them."""
    cues: int
    """The number of cues that were not undone."""
    answered: int
    said_freely: Share
    """The share of the robot's speech that a wizard typed."""


def session_figures(data: SessionData) -> SessionFigures:
    """Count everything in a session.

    :param data: one session at any level, because the counts do not depend on texts.
    """
    begun = [act for act in data.acts if act.started_at is not None]
    actors = Counter(act.actor for act in begun)
    cues = [cue for cue in data.cues if cue.undone_at is None]
    spoken = [act for act in begun if act.speaks]
    return SessionFigures(
        latency=latencies(data.acts, data.cues),
        by_source=_by_source(data.acts),
        acts=tuple(_act_facts(data.acts, data.interruptions)),
        states=tuple(_state_facts(data)),
        mistakes=_mistakes(data, begun),
        actors=dict(actors.most_common()),
        cues=len(cues),
        answered=sum(cue.answered_at is not None for cue in cues),
        said_freely=Share(sum(act.act == FREE_SPEECH for act in spoken), len(spoken)),
    )


def _by_source(acts: Iterable[PlayedAct]) -> tuple[LatencyPart, ...]:
    found: dict[str, list[float]] = {}
    for act in answers(acts):
        if act.response_s is not None:
            found.setdefault(act.by, []).append(act.response_s)
    named = sorted(found, key=lambda source: (-len(found[source]), source))
    return tuple(LatencyPart(source, "cue to answer", tuple(found[source])) for source in named)


def _act_facts(acts: Iterable[PlayedAct], interruptions: Sequence[Interruption]) -> Iterable[ActFacts]:
    by_name: dict[str, list[PlayedAct]] = {}
    for act in acts:
        by_name.setdefault(act.act, []).append(act)
    for name in sorted(by_name, key=lambda each: (-len(by_name[each]), each)):
        asked = by_name[name]
        begun = [act for act in asked if act.started_at is not None]
        lengths = [
            round(act.ended_at - act.started_at, 6)
            for act in begun
            if act.started_at is not None and act.ended_at is not None and act.status == "SUCCEEDED"
            if interruption_between(interruptions, act.started_at, act.ended_at) is None
        ]
        yield ActFacts(
            name=name,
            begun=len(begun),
            by=dict(Counter(act.actor for act in asked).most_common()),
            statuses=dict(Counter(act.status for act in asked).most_common()),
            length=summarise(lengths),
            response=summarise([act.response_s for act in answers(asked) if act.response_s is not None]),
            marks=dict(Counter(act.mark for act in asked if act.mark is not None)),
            fillers=sum(act.filler for act in begun),
        )


def _state_facts(data: SessionData) -> Iterable[StateFacts]:
    found: dict[tuple[str, str], list[Phase]] = {}
    for phase in data.phases:
        found.setdefault((phase.rule, phase.state), []).append(phase)
    rules = list(dict.fromkeys(rule for rule, _ in found))
    for (rule, state), visits in sorted(found.items(), key=lambda each: rules.index(each[0][0])):
        lengths = [round(phase.end - phase.start, 6) for phase in visits]
        away = [seconds_without_engine(data.outages, phase.start, phase.end) for phase in visits]
        cut = [interruption_between(data.interruptions, phase.start, phase.end) for phase in visits]
        whole = [length for length, kind in zip(lengths, cut, strict=True) if kind is None]
        back = sum(phase.stepped_back for phase in visits)
        outage = round(sum(each or 0.0 for each in away), 6)
        yield StateFacts(rule, state, len(visits), round(sum(lengths), 6), summarise(whole), back, outage)


_OF_MISTAKES = (ControlRecord, FailureRecord, RobotRecord, RuleRecord, StopRecord)


def _mistakes(data: SessionData, begun: list[PlayedAct]) -> MistakeFacts:
    marks = Counter(point.name for point in data.points if point.kind == "mistake")
    actions = Counter(part.status for act in data.acts for part in act.parts)
    told = [record for record in data.records if isinstance(record, _OF_MISTAKES)]  # one pass that keeps few records
    holders = [each.holder.partition("#")[0] for each in told if isinstance(each, ControlRecord) and each.holder]
    links = ["connected", *(record.status for record in told if isinstance(record, RobotRecord))]
    return MistakeFacts(
        marks={mark: marks[mark] for mark in MARKS if marks[mark]},
        marked=Share(sum(key.mark is not None for key in data.keys), len(data.keys)),
        rejected=sum(act.status == "REJECTED" for act in data.acts),
        canceled=sum(act.status == "CANCELED" for act in begun),
        actions_failed={name: actions[name] for name in _NOT_DONE if actions[name]},
        aborted=sum(act.status == "ABORTED" for act in begun),
        failures=sum(isinstance(record, FailureRecord) and record.status == "asked" for record in told),
        rules_faulted=sum(isinstance(record, RuleRecord) and record.status == "faulted" for record in told),
        # The engine's own stop at the end of a session does not count.
        stops=sum(
            isinstance(record, StopRecord) and record.status == "requested" and record.source != ENGINE
            for record in told
        ),
        robot_lost=sum(now == "lost" != before for before, now in pairwise(links)),
        robot_degraded=sum((before, now) == ("connected", "degraded") for before, now in pairwise(links)),
        control_changes=sum(now != before for before, now in pairwise(holders)),
    )
