"""`rise-engine study bundle`: a study as one folder for others, and what is to be said of it."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import click

from rise_engine.bundle.about import BundleOptions
from rise_engine.bundle.errors import BundleError
from rise_engine.bundle.making import make_bundle
from rise_engine.cli.export import ended_by_signals, select_sessions
from rise_engine.exit_status import OK, REFUSED, USAGE
from rise_engine.export.format import ExportError
from rise_engine.session.errors import SessionError
from rise_engine.session.levels import LEVELS, ExportLevel
from rise_engine.study.state import StudyUnusable, read_state
from rise_engine.study.study_log import StudyLogError
from rise_engine.study.study_toml import STUDY_FILE, is_study
from rise_engine.text import clean, pluralize


@click.command("bundle")
@click.argument("study", metavar="STUDY", default=".", type=click.Path())
@click.option("-o", "--output", metavar="NEW", required=True, type=click.Path(), help="A new folder, or a new .zip.")
@click.option(
    "--level",
    type=click.Choice(LEVELS),
    default="shared",
    show_default=True,
    help="How much is told. shared: for other researchers; public: for everybody; full: for an archive of your own.",
)
@click.option("--private", metavar="KEY", multiple=True, help="A memory key that is private, too. Repeatable.")
@click.option("--license", metavar="NAME", default="", help="What others may do with it: CC-BY-4.0, CC0-1.0, ...")
@click.option("--all", "all_sessions", is_flag=True, help="Also sessions that do not count.")
def bundle(
    study: str, output: str, level: ExportLevel, private: tuple[str, ...], license: str, all_sessions: bool
) -> None:
    """Put everything of STUDY that others need into a new folder or zip file: design, scenarios, sessions that can be
    run again, tables, BIDS, report, the program itself, check sums, and what it is for programs (an RO-Crate).

    Says what is in it, what was left out, and what you should look at before anybody else gets it.

    Exit status: 0; 1 when it cannot be made; 2 when there is no study.
    """
    sys.exit(bundle_report(study, Path(output), BundleOptions(level, private, license.strip()), all=all_sessions))


def bundle_report(named: str, out: Path, options: BundleOptions, *, all: bool = False) -> int:
    """Make a bundle, and say what is to be said of it; the exit status."""
    path = Path(named).parent if Path(named).name == STUDY_FILE else Path(named)
    if not is_study(path):
        _print_error(f"error: {named} is no study: it has no {STUDY_FILE}")
        return USAGE
    try:
        selection = select_sessions([str(path)], all=all)
        with ended_by_signals():
            report = make_bundle(read_state(path.absolute()), selection.folders, out, options, selection.remarks)
    except (BundleError, ExportError, SessionError, StudyUnusable, StudyLogError) as error:
        _print_error(*(f"error: {line}" for line in str(error).splitlines()))
        return REFUSED
    sessions = pluralize(report.sessions, "session")
    _print(
        [
            f"{out}: a bundle of {sessions}, level {options.level}",
            "",
            "in it:",
            *_indent(report.contents),
            "left out:",
            *_indent(report.left_out),
            "look at this before anybody else gets it:",
            *_indent(report.look_at),
            "its fingerprint, for the paper (rise-engine reproduce prints it):",
            f"  {report.fingerprint}",
        ]
    )
    return OK


def _indent(lines: Sequence[str]) -> list[str]:
    return [f"  {line}" for line in lines]


def _print(lines: Sequence[str]) -> None:
    sys.stdout.write("".join(f"{clean(line)}\n" for line in lines))
    sys.stdout.flush()


def _print_error(*lines: str) -> None:
    sys.stderr.write("".join(f"{clean(line)}\n" for line in lines))
