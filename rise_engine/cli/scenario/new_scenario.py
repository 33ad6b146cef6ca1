"""The command `new`: makes a new study, as a copy of a shipped one or blank."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from shlex import quote

import click

from rise_engine.base.errors import StudyError
from rise_engine.base.exit_status import OK, REFUSED
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.cli.options import FOLDER_OR_NONE
from rise_engine.cli.terminal import Refused, exit_with_usage, print_lines
from rise_engine.scenario.loader import load
from rise_engine.scenario.reading.robot_profiles import robot_names
from rise_engine.scenario.shipped_studies import (
    copy_study,
    shipped_studies,
    study_lines,
    study_title,
    write_agents_file,
    write_blank_study,
)

BLANK = "blank"


@click.command()
@FOLDER_OR_NONE
@click.option(
    "--template", metavar="NAME", help="Begin with a study that comes with the program (--list), or with `blank`."
)
@click.option("--from", "study", metavar="NAME", help="Begin with this study that comes with the program.")
@click.option("--title", metavar="TEXT", default="", help="Set the title of a blank study. Default: its folder's name.")
@click.option(
    "--robot", metavar="NAME", default="", help="Set the robot of a blank study. Default: generic, simulated."
)
@click.option("--list", "listing", is_flag=True, help="List the studies that come with the program.")
def new(folder: str | None, template: str | None, study: str | None, title: str, robot: str, listing: bool) -> int:
    """Make a study of your own in DIR, a new or empty folder. In a terminal, it asks for what is missing.

    Exit status: 0; 1 if it could not be made; 2 wrong usage.
    """
    if listing:
        lines = study_lines()
        print_lines(*lines or ("no study is installed with the program",))
        return OK if lines else REFUSED
    template = template or study
    if (folder is None or template is None) and sys.stdin.isatty():
        folder, template, title, robot = _ask(folder, template, title, robot)
    if folder is None or template is None:
        exit_with_usage(
            "name a folder and a study, as in: rise-engine new my-study --from lablinking (--list shows all)"
        )
    if template != BLANK:
        if title or robot:
            exit_with_usage("--title and --robot are for --template blank; a copied study has both, in scenario.toml")
        _copy(folder, template)
    else:
        _make_blank(Path(folder), title, robot)
    return OK


def _ask(folder: str | None, template: str | None, title: str, robot: str) -> tuple[str, str, str, str]:
    folder = folder or click.prompt("Folder of the new study", type=str)
    assert folder is not None
    if template is None:
        studies = shipped_studies()
        print_lines("What does it begin as?")
        print_lines(*(f"  {name:<12} {study_title(path)}" for name, path in studies.items()))
        print_lines(f"  {BLANK:<12} nothing but a first act and a first rule")
        template = click.prompt("Begin as", type=click.Choice([*studies, BLANK]), default=BLANK, show_choices=False)
    assert template is not None
    if template == BLANK:
        title = title or click.prompt("Title", default=Path(folder).name)
        robot = robot or click.prompt("Robot (rise-engine robots lists them)", default="generic")
    return folder, template, title, robot


def _copy(folder: str, study: str) -> None:
    """Copy a shipped study, and print the next steps."""
    try:
        number = copy_study(study, Path(folder))
        write_agents_file(Path(folder))
    except StudyError as why:
        hints = () if study in shipped_studies() else (f"  {line}" for line in study_lines())
        raise Refused(str(why), hints=hints) from None
    print_lines(
        f"{folder}: {number} files of the study {study}, which are yours to change",
        f"  check it   rise-engine check {quote(folder)}",
        f"  run it     rise-tui --config {quote(folder)}",
    )
    if (Path(folder) / "README.md").exists():
        print_lines(f"  read       {Path(folder) / 'README.md'}")


def _make_blank(folder: Path, title: str, robot: str) -> None:
    known = list(robot_names(folder))
    if robot and robot not in known:
        exit_with_usage(f"there is no robot `{robot}`{did_you_mean(robot, known)}")
    names = write_blank_study(folder, title or folder.absolute().name, robot or "generic")
    problems = load(folder).errors
    assert not problems, json.dumps([str(each) for each in problems])
    where = quote(str(folder))
    print_lines(
        f"{folder}: a blank study of {len(names)} files, which are yours to change",
        f"  change it  rise-tui edit {where}",
        f"  check it   rise-engine check {where}",
        f"  run it     rise-tui --config {where}",
    )
