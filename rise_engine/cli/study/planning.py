"""`rise-engine study check` and `study plan`: the errors of a study, and its plan."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from shlex import quote
from typing import Any

import click

from rise_engine.base.errors import FileError
from rise_engine.base.exit_status import OK, REFUSED
from rise_engine.base.text import pluralize
from rise_engine.checks.kinds import StudyExploration, check_kinds
from rise_engine.cli.options import JSON, STUDY_OR_HERE
from rise_engine.cli.scenario.loading import diagnostic_row
from rise_engine.cli.terminal import Refused, exit_with_usage, print_lines, print_notes, write_json
from rise_engine.study.model import Study
from rise_engine.study.participants import load_participants, session_kinds
from rise_engine.study.plan import cells, runs
from rise_engine.study.planning import last_planned, plan_study
from rise_engine.study.proof import ProvedSession, compared_files, prove_sessions
from rise_engine.study.review import StudyReview, review_study
from rise_engine.study.state import StudyStatus, read_state
from rise_engine.study.study_log import StudyLogError, read_log
from rise_engine.study.study_toml import STUDY_FILE, load_study

_PROBLEMS = (
    "no plan is made while sessions have problems. Correct them, or give a reason for making the plan anyway: "
    "rise-engine study plan --anyway REASON"
)


def explore_study(review: StudyReview) -> StudyExploration | None:
    """Explore and play every kind of session; None: the study has errors.

    :param review: the current review of the study.
    """
    if review.study is None or review.errors:
        return None
    kinds = session_kinds(review.study, review.participants, review.scenarios)
    shown = sys.stderr.isatty()
    return check_kinds(review.study, kinds, lambda sentence: print_notes(sentence) if shown else None)


def exploration_lines(exploration: StudyExploration | None) -> Iterator[str]:
    """Yield problems, warnings and keys that can be lost, a line each, and a summary; none for a study with errors.

    A wizard's key about the participant is often the datum itself.
    """
    if exploration is None:
        return
    for each in exploration.findings:
        finding = each.finding
        if finding.level != "remark" or finding.kind == "lost-key":
            place = f"{finding.place}: " if finding.place else ""
            yield f"{place}{finding.level} {finding.kind}: {finding.text} {each.where}".rstrip()
    yield exploration.sentence


@click.command()
@STUDY_OR_HERE
@click.option(
    "--sessions", is_flag=True, help="Prove every session: replay it, and compare its entries with the result."
)
@JSON
def check(study: Path, sessions: bool, as_json: bool) -> int:
    """Report everything that is wrong with the study in the folder STUDY (default: this folder).

    It checks study.toml, participants.csv, plan.csv and every scenario. It compares the plan with the one that was
    made, and session.toml and study.jsonl with each session's journal. Without errors, it explores and plays every kind
    of session, each condition in each language, for a few seconds, and keeps the result.

    Exit status: 0 no errors (there may be warnings); 1 errors, a problem in some kind of session, or a session that is
    not proved; 2 there is no study.
    """
    review = review_study(study)
    errors = len(review.errors)
    exploration = explore_study(review)
    problems = exploration.problems if exploration is not None else 0
    warnings = len(review.diagnostics) - errors
    if as_json:
        shown = list(prove_sessions(study, _state_of(study))) if sessions else []
        write_json(
            {
                "errors": errors,
                "warnings": warnings,
                "findings": [diagnostic_row(diagnostic) for diagnostic in review.diagnostics],
                "not_looked_at": list(review.omitted),
                **({"explored": exploration.row()} if exploration is not None else {}),
                **({"sessions": [proof_row(each) for each in shown]} if sessions else {}),
            }
        )
        return OK if not errors and not problems and all(each.proved for each in shown) else REFUSED
    print_lines(*review.diagnostics)
    for name in review.omitted:
        print_lines(f"{name} was not checked: {STUDY_FILE} describes it, and has errors")
    found = (
        f"{pluralize(errors, 'error')}, {pluralize(warnings, 'warning')}"
        if review.diagnostics
        else "no errors or warnings"
    )
    found += " in the files" * bool(exploration is not None and exploration.findings)
    print_lines(f"{found}{f' ({_contents_text(review.study, review)})' if review.study is not None else ''}")
    print_lines(*exploration_lines(exploration))
    is_well = not errors and not problems
    if sessions and not _print_proof(study):
        is_well = False
    if review.study is not None and is_well:
        print_lines(_next_step(review, study))
    return OK if is_well else REFUSED


def _state_of(path: Path) -> StudyStatus | None:
    try:
        return read_state(path)
    except (FileError, StudyLogError):
        return None


def _print_proof(path: Path) -> bool:
    """Print the result for each session as soon as it is known; return whether all are proved."""
    found, state = [], _state_of(path)
    for session in prove_sessions(path, state):
        found.append(session)
        print_lines(*proof_lines(session))
    proved = sum(each.proved for each in found)
    print_lines(
        f"{proved} of {pluralize(len(found), 'session')} proved: the record follows from its inputs, and "
        f"{agreement_text(compared_files(state), found)}",
        *(f"not proved: {each}" for each in NOT_PROVED),
    )
    return proved == len(found)


def _contents_text(study: Study, review: StudyReview) -> str:
    parts = [pluralize(len(study.factors), "factor")]
    if (number := len(cells(study))) > 1:
        parts.append(pluralize(number, "cell"))
    if (number := len(runs(study))) > 1:
        parts.append(f"{number} runs each")
    parts.append(f"{study.n} wanted")
    without = sum(not all(each.consent.get(name) for name in study.consent) for each in review.participants)
    parts.append(
        f"{len(review.participants)} in participants.csv{f', {without} of them without consent' * bool(without)}"
    )
    if review.slots:
        parts.append(f"a plan with {pluralize(len(review.slots), 'slot')}")
    return ", ".join(parts)


def _next_step(review: StudyReview, path: Path) -> str:
    """Return the next step for the user."""
    where = quote(str(path))
    if not review.is_planned:
        return f"next: make the plan   rise-engine study plan {where}"
    if not review.participants:
        return "next: write a line for each participant into participants.csv"
    return f"next: run it           rise-tui --config {where}"


@click.command()
@STUDY_OR_HERE
@click.option("--again", metavar="REASON", help="Make a new plan. study.jsonl keeps the reason.")
@click.option(
    "--anyway", metavar="REASON", help="Make the plan although sessions have problems. study.jsonl keeps the reason."
)
def plan(study: Path, again: str | None, anyway: str | None) -> None:
    """Make the plan of the study in the folder STUDY, once, and print the proof of its balance.

    First, it explores and plays every kind of session, each condition in each language, without a robot. If one has a
    problem, there is no plan. With --again, there is a new plan: taken slots stay with their participants, and all
    other rows are new.

    Exit status: 0; 1 if no plan can be made; 2 if there is no study, or no reason.
    """
    if again is not None and not again.strip():
        exit_with_usage("--again needs a reason: rise-engine study plan --again 'eight more participants'")
    if anyway is not None and not anyway.strip():
        exit_with_usage("--anyway needs a reason: rise-engine study plan --anyway 'that rule ends with the session'")
    loaded = load_study(study)
    if loaded.study is None:
        raise Refused("no plan is made while the study has errors", findings=loaded.diagnostics)
    print_notes(*loaded.diagnostics)
    participants = load_participants(loaded.study).participants
    if again is not None or last_planned(read_log(study)) is None:
        exploration = explore_study(StudyReview(loaded.study, loaded.diagnostics, participants, loaded.scenarios))
        print_lines(*exploration_lines(exploration), "")
        if exploration is not None and exploration.problems and anyway is None:
            raise Refused(_PROBLEMS)
    reason = again.strip() if again is not None else None
    made = plan_study(loaded.study, loaded.scenarios, participants, again=reason, anyway=(anyway or "").strip())
    print_lines(made.sentence, "", *made.balance.lines)


# --- replayed sessions ------------------------------------------------------------------------------------------------


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
    "that times of day are right: only the starts of sessions and the lengths of outages were compared, where there "
    "are dates",
)
"""What replays and comparisons do not prove, even without differences. The second: a line removed from the log."""


def agreement_text(files: Sequence[str], sessions: Iterable[ProvedSession]) -> str:
    """Return which files agree with the sessions, except for the participants of reassigned sessions.

    :param files: from `compared_files`.
    :param sessions: all sessions with their results.

    >>> agreement_text(("session.toml", "study.jsonl"), ())
    'session.toml and study.jsonl say the same of it'
    """
    *others, last = files
    named = f"{', '.join(others)} and {last} say" if others else f"{last} says"
    return f"{named} the same of it{_reassigned_note(sessions)}"


def _reassigned_note(sessions: Iterable[ProvedSession]) -> str:
    """Return the end of a sentence about all sessions: the reassigned ones. Empty: there are none."""
    count = sum(bool(each.note) for each in sessions if each.proved)
    return f", except the participant of {pluralize(count, 'reassigned session')}" if count else ""
