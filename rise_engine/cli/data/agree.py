"""`rise-engine agree`: how far wizards agree who answered the same cues."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

import click
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import OK, PARTIAL, USAGE
from rise_engine.base.text import clean, pluralize
from rise_engine.cli.data.agreement_text import agreement_csv, agreement_json, agreement_text
from rise_engine.cli.data.export import level_option, select_sessions
from rise_engine.cli.options import ALL_SESSIONS, STUDIES_OR_SESSIONS
from rise_engine.cli.terminal import json_document, print_notes, refusing, write_bytes
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.judged_cues import JudgedSession, judge_session, wizards_of
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.analysis.wizard_agreement import AgreementReport, compare_wizards
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.writing import new_export
from rise_engine.session.shadow import shadow_files
from rise_engine.study.traces import study_of_session, wizard_names

Form: TypeAlias = Literal["text", "json", "csv"]


@click.command()
@STUDIES_OR_SESSIONS
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json", "csv"]),
    default="text",
    show_default=True,
    help="Choose the format.",
)
@click.option(
    "-o", "--output", metavar="NEW", type=click.Path(), help="Write to this new file. Default: standard output."
)
@level_option(
    "full", "Choose how much to include. Below full, wizards have names from the study's [wizards], or W1, W2, ..."
)
@ALL_SESSIONS
@refusing(USAGE)
def agree(named: tuple[str, ...], form: Form, output: str | None, level: ExportLevel, all_sessions: bool) -> int:
    """Compare the wizard of each session with the wizards who answered its cues afterwards (rise-tui --shadow).

    It compares cue by cue, with percent agreement, Cohen's kappa, Krippendorff's alpha and the ICC of latencies. It
    also compares the marks for mistakes, if two wizards set any.

    Exit status: 0; 1 if something could not be read, and the rest was compared; 2 if nothing was.
    """
    problems: list[str] = []
    selection = select_sessions(named, all=all_sessions)
    print_notes(*(f"note: {remark}" for remark in selection.remarks))
    folders = [folder for folder in selection.folders if shadow_files(folder)]
    if not folders:
        raise ExportError(
            "nobody has judged a session of these yet: rise-tui --shadow SESSION plays its cues to a second wizard"
        )
    if without := len(selection.folders) - len(folders):
        print_notes(f"note: {pluralize(without, 'session')} without a second wizard left out")
    if output is None or output == "-":
        report = _compared(folders, level, problems)
        write_bytes(_formatted(report, form))
    else:
        with new_export(Path(output), folders, f"agree {form}", level) as export:
            report = _compared(folders, level, problems)
            problems += export.problems
            export.here.write_bytes(_formatted(report, form))
    print_notes(*(f"warning: {problem}" for problem in problems))
    if form != "text":
        print_notes(*(f"note: {remark}" for remark in dict.fromkeys(report.remarks)))
    return PARTIAL if problems else OK


def _compared(folders: Sequence[Path], level: ExportLevel, problems: list[str]) -> AgreementReport:
    report = compare_wizards(_judged(folders, level, problems))
    if not report.cues:
        raise ExportError("nothing could be compared", *problems)
    return report


def _judged(folders: Sequence[Path], level: ExportLevel, problems: list[str]) -> Iterator[JudgedSession]:
    """Each session that can be read. Decisions are told by their labels alone, so what is told of the session itself is
    all that a level has to say about, and who the people are."""

    def note_unreadable(folder: Path, error: SessionError) -> None:
        problems.append(f"{folder} could not be read: {error}")

    names = _names(folders) if level != "full" else None
    told = {
        data.folder: data.facts
        for data in read_sessions(folders, level=level, wizards=names, on_unreadable=note_unreadable)
    }
    for folder in told:
        for data in read_sessions([folder]):
            problems.extend(f"{folder.name}: {problem}" for problem in data.problems)
            yield judge_session(replace(data, facts=told[folder]), names)


def _names(folders: Sequence[Path]) -> dict[str, str]:
    """What to call everybody: as their study says, or else W1, W2, ... in the order in which they come."""
    names: dict[str, str] = {}
    people: dict[str, None] = {}
    for folder in folders:
        names.update(wizard_names(study_of_session(folder)))
        for data in read_sessions([folder], on_unreadable=lambda folder, error: None):
            people.update(dict.fromkeys(wizards_of(data)))
    free = (each for number in range(1, 10_000) if (each := f"W{number}") not in set(names.values()))
    for person in people:
        if person not in names:
            names[person] = next(free)
    return names


def _formatted(report: AgreementReport, form: Form) -> bytes:
    if form == "json":
        return json_document(agreement_json(report)) + b"\n"
    text = agreement_csv(report) if form == "csv" else clean(agreement_text(report), keep="\n")
    return text.encode("utf-8", "backslashreplace")


COMMANDS = {"agree": agree}
