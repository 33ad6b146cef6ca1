"""The course of a session as lanes: who did what, from when to when. Drawn by `course`, and in a terminal as lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.results.analysis.model import ActorKind, Cue, Phase, PlayedAct, Point, SessionData
from rise_engine.results.report.document import clock_text, seconds_text

SpanKind: TypeAlias = Literal["cue", "unanswered", "act", "filler", "part", "state", "other-state"]
MarkKind: TypeAlias = Literal["note", "mistake", "stop", "sync", "fault"]
MAX_RULES = 8
"""So many rules have a lane; those with most phases come first."""
_CHANNELS = ("speech", "gaze", "face", "body", "arms")
_NO_NEWS = ("latched", "connected")
"""Of a stop, that it was carried out; of the robot, that it is there."""
_MARKS: dict[str, MarkKind] = {
    "note": "note",
    "mistake": "mistake",
    "stop": "stop",
    "sync": "sync",
    "fault": "fault",
    "robot": "fault",
    "recovery": "fault",
}


class LaneSpan(Struct, frozen=True):
    """Something that lasted."""

    start: float
    end: float
    label: str
    hover: str
    kind: SpanKind


class MomentMark(Struct, frozen=True):
    """Something at one moment."""

    at: float
    hover: str
    kind: MarkKind


class Lane(Struct, frozen=True):
    """What lies on one line of the course."""

    name: str
    spans: tuple[LaneSpan, ...] = ()
    marks: tuple[MomentMark, ...] = ()


def lanes_of(data: SessionData) -> list[Lane]:
    """Every lane in which something lies, from the participant down to the rules."""
    end = data.facts.duration
    lanes = [Lane("cues", tuple(_cue_span(cue, end) for cue in data.cues if cue.undone_at is None))]
    lanes += [Lane(f"robot {channel}", _parts_on(channel, data.acts, end)) for channel in _CHANNELS]
    lanes.append(Lane("robot, other", _parts_on("", data.acts, end)))
    actors: tuple[ActorKind, ...] = ("wizard", "rule", "program", "engine")
    lanes += [Lane(f"{actor} acts", _acts_of(actor, data.acts, end)) for actor in actors]
    lanes.append(Lane("marks", marks=tuple(_moments(data.points))))
    lanes += _rule_lanes(data.phases)
    return [lane for lane in lanes if lane.spans or lane.marks]


def left_out_rules(phases: Iterable[Phase]) -> list[str]:
    """The rules that have no lane of their own, because there are too many."""
    return _rules_by_size(phases)[MAX_RULES:]


def _cue_span(cue: Cue, end: float) -> LaneSpan:
    said = f", \u201c{cue.text}\u201d" if cue.text else ""
    if cue.answered_at is None:
        return LaneSpan(cue.at, cue.at, "", f"cue at {clock_text(cue.at)}{said}, not answered", "unanswered")
    waits = cue.answered_at - cue.at
    filled = f", filled after {seconds_text(cue.filled_at - cue.at)}" if cue.filled_at is not None else ""
    hover = f"cue at {clock_text(cue.at)}{said}, answered after {seconds_text(waits)}{filled}"
    return LaneSpan(cue.at, min(end, cue.answered_at), "", hover, "cue")


def _parts_on(channel: str, acts: Iterable[PlayedAct], end: float) -> tuple[LaneSpan, ...]:
    """The actions that take a channel; with an empty one, those that take none of the known ones."""
    spans = []
    for act in acts:
        for part in act.parts:
            fits = (
                channel in part.channels if channel else bool(part.channels) and not set(part.channels) & {*_CHANNELS}
            )
            if fits and part.accepted_at is not None:
                until = part.ended_at if part.ended_at is not None else end
                hover = f"{clock_text(part.accepted_at)} {part.type} in {act.act}: {part.text or part.status}"
                spans.append(LaneSpan(part.accepted_at, until, part.text, hover, "part"))
    return tuple(spans)


def _acts_of(actor: ActorKind, acts: Iterable[PlayedAct], end: float) -> tuple[LaneSpan, ...]:
    spans = []
    for act in acts:
        if act.actor == actor and act.started_at is not None:
            until = act.ended_at if act.ended_at is not None else end
            lasted = f"{clock_text(act.started_at)} {act.act}, {seconds_text(until - act.started_at)}"
            status = "" if act.status == "SUCCEEDED" else f", {act.status}"
            answered = f", answers after {seconds_text(act.response_s)}" if act.response_s is not None else ""
            filler = ", a filler" if act.filler else ""
            hover = f"{lasted}, by {act.source}{status}{filler}{answered * (not act.filler)}"
            spans.append(LaneSpan(act.started_at, until, act.act, hover, "filler" if act.filler else "act"))
    return tuple(spans)


def _moments(points: Iterable[Point]) -> Iterable[MomentMark]:
    for point in points:
        if (kind := _MARKS.get(point.kind)) is not None and point.name not in _NO_NEWS:
            told = " ".join(filter(None, (point.name, point.value)))
            yield MomentMark(point.at, f"{clock_text(point.at)} {point.kind}: {told}", kind)


def _rule_lanes(phases: Sequence[Phase]) -> list[Lane]:
    lanes = []
    for rule in _rules_by_size(phases)[:MAX_RULES]:
        kinds: tuple[SpanKind, SpanKind] = ("state", "other-state")
        spans: list[LaneSpan] = []
        for phase in phases:
            if phase.rule == rule and phase.end > phase.start:
                hover = (
                    f"{rule}: {phase.state}, {clock_text(phase.start)} to {clock_text(phase.end)}, by {phase.trigger}"
                )
                spans.append(LaneSpan(phase.start, phase.end, phase.state, hover, kinds[len(spans) % 2]))
        lanes.append(Lane(rule, tuple(spans)))
    return lanes


def _rules_by_size(phases: Iterable[Phase]) -> list[str]:
    counts: dict[str, int] = {}
    first: dict[str, float] = {}
    for phase in phases:
        if phase.end > phase.start:
            counts[phase.rule] = counts.get(phase.rule, 0) + 1
            first.setdefault(phase.rule, phase.start)
    most = sorted(counts, key=lambda rule: (-counts[rule], first[rule]))
    shown = sorted(most[:MAX_RULES], key=lambda rule: first[rule])
    return [*shown, *most[MAX_RULES:]]
