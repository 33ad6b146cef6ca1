"""`rise-engine study`: the commands of a study, each from its module."""

from __future__ import annotations

import click

from rise_engine.cli.data.bundle import bundle
from rise_engine.cli.study.day import exclude, next_participant, outcome, reassign, status
from rise_engine.cli.study.new import new
from rise_engine.cli.study.planning import check, plan
from rise_engine.cli.study.withdraw import withdraw

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
