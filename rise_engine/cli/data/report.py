"""`rise-engine report`: a summary of a session or a study, in the terminal or as one HTML file."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Collection
from contextlib import AbstractContextManager, ExitStack
from functools import partial
from pathlib import Path

import click

from rise_engine.base.exit_status import OK, PARTIAL, USAGE
from rise_engine.cli.data.export import LEVEL, select_sessions
from rise_engine.cli.options import PRIVATE, without_file
from rise_engine.cli.terminal import exit_with_usage, print_lines, print_notes, refusing
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.writing import NewExport, new_export
from rise_engine.results.report.making import MadeReport, make_session_report, make_study_report, report_folders
from rise_engine.results.report.page import WIDTH, page_text, text_lines
from rise_engine.study.state import read_state
from rise_engine.study.study_toml import STUDY_FILE, is_study

WIDEST = 100
"""Maximum columns of a report in a terminal."""


@click.command()
@click.argument("named", metavar="SESSION|STUDY", type=click.Path())
@click.option(
    "-o", "--output", metavar="FILE.html", type=click.Path(), help="Write a new HTML file. Default: print text."
)
@click.option(
    "--sheet", metavar="FILE.md", type=click.Path(), help="For a study, write its reporting sheet to a new file."
)
@LEVEL
@PRIVATE
@click.option("--conditions", is_flag=True, help="Show the conditions of a study that hides them and is not complete.")
@refusing(USAGE)
def report(
    named: str,
    output: str | None,
    sheet: str | None,
    level: ExportLevel,
    private: tuple[str, ...],
    conditions: bool,
) -> int:
    """Summarize a SESSION or a STUDY: how long participants waited, what the wizard and the robot did, and what went
    wrong. For a study, it also compares the plan with what happened, and makes the reporting sheet.

    SESSION is a session's folder, or its name in the sessions folder ($RISE_SESSIONS, or ~/rise-sessions). With -o, the
    report is one HTML file with drawings, which needs no other file and no network. Otherwise it is printed as text.
    Existing files are never overwritten.

    Exit status: 0; 1 if something could not be read, and the rest was reported; 2 if nothing was.
    """
    path, damaged = without_file(named, STUDY_FILE), list[str]()
    if is_study(path):
        state = read_state(path)
        folders, people = report_folders(state), {path.resolve(): state.pseudonyms}
        make = partial(make_study_report, path, level, private, conditions=conditions)
    elif sheet is not None or conditions:
        exit_with_usage(f"--{'sheet' if sheet is not None else 'conditions'} is for a study, and {named} is none")
    else:
        selection = select_sessions([named])
        folders, people = selection.folders[:1], {}
        damaged = selection.problems
        make = partial(make_session_report, folders[0], level, private)
    new_file = partial(new_export, folders=folders, level=level, people=people)
    made, written = _write(make, folders, output, sheet, new_file)
    problems = (*damaged, *made.problems)
    print_notes(*(f"warning: {problem}" for problem in problems), *written)
    return PARTIAL if problems else OK


def _write(
    make: Callable[[], MadeReport],
    folders: Collection[Path],
    output: str | None,
    sheet: str | None,
    new_file: Callable[..., AbstractContextManager[NewExport]],
) -> tuple[MadeReport, list[str]]:
    """Make a report and write the requested files, or print it; return it with sentences about the files."""
    notes: list[str] = []
    with ExitStack() as files:  # both, or none
        exports = {
            kind: files.enter_context(new_file(Path(name), format=kind))
            for name, kind in ((output, "report"), (sheet, "sheet"))
            if name is not None
        }
        made = make()
        if exports and (later := {*made.folders} - {*folders}):
            raise ExportError(f"{min(later).name} has ended while this was made, so make it again")
        for kind, export in exports.items():
            export.here.write_text(page_text(made.document) if kind == "report" else made.sheet, "utf-8")
            notes += [f"warning: {each}" for each in export.problems]
            notes.append(f"the {kind} is in {output if kind == 'report' else sheet}")
    if not notes:
        print_lines(*text_lines(made.document, _width()))
    return made, notes


def _width() -> int:
    return min(WIDEST, shutil.get_terminal_size((WIDTH, 24)).columns) if sys.stdout.isatty() else WIDTH
