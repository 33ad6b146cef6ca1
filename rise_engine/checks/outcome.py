"""The context and the outcome of a check."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Literal, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.ports.bridge import RosConnection
from rise_engine.scenario.model import Mode
from rise_engine.study.checks import PendingCheck, check_text
from rise_engine.study.model import Purpose, Study, StudyCheck
from rise_engine.study.participants import SessionKind

NO = "somebody answered no"
"""The reason of a question answered with no and without a comment."""


def local_now() -> datetime:
    """Return this computer's time, with its zone."""
    return datetime.now().astimezone()


class CheckContext(Struct, frozen=True):
    """The session for which checks are made."""

    study: Study
    participant: str
    scenario: str
    """The absolute folder of the scenario that will run."""
    mode: Mode
    purpose: Purpose = "counted"
    run: int = 0
    robot: str | None = None
    """A robot instead of the scenario's."""
    wizard: str = ""
    """The wizard's name as consoles give it (`anna`)."""
    ros: RosConnection = RosConnection()
    kind: SessionKind | None = None
    """The kind of the session; None: no session will begin."""
    session: str = ""
    """For a check after a session: the name of its folder."""
    now: Callable[[], datetime] = local_now


class Finding(Struct, frozen=True):
    """The result of an automatic check or a program."""

    passed: bool
    value: str = ""
    """The observation in a few words: `34.1 GB free`."""
    reason: str = ""
    """The reason of the failure, in a sentence that continues the value."""
    question: str = ""
    """A question that a person must confirm before it passes; empty: none."""


OutcomeResult: TypeAlias = Literal["passed", "failed", "skipped", "asked"]


class CheckOutcome(Struct, frozen=True):
    """The outcome of one check."""

    id: str
    text: str
    """The check in words."""
    result: OutcomeResult
    """asked: a person has to answer `question` (`answer_check`)."""
    value: str = ""
    reason: str = ""
    question: str = ""

    @property
    def found(self) -> str:
        """The value and the reason in a line; empty: there is neither."""
        return ": ".join(filter(None, (self.value, self.reason)))


def make_outcome(check: StudyCheck, finding: Finding) -> CheckOutcome:
    """Make the outcome of a check from its finding."""
    result: OutcomeResult = "failed" if not finding.passed else "asked" if finding.question else "passed"
    return CheckOutcome(check.id, check_text(check), result, finding.value, finding.reason, finding.question)


def answer_check(outcome: CheckOutcome, yes: bool, comment: str = "") -> CheckOutcome:
    """Apply a person's answer to a check.

    :param outcome: one with the result `asked`.
    :param yes: whether `question` is true.
    :param comment: with yes, a value (`23 °C`); with no, the reason.
    """
    comment = " ".join(comment.split())
    if yes:
        value = ", ".join(filter(None, (outcome.value, comment)))
        return replace(outcome, result="passed", value=value, question="")
    return replace(outcome, result="failed", reason=comment or NO, question="")


def skipped_check(check: StudyCheck, reason: str, found: CheckOutcome | None = None) -> CheckOutcome:
    """Make the outcome of a check that a person skips. `skip_problem` decides whether this is allowed.

    :param check: the check.
    :param reason: the reason in their words.
    :param found: an earlier outcome, which stays in the record.
    """
    reason = " ".join(reason.split())
    value = ""
    if found is not None and found.result == "failed":
        value = f"failed before: {found.reason or found.value}"
    return CheckOutcome(check.id, check_text(check), "skipped", value, reason)


def kept_check(pending: PendingCheck) -> CheckOutcome:
    """Return the outcome of a check that passed earlier and is still valid."""
    since = datetime.fromisoformat(pending.good_since)
    value = f"good since {since:%Y-%m-%d %H:%M}" + (f": {pending.value}" if pending.value else "")
    return CheckOutcome(pending.check.id, check_text(pending.check), "passed", value)
