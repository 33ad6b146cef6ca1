"""Tables of the events in sessions: acts and their actions, cues, phases of rules, and all of these as events."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from heapq import merge

from msgspec import Struct

from rise_engine.results.analysis.course import interruption_between, wall_seconds
from rise_engine.results.analysis.model import (
    WAIT_PARTS,
    InterruptionKind,
    PlayedAct,
    Point,
    SessionData,
    WaitPart,
    actor_of,
)
from rise_engine.results.export.session_tables import SESSION_REFERENCES, SOURCE
from rise_engine.results.export.table_schema import (
    ACTION_STATUS,
    ACTORS,
    CUE_STATES,
    EVENT_ACTORS,
    EVENT_KINDS,
    MARKS,
    PHASE_ENDS,
    STATUS,
    Column,
    Reference,
    Row,
    TableSchema,
    ends,
    interrupted,
    interruption,
    moment,
    numbering,
    outage_columns,
    rows_of,
    seconds,
    span,
    wall_column,
)


def _response_by_wall_clock(row: Row) -> float | None:
    act: PlayedAct = row.of
    return None if act.filler else wall_seconds(act.response_s, act.response_outage_s, row.data.facts.speed)


def _wait_interruption(row: Row) -> InterruptionKind | None:
    act: PlayedAct = row.of
    return interruption_between(row.data.interruptions, *act.wait_ends) if row.data.interruptions else None


def _ends_of_part(part: WaitPart, row: Row) -> tuple[float | None, float | None]:
    act: PlayedAct = row.of
    return act.ends_of(part)


ACTS = TableSchema(
    "acts",
    "One row is one requested act or free speech, even if it was refused or never had its turn.",
    (
        Column(
            "task",
            "The act's number in the session, from 1; the key together with session.",
            type="integer",
            required=True,
            minimum=1,
        ),
        Column("act", "The act's name; say: free speech.", required=True),
        SOURCE,
        Column("by", "Who caused it, directly or through any number of rules."),
        Column(
            "via",
            "The rules between `by` and the act in order, joined by ` > `.",
            lambda row: " > ".join(row.of.via),
        ),
        Column("actor", "The kind of source in `by`.", levels=ACTORS),
        Column("status", "How it ended.", levels=STATUS, required=True),
        Column("reason", "Why it did not succeed, or what it repeats."),
        Column(
            "filler",
            "Whether it bridged the time after a cue. It is then not an answer.",
            type="boolean",
            required=True,
        ),
        Column("speaks", "Whether one of its actions uses the robot's voice.", type="boolean", required=True),
        Column("text", "What it says: its speech actions joined by a blank.", lambda row: row.of.words),
        Column(
            "mark", "What a wizard marked as wrong about it or the key that caused it; empty: nothing.", levels=MARKS
        ),
        Column(
            "cue",
            "The number in cues.csv of the cue that it answers or bridges; empty: none.",
            type="integer",
            minimum=1,
        ),
        moment("cue_at", "that cue was marked (`at` in cues.csv)."),
        Column(
            "before_cue",
            "Whether it was requested before that cue; empty: it has no cue.",
            lambda row: None if row.of.cue_at is None else row.of.before_cue,
            "boolean",
        ),
        moment("key_at", "the key that caused it was pressed, by the console's clock; empty: no key, or not known."),
        moment("accepted_at", "the engine accepted it.", required=True),
        moment("started_at", "its turn came."),
        moment("robot_at", "the robot confirmed its first action. The first sound comes later."),
        moment("voice_at", "the robot confirmed its first action that uses the voice. The first sound comes later."),
        moment("ended_at", "it ended."),
        seconds(
            "wizard_s",
            "From the cue to the key: the wizard's share. Empty: no cue, no key, or requested before the cue.",
        ),
        seconds("way_s", "From the key to the engine, which takes its request. Empty: no key, or before_cue."),
        seconds(
            "rules_s",
            "From there (without a key: from the cue) until the act is requested: what rules do and wait for before, "
            "the keeping of an event, or attempts that failed. 0: the key requests it. Empty: before_cue, or neither "
            "key nor cue.",
        ),
        seconds("queue_s", "Time in the queue; if before_cue, from the cue on."),
        seconds("robot_s", "From its turn until the robot's confirmation."),
        seconds("voice_s", "From the first confirmed action to the first one that uses the voice."),
        seconds(
            "response_s",
            "From the cue to the answer: to voice_at if it speaks, otherwise to robot_at. It is the sum of wizard_s, "
            "way_s, rules_s, queue_s, robot_s and, if it speaks, voice_s. Empty: it is a filler, or no answer.",
            lambda row: None if row.of.filler else row.of.response_s,
        ),
        seconds("duration_s", "From started_at to ended_at.", span("started_at", "ended_at")),
        *outage_columns("duration_s", "started_at", "ended_at"),
        interrupted("response_interrupted", "the time from the cue to the answer"),
        seconds("response_outage_s", "Seconds without an engine between the cue and the answer; empty: none."),
        seconds(
            "response_wall_s",
            "response_s by the wall clock, as wall_s; empty: as in session time.",
            _response_by_wall_clock,
        ),
        interrupted("wait_interrupted", "the parts from wizard_s to voice_s", _wait_interruption),
        *(wall_column(part, partial(_ends_of_part, part)) for part in WAIT_PARTS),
    ),
    ("session", "task"),
    rows_of("acts"),
    SESSION_REFERENCES,
)


def _action_rows(data: SessionData) -> Iterator[Row]:
    for act in data.acts:
        for number, part in enumerate(act.parts, 1):
            yield Row(data, number, part, act)


ACTIONS = TableSchema(
    "actions",
    "One row is one action of an act, as the robot performed it.",
    (
        Column(
            "task",
            "The number in acts.csv of the act that it is part of.",
            lambda row: row.beside.task,
            "integer",
            required=True,
            minimum=1,
        ),
        Column("act", "The act's name.", lambda row: row.beside.act),
        Column("action", "Its actionID within the act.", required=True),
        Column("type", "The kind of action: Speech, LookAt, ...", required=True),
        Column(
            "channels",
            "The parts of the robot that it uses, separated by blanks; empty: it only waits, or not known.",
        ),
        Column("text", "What it says, or its main parameter."),
        Column("parameters", "All of its parameters, as JSON.", type="object"),
        Column("status", "How it ended.", levels=ACTION_STATUS, required=True),
        moment("started_at", "it was sent to the robot, or began to wait; empty: never."),
        moment("accepted_at", "the robot confirmed it. Waiting is never confirmed."),
        moment("ended_at", "it ended."),
    ),
    ("session", "task", "action"),
    _action_rows,
    (*SESSION_REFERENCES, Reference(("session", "task"), "acts")),
)


def _cue_rows(data: SessionData) -> Iterator[Row]:
    early = {act.task for act in data.acts if act.before_cue}
    for number, cue in enumerate(data.cues, 1):
        yield Row(data, number, cue, cue.task in early if cue.task is not None else None)


CUES = TableSchema(
    "cues",
    "One row is one cue: somebody marked the end of the participant's turn.",
    (
        numbering("cue"),
        moment(
            "at", "its key was pressed, by the console's clock; without a key, when the engine took it.", required=True
        ),
        SOURCE,
        Column("text", "What the wizard said about it."),
        Column("state", "What became of the cue.", levels=CUE_STATES, required=True),
        moment("filled_at", "the robot confirmed the first filler."),
        moment("answered_at", "the robot began to answer, with its voice if the answer speaks."),
        moment("undone_at", "it was taken back."),
        Column("task", "The number in acts.csv of the act that answered.", type="integer", minimum=1),
        Column(
            "before_cue",
            "Whether the answer was requested before the cue; empty: no answer.",
            lambda row: row.beside,
            "boolean",
        ),
        seconds("filled_s", "From the cue to the filler.", span("at", "filled_at")),
        seconds("response_s", "From the cue to the answer.", span("at", "answered_at")),
        *outage_columns("response_s", "at", "answered_at"),
        interrupted("filled_interrupted", "filled_s", interruption("at", "filled_at")),
        wall_column("filled_s", ends("at", "filled_at")),
    ),
    ("session", "cue"),
    _cue_rows,
    SESSION_REFERENCES,
)
PHASES = TableSchema(
    "phases",
    "One row is one stay of a rule in a state, even if it took 0 s.",
    (
        numbering("phase"),
        Column("rule", "The rule.", required=True),
        Column("state", "The state.", required=True),
        moment("start", "the state was entered.", required=True),
        moment("end", "the state was left, or the record ended.", required=True),
        seconds("duration_s", "From start to end.", span("start", "end")),
        *outage_columns("duration_s", "start", "end"),
        Column("trigger", "What led to the state: an event, after 2s, a condition, start, resumed, stepped back."),
        Column("source", "Who started the rule; only in the row of its first state."),
        Column("ended_by", "How the rule ended in this state; empty: it went on.", levels=PHASE_ENDS),
        Column("stepped_back", "Whether a wizard put the rule back into this state.", type="boolean", required=True),
    ),
    ("session", "phase"),
    rows_of("phases"),
    SESSION_REFERENCES,
)


class _Event(Struct, frozen=True):
    """An event of any kind."""

    onset: float
    kind: str
    name: str
    value: str
    source: str
    task: int | None = None
    end: float | None = None
    """None: it has no duration."""
    by: str = ""
    """Its cause. Empty: `source`."""
    outage_s: float | None = None
    """For a recovery or a note of a suspend: the seconds without an engine before it."""


def _event_rows(data: SessionData) -> Iterator[Row]:
    def began(act: PlayedAct) -> float:
        return act.started_at if act.started_at is not None else act.accepted_at

    def event_of(act: PlayedAct) -> _Event:
        end = (
            (act.ended_at if act.ended_at is not None else data.facts.duration) if act.started_at is not None else None
        )
        return _Event(began(act), "act", act.act, act.status, act.source, act.task, end, act.by)

    acts, of_keys = {act.task: act.act for act in data.acts}, data.marked_acts()

    def event_at(point: Point) -> _Event:
        task, value = point.task, point.value
        if point.kind == "mistake" and task is not None and task not in acts:
            task = of_keys.get(task)
            value = value or acts.get(task or 0, "")
        return _Event(point.at, point.kind, point.name, value, point.source, task, outage_s=point.outage_s)

    events = merge(  # one at a time, because a long session has hundreds of thousands
        (_Event(each.start, "phase", each.rule, each.state, each.source, None, each.end) for each in data.phases),
        (
            _Event(each.at, "cue", "cue", each.text, each.source, each.task)
            for each in sorted(data.cues, key=lambda cue: cue.at)
        ),
        (event_of(each) for each in sorted(data.acts, key=began)),
        map(event_at, sorted(data.points, key=lambda point: point.at)),
        key=lambda event: event.onset,
    )
    for number, each in enumerate(events, 1):
        yield Row(data, number, each)


def _event_columns() -> tuple[Column, ...]:
    outage_s, wall_s, _ = outage_columns("duration", "onset", "end")
    return (
        numbering("event"),
        moment("onset", "it began.", required=True),
        seconds(
            "duration",
            "How long it lasted; 0: a moment. What was still running when the record ended lasts until then.",
            lambda row: span("onset", "end")(row) or 0.0,
        ),
        seconds(
            "outage_s",
            outage_s.about,
            lambda row: outage_s.of(row) if row.of.outage_s is None else row.of.outage_s,
        ),
        wall_s,
        Column("kind", "The kind of event.", levels=EVENT_KINDS, required=True),
        Column("name", "The name of what it is about; see kind."),
        Column("value", "Its value; see kind."),
        SOURCE,
        Column(
            "by",
            "Who caused it: of an act as in acts.csv, otherwise the source.",
            lambda row: row.of.by or row.of.source,
        ),
        Column(
            "actor",
            "The kind of source in `by`.",
            lambda row: actor_of(row.of.by or row.of.source) if row.of.source else None,
            levels=EVENT_ACTORS,
        ),
        Column(
            "task",
            "The number in acts.csv of the act that it is or is about; of a marked key, the first act that it caused. "
            "Empty: none.",
            type="integer",
            minimum=1,
        ),
    )


EVENTS = TableSchema(
    "events",
    "One row is one event of any kind: the course of a session in one table, by onset.",
    _event_columns(),
    ("session", "event"),
    _event_rows,
    SESSION_REFERENCES,
)
CODED = TableSchema(
    "coded",
    "One row is one annotation that people made in ELAN or BORIS and that was read back.",
    (
        numbering("coded"),
        Column("tier", "ELAN: the tier. BORIS: subject and behaviour, `participant: smiles`.", required=True),
        Column("annotator", "The annotator; empty: not named."),
        moment("begin", "it begins.", required=True),
        moment("end", "it ends; equal to begin: it is a moment.", required=True),
        seconds("duration_s", "From begin to end.", span("begin", "end")),
        *outage_columns("duration_s", "begin", "end", lambda row: row.of.outage_s)[:2],
        Column(
            "value",
            "The annotation; BORIS: the behaviour. Below the level full, speech is replaced by its number of words.",
        ),
        Column("modifiers", "BORIS: modifiers, joined by a vertical bar."),
        Column("comment", "BORIS: the comment; below the level full, its number of words."),
        Column("file", "Its file in `coded/` of the session's folder; only at the level full."),
        Column("speech", "Whether its tier is the participant's speech.", type="boolean", required=True),
        seconds(
            "robot_overlap_s",
            "For the participant's speech: seconds in which the robot spoke too, that is, from the confirmation of a "
            "speech action to its end. Empty with outage_s: it is unknown what the robot said then.",
        ),
        seconds(
            "gap_s",
            "For the participant's speech: from the end of the robot's last utterance before begin, to begin. "
            "Negative: the robot was still speaking. Empty: the robot had said nothing, it is unknown when it fell "
            "silent, or an outage lies between.",
            minimum=None,
        ),
    ),
    ("session", "coded"),
    rows_of("coded"),
    SESSION_REFERENCES,
)
