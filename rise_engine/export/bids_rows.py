"""The rows of a BIDS export: events, acts and sessions, as texts of a table of BIDS."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any

from rise_engine.analysis.model import PlayedAct, SessionData
from rise_engine.analysis.outages import seconds_without_engine
from rise_engine.export.bids_columns import ACT_COLUMNS, EVENT_COLUMNS, SESSION_COLUMNS

NOTHING = "n/a"
"""What stands in an empty cell."""
_BLANKS = re.compile(r"[\s\x00-\x1f\x7f-\x9f\u2028\u2029]+")

Row = Mapping[str, Any]


def table_text(columns: Sequence[str], rows: Iterable[Row]) -> str:
    """A table of BIDS: tabs between the cells, one line a row, `n/a` for nothing."""
    lines = ["\t".join(columns)]
    lines += ["\t".join(cell(row.get(column)) for column in columns) for row in rows]
    return "\n".join(lines) + "\n"


def cell(value: Any) -> str:
    """A value as a cell has it: seconds to the microsecond, tabs and line ends as blanks.

    >>> cell(1.50), cell(None), cell(True), cell("two\\tlines\\nof text ")
    ('1.5', 'n/a', 'true', 'two lines of text')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.6f}".rstrip("0").rstrip(".")
    return _BLANKS.sub(" ", "" if value is None else str(value)).strip() or NOTHING


def event_rows(data: SessionData) -> list[Row]:
    """Everything of a session that has a time, by its onset."""
    rows = [row for act in data.acts for row in _rows_of_act(act)]
    for cue in data.cues:
        end = cue.answered_at if cue.answered_at is not None else cue.undone_at
        rows.append(
            {
                "onset": cue.at,
                "duration": None if end is None else max(0.0, end - cue.at),
                "trial_type": "cue",
                "actor": cue.source,
                "value": cue.text,
                "status": "undone" if cue.undone_at is not None else "answered" if end is not None else "",
                "task_id": cue.task,
            }
        )
    for phase in data.phases:
        rows.append(
            {
                "onset": phase.start,
                "duration": max(0.0, phase.end - phase.start),
                "trial_type": "rule_state",
                "actor": f"rule:{phase.rule}",
                "name": f"{phase.rule}.{phase.state}",
                "value": phase.trigger,
                "status": phase.ended_by,
            }
        )
    for point in data.points:
        rows.append(
            {
                "onset": point.at,
                "duration": 0.0,
                "trial_type": point.kind,
                "actor": point.source,
                "name": point.name,
                "value": point.value,
                "task_id": point.task,
            }
        )
    kinds = list(EVENT_COLUMNS["trial_type"]["Levels"])
    rows.sort(key=lambda row: (row["onset"], kinds.index(row["trial_type"])))
    return [{**row, "outage_s": _outage(data, row), "condition": data.facts.condition} for row in rows]


def _outage(data: SessionData, row: Row) -> float | None:
    onset = row["onset"]
    if row["trial_type"] == "recovery":
        return next((each.seconds for each in data.outages if each.at == onset), None)
    return seconds_without_engine(data.outages, onset, onset + (row["duration"] or 0.0))


def act_rows(data: SessionData) -> list[Row]:
    """A row for each act, for `_beh.tsv`."""
    return [
        {
            "task_id": act.task,
            "act": act.act,
            "actor": act.by,
            "actor_kind": act.actor,
            "via": " > ".join(act.via),
            "status": act.status,
            "filler": act.filler,
            "before_cue": act.before_cue,
            **{name: getattr(act, name) for name in ACT_COLUMNS if name.endswith(("_at", "_s"))},
            "response_time": None if act.filler else act.response_s,
            "mark": act.mark,
            "condition": data.facts.condition,
        }
        for act in data.acts
    ]


def session_row(data: SessionData, filename: str) -> Row:
    """The row of a session in `_scans.tsv`."""
    facts = data.facts
    known = {name: getattr(facts, name) for name in SESSION_COLUMNS if hasattr(facts, name)}
    return {
        **{f"factor_{name}": level for name, level in facts.factors.items()},
        **known,
        "filename": filename,
        "acq_time": _local_time(facts.started),
        "session_duration": facts.duration,
        "run": facts.run or None,
        "attempt": facts.attempt or None,
    }


def _rows_of_act(act: PlayedAct) -> list[Row]:
    begun = act.robot_at if act.robot_at is not None else act.started_at
    onset = begun if begun is not None else act.accepted_at
    end = act.ended_at if begun is not None else onset
    rows: list[Row] = [
        {
            "onset": onset,
            "duration": None if end is None else max(0.0, end - onset),
            "trial_type": "robot_act",
            "response_time": act.answer_s,
            "actor": act.by,
            "name": act.act,
            "value": act.reason,
            "status": f"{act.status} filler" if act.filler else act.status,
            "task_id": act.task,
            "mark": act.mark,
        }
    ]
    for part in act.parts:
        if part.accepted_at is None:
            continue
        duration = None if part.ended_at is None else max(0.0, part.ended_at - part.accepted_at)
        rows.append(
            {
                "onset": part.accepted_at,
                "duration": duration,
                "trial_type": "robot_action",
                "actor": "robot",
                "name": part.type,
                "value": part.text,
                "channel": "+".join(part.channels),
                "status": part.status,
                "task_id": act.task,
            }
        )
    return rows


def _local_time(started: str) -> str:
    """As BIDS has it: without a zone. Empty where the level tells none."""
    try:
        return datetime.fromisoformat(started).replace(tzinfo=None).isoformat(timespec="milliseconds")
    except ValueError:
        return ""
