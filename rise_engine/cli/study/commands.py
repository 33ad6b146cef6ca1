"""`rise-engine study`: the commands of a study, each from its module."""

from __future__ import annotations

import click

from rise_engine.cli.lazy_group import LazyGroup

STUDY = {
    "bundle": "rise_engine.cli.data.bundle:bundle",
    "check": "rise_engine.cli.study.planning:check",
    "exclude": "rise_engine.cli.study.day:exclude",
    "new": "rise_engine.cli.study.new:new",
    "next": "rise_engine.cli.study.day:next_participant",
    "outcome": "rise_engine.cli.study.day:outcome",
    "plan": "rise_engine.cli.study.planning:plan",
    "reassign": "rise_engine.cli.study.day:reassign",
    "status": "rise_engine.cli.study.day:status",
    "withdraw": "rise_engine.cli.study.withdraw:withdraw",
}
"""Where every command of `rise-engine study` lies, by its name."""


@click.group("study", cls=LazyGroup, places=STUDY)
def study() -> None:
    """Make, check and run a study: a folder with study.toml (docs/reference/study.md)."""


COMMANDS = {"study": study}
