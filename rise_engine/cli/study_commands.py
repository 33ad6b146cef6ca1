"""The commands of a study: `rise-engine study new`, `check`, `plan`, ... Each is a function here, and in `STUDY`."""

from __future__ import annotations

import sys
from typing import Any

import click

from rise_engine.cli.arguments import exit_with_usage
from rise_engine.cli.bundle import bundle
from rise_engine.cli.options import JSON, MODE
from rise_engine.cli.study_day_commands import exclude, next_participant, outcome, reassign, status
from rise_engine.cli.study_new import USUAL_CHECKS, NewStudyOptions, new_report
from rise_engine.cli.study_planning import check_report, plan_report
from rise_engine.cli.withdraw import withdraw
from rise_engine.scenario.model import Mode
from rise_engine.study.study_toml import MAX_SEED

STUDY_FOLDER = click.argument("folder", metavar="STUDY", default=".", type=click.Path())


@click.command()
@STUDY_FOLDER
@click.option("--sessions", is_flag=True, help="Prove every session: replay it, and compare what is said of it.")
@JSON
def check(folder: str, sessions: bool, as_json: bool) -> None:
    """Say everything that is wrong with the study in the folder STUDY (this one, if none is given).

    study.toml, participants.csv, plan.csv, every scenario, and whether the plan is still the one that was made; also
    whether session.toml and study.jsonl say of each session what its journal says. Without errors, every kind of
    session, each condition in each language, is explored and played for a few seconds; what came of it is kept.

    Exit status: 0 without errors (warnings may be there), 1 with errors, with a problem in some kind of session, or
    with a session that is not proved, 2 when there is no study.
    """
    sys.exit(check_report(folder, sessions=sessions, as_json=as_json))


@click.command()
@STUDY_FOLDER
@click.option("--again", metavar="REASON", help="Make a new plan; study.jsonl keeps the reason.")
@click.option("--anyway", metavar="REASON", help="Plan although sessions have problems; study.jsonl keeps the reason.")
def plan(folder: str, again: str | None, anyway: str | None) -> None:
    """Make the plan of the study in the folder STUDY, once, and print the proof of its balance.

    Before that, every kind of session, each condition in each language, is explored and played without a robot. With a
    problem in one, there is no plan. With --again, there is a new plan: whoever holds a slot keeps it, and all other
    rows are made anew.

    Exit status: 0; 1 when no plan can be made; 2 when there is no study, or without a reason.
    """
    if again is not None and not again.strip():
        exit_with_usage("--again needs a reason: rise-engine study plan --again 'eight more participants'")
    if anyway is not None and not anyway.strip():
        exit_with_usage("--anyway needs a reason: rise-engine study plan --anyway 'that rule ends with the session'")
    reason = again.strip() if again is not None else None
    sys.exit(plan_report(folder, again=reason, anyway=(anyway or "").strip()))


@click.command()
@click.argument("folder", metavar="STUDY", type=click.Path())
@click.option("--title", metavar="TEXT", help="What the study is called.")
@click.option("--id", metavar="WORD", help="Its short name: letters and digits.")
@click.option("--scenario", metavar="NAME|DIR", help="The scenario that is copied: a shipped one, or a path.")
@click.option("--n", metavar="N", help="Complete participants that are wanted.")
@MODE
@click.option("--robot", metavar="NAME", default="", help="Another robot profile than the scenario's.")
@click.option("--seed", type=click.IntRange(0, MAX_SEED), metavar="N", help="Of the plan. Without: drawn.")
@click.option("--factor", "factors", metavar="NAME=KIND", multiple=True, help="noise=between, or within. Repeatable.")
@click.option(
    "--level",
    "levels",
    metavar="FACTOR.LEVEL=SETS",
    multiple=True,
    help="'noise.loud=noise = true', or 'noise.loud=scenario DIR'. Repeatable.",
)
@click.option("--label-only", metavar="FACTOR", multiple=True, help="What differs in it is done by people. Repeatable.")
@click.option("--stratum", "strata", metavar="NAME=A,B", multiple=True, help="language=de,en. Repeatable.")
@click.option("--consent", metavar="A,B", help="What must be consented to; - for nothing. Default: study.")
@click.option("--auto", "automatic", metavar="A,B", help=f"Automatic checks; - for none. Default: {USUAL_CHECKS}.")
@click.option("--ask", "asked", metavar="SENTENCE", multiple=True, help="To be confirmed before a session. Repeatable.")
@click.option(
    "--ask-after",
    "asked_after",
    metavar="SENTENCE",
    multiple=True,
    help="The same after it; - for nothing. Repeatable.",
)
@click.option("--hidden", is_flag=True, help="Screens show the condition only when the session begins.")
@click.option("--yes", is_flag=True, help="Ask nothing: what no option says is as usual.")
def new(folder: str, mode: Mode | None, **options: Any) -> None:
    """Make a study in the new or empty folder STUDY: asks what it is about, and writes study.toml with comments.

    Exit status: 0; 1 when it could not be made; 2 wrong usage; 130 when it was broken off. Nothing is left half made.
    """
    sys.exit(new_report(folder, NewStudyOptions(mode=mode or "real", **options)))


STUDY: dict[str, click.Command] = {
    "bundle": bundle,
    "check": check,
    "exclude": exclude,
    "new": new,
    "next": next_participant,
    "outcome": outcome,
    "plan": plan,
    "reassign": reassign,
    "status": status,
    "withdraw": withdraw,
}
"""Every command of `rise-engine study`, by its name."""


@click.group("study", commands=STUDY)
def study() -> None:
    """Make, check and run a study: a folder with study.toml (docs/reference/study.md)."""


COMMANDS = {"study": study}
