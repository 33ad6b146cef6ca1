"""The tables of an export, and what every column means: docs/reference/exports.md says the same."""

from __future__ import annotations

import json

from rise_engine.export.table_schema import Column, Reference, TableSchema
from rise_engine.study.model import Level, Study

HASH = "^[0-9a-f]{64}$"
STATUS = {
    "PENDING": "it still waits: the record ends before its turn",
    "ACTIVE": "it still runs: the record ends before it does",
    "SUCCEEDED": "done to its end",
    "ABORTED": "failed",
    "CANCELED": "stopped, interrupted, or taken out of the queue",
    "REJECTED": "refused at once, with a reason",
}
ACTION_STATUS = {
    "started": "sent to the robot; the record ends before it confirms",
    "accepted": "confirmed by the robot; the record ends before it does",
    "succeeded": "done to its end",
    "failed": "the robot could not do it",
    "canceled": "stopped before its end",
    "timed-out": "the robot reported no end in time",
    "lost": "nobody knows what became of it",
    "skipped": "never begun",
}
ACTORS = {
    "wizard": "a person at a console",
    "rule": "an interaction rule by itself, as after a time",
    "program": "a node, a client, the command line",
    "engine": "the engine by itself, as for fillers that it starts",
}
MARKS = {
    "wrong": "it was the wrong one",
    "late": "it came too late",
    "early": "it came too early",
    "double": "it was asked for twice",
}
OUTCOMES = {
    "complete": "the run counts",
    "aborted": "it was broken off",
    "excluded": "the participant does not count",
}
PURPOSES = {
    "counted": "data of the study",
    "pilot": "a trial run with a person; does not count",
    "training": "of a wizard; does not count",
    "debug": "with a simulated robot; does not count",
}
MODES = {"real": "a robot moved", "debug": "the robot was simulated: no data of a participant"}
CUE_STATES = {
    "answered": "an act answered it",
    "undone": "it was taken back",
    "open": "nothing answered it",
}
PHASE_ENDS = {
    "ended": "the rule came to its end in it",
    "stopped": "the rule was stopped in it",
    "faulted": "the rule was stopped for a fault in it",
}
CHECK_RESULTS = {
    "passed": "as it should be",
    "failed": "not as it should be",
    "skipped": "not looked at, with a reason",
}
RECORDING_STATES = {
    "started": "told to record",
    "running": "it records",
    "stalled": "it says that it records, and its file did not grow",
    "stopped": "ended as it should",
    "failed": "it did not record, or not to its end",
}
MEDIA_KINDS = {
    "video": "video, perhaps with sound",
    "audio": "sound",
    "bag": "a bag of ROS 2",
    "streams": "streams of LSL",
    "other": "something else",
}
ALIGNMENTS = {
    "marks": "by marks that were found in it",
    "given": "somebody said it",
    "start": "by when its recorder was started; that is no time of the first frame",
}
EVENT_KINDS = {
    "act": "an act, from when its turn came to its end; name: the act; value: how it ended",
    "phase": "a rule in a state; name: the rule; value: the state",
    "cue": "the participant's turn ended; value: what the wizard said of it",
    "note": "a note; value: its text",
    "mistake": "a wizard's mark at an act; name: the mark; value: the act",
    "stop": "stop-all; name: requested, latched, let-go or released",
    "sync": "a mark for recordings; name: its number; value: sound or flash",
    "event": "an event; name: its topic; value: the rule that took it",
    "memory": "a memory value was set; name: the key; value: what it is now",
    "control": "who may act; name: what happened; value: who has control now",
    "robot": "the link to the robot; name: its state",
    "fault": "an act, a rule or an expression failed; name: which; value: why",
    "check": "something was looked at; name: which check; value: the result",
    "recovery": "another engine went on with the session; outage_s: for how long it had none",
}

FACTS = (
    Column("session", "Which session. The key of sessions.csv.", required=True),
    Column("participant", "The participant's pseudonym; empty: nobody was named."),
    Column("run", "Which of the participant's runs, from 1; empty: the session is of no study.", "integer", minimum=1),
    Column("condition", "The condition: the levels of all factors, joined by +."),
    Column("mode", "Whether a robot moved.", levels=MODES),
    Column("purpose", "Why the session was run; empty: it is of no study.", levels=PURPOSES),
    Column("outcome", "How the session counts; empty: nobody has said it.", levels=OUTCOMES),
)
"""Of the session; they stand in every row of every table, and the factors after them."""
_WALL = (
    ("outage_s", "Seconds without an engine in {}; empty: none. Session time stood still then."),
    ("wall_s", "{} by the wall clock, with outage_s; empty: as in session time."),
)
_T = "Session seconds; the session's clock begins at 0. "
_SOURCE = Column("source", "Who asked for it, as the record has it: wizard:NAME, rule:NAME, engine.")
_ACTOR = Column("actor", "What kind of source that is.", levels=ACTORS)
_SESSION = (Reference(("session",), "sessions"),)


def _time(name: str, about: str, *, required: bool = False) -> Column:
    return Column(name, f"{_T}{about}", "number", "s", required=required)


def _seconds(name: str, about: str, minimum: float | None = 0) -> Column:
    return Column(name, about, "number", "s", minimum=minimum)


def _wall(what: str) -> tuple[Column, Column]:
    away, whole = ((name, about.format(what)) for name, about in _WALL)
    return _seconds(*away), _seconds(*whole)


def _number(name: str) -> Column:
    """The part of a key that is not the session."""
    about = "Its number in the session, from 1; the key together with session."
    return Column(name, about, "integer", required=True, minimum=1)


def _count(name: str, about: str) -> Column:
    return Column(name, about, "integer", minimum=0, required=True)


SESSIONS = TableSchema(
    "sessions",
    "One row is one session.",
    (
        Column("study", "The study's id; empty: the session is of no study."),
        Column("study_hash", "SHA-256 of study.toml when the session began.", pattern=HASH),
        Column("slot", "The row of the study's plan; empty: it takes none.", "integer", minimum=1),
        Column("attempt", "The how-manieth session of this run, from 1.", "integer", minimum=1),
        Column("outcome_reason", "Why it is aborted or excluded, as somebody wrote it."),
        Column("title", "The scenario's title."),
        Column("scenario_hash", "SHA-256 of all that is in the scenario, and of the language.", pattern=HASH),
        Column("language", "In which everything was said, by BCP 47; empty: the scenario does not say."),
        Column("robot", "The robot's profile."),
        Column("seed", "Of everything that was picked at random.", "integer"),
        Column("speed", "Session seconds in a second of the wall clock.", "number"),
        Column("started", "Date and time of day; only at the level full.", "datetime", required=False),
        Column("program", "The version of rise-tui that began it."),
        _seconds("duration_s", "Session seconds until the last record."),
        Column("ended", "Whether it came to its end in order.", "boolean"),
        _count("recoveries", "How often its engine had gone, and another one went on with it."),
        _seconds("downtime_s", "Seconds of the wall clock without an engine; session time does not count them."),
        _count("acts", "Acts that somebody asked for, refused ones too."),
        _count("wizard_acts", "Those that a wizard's key caused, through rules, too."),
        _count("rejected_acts", "Those that were refused."),
        _count("failed_acts", "Those that failed."),
        _count("fillers", "Acts that bridged the time of a cue; they are no answers."),
        _count("cues", "How often the end of the participant's turn was marked."),
        _count("cues_answered", "Cues that an act answered, also one that was never heard."),
        _count("cues_undone", "Cues that were taken back."),
        _count("responses", "Answers with a response time that were not asked for before their cue: the next three."),
        _seconds("response_median_s", "Median of response_s over these answers; empty: there is none."),
        _seconds("response_iqr_s", "Its interquartile range; quartiles as in R and numpy (Hyndman and Fan 7)."),
        _count("responses_over_2s", "Those of them that took longer than 2 s."),
        _count("before_cue", "Answers that were asked for before their cue came."),
        _count("wizard_keys", "What wizards asked for: acts, rules, events, values, cues, speech, stops."),
        _count("mistakes", "Mistakes that were marked and not taken back."),
        _count("stops", "Stop-all, how often a person or a program asked for it."),
        _count("faults", "Acts, rules and expressions that failed."),
        _count(
            "repairs",
            "How often something was mended: acts_repeated, steps_back, cues_undone, acts_stopped, stops_released.",
        ),
        _count("acts_repeated", "Acts that were done again after they had failed."),
        _count("steps_back", "Rules that a wizard put back into an earlier state."),
        _count("acts_stopped", "Acts that a wizard stopped or interrupted after they had begun."),
        _count("stops_released", "Stops that were released."),
        _count("checks_skipped", "Checks that nobody made, with a reason."),
        _count("checks_failed", "Checks that failed."),
        _count("notes", "Notes that were written down."),
        _count("unreadable", "Things that could not be read of its record: 0 is a whole record."),
    ),
    ("session",),
)
ACTS = TableSchema(
    "acts",
    "One row is one act (or free speech) that somebody asked for, also one that was refused or never had its turn.",
    (
        _number("task"),
        Column("act", "The act's name; say: free speech.", required=True),
        _SOURCE,
        Column("by", "Whose doing it is: the source of what caused it, through any number of rules."),
        Column("via", "The rules between by and the act, the first one first, joined by ` > `."),
        Column("actor", "What kind of source by is.", levels=ACTORS),
        Column("status", "How it ended.", levels=STATUS, required=True),
        Column("reason", "Why it did not succeed, or what it repeats."),
        Column("filler", "Whether it bridged the time of a cue. It is no answer then.", "boolean", required=True),
        Column("speaks", "Whether one of its actions takes the voice.", "boolean", required=True),
        Column("text", "What it says, its speech actions joined by a blank."),
        Column("mark", "What was said to be wrong about it, or the key that caused it; empty: nothing.", levels=MARKS),
        Column("cue", "The cue that it answers or bridges: its number in cues.csv; empty: none.", "integer", minimum=1),
        _time("cue_at", "That cue was marked."),
        Column("before_cue", "Whether it was asked for before that cue came; empty: it has no cue.", "boolean"),
        _time("key_at", "The key was pressed that caused it, on the console's clock; empty: no key, or not known."),
        _time("accepted_at", "The engine took it.", required=True),
        _time("started_at", "Its turn came."),
        _time("robot_at", "The robot confirmed its first action. It is no time of the first sound."),
        _time("voice_at", "The robot confirmed its first action that takes the voice. The first sound comes later."),
        _time("ended_at", "Its end."),
        _seconds("wizard_s", "Cue to key: the wizard. Empty: no cue, no key, or asked for before the cue."),
        _seconds("way_s", "Key to engine; from the cue, where no key was pressed. Empty if before_cue."),
        _seconds("queue_s", "In the queue; if before_cue, from the cue on."),
        _seconds("robot_s", "From its turn until the robot confirms."),
        _seconds("voice_s", "From the first confirmed action to the first one that takes the voice."),
        _seconds(
            "response_s",
            "Cue to answer: to voice_at if it speaks, else to robot_at. wizard_s, way_s, queue_s, robot_s and, if it "
            "speaks, voice_s add up to it. Empty: it is a filler, or no answer.",
        ),
        _seconds("duration_s", "From started_at to ended_at."),
        *_wall("duration_s"),
        _seconds("response_outage_s", "Seconds without an engine in response_s; empty: none."),
    ),
    ("session", "task"),
    _SESSION,
)
ACTIONS = TableSchema(
    "actions",
    "One row is one action of an act, as the robot did it.",
    (
        Column("task", "The act that it is part of.", "integer", required=True, minimum=1),
        Column("act", "That act's name."),
        Column("action", "Its actionID within the act.", required=True),
        Column("type", "What kind of action: Speech, LookAt, ...", required=True),
        Column("channels", "What of the robot it takes, separated by blanks; empty: it only waits, or nobody knows."),
        Column("text", "What it says, or its most telling parameter."),
        Column("parameters", "All of its parameters, as JSON.", "object"),
        Column("status", "How it ended.", levels=ACTION_STATUS, required=True),
        _time("started_at", "It was sent to the robot, or began to wait; empty: it never was."),
        _time("accepted_at", "The robot confirmed it. Waiting is never confirmed."),
        _time("ended_at", "Its end."),
    ),
    ("session", "task", "action"),
    (*_SESSION, Reference(("session", "task"), "acts")),
)
CUES = TableSchema(
    "cues",
    "One row is one cue: the participant's turn ended, and somebody marked it.",
    (
        _number("cue"),
        _time("at", "It was marked.", required=True),
        _SOURCE,
        Column("text", "What was said of it."),
        Column("state", "What became of it.", levels=CUE_STATES, required=True),
        _time("filled_at", "The robot confirmed the first filler."),
        _time("answered_at", "The robot began to answer, with its voice if the answer speaks."),
        _time("undone_at", "It was taken back."),
        Column("task", "The act that answered: its number in acts.csv.", "integer", minimum=1),
        Column("before_cue", "Whether the answer was asked for before the cue; empty: no answer.", "boolean"),
        _seconds("filled_s", "Cue to filler."),
        _seconds("response_s", "Cue to answer."),
        *_wall("response_s"),
    ),
    ("session", "cue"),
    _SESSION,
)
PHASES = TableSchema(
    "phases",
    "One row is one stay of a rule in a state, also one of 0 s.",
    (
        _number("phase"),
        Column("rule", "Which rule.", required=True),
        Column("state", "Which state.", required=True),
        _time("start", "It was entered.", required=True),
        _time("end", "It was left, or the record ended.", required=True),
        _seconds("duration_s", "How long the rule was in it."),
        *_wall("duration_s"),
        Column("trigger", "What led to it: an event, after 2s, a condition, start, resumed, stepped back."),
        Column("source", "Who started the rule; only of its first state."),
        Column("ended_by", "How the rule ended in it; empty: it went on.", levels=PHASE_ENDS),
        Column("stepped_back", "Whether a wizard put the rule back into it.", "boolean", required=True),
    ),
    ("session", "phase"),
    _SESSION,
)
EVENTS = TableSchema(
    "events",
    "One row is something that happened: the course of a session in one table, by onset.",
    (
        _number("event"),
        _time("onset", "It began.", required=True),
        _seconds("duration", "How long it lasted; 0: a moment. What the record's end cut off lasts until then."),
        *_wall("duration"),
        Column("kind", "What it is.", levels=EVENT_KINDS, required=True),
        Column("name", "What it is about."),
        Column("value", "What is told of it."),
        _SOURCE,
        _ACTOR,
        Column("task", "The act that it is or is about: its number in acts.csv; empty: none.", "integer", minimum=1),
    ),
    ("session", "event"),
    _SESSION,
)
CHECKS = TableSchema(
    "checks",
    "One row is something that was looked at before or after a session; the last result of each.",
    (
        Column("check", "Its id in study.toml; the key together with session.", required=True),
        _time("at", "It stands in the record from then on.", required=True),
        Column("text", "What was looked at."),
        Column("result", "What came of it.", levels=CHECK_RESULTS, required=True),
        Column("value", "What was found."),
        Column("reason", "Why it failed, or why somebody skipped it."),
        _SOURCE,
    ),
    ("session", "check"),
    _SESSION,
)
RECORDINGS = TableSchema(
    "recordings",
    "One row is one recording of a session: what its recorder said last, and where its file lies against the session.",
    (
        _number("recording"),
        Column("name", "Of its recorder; empty: the file was added later."),
        Column("status", "What its recorder said last; empty: it said nothing.", levels=RECORDING_STATES),
        Column("reason", "Why it stalled or failed."),
        Column("kind", "What it is; empty: not known.", levels=MEDIA_KINDS),
        Column("path", "Of its file; only at the level full."),
        Column("bytes", "How large its file is.", "integer", "bytes", minimum=0),
        _seconds("duration_s", "How long it is."),
        _seconds("offset_s", "Media time = offset_s + rate * session time; empty: nobody knows.", None),
        Column("rate", "Seconds of the file for one second of the session.", "number"),
        Column("aligned_by", "How that is known.", levels=ALIGNMENTS),
        _seconds(
            "within_s",
            "By which that is wrong at most between its marks, as far as the marks' own times are known; in a short "
            "session, rate can then be nothing but that.",
        ),
    ),
    ("session", "recording"),
    _SESSION,
)
TABLES = (SESSIONS, ACTS, ACTIONS, CUES, PHASES, EVENTS, CHECKS, RECORDINGS)


def factor_column(name: str, study: Study | None) -> Column:
    """The column of a factor.

    :param name: the factor's.
    :param study: the design, which says its levels; None: nobody knows them.
    """
    factor = next((each for each in study.factors if each.name == name), None) if study is not None else None
    levels = {level.name: _level_text(level) for level in factor.levels} if factor is not None else {}
    return Column(f"factor_{name}", f"The level of the factor {name}; empty: the session has none.", levels=levels)


def _level_text(level: Level) -> str:
    told = [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in level.memory.items()]
    return "; ".join([*told, f"scenario {level.scenario}"] if level.scenario else told)
