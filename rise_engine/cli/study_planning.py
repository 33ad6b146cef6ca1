"""What `rise-engine study check` and `study plan` print."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from shlex import quote

from rise_engine.checks.kinds import StudyLook, look_at_kinds
from rise_engine.cli.arguments import exit_with_usage
from rise_engine.cli.check import diagnostic_row
from rise_engine.cli.proof_text import proof_lines, proof_row
from rise_engine.cli.terminal import write_json
from rise_engine.exit_status import OK, REFUSED
from rise_engine.study.design import cells, runs
from rise_engine.study.model import Study
from rise_engine.study.participants import load_participants
from rise_engine.study.plan_file import PlanError
from rise_engine.study.planning import last_planned, plan_study
from rise_engine.study.proof import ProvedSession, prove_sessions
from rise_engine.study.review import StudyReview, review_study
from rise_engine.study.session_kinds import session_kinds
from rise_engine.study.state import StudyUnusable, read_state
from rise_engine.study.study_log import StudyLogError, read_log
from rise_engine.study.study_toml import STUDY_FILE, is_study, load_study
from rise_engine.text import clean, pluralize

_PROBLEMS = (
    "nothing is planned as long as sessions have problems. Correct them, or say why the plan is made all the same: "
    "rise-engine study plan --anyway REASON"
)


def resolve_study_folder(folder: str) -> Path:
    """The folder of a study, given as itself or as its study.toml; ends the program if it is none."""
    path = Path(folder)
    path = path.parent if path.name == STUDY_FILE else path
    if is_study(path):
        return path
    if path.is_dir():
        problem = f"there is no {STUDY_FILE} in {'this folder' if folder == '.' else folder}"
    else:
        problem = f"there is no folder {folder}"
    return exit_with_usage(f"{problem}; `rise-engine study new DIR` makes a study")


def look_at_study(review: StudyReview) -> StudyLook | None:
    """Explore and play every kind of session; None: the study has errors.

    :param review: of the study, which was read a moment ago.
    """
    if review.study is None or review.errors:
        return None
    kinds = session_kinds(review.study, review.participants, review.scenarios)
    shown = sys.stderr.isatty()
    return look_at_kinds(review.study, kinds, lambda sentence: print(sentence, file=sys.stderr) if shown else None)


def look_lines(look: StudyLook) -> Iterator[str]:
    """Problems and warnings, a line each, and what was looked at."""
    for each in look.findings:
        finding = each.finding
        if finding.level != "remark":
            place = f"{finding.place}: " if finding.place else ""
            yield clean(f"{place}{finding.level} {finding.kind}: {finding.text} {each.where}".rstrip())
    yield look.sentence


def check_report(folder: str, *, sessions: bool = False, as_json: bool) -> int:
    """Print everything that is wrong with a study, and what is to be done next.

    :param folder: the study's.
    :param sessions: prove its sessions, too.
    :param as_json: as one document.
    :return: the exit status, 1 when something is an error, a kind of session has a problem, or a session is not proved.
    """
    path = resolve_study_folder(folder)
    review = review_study(path)
    errors = len(review.errors)
    look = look_at_study(review)
    problems = look.problems if look is not None else 0
    proved = _proved(path) if sessions else iter(())
    warnings = len(review.diagnostics) - errors
    if as_json:
        rows = [diagnostic_row(diagnostic) for diagnostic in review.diagnostics]
        left_out = list(review.left_out)
        shown = list(proved)
        of_sessions = {"sessions": [proof_row(each) for each in shown]} if sessions else {}
        of_kinds = {"explored": look.row()} if look is not None else {}
        write_json(
            {
                "errors": errors,
                "warnings": warnings,
                "findings": rows,
                "not_looked_at": left_out,
                **of_kinds,
                **of_sessions,
            }
        )
        return OK if not errors and not problems and all(each.proved for each in shown) else REFUSED
    for diagnostic in review.diagnostics:
        print(str(diagnostic))
    for name in review.left_out:
        print(f"{name} was not looked at: {STUDY_FILE} says what stands in it, and has errors there")
    found = f"{pluralize(errors, 'error')}, {pluralize(warnings, 'warning')}" if review.diagnostics else "no findings"
    print(f"{found}{f' ({_contents_text(review.study, review)})' if review.study is not None else ''}")
    for line in look_lines(look) if look is not None else ():
        print(line)
    is_proved = _print_proof(proved) if sessions else True
    if review.study is not None and not errors and not problems and is_proved:
        print(_next_step(review, path))
    return OK if not errors and not problems and is_proved else REFUSED


def _proved(path: Path) -> Iterator[ProvedSession]:
    try:
        state = read_state(path)
    except (StudyUnusable, StudyLogError):
        state = None
    return prove_sessions(path, state)


def _print_proof(sessions: Iterator[ProvedSession]) -> bool:
    """Print what is proved of each session, as soon as it is; whether all are."""
    found = []
    for session in sessions:
        found.append(session)
        print("\n".join(clean(line) for line in proof_lines(session)), flush=True)
    proved = sum(each.proved for each in found)
    print(
        f"{proved} of {pluralize(len(found), 'session')} proved: the record comes out of its inputs again, and "
        "session.toml, study.jsonl and plan.csv say the same of it"
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
    """What somebody does next."""
    where = quote(str(path))
    if not review.is_planned:
        return f"next: make the plan   rise-engine study plan {where}"
    if not review.participants:
        return "next: write a line for each participant into participants.csv"
    return f"next: run it           rise-tui --config {where}"


def plan_report(folder: str, *, again: str | None, anyway: str = "") -> int:
    """Make the plan, or a new one, and print what was done and the proof of its balance.

    Before that, every kind of session is explored and played; with a problem in one, there is no plan.

    :param folder: the study's.
    :param again: why there is to be a new one; None: the first.
    :param anyway: why it is made in spite of problems; empty: it is not.
    :return: the exit status, 1 when no plan can be made.
    """
    path = resolve_study_folder(folder)
    loaded = load_study(path)
    for diagnostic in loaded.diagnostics:
        print(str(diagnostic), file=sys.stderr)
    if loaded.study is None:
        print("error: nothing is planned as long as the study has errors", file=sys.stderr)
        return REFUSED
    participants = load_participants(loaded.study).participants
    try:
        if again is not None or last_planned(read_log(path)) is None:
            look = look_at_study(StudyReview(loaded.study, loaded.diagnostics, participants, loaded.scenarios))
            for line in look_lines(look) if look is not None else ():
                print(line)
            print()
            if look is not None and look.problems and not anyway:
                print(f"error: {_PROBLEMS}", file=sys.stderr)
                return REFUSED
        made = plan_study(loaded.study, loaded.scenarios, participants, again=again, anyway=anyway)
    except (PlanError, StudyLogError) as error:
        print(f"error: {error}", file=sys.stderr)
        return REFUSED
    print(made.sentence)
    print()
    for line in made.balance.lines:
        print(line)
    return OK
