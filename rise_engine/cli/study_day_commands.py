"""`rise-engine study status|next|exclude|outcome|reassign`: how a study stands, and what people say of its sessions."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import click

from rise_engine import exit_status
from rise_engine.checks import CheckContext
from rise_engine.cli.options import JSON
from rise_engine.cli.study_checks import (
    CheckOptions,
    ChecksRefused,
    check_options,
    gather_check_reports,
    read_check_options,
)
from rise_engine.cli.study_planning import resolve_study_folder
from rise_engine.cli.study_status import next_json, next_lines, status_json, status_lines
from rise_engine.cli.terminal import write_json
from rise_engine.kernel.records import OutcomeStatus
from rise_engine.study.judge import CannotJudge, exclude_participant, judge_session, reassign_session, session_to_judge
from rise_engine.study.state import OpenStudy, StudyUnusable, read_state
from rise_engine.study.study_log import StudyLogError

_STUDY = click.argument("study", metavar="STUDY", type=click.Path())
_STUDY_OR_HERE = click.argument("study", metavar="STUDY", default=".", type=click.Path())


def _carry_out(action: Callable[[Path], int], study: str) -> int:
    """Do something with a study's folder; the exit status, after sentences about what went wrong."""
    try:
        return action(resolve_study_folder(study).absolute())
    except StudyUnusable as error:
        lines, code = error.lines, exit_status.REFUSED
    except ChecksRefused as error:
        lines, code = [f"error: {line}" for line in error.lines], exit_status.REFUSED
    except CannotJudge as error:
        lines, code = [f"error: {line}" for line in str(error).splitlines()], exit_status.REFUSED
    except StudyLogError as error:
        lines, code = [f"error: {error}"], exit_status.NOT_WRITTEN
    for line in lines:
        print(line, file=sys.stderr)
    return code


@click.command("status")
@_STUDY_OR_HERE
@JSON
def status(study: str, as_json: bool) -> None:
    """Say how STUDY (this folder, if none is given) stands: participants, cells, who is next, what somebody must do.

    Nothing is written. Exit status: 0; 1 when a file of the study has errors.
    """

    def show(folder: Path) -> int:
        state = read_state(folder)
        if as_json:
            write_json(status_json(state))
        else:
            print("\n".join(status_lines(state)))
        return exit_status.OK

    sys.exit(_carry_out(show, study))


@click.command("next")
@_STUDY_OR_HERE
@JSON
def next_participant(study: str, as_json: bool) -> None:
    """Say who of STUDY (this folder, if none is given) is next, and with which command their session begins.

    Exit status: 0; 1 when nobody can begin, or a file of the study has errors.
    """

    def show(folder: Path) -> int:
        state = read_state(folder)
        if as_json:
            write_json(next_json(state))
        else:
            print("\n".join(next_lines(state)))
        return exit_status.OK if state.standing.next else exit_status.REFUSED

    sys.exit(_carry_out(show, study))


@click.command("exclude")
@_STUDY
@click.argument("participant")
@click.argument("reason")
def exclude(study: str, participant: str, reason: str) -> None:
    """Exclude PARTICIPANT: they do not count, and their row of the plan goes to the next of their stratum.

    Exit status: 0; 1 when that cannot be; 74 when it cannot be written.
    """

    def carry_out(folder: Path) -> int:
        with OpenStudy(folder) as open:
            slot = exclude_participant(open, participant, reason)
        print(f"{participant} is excluded" + (f"; slot {slot} is free" if slot is not None else ""))
        return exit_status.OK

    sys.exit(_carry_out(carry_out, study))


@click.command("reassign")
@_STUDY
@click.argument("session", metavar="SESSION")
@click.argument("participant")
@click.option("--reason", metavar="TEXT", default="", help="Why; needed.")
def reassign(study: str, session: str, participant: str, reason: str) -> None:
    """Give SESSION (its folder's name), which was run under the wrong participant, to PARTICIPANT, who heard it.

    Its row of the plan goes with it, if nobody has done anything else in it. Its own record stays as it is; study.jsonl
    says whose it is, and everything else follows. Exit status: 0; 1 when that cannot be; 74 when it cannot be written.
    """

    def carry_out(folder: Path) -> int:
        with OpenStudy(folder) as open:
            moved = reassign_session(open, Path(session).name, participant, reason)
        row = f", with row {moved.slot} of the plan" if moved.slot is not None else ""
        print(f"{Path(session).name} is {moved.participant}'s session now, and not {moved.was}'s{row}")
        return exit_status.OK

    sys.exit(_carry_out(carry_out, study))


@click.command("outcome")
@_STUDY
@click.argument("participant")
@click.argument("status", type=click.Choice(["complete", "aborted", "excluded"]))
@click.option("--reason", metavar="TEXT", default="", help="Why; needed for aborted and excluded.")
@click.option(
    "--session", metavar="FOLDER", default="", help="Another session than the one without outcome or the last."
)
@click.option(
    "--here", is_flag=True, help="Also of one that another computer had last, where nobody sees if it still has."
)
@check_options
def outcome(
    study: str,
    participant: str,
    status: OutcomeStatus,
    reason: str,
    session: str,
    here: bool,
    confirmed: tuple[str, ...],
    skipped: tuple[str, ...],
) -> None:
    """Say how a session of PARTICIPANT counts that ended without outcome, or did not end because its engine has gone.

    With a reason, also how their last session counts that was judged wrongly. Then the study's checks after a session
    are made; with --confirm or --skip-check also those of one that counts so already. Exit status: 0; 1 when that
    cannot be; 74 when it cannot be written.
    """

    def carry_out(folder: Path) -> int:
        options = CheckOptions(confirmed, skipped)
        read_check_options(read_state(folder).study, "counted", options, "after")
        with OpenStudy(folder) as open:
            state = open.state
            judged = session_to_judge(state, participant, session)
            if judged.entry.outcome != status or options == CheckOptions():
                judged = judge_session(open, participant, status, reason, session=session, here=here)
                print(f"{judged.name}: {status}")
        entry = judged.entry
        context = CheckContext(state.study, participant, "", state.study.mode, run=entry.run, session=judged.name)
        gather_check_reports(context, options, "after")
        return exit_status.OK

    sys.exit(_carry_out(carry_out, study))
