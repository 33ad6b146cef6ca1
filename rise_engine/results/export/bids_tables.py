"""The tables of a BIDS export: the columns of each by their BIDS names, and the rows of events.

Acts and sessions have the columns of the other tables (`course_tables`, `session_tables`) under BIDS names.
https://bids-specification.readthedocs.io/en/v1.11.1/
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.results.analysis.course import seconds_without_engine, wall_seconds
from rise_engine.results.analysis.model import PlayedAct, SessionData, seconds_between
from rise_engine.results.export.course_tables import ACTS
from rise_engine.results.export.format import started_text
from rise_engine.results.export.session_tables import FACTS, SESSIONS
from rise_engine.results.export.table_schema import MARKS, Column, Row, TableSchema, Value, seconds
from rise_engine.results.export.trial_tables import TRIALS, declared_column

Columns: TypeAlias = Mapping[str, Column]
"""Columns by their BIDS names, in their order."""
NOTHING = "n/a"
"""The content of an empty cell."""
_FILE_ENTITIES = (
    "subject session sample task tracksys acquisition nucleus volume ceagent staining tracer reconstruction direction "
    "run proc modality echo flip inv mt part recording space chunk suffix scans fmap datatype extension"
)
ENTITIES = frozenset(_FILE_ENTITIES.split())
"""Entities in BIDS file names. No column may have such a name: pybids would take its description for a value."""
_EMPTY = re.compile(r"\b[Ee]mpty\b")
_BLANKS = re.compile(r"[\s\x00-\x1f\x7f-\x9f\u2028\u2029]+")
_TRIAL_TYPES = {
    "robot_act": "An act of the robot or free speech, from the confirmation of its first action to its end.",
    "robot_action": "One action of an act, from the robot's confirmation to its end.",
    "cue": "The participant's turn ended. The row lasts until the robot began to answer or the cue was taken back.",
    "rule_state": "A rule of the scenario was in a state.",
    "trial": "A trial. Only these rows have the columns of trials.",
    "event": "An event that rules can react to.",
    "memory": "A value of the scenario's memory changed.",
    "note": "A remark for the record.",
    "mistake": "A wizard marked something as a mistake.",
    "stop": "The robot was stopped, or released.",
    "sync": "A mark for recordings.",
    "control": "Control passed from one console to another.",
    "robot": "The link to the robot changed.",
    "fault": "Something went wrong.",
    "check": "A check before or after the session.",
    "coded": "An annotation by a person; name: its tier; value: the annotation.",
    "scenario": "The session went on with changed files of its scenario; value: what changed.",
    "recovery": "Another engine continued the session; outage_s says how long there was none.",
}
"""The kinds of rows in `_events.tsv`."""
_TRIAL_COLUMNS = (
    "trial robot_said asked_task asked_at asked_end cue_at participant_s speech_at speech_s key_at "
    "wizard_key wizard_asked wizard_s key_s "
    "robot_next_at prompts repairs events marks failures stops interrupted "
    "participant_interrupted wizard_interrupted participant_wall_s wizard_wall_s key_wall_s "
    "speech_interrupted speech_wall_s"
)


def sidecar(columns: Columns) -> dict[str, dict[str, Any]]:
    """Describe the columns of a table for the JSON file beside it."""
    return {name: _described(column) for name, column in columns.items()}


def _described(column: Column) -> dict[str, Any]:
    levels = dict(column.levels) or ({"true": "yes", "false": "no"} if column.type == "boolean" else {})
    found: dict[str, Any] = {"Description": _EMPTY.sub(NOTHING, column.about)}
    return found | ({"Units": column.unit} if column.unit else {}) | ({"Levels": levels} if levels else {})


def table_text(names: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Write a BIDS table: tabs between the cells, one line a row."""
    return "".join("\t".join(row) + "\n" for row in (names, *rows))


def cells(columns: Columns, row: Any) -> list[str]:
    """Return the cells of a row in a BIDS table."""
    return [cell(column.of(row)) for column in columns.values()]


def cell(value: Any) -> str:
    """Write a value as a cell: seconds to the microsecond, tabs and line ends as blanks.

    >>> cell(1.50), cell(None), cell(True), cell("two\\tlines\\nof text ")
    ('1.5', 'n/a', 'true', 'two lines of text')
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.6f}".rstrip("0").rstrip(".")
    return _BLANKS.sub(" ", "" if value is None else str(value)).strip() or NOTHING


def _picked(table: TableSchema, names: str) -> dict[str, Column]:
    """Pick columns of a table and facts by name. `task_id=task act` picks two and renames the first for BIDS."""
    columns = {column.name: column for column in (*FACTS, *table.columns)}
    renamed = {name: other or name for name, _, other in (each.partition("=") for each in names.split())}

    def described(about: str) -> str:
        for name, other in renamed.items():
            about = about.replace(f"`{other}`", f"`{name}`")
        return about

    return {name: replace(columns[other], about=described(columns[other].about)) for name, other in renamed.items()}


ACT_COLUMNS: Columns = _picked(
    ACTS,
    "task_id=task act actor=by actor_kind=actor via status filler before_cue cue_at key_at accepted_at started_at "
    "robot_at voice_at ended_at wizard_s way_s rules_s queue_s robot_s voice_s response_time=response_s "
    "response_outage=response_outage_s response_wall=response_wall_s response_interrupted wait_interrupted "
    "wizard_wall_s way_wall_s rules_wall_s queue_wall_s robot_wall_s voice_wall_s mark condition",
)
"""The columns of `_beh.tsv`: a row for each act, in the order of the requests."""


def _local_time(row: Row) -> str:
    """Return the local time without a zone, as in BIDS. Empty: the level hides times."""
    started = row.data.facts.started
    return started_text(started, lambda at: at.replace(tzinfo=None).isoformat(timespec="milliseconds"))


def session_columns(factors: Iterable[Column], *, dated: bool) -> Columns:
    """Return the columns of `_scans.tsv`: a row for each session of a participant, with the name of its events table.

    :param factors: the columns of the factors.
    :param dated: whether to include start times; BIDS allows no empty ones.
    """
    table = "The table of events of the session, in the participant's folder."
    began = "When the session began, in local time."
    return {
        "filename": Column("filename", table, lambda row: row.beside),
        **({"acq_time": Column("acq_time", began, _local_time)} if dated else {}),
        **_picked(SESSIONS, "rise_session=session condition"),
        **{column.name: column for column in factors},
        **_picked(
            SESSIONS,
            "rise_run=run attempt run_as purpose mode outcome robot driver injected_faults scenario_hash "
            "scenario_changed_to changed_keys speed session_duration=duration_s downtime=downtime_s",
        ),
    }


class _EventRow(Struct, kw_only=True, frozen=True):
    """A row of the events table."""

    onset: float
    end: float | None
    """The end; equal to the onset for an event without duration. None: it had not ended at the end of the record."""
    trial_type: str
    actor: str = ""
    name: str = ""
    value: str = ""
    status: str = ""
    task_id: int | None = None
    response_time: float | None = None
    channel: str = ""
    mark: str | None = None
    outage_s: float | None = None
    """For a recovery or a note of a suspend: the seconds without an engine before it."""


def _duration(row: Row) -> float | None:
    lasted = seconds_between(row.of.onset, row.of.end)
    return None if lasted is None else max(0.0, lasted)


def _outage(row: Row) -> float | None:
    of, outages = row.of, row.data.outages
    if of.outage_s is not None:
        return of.outage_s  # type: ignore[no-any-return]
    return seconds_without_engine(outages, of.onset, max(of.onset, of.end if of.end is not None else of.onset))


def _by_wall_clock(row: Row) -> float | None:
    away = _outage(row) if row.of.trial_type != "recovery" else None
    return wall_seconds(_duration(row), away, row.data.facts.speed)


EVENT_COLUMNS: Columns = {
    column.name: column
    for column in (
        seconds(
            "onset",
            "Seconds since the session began, on a monotonic clock. For robot_act and robot_action: when the robot "
            "confirmed it. The first sound or movement comes later. An act that the robot never confirmed has the "
            "time of its turn.",
        ),
        seconds(
            "duration",
            "Seconds; 0 for a moment, n/a for what was still running when the record ended.",
            _duration,
        ),
        Column("trial_type", "The kind of the row.", levels=_TRIAL_TYPES),
        seconds(
            "response_time",
            "Only for a robot_act that answered a cue, was requested after it, and whose wait nothing interrupted: "
            "seconds from the cue to the confirmation of its first action that uses the robot's voice or, if it does "
            "not speak, of its first action.",
        ),
        Column(
            "actor",
            "Who did it: wizard:NAME, rule:NAME, a program; coder:NAME for an annotation; for a robot_act, who caused "
            "it, directly or through any number of rules; for a robot_action: robot.",
        ),
        Column(
            "name",
            "The act, the type of the action, RULE.STATE, the event's topic, the memory key, the check, the trial.",
        ),
        Column("value", "What was said or written, as far as the export's level shows it."),
        Column(
            "channel",
            "For a robot_action: the parts of the robot that it uses (speech, gaze, face, body, arms), joined by +.",
        ),
        Column(
            "status",
            "How an act or an action ended; for a filler, `filler` follows. For cue: answered, unheard, undone or "
            "open. For coded: modifiers of BORIS.",
        ),
        Column("task_id", "The number of its task in the session's record."),
        Column("mark", "What a wizard marked as wrong about the act.", levels=MARKS),
        seconds(
            "outage_s",
            "Seconds of the wall clock without an engine, during the event or before a recovery. Session time stands "
            "still then: the duration does not include them.",
            _outage,
        ),
        seconds(
            "wall_s",
            "duration by the wall clock: divided by speed, and including outage_s; n/a: as in session time.",
            _by_wall_clock,
        ),
        *_picked(ACTS, "condition").values(),
    )
}
"""The columns of `_events.tsv`."""


def trial_columns(declared: Iterable[str]) -> Columns:
    """Return further columns of `_events.tsv` for rows that are trials.

    :param declared: the columns of trials that the scenarios declare.
    """
    columns = _picked(TRIALS, _TRIAL_COLUMNS) | {column.name: column for column in map(declared_column, declared)}
    return {
        (f"trial_{name}" if name in EVENT_COLUMNS or name in ENTITIES else name): replace(
            column, value=_trial_value(column)
        )
        for name, column in columns.items()
    }


def _trial_value(column: Column) -> Value:
    return lambda row: None if row.beside is None else column.of(row.beside)


def event_rows(data: SessionData) -> list[Row]:
    """Return every event of a session that has a time, sorted by onset."""
    kinds = {name: number for number, name in enumerate(_TRIAL_TYPES)}
    events: list[tuple[_EventRow, Row | None]] = [(event, None) for event in _events(data)]
    events += [(_event_of_trial(row), row) for row in TRIALS.rows(data)]
    events.sort(key=lambda each: (each[0].onset, kinds[each[0].trial_type]))
    return [Row(data, number, event, trial) for number, (event, trial) in enumerate(events, 1)]


def _event_of_trial(row: Row) -> _EventRow:
    trial = row.of
    return _EventRow(onset=trial.start, end=trial.end, trial_type="trial", name=str(row.number), status=trial.ended_by)


def _events(data: SessionData) -> Iterator[_EventRow]:
    for act in data.acts:
        yield from _events_of_act(act)
    for cue in data.cues:
        end = cue.answered_at if cue.answered_at is not None else cue.undone_at
        yield _EventRow(
            onset=cue.at,
            end=end,
            trial_type="cue",
            actor=cue.source,
            value=cue.text,
            status=cue.state,
            task_id=cue.task,
        )
    for phase in data.phases:
        yield _EventRow(
            onset=phase.start,
            end=phase.end,
            trial_type="rule_state",
            actor=f"rule:{phase.rule}",
            name=f"{phase.rule}.{phase.state}",
            value=phase.trigger,
            status=phase.ended_by,
        )
    for each in data.coded:
        yield _EventRow(
            onset=each.begin,
            end=each.end,
            trial_type="coded",
            actor=f"coder:{each.annotator}" if each.annotator else "",
            name=each.tier,
            value=each.value,
            status=each.modifiers,
        )
    acts, of_keys = {act.task for act in data.acts}, data.marked_acts()
    for point in data.points:
        of_key = point.kind == "mistake" and point.task is not None and point.task not in acts
        yield _EventRow(
            onset=point.at,
            end=point.at,
            trial_type=point.kind,
            actor=point.source,
            name=point.name,
            value=point.value,
            outage_s=point.outage_s,
            task_id=of_keys.get(point.task or 0) if of_key else point.task,
        )


def _events_of_act(act: PlayedAct) -> Iterator[_EventRow]:
    begun = act.robot_at if act.robot_at is not None else act.started_at
    onset = begun if begun is not None else act.accepted_at
    yield _EventRow(
        onset=onset,
        end=act.ended_at if begun is not None else onset,
        trial_type="robot_act",
        response_time=act.answer_s,
        actor=act.by,
        name=act.act,
        value=act.reason,
        status=f"{act.status} filler" if act.filler else act.status,
        task_id=act.task,
        mark=act.mark,
    )
    for part in act.parts:
        if part.accepted_at is not None:
            yield _EventRow(
                onset=part.accepted_at,
                end=part.ended_at,
                trial_type="robot_action",
                actor="robot",
                name=part.type,
                value=part.text,
                channel="+".join(part.channels),
                status=part.status,
                task_id=act.task,
            )
