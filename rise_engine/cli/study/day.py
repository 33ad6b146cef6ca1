"""`rise-engine study status|next|exclude|outcome|reassign`: the state of a study, and decisions about its sessions."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import msgspec

from rise_engine.base.exit_status import NOT_WRITTEN, OK, REFUSED
from rise_engine.checks.outcome import CheckContext
from rise_engine.cli.options import CHECK_OPTIONS, HERE, JSON, STUDY, STUDY_OR_HERE, options
from rise_engine.cli.study.checks import CheckOptions, gather_check_reports, read_check_options
from rise_engine.cli.terminal import print_lines, print_notes, refusing, show, table_lines
from rise_engine.kernel.records import OutcomeStatus
from rise_engine.study.begin import BeginRequest, CannotBegin, plan_session
from rise_engine.study.judge import exclude_participant, judge_session, reassign_session, session_to_judge
from rise_engine.study.model import ParticipantStanding, ParticipantState, SessionEntry
from rise_engine.study.standing import when_text
from rise_engine.study.state import OpenStudy, StudyStatus, read_state
from rise_engine.study.study_log import StudyLogError

_log_errors = refusing(NOT_WRITTEN, of=StudyLogError)


@click.command("status")
@STUDY_OR_HERE
@JSON
@_log_errors
def status(study: Path, as_json: bool) -> int:
    """Show the state of STUDY (default: this folder): participants, cells, who is next, and what is left to do.

    It writes nothing. Exit status: 0; 1 if a file of the study has errors, a session was given another label, or a
    withdrawal was interrupted.
    """
    state = read_state(study.absolute())
    show(status_lines(state), status_json(state), as_json=as_json)
    relabelled = any(each.differences for each in state.sessions)
    return REFUSED if relabelled or state.interrupted or state.damaged else OK


@click.command("next")
@STUDY_OR_HERE
@JSON
@_log_errors
def next_participant(study: Path, as_json: bool) -> int:
    """Show who is next in STUDY (default: this folder), and the command that begins their session.

    Exit status: 0; 1 if nobody can begin, or a file of the study has errors.
    """
    state = read_state(study.absolute())
    print_notes(*(f"warning: {each}" for each in (*state.interrupted, *state.damaged)))
    show(next_lines(state), next_json(state), as_json=as_json)
    return OK if state.standing.next else REFUSED


@click.command("exclude")
@STUDY
@click.argument("participant")
@click.argument("reason")
@_log_errors
def exclude(study: Path, participant: str, reason: str) -> None:
    """Exclude PARTICIPANT: they do not count, and the next of their stratum gets their row of the plan.

    Exit status: 0; 1 if this is not possible; 74 if it cannot be written.
    """
    with OpenStudy(study.absolute()) as open:
        slot = exclude_participant(open, participant, reason)
    print_lines(f"{participant} is excluded" + (f"; slot {slot} is free" if slot is not None else ""))


@click.command("reassign")
@STUDY
@click.argument("session", metavar="SESSION")
@click.argument("participant")
@click.option("--reason", metavar="TEXT", default="", help="Give the reason; required.")
@_log_errors
def reassign(study: Path, session: str, participant: str, reason: str) -> None:
    """Give SESSION (its folder's name), which ran under the wrong participant, to PARTICIPANT, who took part in it.

    Its row of the plan moves with it, unless something else was done in that row. Its own record stays unchanged:
    study.jsonl names the right participant, and everything else follows. Exit status: 0; 1 if this is not possible; 74
    if it cannot be written.
    """
    name = Path(session).name
    with OpenStudy(study.absolute()) as open:
        moved = reassign_session(open, name, participant, reason)
    row = f", with row {moved.slot} of the plan" if moved.slot is not None else ""
    print_lines(f"{name} is {moved.participant}'s session now, and not {moved.was}'s{row}")


@click.command("outcome")
@STUDY
@click.argument("participant")
@click.argument("status", type=click.Choice(["complete", "aborted", "excluded"]))
@click.option("--reason", metavar="TEXT", default="", help="Give the reason; required for aborted and excluded.")
@click.option(
    "--session",
    metavar="FOLDER",
    default="",
    help="Choose another session than the one without an outcome or the last.",
)
@HERE
@options(*CHECK_OPTIONS)
@_log_errors
def outcome(
    study: Path,
    participant: str,
    status: OutcomeStatus,
    reason: str,
    session: str,
    here: bool,
    confirmed: tuple[str, ...],
    skipped: tuple[str, ...],
) -> None:
    """Record how a session of PARTICIPANT counts that ended without an outcome, or whose engine has gone.

    With --reason, it also corrects the outcome of their last session. Then it makes the study's checks after a session.
    With --confirm or --skip-check, it also makes those of a session that counts like this already. Exit status: 0; 1 if
    this is not possible; 74 if it cannot be written.
    """
    folder, checks = study.absolute(), CheckOptions(confirmed, skipped)
    read_check_options(read_state(folder).study, "counted", checks, "after")
    with OpenStudy(folder) as open:
        state = open.state
        judged = session_to_judge(state, participant, session)
        if judged.entry.outcome != status or checks == CheckOptions():
            judged = judge_session(open, participant, status, reason, session=session, here=here)
            print_lines(f"{judged.name}: {status}")
    entry = judged.entry
    context = CheckContext(state.study, participant, "", state.study.mode, run=entry.run, session=judged.name)
    gather_check_reports(context, checks, "after")


# --- in words -------------------------------------------------------------------------------------------------------

_STATES: dict[ParticipantState, str] = {
    "no-consent": "no consent",
    "to-judge": "to judge",
    "to-go-on": "in progress",
}
"""Words that differ from the state's name."""


def status_lines(state: StudyStatus) -> list[str]:
    """Describe the study: participants, cells, rehearsals, tasks that are due, and the next participant."""
    study, standing = state.study, state.standing
    lines = [f"{study.title} ({study.id}): {standing.complete} of {standing.wanted} participants are complete", ""]
    strata = study.assignment.strata
    rows = [["", *strata, "state", "slot", "runs", "last session", ""]]
    rows += [_participant_row(each, strata) for each in standing.participants]
    lines += table_lines(rows) if standing.participants else ["  participants.csv has no participants yet"]
    if standing.cells:
        hidden = " (conditions are hidden until a session begins)" if study.assignment.hidden else ""
        lines += ["", f"cells of the plan{hidden}", *table_lines(_cell_rows(state))]
    if standing.rehearsals:
        counts: dict[str, int] = {}
        for each in standing.rehearsals:
            counts[each.purpose] = counts.get(each.purpose, 0) + 1
        lines += ["", "not counted: " + ", ".join(f"{number} {purpose}" for purpose, number in counts.items())]
    if standing.due:
        lines += ["", "to do", *(f"  {each}" for each in standing.due), *_command_lines(state)]
    return [*lines, "", *next_lines(state)]


def _command_lines(state: StudyStatus) -> list[str]:
    """List the commands for some of the tasks that are due."""
    states = {each.state for each in state.standing.participants}
    where = shlex.quote(state.study.folder)
    lines = []
    if "to-judge" in states:
        lines.append(
            f"  how a session counts:  rise-engine study outcome {where} PARTICIPANT complete|aborted|excluded"
        )
    if "unfinished" in states:
        lines.append(
            f"  going on, giving up:   rise-engine serve --study {where} --participant PARTICIPANT --recover|--new"
        )
    return lines


def status_json(state: StudyStatus) -> dict[str, Any]:
    """Return the same as JSON."""
    study = state.study
    built: dict[str, Any] = msgspec.to_builtins(state.standing)
    return {"id": study.id, "title": study.title, "folder": study.folder, "mode": study.mode, **built}


def next_lines(state: StudyStatus) -> list[str]:
    """Return the next participant with the commands for their session, or a sentence that there is none."""
    following = next_json(state)
    if not following["participant"]:
        if state.standing.complete >= state.standing.wanted:
            return ["nobody is next: the study is complete"]
        reasons = [each for each in state.standing.due if each]
        return ["nobody is next" + (f": {reasons[0]}" if reasons else "")]
    where, participant = shlex.quote(state.study.folder), following["participant"]
    return [
        f"next: {following['sentence']}",
        f"  rise-tui --config {where}",
        f"  rise-engine serve --study {where} --participant {participant}",
    ]


def next_json(state: StudyStatus) -> dict[str, Any]:
    """Return the next participant as JSON; `participant` is empty if there is none."""
    name = state.standing.next
    found: dict[str, Any] = {"participant": name, "sentence": "", "run": None, "attempt": None, "slot": None}
    if not name:
        return found
    try:
        plan = plan_session(state, BeginRequest(name, mode="real", checks=None))
    except CannotBegin as error:
        return {**found, "participant": "", "sentence": str(error)}
    standing = next(each for each in state.standing.participants if each.participant == name)
    sentence = f"{name}, run {plan.run.run} of {standing.runs}, slot {plan.slot}"
    if plan.attempt > 1:
        sentence += f", attempt {plan.attempt}"
    if plan.language:
        sentence += f", language {plan.language}"
    if plan.run.condition and not state.study.assignment.hidden:
        sentence += f", condition {plan.run.condition}"
        found["condition"] = plan.run.condition
    return {**found, "sentence": sentence, "run": plan.run.run, "attempt": plan.attempt, "slot": plan.slot}


def _participant_row(standing: ParticipantStanding, strata: Sequence[str]) -> list[str]:
    done = len({each.run for each in standing.sessions if each.outcome == "complete"})
    last = standing.sessions[-1] if standing.sessions else None
    return [
        standing.participant,
        *(standing.strata.get(column, "") for column in strata),
        _STATES.get(standing.state, standing.state),
        "" if standing.slot is None else str(standing.slot),
        f"{done} of {standing.runs}",
        _last_text(last),
        standing.why if standing.state not in ("running", "unfinished", "to-judge") else "",  # the last session has it
    ]


def _last_text(last: SessionEntry | None) -> str:
    if last is None:
        return ""
    attempt = f", attempt {last.attempt}" if last.attempt > 1 else ""
    return f"{when_text(last.started)}, run {last.run}{attempt}, {last.outcome or last.status}"


def _cell_rows(state: StudyStatus) -> list[list[str]]:
    """Make the table of cells, without planned numbers if the sizes of strata are unknown.

    If conditions are hidden, it has only the strata, because the numbers of cells would reveal the next condition.
    """
    cells, hidden = state.standing.cells, state.study.assignment.hidden
    columns = list(cells[0].strata)
    known = not columns and any(each.planned for each in cells)
    counts: dict[tuple[str, ...], list[int]] = {}
    for each in cells:
        name = (*each.strata.values(), *([] if hidden else [each.condition or "(one)"]))
        count = counts.setdefault(name, [0, 0, 0])
        for at, number in enumerate((each.complete, each.open, each.planned)):
            count[at] += number
    rows = [[*columns, *([] if hidden else ["condition"]), "complete", "open", *(["planned"] if known else [])]]
    return rows + [[*name, *map(str, count if known else count[:2])] for name, count in counts.items()]
