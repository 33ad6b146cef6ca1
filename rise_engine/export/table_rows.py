"""The rows of every table, of one session."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from heapq import merge
from typing import Any, TypeAlias

from rise_engine.analysis.causes import actor_of
from rise_engine.analysis.model import Cue, PlayedAct, SessionData, SessionFacts
from rise_engine.analysis.outages import seconds_without_engine
from rise_engine.analysis.statistics import share_over, summarise
from rise_engine.export.table_definitions import (
    ACTIONS,
    ACTS,
    CHECKS,
    CUES,
    EVENTS,
    PHASES,
    RECORDINGS,
    SESSIONS,
)
from rise_engine.kernel.records import ENGINE
from rise_engine.session.media import MediaFile

Row: TypeAlias = Mapping[str, Any]
LONG = 2.0
"""Seconds after which an answer is counted as late to come."""


def fact_values(facts: SessionFacts) -> dict[str, Any]:
    """What stands in every row of a session."""
    return {
        "session": facts.session,
        "participant": facts.participant,
        "run": facts.run or None,
        "condition": facts.condition,
        "mode": facts.mode,
        "purpose": facts.purpose,
        "outcome": facts.outcome,
        **{f"factor_{name}": level for name, level in facts.factors.items()},
    }


def response_of(act: PlayedAct) -> float | None:
    """From the cue to this act, if it is an answer; a filler is none."""
    return None if act.filler else act.response_s


def _session_rows(data: SessionData) -> Iterator[Row]:
    facts, repairs = data.facts, data.repairs
    responses = [each for act in data.acts if (each := act.answer_s) is not None]
    told = summarise(responses)
    kinds = Counter(point.kind for point in data.points)
    asked = [point for point in data.points if point.kind == "stop" and point.name == "requested"]
    stops = sum(point.source != ENGINE for point in asked)
    checks = Counter(check.result for check in data.checks)
    yield {
        "study": facts.study,
        "study_hash": facts.study_hash,
        "slot": facts.slot,
        "attempt": facts.attempt or None,
        "outcome_reason": facts.outcome_reason,
        "title": facts.title,
        "scenario_hash": facts.scenario_hash,
        "language": facts.language,
        "robot": facts.robot,
        "seed": facts.seed,
        "speed": float(facts.speed),
        "started": _started(facts.started),
        "program": facts.versions.get("rise-tui"),
        "duration_s": facts.duration,
        "ended": facts.ended,
        "recoveries": facts.recoveries,
        "downtime_s": facts.downtime,
        "acts": len(data.acts),
        "wizard_acts": sum(act.actor == "wizard" for act in data.acts),
        "rejected_acts": sum(act.status == "REJECTED" for act in data.acts),
        "failed_acts": sum(act.status == "ABORTED" for act in data.acts),
        "fillers": sum(act.filler for act in data.acts),
        "cues": len(data.cues),
        "cues_answered": sum(cue.task is not None for cue in data.cues),
        "cues_undone": repairs.cues_undone,
        "responses": len(responses),
        "response_median_s": told.median if told is not None else None,
        "response_iqr_s": told.iqr if told is not None else None,
        "responses_over_2s": share_over(responses, LONG).count,
        "before_cue": sum(act.before_cue and not act.filler for act in data.acts),
        "wizard_keys": len(data.keys),
        "mistakes": sum(point.kind == "mistake" for point in data.points),
        "stops": stops,
        "faults": kinds["fault"],
        "repairs": repairs.total,
        "acts_repeated": repairs.repeated,
        "steps_back": repairs.stepped_back,
        "acts_stopped": repairs.canceled,
        "stops_released": repairs.released,
        "checks_skipped": checks["skipped"],
        "checks_failed": checks["failed"],
        "notes": kinds["note"],
        "unreadable": len(data.problems),
    }


def _started(text: str) -> str:
    try:
        return datetime.fromisoformat(text).isoformat(timespec="milliseconds")
    except ValueError:
        return ""


def _act_rows(data: SessionData) -> Iterator[Row]:
    numbers = {cue.at: number for number, cue in enumerate(data.cues, 1)}
    for act in data.acts:
        yield {
            "task": act.task,
            "act": act.act,
            "source": act.source,
            "by": act.by,
            "via": " > ".join(act.via),
            "actor": act.actor,
            "status": act.status,
            "reason": act.reason,
            "filler": act.filler,
            "speaks": act.speaks,
            "text": spoken_words(act),
            "mark": act.mark,
            "cue": None if act.cue_at is None else numbers.get(act.cue_at),
            "cue_at": act.cue_at,
            "before_cue": None if act.cue_at is None else act.before_cue,
            "key_at": act.key_at,
            "accepted_at": act.accepted_at,
            "started_at": act.started_at,
            "robot_at": act.robot_at,
            "voice_at": act.voice_at,
            "ended_at": act.ended_at,
            "wizard_s": act.wizard_s,
            "way_s": act.way_s,
            "queue_s": act.queue_s,
            "robot_s": act.robot_s,
            "voice_s": act.voice_s,
            "response_s": response_of(act),
            "duration_s": _between(act.started_at, act.ended_at),
            **_wall_values(data, act.started_at, act.ended_at),
            "response_outage_s": seconds_without_engine(data.outages, act.cue_at, _answered_at(act)),
        }


def _answered_at(act: PlayedAct) -> float | None:
    return act.voice_at if act.speaks else act.robot_at


def _wall_values(data: SessionData, start: float | None, end: float | None) -> dict[str, float | None]:
    """Of what had no engine for a while: for how long, and how long it lasted by the wall clock."""
    away, lasted = seconds_without_engine(data.outages, start, end), _between(start, end)
    return {"outage_s": away, "wall_s": None if away is None or lasted is None else round(lasted + away, 6)}


def spoken_words(act: PlayedAct) -> str:
    """What an act says."""
    return " ".join(part.text for part in act.parts if "speech" in part.channels and part.text)


def _action_rows(data: SessionData) -> Iterator[Row]:
    for act in data.acts:
        for part in act.parts:
            yield {
                "task": act.task,
                "act": act.act,
                "action": part.action,
                "type": part.type,
                "channels": part.channels,
                "text": part.text,
                "parameters": part.parameters,
                "status": part.status,
                "started_at": part.started_at,
                "accepted_at": part.accepted_at,
                "ended_at": part.ended_at,
            }


def _cue_rows(data: SessionData) -> Iterator[Row]:
    early = {act.task for act in data.acts if act.before_cue}
    for number, cue in enumerate(data.cues, 1):
        yield {
            "cue": number,
            "at": cue.at,
            "source": cue.source,
            "text": cue.text,
            "state": _cue_state(cue),
            "filled_at": cue.filled_at,
            "answered_at": cue.answered_at,
            "undone_at": cue.undone_at,
            "task": cue.task,
            "before_cue": cue.task in early if cue.task is not None else None,
            "filled_s": _between(cue.at, cue.filled_at),
            "response_s": _between(cue.at, cue.answered_at),
            **_wall_values(data, cue.at, cue.answered_at),
        }


def _cue_state(cue: Cue) -> str:
    return "undone" if cue.undone_at is not None else "open" if cue.task is None else "answered"


def _phase_rows(data: SessionData) -> Iterator[Row]:
    for number, phase in enumerate(data.phases, 1):
        yield {
            "phase": number,
            "rule": phase.rule,
            "state": phase.state,
            "start": phase.start,
            "end": phase.end,
            "duration_s": _between(phase.start, phase.end),
            **_wall_values(data, phase.start, phase.end),
            "trigger": phase.trigger,
            "source": phase.source,
            "ended_by": phase.ended_by,
            "stepped_back": phase.stepped_back,
        }


def _event_rows(data: SessionData) -> Iterator[Row]:
    def row(
        onset: float, end: float | None, kind: str, name: str, value: str, source: str, task: int | None
    ) -> dict[str, Any]:
        return {
            "onset": onset,
            "duration": _between(onset, end) if end is not None else 0.0,
            **_wall_values(data, onset, end),
            "kind": kind,
            "name": name,
            "value": value,
            "source": source,
            "actor": actor_of(source) if source else None,
            "task": task,
        }

    def row_of_act(act: PlayedAct) -> dict[str, Any]:
        end = (act.ended_at if act.ended_at is not None else last) if act.started_at is not None else None
        return row(_began(act), end, "act", act.act, act.status, act.source, act.task)

    last = data.facts.duration
    rows = merge(  # a long session has hundreds of thousands: one is made at a time
        (row(each.start, each.end, "phase", each.rule, each.state, each.source, None) for each in data.phases),
        (row(each.at, None, "cue", "cue", each.text, each.source, each.task) for each in data.cues),
        (row_of_act(each) for each in sorted(data.acts, key=_began)),
        (
            row(each.at, None, each.kind, each.name, each.value, each.source, each.task)
            for each in sorted(data.points, key=lambda point: point.at)
        ),
        key=lambda row: row["onset"],
    )
    gaps = {each.at: each.seconds for each in data.outages}
    for number, each in enumerate(rows, 1):
        away = {"outage_s": gaps.get(each["onset"])} if each["kind"] == "recovery" else {}
        yield {"event": number, **each, **away}


def _began(act: PlayedAct) -> float:
    return act.started_at if act.started_at is not None else act.accepted_at


def _check_rows(data: SessionData) -> Iterator[Row]:
    for check in data.checks:
        yield {
            "check": check.id,
            "at": check.t,
            "text": check.text,
            "result": check.result,
            "value": check.value,
            "reason": check.reason,
            "source": check.source,
        }


def _recording_rows(data: SessionData) -> Iterator[Row]:
    rows: list[dict[str, Any]] = []
    files = list(data.media)
    for said in data.recordings:
        theirs = [each for each in files if each.name == said.name]
        files = [each for each in files if each.name != said.name]
        told = {"name": said.name, "status": said.status, "reason": said.reason, "path": said.path, "bytes": said.bytes}
        rows += [{**told, **_file_values(each)} for each in theirs] or [told]
    rows += [{"name": each.name, **_file_values(each)} for each in files]
    for number, row in enumerate(rows, 1):
        yield {"recording": number, **row}


def _file_values(file: MediaFile) -> dict[str, Any]:
    return {
        "kind": file.kind,
        "path": file.path,
        "bytes": file.bytes,
        "duration_s": file.duration,
        "offset_s": file.offset,
        "rate": file.rate if file.offset is not None else None,
        "aligned_by": file.aligned_by,
        "within_s": file.within,
    }


def _between(earlier: float | None, later: float | None) -> float | None:
    return None if earlier is None or later is None else round(later - earlier, 6)


ROWS: Mapping[str, Callable[[SessionData], Iterator[Row]]] = {
    SESSIONS.name: _session_rows,
    ACTS.name: _act_rows,
    ACTIONS.name: _action_rows,
    CUES.name: _cue_rows,
    PHASES.name: _phase_rows,
    EVENTS.name: _event_rows,
    CHECKS.name: _check_rows,
    RECORDINGS.name: _recording_rows,
}
"""By table, what makes its rows; facts of the session are added to each."""
