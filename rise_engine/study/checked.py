"""Which checks of a study are still to be made, and which hinder a session: pure, from what was found earlier."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from datetime import datetime, timedelta
from typing import Literal, Protocol

from msgspec import Struct

from rise_engine.study.check_settings import AUTOMATIC_CHECKS, OF_THE_PARTICIPANT
from rise_engine.study.model import CheckResult, Purpose, SessionEntry, Study, StudyCheck


class CheckedEntry(Struct, frozen=True, kw_only=True):
    """What came of one check, as study.jsonl keeps it (`checked`)."""

    at: str
    """ISO 8601 with offset."""
    id: str
    result: CheckResult
    when: Literal["before", "after"] = "before"
    text: str = ""
    value: str = ""
    reason: str = ""
    source: str = ""
    participant: str = ""
    run: int = 0
    purpose: Purpose = "counted"
    session: str = ""
    """Of a check after a session: the name of its folder."""


class CheckedReport(Protocol):
    """What `missing_checks` must know of a report: `rise_engine.kernel.inputs.CheckReport` is one."""

    @property
    def id(self) -> str: ...
    @property
    def result(self) -> CheckResult: ...
    @property
    def reason(self) -> str: ...


class PendingCheck(Struct, frozen=True):
    """A check that belongs to a session, and whether it has to be made for it."""

    check: StudyCheck
    good_since: str = ""
    """When it passed, ISO 8601, if that is still good (`every`); empty: it has to be made."""
    value: str = ""
    """What was found then."""


def check_text(check: StudyCheck) -> str:
    """What is looked at, as people and records have it: the sentence, what the program does, or the command."""
    if check.ask:
        return check.ask
    return AUTOMATIC_CHECKS.get(check.auto, check.auto) if check.auto else shlex.join(check.run)


def pending_checks(
    study: Study, when: Literal["before", "after"], earlier: Iterable[CheckedEntry], now: datetime
) -> tuple[PendingCheck, ...]:
    """The checks before or after a session, in the order of the file.

    One with `every` is still good when it passed last within that time, and asked the same then. What was skipped since
    changes nothing; a failure since does. That one participant has consented says nothing about the next.

    :param study: whose checks.
    :param when: which of them.
    :param earlier: what study.jsonl has, in its order.
    :param now: aware of its time zone.
    """
    last: dict[str, CheckedEntry] = {}
    for entry in earlier:
        if entry.result != "skipped":
            last[entry.id] = entry
    return tuple(_pending(check, last.get(check.id), now) for check in study.checks if check.when == when)


def _pending(check: StudyCheck, last: CheckedEntry | None, now: datetime) -> PendingCheck:
    if check.valid is None or check.auto in OF_THE_PARTICIPANT or last is None or last.result != "passed":
        return PendingCheck(check)
    try:
        age = now - datetime.fromisoformat(last.at)
    except (ValueError, TypeError):  # not a time, or one without its zone: somebody wrote it by hand
        return PendingCheck(check)
    if last.text != check_text(check) or not timedelta(0) <= age <= timedelta(seconds=check.valid):
        return PendingCheck(check)
    return PendingCheck(check, last.at, last.value)


def skip_problem(check: StudyCheck, purpose: Purpose, reason: str) -> str:
    """Why a check cannot be skipped with that reason, as a sentence; empty: it can."""
    if check.auto == "consent" and purpose == "counted":
        return f"{check.id}: consent cannot be skipped in a session that counts"
    if not reason.strip():
        return f"{check.id}: who skips a check says why"
    return ""


def missing_checks(study: Study, purpose: Purpose, reports: Sequence[CheckedReport]) -> list[str]:
    """What hinders a session from beginning, a sentence for each check; empty: nothing does.

    Every check before a session that blocks must have passed, or have been skipped with a reason; of several reports
    the last one counts. A session in debug mode is hindered by none.
    """
    if purpose == "debug":
        return []
    last = {report.id: report for report in reports}
    problems: list[str] = []
    for check in study.checks:
        if check.when != "before" or not check.blocks:
            continue
        report = last.get(check.id)
        if report is None:
            problems.append(f"{check.id}: has not been looked at ({check_text(check)})")
        elif report.result == "failed":
            problems.append(f"{check.id}: failed, {report.reason or check_text(check)}")
        elif report.result == "skipped" and (problem := skip_problem(check, purpose, report.reason)):
            problems.append(problem)
    return problems


def due_after_checks(study: Study, sessions: Iterable[SessionEntry], entries: Iterable[CheckedEntry]) -> list[str]:
    """What nobody has looked at after a session that counts, a sentence for each. It is only said: no data is lost."""
    after = [check for check in study.checks if check.when == "after"]
    made = {(entry.session, entry.id) for entry in entries if entry.when == "after" and entry.result != "failed"}
    return [
        f"{session.participant}, session {session.folder}: {check_text(check)} ({check.id}) is not confirmed yet"
        for session in sessions
        if session.status == "ended" and session.purpose == "counted"
        for check in after
        if (session.folder, check.id) not in made
    ]
