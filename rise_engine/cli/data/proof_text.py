"""Results of replayed sessions as lines and as JSON, for `reproduce` and `study check --sessions`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from rise_engine.base.text import pluralize
from rise_engine.study.proof import ProvedSession


def proof_lines(session: ProvedSession) -> list[str]:
    """Describe the result for one session."""
    found = session.comparison
    if found is None:
        first, *others = session.problems
        return [f"{session.name}: not proved: {first}", *(f"  {each}" for each in others)]
    others = [f"{session.name}: {each}" for each in (session.note, *session.problems) if each]
    if found.identical:
        inputs, records = pluralize(found.inputs, "input"), pluralize(found.records, "record")
        return [f"{session.name}: identical ({inputs}, {records}, {found.seconds:.1f} s)", *others]
    return [f"{session.name}: different: {found.why}", *others]


def proof_row(session: ProvedSession) -> dict[str, Any]:
    """Return the same as JSON."""
    found = session.comparison
    row: dict[str, Any] = {
        "session": session.name,
        "identical": session.identical,
        "proved": session.proved,
        "problems": list(session.problems),
        "note": session.note,
    }
    if found is not None:
        row |= {
            "inputs": found.inputs,
            "records": found.records,
            "seconds": found.seconds,
            "difference": found.difference,
            "damaged": [{"line": line, "reason": why} for line, why in found.damaged.items()],
            "missing": found.missing,
        }
    return row


NOT_PROVED = (
    "that participants.csv, questionnaires, coded.json (annotations) and media.json (recordings) hold what people "
    "gave: nothing else records it",
    "that study.jsonl has everything that people decided after a session: no session has a copy of it",
    "that times of day are right: only when sessions began and how long outages lasted were compared, where there are "
    "dates",
)
"""What replays and comparisons leave open, also when nothing differs. The second: a line removed from the log."""


def agreement_text(files: Sequence[str], sessions: Iterable[ProvedSession]) -> str:
    """Say which files agree with the sessions, except for the participants of reassigned sessions.

    :param files: from `compared_files`.
    :param sessions: all sessions with their results.

    >>> agreement_text(("session.toml", "study.jsonl"), ())
    'session.toml and study.jsonl say the same of it'
    """
    *others, last = files
    named = f"{', '.join(others)} and {last} say" if others else f"{last} says"
    return f"{named} the same of it{_except_reassigned(sessions)}"


def _except_reassigned(sessions: Iterable[ProvedSession]) -> str:
    """End a sentence about all sessions with those that the log has reassigned. Empty: there are none."""
    count = sum(bool(each.note) for each in sessions if each.proved)
    return f", except the participant of {pluralize(count, 'reassigned session')}" if count else ""
