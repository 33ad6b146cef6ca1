"""Which checks of a study must still be made, can be skipped, or are due, according to earlier results."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from datetime import datetime, timedelta
from typing import Literal

from msgspec import Struct

from rise_engine.study.check_tables import AUTOMATIC, OF_THE_PARTICIPANT
from rise_engine.study.model import Purpose, SessionEntry, Study, StudyCheck
from rise_engine.study.study_log import LogEntry

_DEBRIEF = "debrief"


class PendingCheck(Struct, frozen=True):
    """A check before or after a session, and whether it must be made."""

    check: StudyCheck
    good_since: str = ""
    """When it passed (ISO 8601), if this is still valid (`every`). Empty: it must be made."""
    value: str = ""
    """The earlier result's value."""


def check_text(check: StudyCheck) -> str:
    """Return a check in words: its sentence, what the program checks, or the command."""
    if check.ask:
        return check.ask
    return AUTOMATIC.get(check.auto, check.auto) if check.auto else shlex.join(check.run)


def pending_checks(
    study: Study, when: Literal["before", "after"], earlier: Sequence[LogEntry], now: datetime
) -> tuple[PendingCheck, ...]:
    """Return the checks before or after a session in the order of the file, with those that are still valid.

    :param study: the study with the checks.
    :param when: which of them.
    :param earlier: the entries of study.jsonl in their order.
    :param now: a time with a time zone.
    """
    return tuple(still_good(check, earlier, now) for check in study.checks if check.when == when)


def still_good(check: StudyCheck, earlier: Sequence[LogEntry], now: datetime) -> PendingCheck:
    """Decide whether an earlier result of a check is still valid: the check has `every`, passed last within that time,
    and had the same text. Later skips do not matter, failures do. Checks of one participant never stay valid.

    :return: the check, with `good_since` if it is.
    """
    made = (
        entry
        for entry in reversed(earlier)
        if entry.kind == "checked" and entry.get("id") == check.id and entry.get("result") != "skipped"
    )
    last = next(made, None) if check.valid is not None and check.auto not in OF_THE_PARTICIPANT else None
    if check.valid is None or last is None or last.get("result") != "passed" or last.get("text") != check_text(check):
        return PendingCheck(check)
    try:
        age = now - datetime.fromisoformat(last.at)
    except (ValueError, TypeError):  # not a time, or one without a zone, in an edited file
        return PendingCheck(check)
    if not timedelta(0) <= age <= timedelta(seconds=check.valid):
        return PendingCheck(check)
    return PendingCheck(check, last.at, str(last.get("value", "")))


def skip_problem(check: StudyCheck, purpose: Purpose, reason: str) -> str:
    """Say in a sentence why a check cannot be skipped with this reason. Empty: it can."""
    if check.auto in OF_THE_PARTICIPANT and purpose == "counted":
        what = "consent" if check.auto == "consent" else "whether the participant may take part"
        return f"{check.id}: {what} cannot be skipped in a session that counts"
    if not reason.strip():
        return f"{check.id}: give a reason for skipping a check"
    return ""


def due_after_checks(study: Study, sessions: Iterable[SessionEntry], entries: Iterable[LogEntry]) -> list[str]:
    """List checks not made after counted sessions, one sentence each. They are only reminders: no data is lost."""
    after = [check for check in study.checks if check.when == "after"]
    made = made_after(entries)
    return [
        f"{session.participant}, run {session.run}{attempt_text(session)}: not confirmed: “{check_text(check)}” "
        f"(check {check.id})"
        for session in sessions
        if session.status == "ended" and session.purpose == "counted"
        for check in after
        if (session.folder, check.id) not in made
    ]


def asks_debriefing(id: str, text: str = "") -> bool:
    """Whether a check confirms a debriefing: its id or its sentence contains that word.

    >>> asks_debriefing("participant-debriefed"), asks_debriefing("end", "Debriefing is done"), asks_debriefing("lamp")
    (True, True, False)
    """
    return any(_DEBRIEF in each.casefold() for each in (id, text))


def checks_after(entries: Iterable[LogEntry]) -> dict[str, dict[str, str]]:
    """Return the results of checks after each session: by the session's folder, then by id. The last one counts."""
    found: dict[str, dict[str, str]] = {}
    for entry in entries:
        if entry.kind == "checked" and entry.get("when") == "after":
            found.setdefault(str(entry.get("session")), {})[str(entry.get("id"))] = str(entry.get("result"))
    return found


def attempt_text(session: SessionEntry) -> str:
    """Return `, attempt 2`, or an empty text for the first attempt."""
    return f", attempt {session.attempt}" if session.attempt > 1 else ""


def made_after(entries: Iterable[LogEntry]) -> frozenset[tuple[str, str]]:
    """Return the checks after sessions that have not failed: the session's folder and the check's id."""
    return frozenset(
        (session, id)
        for session, results in checks_after(entries).items()
        for id, result in results.items()
        if result != "failed"
    )
