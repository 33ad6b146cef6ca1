"""`rise-engine study withdraw`: the deletion of all data of a participant."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import click

from rise_engine.base.exit_status import OK, PARTIAL
from rise_engine.base.text import pluralize
from rise_engine.cli.terminal import Refused, exit_with_usage, print_lines
from rise_engine.results.export.session_tables import rows_to_keep
from rise_engine.study.labels import Reassignment, reassignments
from rise_engine.study.study_log import LOG_FILE, WITHDRAWN_PREFIX, read_log
from rise_engine.study.traces import KEPT_FILE, STUDY_FILE
from rise_engine.study.withdrawal import plan_withdrawal
from rise_engine.study.withdrawal import withdraw as withdraw_participant
from rise_engine.study.withdrawal_work import WithdrawalPlan


@click.command("withdraw")
@click.argument("folder", metavar="STUDY", type=click.Path())
@click.argument("participant", metavar="PARTICIPANT")
@click.option("--yes", is_flag=True, help="Do not ask. You cannot undo this.")
@click.option(
    "--keep-anonymous",
    is_flag=True,
    help="Keep numbers about their sessions under a new id, because they agreed (consent_anonymous).",
)
def withdraw(folder: str, participant: str, yes: bool, keep_anonymous: bool) -> int:
    """Erase everything about PARTICIPANT from STUDY, because they have withdrawn their consent.

    It erases their session folders, the recordings that these have registered, and what `export -o` made of them. In
    study.jsonl, a salted hash replaces the pseudonym, and their slot becomes free. It lists what it cannot reach. You
    cannot undo this. If it was interrupted, run it again.

    With --keep-anonymous, anonymous.csv keeps a row for each of their sessions that counts: condition, duration,
    numbers of acts, answer times; no date, no slot, no words. This needs a date in consent_anonymous for them in
    participants.csv.

    Exit status: 0 done; 1 refused, something known was not erased, or the study's folder still names them; 2 wrong
    usage.
    """
    study = Path(folder)
    if not ((study / STUDY_FILE).is_file() or (study / LOG_FILE).is_file()):
        exit_with_usage(f"{folder} is not a study: it has no {STUDY_FILE}")
    plan = plan_withdrawal(study, participant)
    keep = rows_to_keep(study, participant, plan.sessions) if keep_anonymous else []
    print_lines(*_plan_lines(plan, reassignments(read_log(study))))
    if keep:
        print_lines(f"{pluralize(len(keep), 'row')} of numbers stay in {KEPT_FILE}, as {keep[0]['id']}")
    if not yes:
        _ask(participant)
    slot = _slot_afterwards(study, participant)
    report = withdraw_participant(study, participant, keep=keep)
    erased = f"{participant} has withdrawn: {pluralize(len(report.erased), 'thing')} erased"
    lines = [f"{erased}; {slot}" if slot else erased]
    if report.make_again:
        lines += ["exports that held others too are erased; make them again:", *_indent(report.make_again)]
    if report.remains:
        lines += ["still named in the study's folder:", *_indent(report.remains)]
    if report.unreached:
        lines += ["not erased; you must see to it:", *_indent(report.unreached)]
    lines += ["what this program cannot reach; you must see to it:", *_indent(report.beyond)]
    print_lines(*lines)
    return PARTIAL if report.remains or report.unreached else OK


def _slot_afterwards(study: Path, participant: str) -> str:
    """Return what happens to the slot of a participant who withdraws; empty: they have none."""
    taken = [entry for entry in read_log(study) if entry.kind == "taken"]
    takers = {entry.get("slot"): entry.get("participant") for entry in taken}
    theirs = [entry.get("slot") for entry in taken if entry.get("participant") == participant]
    if not theirs:
        return ""
    holder = str(takers[theirs[-1]])
    if holder == participant:
        return "their slot is free"
    stays = "is free" if holder.startswith(WITHDRAWN_PREFIX) else f"stays with {holder}"
    return f"slot {theirs[-1]}, which they had, {stays}"


def _plan_lines(plan: WithdrawalPlan, moved: Mapping[str, Reassignment]) -> list[str]:
    lines = [f"this will be erased about {plan.participant}, and cannot be restored:"]
    lines += _indent(
        [f"session {name}" + (f", {moved[name].sentence}" if name in moved else "") for name in plan.sessions]
    )
    lines += _indent([f"recording {path}" for path in plan.recordings])
    for path, others in plan.exports.items():
        what = "export folder, with everything in it:" if path in plan.export_folders else "export"
        lines += _indent([f"{what} {path}" + (f", which also holds {', '.join(others)}" if others else "")])
    return [*lines, *_indent(["what study.jsonl says about them, except a salted hash"])]


def _ask(participant: str) -> None:
    """End the command unless the user types the pseudonym."""
    if not sys.stdin.isatty():
        exit_with_usage("without a terminal, use --yes to do it. Nothing was erased")
    typed = click.prompt("To do it, type the pseudonym", default="", show_default=False)
    if typed.strip() != participant:
        raise Refused("that is another pseudonym; nothing was erased")


def _indent(lines: Sequence[str]) -> list[str]:
    return [f"  {line}" for line in lines]
