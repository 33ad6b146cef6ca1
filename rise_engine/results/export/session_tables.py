"""Tables of whole sessions: the facts in every row of every table, sessions, checks and recordings."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rise_engine.base.errors import StudyError
from rise_engine.kernel.records import ENGINE
from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.analysis.statistics import Summary, share_over, summarise
from rise_engine.results.export.format import started_text
from rise_engine.results.export.table_schema import (
    ALIGNMENTS,
    CHECK_RESULTS,
    MEDIA_KINDS,
    MODES,
    OUTCOMES,
    PURPOSES,
    RECORDING_STATES,
    Column,
    Reference,
    Row,
    TableSchema,
    Value,
    cell,
    count,
    moment,
    numbering,
    rows_of,
    seconds,
)
from rise_engine.study.model import Level, Study
from rise_engine.study.participants import CONSENT_PREFIX, PARTICIPANTS_FILE, load_participants
from rise_engine.study.study_toml import STUDY_FILE, load_study
from rise_engine.study.traces import KEPT_CONSENT, KEPT_ID, new_id

LONG = 2.0
"""Seconds after which answers count as late."""
SOURCE = Column("source", "Who asked for it, as in the record: wizard:NAME, rule:NAME, engine.")
SESSION_REFERENCES = (Reference(("session",), "sessions"),)
_HASH = "^[0-9a-f]{64}$"


def _fact(name: str) -> Value:
    return lambda row: getattr(row.data.facts, name) or None


def _answers(data: SessionData) -> list[float]:
    return [each for act in data.acts if (each := act.answer_s) is not None]


def _answer_figure(figure: Callable[[Summary], float | None]) -> Value:
    return lambda row: figure(summary) if (summary := summarise(_answers(row.data))) is not None else None


def _points(kind: str) -> Value:
    return lambda row: sum(point.kind == kind for point in row.data.points)


def _acts(which: Callable[[Any], bool]) -> Value:
    return lambda row: sum(which(act) for act in row.data.acts)


def _repairs(name: str) -> Value:
    return lambda row: getattr(row.data.repairs, name)


def _checks(result: str) -> Value:
    return lambda row: sum(check.result == result for check in row.data.checks)


def _stops(row: Row) -> int:
    asked = [point for point in row.data.points if point.kind == "stop" and point.name == "requested"]
    return sum(point.source != ENGINE for point in asked)


def _started(row: Row) -> str:
    return started_text(row.data.facts.started, lambda at: at.isoformat(timespec="milliseconds"))


FACTS = (
    Column("session", "The session's folder name. The key of sessions.csv.", _fact("session"), required=True),
    Column("participant", "The participant's pseudonym; empty: no participant was named.", _fact("participant")),
    Column(
        "run",
        "The number of the participant's run, from 1; empty: the session belongs to no study.",
        _fact("run"),
        "integer",
        minimum=1,
    ),
    Column("condition", "The condition: the levels of all factors, joined by +.", _fact("condition")),
    Column("mode", "The mode of the session.", _fact("mode"), levels=MODES),
    Column("purpose", "Why the session was run; empty: it belongs to no study.", _fact("purpose"), levels=PURPOSES),
    Column("outcome", "Whether the session counts; empty: undecided.", _fact("outcome"), levels=OUTCOMES),
)
"""The session's facts in every row of every table. The factors follow them."""
SESSIONS = TableSchema(
    "sessions",
    "One row is one session.",
    (
        Column("study", "The study's id; empty: the session belongs to no study."),
        Column(
            "study_hash", "SHA-256 of what study.toml said about sessions at the start of the session.", pattern=_HASH
        ),
        Column("slot", "The session's row in the study's plan; empty: none.", type="integer", minimum=1),
        Column(
            "attempt",
            "The number of the attempt at this run, from 1.",
            _fact("attempt"),
            "integer",
            minimum=1,
        ),
        Column(
            "run_as",
            "The participant under whom it was run, if study.jsonl has reassigned it; withdrawn: they have withdrawn. "
            "Empty: it was run as `participant`.",
        ),
        Column("outcome_reason", "The written reason why it is aborted or excluded."),
        Column("title", "The scenario's title."),
        Column("scenario_hash", "SHA-256 of the whole scenario and the language.", pattern=_HASH),
        Column(
            "scenario_changed_to",
            "The same of changed files with which the session went on (kind scenario in events.csv), joined by ` ; `; "
            "empty: none.",
            lambda row: " ; ".join(row.of.changed_to),
        ),
        Column(
            "changed_keys",
            "Memory keys of the condition that a wizard set to another value (kind memory in events.csv), joined by "
            "` ; `; empty: none.",
            lambda row: " ; ".join(row.of.changed_keys),
        ),
        Column("language", "The language in which the robot spoke (BCP 47); empty: the scenario names none."),
        Column("robot", "The robot's profile."),
        Column("driver", "The driver of the robot; simulated: no robot moved, in any mode. Empty: not known."),
        Column(
            "injected_faults",
            "Faults that the simulated robot was told to make, joined by ` ; `; empty: none.",
            lambda row: " ; ".join(row.of.injected_faults),
        ),
        Column("seed", "The seed of all random choices.", type="integer"),
        Column("speed", "Session seconds per second of the wall clock.", lambda row: float(row.of.speed), "number"),
        Column("started", "Date and time of day; only at the level full.", _started, "datetime"),
        Column("program", "The version of rise-tui that began it.", lambda row: row.of.versions.get("rise-tui")),
        seconds("duration_s", "Length of the session until its last record.", lambda row: row.of.duration),
        Column("ended", "Whether the session ended properly.", type="boolean"),
        count("recoveries", "How often another engine continued the session after a failure."),
        seconds(
            "downtime_s",
            "Seconds of the wall clock without an engine, which session time does not include. Empty: not known, "
            "because the computer's clock was set back meanwhile.",
            lambda row: row.of.downtime,
        ),
        count("acts", "Requested acts, including refused ones.", lambda row: len(row.data.acts)),
        count(
            "wizard_acts",
            "Acts that a wizard's key caused, directly or through rules.",
            _acts(lambda act: act.actor == "wizard"),
        ),
        count("rejected_acts", "Acts that were refused.", _acts(lambda act: act.status == "REJECTED")),
        count("failed_acts", "Acts that failed.", _acts(lambda act: act.status == "ABORTED")),
        count(
            "fillers", "Acts that bridged the time after a cue. They are not answers.", _acts(lambda act: act.filler)
        ),
        count("cues", "How often somebody marked the end of the participant's turn.", lambda row: len(row.data.cues)),
        count(
            "cues_answered",
            "Cues with the state answered.",
            lambda row: sum(cue.state == "answered" for cue in row.data.cues),
        ),
        count("cues_undone", "Cues that were taken back.", _repairs("cues_undone")),
        count(
            "responses",
            "Answers with a response time that were requested after their cue, and whose wait nothing interrupted. The "
            "next three columns are about them.",
            lambda row: len(_answers(row.data)),
        ),
        seconds(
            "response_median_s",
            "Median of response_s of these answers; empty: there are none.",
            _answer_figure(lambda summary: summary.median),
        ),
        seconds(
            "response_iqr_s",
            "Interquartile range of response_s; quartiles as in R and numpy (Hyndman and Fan 7).",
            _answer_figure(lambda summary: summary.iqr),
        ),
        count(
            "responses_over_2s",
            "Answers that took longer than 2 s.",
            lambda row: share_over(_answers(row.data), LONG).count,
        ),
        count(
            "before_cue",
            "Answers that were requested before their cue.",
            _acts(lambda act: act.before_cue and not act.filler),
        ),
        count(
            "wizard_keys",
            "Requests by wizards: acts, rules, events, values, cues, speech, stops.",
            lambda row: len(row.data.keys),
        ),
        count("mistakes", "Mistakes that were marked and not taken back.", _points("mistake")),
        count("stops", "How often a person or a program requested stop-all.", _stops),
        count("faults", "Acts, rules and expressions that failed.", _points("fault")),
        count(
            "repairs",
            "Corrections: the sum of acts_repeated, steps_back, cues_undone and acts_stopped.",
            _repairs("total"),
        ),
        count("acts_repeated", "Acts that were repeated after they had failed.", _repairs("repeated")),
        count("steps_back", "How often a wizard put a rule back into an earlier state.", _repairs("stepped_back")),
        count("acts_stopped", "Acts that a wizard stopped or interrupted after they had begun.", _repairs("canceled")),
        count("stops_released", "Stops that were released.", _repairs("released")),
        count("checks_skipped", "Checks that were skipped, with a reason.", _checks("skipped")),
        count("checks_failed", "Checks that failed.", _checks("failed")),
        count("notes", "Notes.", _points("note")),
        count(
            "unreadable",
            "Parts of the record that could not be read; 0: the record is complete.",
            lambda row: len(row.data.problems),
        ),
    ),
    ("session",),
    lambda data: iter((Row(data, 1, data.facts),)),
)
CHECKS = TableSchema(
    "checks",
    "One row is one check before or after a session, with its last result.",
    (
        Column(
            "check",
            "The check's id in study.toml; the key together with session.",
            lambda row: row.of.id,
            required=True,
        ),
        moment("at", "the result was recorded.", lambda row: row.of.t, required=True),
        Column("text", "The question of the check."),
        Column("result", "The result.", levels=CHECK_RESULTS, required=True),
        Column("value", "The value that was found."),
        Column("reason", "Why it failed or was skipped."),
        SOURCE,
    ),
    ("session", "check"),
    rows_of("checks"),
    SESSION_REFERENCES,
)


def _recording_rows(data: SessionData) -> Iterator[Row]:
    """Return each recorder's last report with its files, then the files without a report."""
    reported = {each.name for each in data.recordings}
    pairs: list[tuple[Any, Any]] = []
    for each in data.recordings:
        files = [file for file in data.media if file.name == each.name]
        pairs += [(each, file) for file in files] or [(each, None)]
    pairs += [(None, file) for file in data.media if file.name not in reported]
    return (Row(data, number, each, file) for number, (each, file) in enumerate(pairs, 1))


def _file(name: str) -> Value:
    return lambda row: getattr(row.beside, name, None)


def _recorder(name: str) -> Value:
    return lambda row: getattr(row.of, name, None)


def _file_or_recorder(name: str) -> Value:
    return lambda row: getattr(row.of if row.beside is None else row.beside, name)


def _rate(row: Row) -> float | None:
    return row.beside.rate if row.beside is not None and row.beside.offset is not None else None


RECORDINGS = TableSchema(
    "recordings",
    "One row is one recording of a session: its recorder's last report, and how its file is aligned with the session.",
    (
        numbering("recording"),
        Column("name", "The recorder's name; empty: the file was added later.", _file_or_recorder("name")),
        Column(
            "status",
            "The recorder's last report; empty: none.",
            _recorder("status"),
            levels=RECORDING_STATES,
        ),
        Column("reason", "Why it stalled or failed.", _recorder("reason")),
        Column("kind", "The kind of recording; empty: not known.", _file("kind"), levels=MEDIA_KINDS),
        Column("path", "The path of its file; only at the level full.", _file_or_recorder("path")),
        Column("bytes", "Size of its file.", _file_or_recorder("bytes"), "integer", "bytes", minimum=0),
        seconds("duration_s", "Length of the recording.", _file("duration")),
        seconds("offset_s", "Media time = offset_s + rate * session time; empty: not known.", _file("offset"), None),
        Column("rate", "Seconds of the recording per session second.", _rate, "number"),
        Column("aligned_by", "How the alignment is known.", _file("aligned_by"), levels=ALIGNMENTS),
        seconds(
            "within_s",
            "The largest error of the alignment between the marks, as far as the marks' own times are known. In a "
            "short session, the rate can be as uncertain as this.",
            _file("within"),
        ),
    ),
    ("session", "recording"),
    _recording_rows,
    SESSION_REFERENCES,
)


def factor_column(name: str, study: Study | None) -> Column:
    """Return the column of a factor.

    :param name: the factor's name.
    :param study: the design with its levels; None: they are unknown.
    """
    factor = next((each for each in study.factors if each.name == name), None) if study is not None else None
    return Column(
        f"factor_{name}",
        f"The level of the factor {name}; empty: the session has none.",
        lambda row: row.data.facts.factors.get(name),
        levels={level.name: _level_text(level) for level in factor.levels} if factor is not None else {},
    )


def _level_text(level: Level) -> str:
    parts = [level.description] if level.description else []
    parts += [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in level.memory.items()]
    return "; ".join([*parts, f"scenario {level.scenario}"] if level.scenario else parts)


# --- rows of withdrawn participants -----------------------------------------------------------------------------------

_OMITTED = frozenset(
    {
        *("session", "participant", "study", "study_hash", "slot", "attempt", "outcome_reason", "title", "seed"),
        *("started", "program", "speed", "scenario_hash", "scenario_changed_to", "purpose", "unreadable", "run_as"),
    }
)
"""Columns of the table of sessions that reveal the person or the date, or that would match a copy of the record."""


def rows_to_keep(study: Path, participant: str, sessions: list[str]) -> list[dict[str, str]]:
    """Return a row for each counted session of a participant, all under one new id.

    :param study: the study's folder.
    :param participant: their pseudonym.
    :param sessions: the names of their folders in the study's sessions.
    :raises StudyError: they have not agreed to this, or their consent is unknown.
    :raises rise_engine.base.errors.SessionError: one of their sessions cannot be read.
    """
    loaded = load_study(study, check_scenarios=False).study
    if loaded is None:
        raise StudyError(f"{STUDY_FILE} has errors, so it is not known who has agreed to what. Nothing was erased")
    found = [each for each in load_participants(loaded).participants if each.participant == participant]
    column = f"{CONSENT_PREFIX}{KEPT_CONSENT}"
    if not any(each.consent.get(KEPT_CONSENT) for each in found):
        raise StudyError(
            f"{participant} has not agreed that anything is kept: {PARTICIPANTS_FILE} has no date in {column}. "
            "Nothing was erased; without --keep-anonymous, everything is"
        )
    fresh = new_id()
    rows = []
    for data in read_sessions([study / "sessions" / name for name in sessions], level="public"):
        if data.facts.purpose != "counted":
            continue
        columns = [*FACTS, *(factor_column(name, loaded) for name in data.facts.factors), *SESSIONS.columns]
        (row,) = SESSIONS.rows(data)
        rows.append(
            {KEPT_ID: fresh, **{each.name: cell(each.of(row)) for each in columns if each.name not in _OMITTED}}
        )
    return rows
