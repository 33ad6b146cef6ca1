"""Checks of study.jsonl against the sessions and against itself, for `study check`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from typing import get_args

from rise_engine.base.nearest_name import nearest_name
from rise_engine.base.text import pluralize
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import SourceLocation
from rise_engine.session.folder import JOURNAL
from rise_engine.study.model import Participant, Study
from rise_engine.study.participants import CONSENT_PREFIX, PARTICIPANTS_FILE
from rise_engine.study.sessions import StudySession
from rise_engine.study.study_log import LOG_FILE, EntryKind, LogEntry
from rise_engine.study.study_toml import STUDY_FILE
from rise_engine.study.verdict import check_results, read_verdict
from rise_engine.study.withdrawn import PREFIX

_KINDS = get_args(EntryKind)
_ROUNDED = 0.001
"""Seconds by which the log's times differ from a journal's at most."""


def review_entries(
    study: Study,
    entries: Sequence[LogEntry],
    sessions: Mapping[str, StudySession],
    people: Iterable[Participant],
    diagnostics: Diagnostics,
) -> None:
    """Check what nobody reads, what contradicts sessions, and what does not fit them.

    :param study: the design.
    :param entries: all entries of study.jsonl.
    :param sessions: by the names of their folders.
    :param people: the rows of participants.csv.
    :param diagnostics: gets the problems.
    """
    _check_kinds(entries, diagnostics)
    _check_taken(entries, diagnostics)
    _check_mode(study, entries, diagnostics)
    _check_consent(study, sessions.values(), people, diagnostics)
    for session in sessions.values():
        if session.info is not None and session.entry.status == "ended":
            _check_told(session, entries, diagnostics)


def _check_kinds(entries: Sequence[LogEntry], diagnostics: Diagnostics) -> None:
    for each in entries:
        if each.kind in _KINDS:
            continue
        message = f"`{each.kind}` is no kind of entry, so that nobody reads this line"
        if near := nearest_name(each.kind, _KINDS):
            diagnostics.error("unknown-kind", SourceLocation(LOG_FILE, each.line), f"{message}; did you mean `{near}`?")
        else:
            message += "; a newer version may have written it"
            diagnostics.warning("unknown-kind", SourceLocation(LOG_FILE, each.line), message)


def _check_taken(entries: Sequence[LogEntry], diagnostics: Diagnostics) -> None:
    """Check that the participant of each counted session had taken the session's slot, if they took any or somebody
    else took it."""
    moved = {(each.get("slot"), each.get("participant")) for each in entries if each.get("instead_of")}
    takers: dict[object, dict[str, LogEntry]] = {}
    took: dict[str, LogEntry] = {}
    for each in entries:
        slot, name = each.get("slot"), str(each.get("participant"))
        if each.kind == "taken":
            takers.setdefault(slot, {})[name] = took[name] = each
        elif each.kind == "session" and each.get("purpose") == "counted" and slot and (slot in takers or name in took):
            names = takers.get(slot, {})
            if name in names or (slot, name) in moved or any(other.startswith(PREFIX) for other in names):
                continue
            moved.add((slot, name))  # told once
            other, taken = list(names.items())[-1] if names else (name, took[name])
            message = (
                f"it says that {other} took slot {taken.get('slot')}, but {each.get('folder')}, the session of {name}, "
                f"began in slot {slot} (line {each.line}), which {name} had not taken"
            )
            diagnostics.error("other-holder", SourceLocation(LOG_FILE, taken.line), message)


def _check_mode(study: Study, entries: Sequence[LogEntry], diagnostics: Diagnostics) -> None:
    real = sum(
        each.kind == "session" and each.get("purpose") == "counted" and each.get("mode") == "real" for each in entries
    )
    if study.mode == "debug" and real:
        message = f'mode is "debug", but {pluralize(real, "session")} with the robot counted; set it to "real" again'
        diagnostics.warning("debug-mode", SourceLocation(STUDY_FILE), message)


def _check_consent(
    study: Study, sessions: Iterable[StudySession], people: Iterable[Participant], diagnostics: Diagnostics
) -> None:
    first: dict[str, str] = {}
    for each in sessions:
        if each.info is not None and each.entry.purpose == "counted":
            with suppress(ValueError):
                day = datetime.fromisoformat(each.entry.started).date().isoformat()
                first[each.entry.participant] = min(day, first.get(each.entry.participant, day))
    for person in people:
        for name in study.consent:
            given, day = person.consent.get(name, ""), first.get(person.participant, "")
            if day and given > day:
                message = (
                    f"`{person.participant}` has consented on {given} ({CONSENT_PREFIX}{name}), and their first "
                    f"session was on {day}"
                )
                diagnostics.warning("late-consent", SourceLocation(PARTICIPANTS_FILE, person.line), message)


def _check_told(session: StudySession, entries: Sequence[LogEntry], diagnostics: Diagnostics) -> None:
    """Check the results of checks and the length that the log repeats from a session's journal."""
    told = [each for each in entries if session.name in (each.get("folder"), each.get("session"))]
    for begun in (each for each in told if each.kind == "session" and each.get("checks")):
        recorded = check_results(session.path)
        for each in begun.get("checks"):
            results = recorded.get(str(each.get("id")), frozenset()) if isinstance(each, dict) else frozenset()
            if results and each.get("result") not in results:
                message = (
                    f"it says that the check {each.get('id')} {each.get('result')} before {session.name}, but its "
                    f"{JOURNAL} says {' and '.join(sorted(results))}"
                )
                diagnostics.warning("other-result", SourceLocation(LOG_FILE, begun.line), message)
    outcome = next((each for each in told if each.kind == "outcome"), None)
    seconds = outcome.get("seconds") if outcome is not None else None
    if outcome is not None and isinstance(seconds, float | int) and seconds:
        end = read_verdict(session.path).seconds
        if seconds < end - _ROUNDED:  # an earlier end of the journal is another label
            message = f"it says {seconds:.3f} s, but {JOURNAL} of {session.name} ends at {end:.3f} s"
            diagnostics.warning("other-result", SourceLocation(LOG_FILE, outcome.line), message)
