"""What can be kept of somebody who withdraws and has agreed to it: how their sessions went, in numbers."""

from __future__ import annotations

from pathlib import Path

from rise_engine.base.errors import StudyError
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.export.session_tables import FACTS, SESSIONS, factor_column
from rise_engine.results.export.table_schema import cell
from rise_engine.study.kept_rows import CONSENT, ID, new_id
from rise_engine.study.participants import CONSENT_PREFIX, PARTICIPANTS_FILE, load_participants
from rise_engine.study.study_toml import STUDY_FILE, load_study

_LEFT_OUT = frozenset(
    {
        *("session", "participant", "study", "study_hash", "slot", "attempt", "outcome_reason", "title", "seed"),
        *("started", "program", "speed", "scenario_hash", "purpose", "unreadable"),
    }
)
"""Columns of the table of sessions that say who it was or when, or by which a copy of the record is found."""


def rows_to_keep(study: Path, participant: str, sessions: list[str]) -> list[dict[str, str]]:
    """A row for each counted session of a participant, under one fresh id.

    :param study: the study's folder.
    :param participant: their pseudonym.
    :param sessions: names of their folders in the study's sessions.
    :raises StudyError: they have not agreed to it, or it is not known whether they have.
    :raises rise_engine.base.errors.SessionError: one of their sessions cannot be read.
    """
    loaded = load_study(study, check_scenarios=False).study
    if loaded is None:
        raise StudyError(f"{STUDY_FILE} has errors, so nobody can say who has agreed to what. Nothing was erased")
    found = [each for each in load_participants(loaded).participants if each.participant == participant]
    column = f"{CONSENT_PREFIX}{CONSENT}"
    if not any(each.consent.get(CONSENT) for each in found):
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
        rows.append({ID: fresh, **{each.name: cell(each.of(row)) for each in columns if each.name not in _LEFT_OUT}})
    return rows
