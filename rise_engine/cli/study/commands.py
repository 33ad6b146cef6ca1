"""`rise-engine study`: the commands of a study, each from its module."""

from __future__ import annotations

import click

from rise_engine.cli.lazy_group import LazyGroup

STUDY = {
    "bundle": ("rise_engine.cli.data.bundle:bundle", "Put a study into one folder or zip file for others."),
    "check": ("rise_engine.cli.study.planning:check", "Report everything that is wrong with a study."),
    "exclude": ("rise_engine.cli.study.day:exclude", "Exclude a participant; the next one gets their row."),
    "new": ("rise_engine.cli.study.new:new", "Make a study: ask what it is about."),
    "next": ("rise_engine.cli.study.day:next_participant", "Show who is next, and how their session begins."),
    "outcome": ("rise_engine.cli.study.day:outcome", "Record how a session counts."),
    "plan": ("rise_engine.cli.study.planning:plan", "Make the plan, once, and print its balance."),
    "reassign": ("rise_engine.cli.study.day:reassign", "Give a session to the participant who took part."),
    "status": ("rise_engine.cli.study.day:status", "Show participants, cells and what is left to do."),
    "withdraw": ("rise_engine.cli.study.withdraw:withdraw", "Erase everything about a participant."),
}
"""Every command of `rise-engine study`: its place, and its line of the help."""


@click.group("study", cls=LazyGroup, sections={"Commands": STUDY})
def study() -> None:
    """Make, check and run a study: a folder with study.toml (docs/reference/study.md)."""
