"""The spans of a session to show beside a video: the robot's actions, requests, cues, rules.

The robot's actions begin when it confirms them, not when they are requested. The queue and fillers, which are not
answers, have their own tiers. Changes of memory, checks and control are only in the tables.
"""

from __future__ import annotations

from collections.abc import Iterator

from rise_engine.kernel.records import ENGINE
from rise_engine.kernel.speech import SAY
from rise_engine.results.analysis.course import PARTLY_WITH, interruption_between, seconds_without_engine
from rise_engine.results.analysis.model import ActPart, Cue, Phase, PlayedAct, Point, SessionData
from rise_engine.results.export.media_clock import ROBOT_SPEECH, TierActor, TierSpan
from rise_engine.scenario.model import CUE_TOPICS

ROBOT_TIERS = (ROBOT_SPEECH, "robot gaze", "robot face", "robot body", "robot arms")
"""Tiers by channel, in their order. Channels of a particular robot follow them."""
ROBOT_OTHER = ("robot other", "robot wait")
WAIT = "Wait"
"""The action for a pause (core_actions.toml)."""
ACT_TIERS = ("wizard acts", "rule acts", "program acts", "engine acts")
FILLERS = "fillers"
QUEUE = "queue"
RULE = "rule "
"""The start of the name of a rule's tier."""
REJECTED = "rejected"
CUE = "cue"
CUE_UNDONE = "cue taken back"
ROBOT_LINK = "robot link"
STOPPED = "stopped"
MOMENTS: dict[str, tuple[str, TierActor]] = {
    "event": ("event", "session"),
    "note": ("note", "wizard"),
    "mistake": ("mistake", "wizard"),
    "fault": ("fault", "session"),
    "sync": ("sync", "session"),
    "recovery": ("recovery", "session"),
    "scenario": ("scenario", "session"),
}
"""The tier of each kind of point, and who acts in it."""
_ENDINGS = {
    "failed": "failed",
    "canceled": "canceled",
    "timed-out": "no end in time",
    "lost": "lost",
    "started": "not ended",
    "accepted": "not ended",
    "ABORTED": "aborted",
    "CANCELED": "canceled",
    "REJECTED": "rejected",
    "PENDING": "not ended",
    "ACTIVE": "not ended",
}
"""Suffixes of texts for everything that did not succeed."""


def spans_of(data: SessionData) -> list[TierSpan]:
    """Return all spans of a session in the order of the tiers."""
    spans = [*_robot_spans(data), *_act_spans(data), *_cue_spans(data), *_rule_spans(data), *_moments(data)]
    order = _tier_order(spans)
    return sorted(spans, key=lambda span: (order[span.tier], span.start))


def _tier_order(spans: list[TierSpan]) -> dict[str, int]:
    channels = sorted({span.tier for span in spans if span.actor == "robot"} - {*ROBOT_TIERS, *ROBOT_OTHER})
    rules = [span.tier for span in spans if span.tier.startswith(RULE)]
    asked = (*ACT_TIERS, FILLERS, QUEUE, REJECTED, CUE)
    last = (STOPPED, ROBOT_LINK, *(tier for tier, _ in MOMENTS.values()))
    names = dict.fromkeys([*ROBOT_TIERS, *channels, *ROBOT_OTHER, *asked, *rules, *last])
    return {name: place for place, name in enumerate(names)}


# --- the robot --------------------------------------------------------------------------------------------------------


def _robot_spans(data: SessionData) -> Iterator[TierSpan]:
    for act in data.acts:
        for part in act.parts:
            begun = part.started_at if _is_pause(part) else part.accepted_at
            if begun is None:
                continue
            for tier in _tiers_of(part):
                yield TierSpan(
                    tier=tier,
                    start=begun,
                    end=part.ended_at if part.ended_at is not None else data.facts.duration,
                    text=_with_ending(_words_of(part, tier), part.status),
                    code=tier,
                    actor="robot",
                )


def _tiers_of(part: ActPart) -> list[str]:
    if part.channels:
        return [f"robot {channel}" for channel in part.channels]
    return ["robot wait" if _is_pause(part) else "robot other"]


def _is_pause(part: ActPart) -> bool:
    """Whether it is a pause, which the robot does not confirm."""
    return part.type == WAIT and not part.channels


def _words_of(part: ActPart, tier: str) -> str:
    if not part.text:
        return part.type
    return part.text if tier == ROBOT_SPEECH else f"{part.type}: {part.text}"


def _with_ending(text: str, status: str) -> str:
    ending = _ENDINGS.get(status)
    return f"{text} ({ending})" if ending else text


# --- acts and cues ----------------------------------------------------------------------------------------------------


def _act_spans(data: SessionData) -> Iterator[TierSpan]:
    duration = data.facts.duration
    for act in data.acts:
        name, ended = _name_of(act), act.ended_at if act.ended_at is not None else duration
        if act.status == "REJECTED":
            text = f"{name}: {act.reason}" if act.reason else name
            yield _act_span(act, REJECTED, act.accepted_at, None, text)
            continue
        begun = act.started_at
        if (begun if begun is not None else ended) > act.accepted_at:
            waited = name if begun is not None else _with_ending(name, act.status)
            yield _act_span(act, QUEUE, act.accepted_at, begun if begun is not None else ended, waited)
        if begun is not None:
            tier = FILLERS if act.filler else f"{act.actor} acts"
            shown = act.robot_at if act.robot_at is not None else begun
            yield _act_span(act, tier, shown, ended, _with_ending(name, act.status))


def _act_span(act: PlayedAct, tier: str, start: float, end: float | None, text: str) -> TierSpan:
    actor: TierActor = "wizard" if act.actor == "wizard" else "session"
    code = tier if tier in (QUEUE, REJECTED) else act.act
    return TierSpan(tier=tier, start=start, end=end, text=text, code=code, actor=actor, asked_by=act.actor)


def _name_of(act: PlayedAct) -> str:
    if act.act != SAY:
        return act.act
    words = next((part.text for part in act.parts if part.text), "")
    return f"{SAY}: {words}" if words else SAY


def _cue_spans(data: SessionData) -> Iterator[TierSpan]:
    for cue in data.cues:
        end, text = _answer_of(cue, data)
        label = f"{text} ({cue.text})" if cue.text else text
        code = CUE if cue.undone_at is None else CUE_UNDONE
        yield TierSpan(tier=CUE, start=cue.at, end=end, text=label, code=code, actor="participant")


def _answer_of(cue: Cue, data: SessionData) -> tuple[float | None, str]:
    if cue.undone_at is not None:
        return cue.undone_at, "taken back"
    if cue.answered_at is not None:
        away = seconds_without_engine(data.outages, cue.at, cue.answered_at)
        without = f", and {away:.2f} s without an engine" if away else ""
        if (kind := interruption_between(data.interruptions, cue.at, cue.answered_at)) in PARTLY_WITH:
            without = f", partly with {PARTLY_WITH[kind]}"
        return cue.answered_at, f"waits {cue.answered_at - cue.at:.2f} s{without}"
    return None, "answer not heard" if cue.state == "unheard" else "no answer"


# --- rules ------------------------------------------------------------------------------------------------------------


def _rule_spans(data: SessionData) -> Iterator[TierSpan]:
    """Give the states of rules. A state without duration is joined with the next one: `Start → Welcome`."""
    passed: dict[str, list[Phase]] = {}
    last: dict[str, TierSpan] = {}
    for phase in data.phases:
        run = passed.setdefault(phase.rule, [])
        if _lasts(phase):
            if phase.rule in last:
                yield last.pop(phase.rule)
            last[phase.rule] = _rule_span(phase, [*run, phase])
            run.clear()
        else:
            run.append(phase)
        if phase.ended_by:
            if run and phase.rule in last:  # it ended in a state without duration
                last[phase.rule] = _lengthened(last[phase.rule], run)
            elif run:
                last[phase.rule] = _rule_span(phase, run)
            run.clear()
            if phase.rule in last:
                yield last.pop(phase.rule)
    yield from last.values()
    yield from (_rule_span(run[-1], run) for run in passed.values() if run)


def _lasts(phase: Phase) -> bool:
    return round(phase.end * 1000) > round(phase.start * 1000)


def _rule_span(phase: Phase, run: list[Phase]) -> TierSpan:
    return TierSpan(
        tier=f"{RULE}{phase.rule}",
        start=run[0].start,
        end=phase.end,
        text=" → ".join(_state_text(each) for each in run),
        code=f"{phase.rule}: {phase.state}",
        actor="session",
    )


def _lengthened(span: TierSpan, run: list[Phase]) -> TierSpan:
    text = " → ".join([span.text, *(_state_text(each) for each in run)])
    return TierSpan(tier=span.tier, start=span.start, end=span.end, text=text, code=span.code, actor=span.actor)


def _state_text(phase: Phase) -> str:
    notes = [
        word for word in ("stepped back" if phase.stepped_back else "", phase.ended_by) if word and word != "ended"
    ]
    return f"{phase.state} ({', '.join(notes)})" if notes else phase.state


# --- moments ----------------------------------------------------------------------------------------------------------


def _moments(data: SessionData) -> Iterator[TierSpan]:
    shown = {act.task for act in data.acts}
    yield from _while(data, "stop", frozenset({"released"}), STOPPED, "wizard")
    yield from _while(data, "robot", frozenset({"connected"}), ROBOT_LINK, "session")
    for point in data.points:
        if point.kind not in MOMENTS or _is_inner(point) or (point.kind == "fault" and point.task in shown):
            continue
        tier, actor = MOMENTS[point.kind]
        code = point.name if point.kind == "event" and point.name else tier
        yield TierSpan(tier=tier, start=point.at, end=None, text=_text_of(point), code=code, actor=actor)


def _is_inner(point: Point) -> bool:
    """Whether an event is shown elsewhere: the tiers of rules show its cause, and cues have their own tier."""
    inner = point.source == ENGINE or point.source.startswith("rule:")
    return point.kind == "event" and (inner or point.name.lstrip("/") in CUE_TOPICS)


def _while(data: SessionData, kind: str, over: frozenset[str], tier: str, actor: TierActor) -> Iterator[TierSpan]:
    """Give spans from each point of a kind until the point that ends it, or until the next one."""
    since: Point | None = None
    for point in (each for each in data.points if each.kind == kind):
        if since is not None and (point.name in over or tier != STOPPED):
            yield _lasting(since, point.at, tier, actor)
            since = None
        if point.name not in over and since is None:
            since = point
    if since is not None:
        yield _lasting(since, data.facts.duration, tier, actor)


def _lasting(since: Point, end: float, tier: str, actor: TierActor) -> TierSpan:
    text = STOPPED if tier == STOPPED else _text_of(since)
    return TierSpan(tier=tier, start=since.at, end=end, text=text, code=tier, actor=actor)


def _text_of(point: Point) -> str:
    match point.kind:
        case "note":
            return point.value or point.name
        case "event":
            return f"{point.name} → {point.value}" if point.value else point.name
        case "sync":
            return f"sync {point.name} ({point.value})"
        case _:
            return ": ".join(each for each in (point.name, point.value) if each) or point.kind
