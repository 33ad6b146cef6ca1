"""The checks of a study before and after each session (docs/how-to/check-before-a-session.md).

    for pending in pending_checks(study, "before", read_log(folder), now):
        outcome = kept_check(pending) if pending.good_since else await run_check(pending.check, context)
        if outcome.result == "asked":
            outcome = answer_check(outcome, yes=ask_somebody(outcome.question))

Consoles and commands only show and ask. What a check does, and what its result means, is defined here.
"""

from __future__ import annotations

from rise_engine.checks.outcome import (
    CheckContext,
    CheckOutcome,
    Finding,
    answer_check,
    kept_check,
    skipped_check,
)
from rise_engine.checks.runner import append_checked, limit_seconds, report_check, run_check
from rise_engine.study.checks import (
    AUTOMATIC,
    PendingCheck,
    check_text,
    due_after_checks,
    pending_checks,
    program_problem,
    skip_problem,
)

__all__ = [
    "AUTOMATIC",
    "CheckContext",
    "CheckOutcome",
    "Finding",
    "PendingCheck",
    "answer_check",
    "append_checked",
    "check_text",
    "due_after_checks",
    "kept_check",
    "limit_seconds",
    "pending_checks",
    "program_problem",
    "report_check",
    "run_check",
    "skip_problem",
    "skipped_check",
]
