"""`rise-engine agree`: the agreement of wizards who answered the same cues."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal, TypeAlias

import click
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import OK, PARTIAL, USAGE
from rise_engine.base.text import clean, pluralize
from rise_engine.cli.data.export import level_option, select_sessions
from rise_engine.cli.options import ALL_SESSIONS, STUDIES_OR_SESSIONS
from rise_engine.cli.terminal import json_document, print_notes, refusing, table_lines, write_bytes
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.agreement import (
    SMALL_SAMPLE,
    AgreementReport,
    Differences,
    Estimate,
    GroupStatistics,
    PairStatistics,
    compare_wizards,
)
from rise_engine.results.analysis.judged_cues import JudgedCue, JudgedSession, judge_session, wizards_of
from rise_engine.results.analysis.model import SessionFacts
from rise_engine.results.analysis.reading import read_sessions
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
    """Yield each readable session with its decisions, by labels: the level applies to the facts and the people only."""

    def note_unreadable(folder: Path, error: SessionError) -> None:
        problems.append(f"{folder} could not be read: {error}")

    names = _names(folders) if level != "full" else None
    facts_of = {
        data.folder: data.facts
        for data in read_sessions(folders, level=level, wizards=names, on_unreadable=note_unreadable)
    }
    for folder in facts_of:
        for data in read_sessions([folder]):
            problems.extend(f"{folder.name}: {problem}" for problem in data.problems)
            yield judge_session(replace(data, facts=facts_of[folder]), names)


def _names(folders: Sequence[Path]) -> dict[str, str]:
    """Choose the names of all people: the study's codes, or else W1, W2, ... in the order of appearance."""
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


# --- reports as text and as a table -----------------------------------------------------------------------------------

WIDTH = 100
VALUES = 44
"""The column where values begin."""
MAX_CELLS = 12
"""Maximum number of disagreements listed for a pair."""
COLUMNS = (
    "session",
    "participant",
    "condition",
    "cue",
    "cue_at_s",
    "wizard",
    "decision",
    "latency_s",
    "why_no_latency",
)
CAVEATS = (
    "Percent agreement does not know how often two would agree by chance. Kappa and alpha do: 0 is chance, 1 perfect. "
    "Alpha is for any number of wizards, and for cues that some did not see. No value is good in itself; report it "
    "with its interval and with the disagreements themselves. Where nearly all cues get the same decision, kappa is "
    "low however well two agree.",
    "Doing nothing until the next cue counts as a decision. Decisions are compared by what was pressed: another act "
    "with the same meaning counts as a disagreement, and all free speech as the same.",
    "Latencies are from the cue to the key. The first wizard heard the participant and marked the cue; the others saw "
    "it marked. The limits of agreement hold 95 % of the differences. ICC(A,1) counts a constant difference between "
    "two as disagreement; it is for cues to which all of them did something, whatever that was.",
)


def agreement_text(report: AgreementReport) -> str:
    """Format the whole report for a terminal."""
    return "\n".join([*_head(report), *_cue_table(report), *_statistics(report), *_marks(report), *_end(report), ""])


def agreement_csv(report: AgreementReport) -> str:
    """Format one row for each cue and wizard."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    for cue in report.cues:
        at = f"{cue.at:.6f}".rstrip("0").rstrip(".")
        for name, decision in cue.decisions.items():
            latency = "" if decision.latency is None else f"{decision.latency:.6g}"
            of_session = _session_fields(cue.facts).values()
            writer.writerow((*of_session, cue.number, at, name, decision.label, latency, decision.why))
    return out.getvalue()


def agreement_json(report: AgreementReport) -> dict[str, Any]:
    """Return everything: each cue, each marked act, and all statistics."""
    cues = [
        {**_session_fields(cue.facts), "cue": cue.number, "cue_at_s": cue.at, "decisions": cue.decisions}
        for cue in report.cues
    ]
    marks = [
        {**_session_fields(act.facts), "task": act.task, "act": act.act, "marks": act.marks} for act in report.marks
    ]
    return {
        "wizards": report.wizards,
        "sessions": report.sessions,
        "cues_taken_back": report.undone,
        "statistics": report.groups,
        "mark_statistics": report.marked,
        "cues": cues,
        "marked_acts": marks,
        "remarks": list(dict.fromkeys(report.remarks)),
    }


def _session_fields(facts: SessionFacts) -> dict[str, Any]:
    return {"session": facts.session, "participant": facts.participant, "condition": facts.condition}


def _head(report: AgreementReport) -> Iterator[str]:
    cues = pluralize(len(report.cues), "cue")
    yield f"{cues} of {pluralize(report.sessions, 'session')}; wizards: {', '.join(report.wizards)}"
    if report.undone:
        verb = "was" if report.undone == 1 else "were"
        yield f"{pluralize(report.undone, 'cue')} {verb} taken back and left out"
    yield ""


def _cue_table(report: AgreementReport) -> Iterator[str]:
    rows = [("participant", "cue", "at", *report.wizards, "")]
    rows += [
        (
            cue.facts.participant or cue.facts.session,
            str(cue.number),
            _clock(cue.at),
            *(_decision(cue, name) for name in report.wizards),
            "" if len({each.label for each in cue.decisions.values()}) < 2 else "differ",
        )
        for cue in report.cues
    ]
    yield from table_lines(rows, indent="")
    yield ""


def _decision(cue: JudgedCue, name: str) -> str:
    decision = cue.decisions.get(name)
    if decision is None:
        return "-"
    return decision.label if decision.latency is None else f"{decision.label}  {decision.latency:.2f} s"


def _statistics(report: AgreementReport) -> Iterator[str]:
    for group in report.groups:
        yield f"Condition {group.group}: {pluralize(group.units, 'cue')}" if group.group else "All cues"
        yield from _group(group, several=len(report.wizards) > 2)
        yield ""


def _group(group: GroupStatistics, *, several: bool) -> Iterator[str]:
    if several or not group.pairs:
        yield from _entry("Krippendorff's alpha, all wizards", _value(group.alpha), _count_text(group.alpha, "cue"))
        yield from _entry("ICC(A,1) of latencies, all wizards", _value(group.icc), _count_text(group.icc, "cue"))
    for pair in group.pairs:
        yield f"  {pair.first} and {pair.second}"
        yield from _pair(pair)
        if not several:
            yield from _entry("Krippendorff's alpha", _value(group.alpha), _count_text(group.alpha, "cue"))


def _pair(pair: PairStatistics) -> Iterator[str]:
    yield from _entry("the same decision", _percent(pair.percent), _count_text(pair.percent, "cue"))
    yield from _entry("Cohen's kappa", _value(pair.kappa), _error(pair.kappa))
    yield from _entry("ICC(A,1) of latencies", _value(pair.icc), _count_text(pair.icc, "cue"))
    yield from _entry(f"latency of {pair.second} minus {pair.first}", *_difference(pair.latency))
    yield from _disagreements(pair)


def _disagreements(pair: PairStatistics) -> Iterator[str]:
    differing = [cell for cell in pair.confusion if cell.first != cell.second]
    for cell in differing[:MAX_CELLS]:
        yield f"      {cell.count} x  {pair.first}: {cell.first}   {pair.second}: {cell.second}"
    if len(differing) > MAX_CELLS:
        yield f"      and {len(differing) - MAX_CELLS} other kinds of disagreement (--format json has them all)"


def _marks(report: AgreementReport) -> Iterator[str]:
    if report.marked is None:
        return
    yield "Marks for mistakes"
    for pair in report.marked.pairs:
        yield f"  {pair.first} and {pair.second}"
        yield from _entry("the same mark, or both none", _percent(pair.percent), _count_text(pair.percent, "act"))
        yield from _entry("Cohen's kappa", _value(pair.kappa), _error(pair.kappa))
        yield from _disagreements(pair)
    yield from _entry("Krippendorff's alpha", _value(report.marked.alpha), _count_text(report.marked.alpha, "act"))
    yield ""


def _end(report: AgreementReport) -> Iterator[str]:
    yield "How to read this"
    for text in CAVEATS:
        yield from (f"  {line}" for line in wrap(text, WIDTH - 2))
    if any(pair.percent.n < SMALL_SAMPLE for pair in report.groups[0].pairs):
        yield f"  Fewer than {SMALL_SAMPLE} cues: intervals are wide, and that of kappa is too narrow."
    for remark in dict.fromkeys(report.remarks):
        yield from wrap(f"note: {remark}", WIDTH, subsequent_indent="      ")


# --- values -----------------------------------------------------------------------------------------------------------


def _entry(name: str, value: str, more: str = "") -> Iterator[str]:
    text = f"{value}   ({more})" if more else value
    first, *rest = wrap(text, WIDTH - VALUES, break_long_words=False) or [""]
    yield f"    {name:<{VALUES - 6}}  {first}"
    yield from (" " * VALUES + each for each in rest)


def _value(estimate: Estimate) -> str:
    if estimate.value is None:
        return f"no number: {estimate.why}"
    if estimate.low is None or estimate.high is None:
        return f"{estimate.value:.3f}"
    return f"{estimate.value:.3f}  [{estimate.low:.3f}, {estimate.high:.3f}]"


def _percent(estimate: Estimate) -> str:
    if estimate.value is None:
        return f"no number: {estimate.why}"
    low, high = estimate.low, estimate.high
    within = f"  [{100 * low:.0f}, {100 * high:.0f}] %" if low is not None and high is not None else ""
    return f"{100 * estimate.value:.1f} %{within}"


def _difference(found: Differences) -> tuple[str, str]:
    if found.mean is None:
        return f"no number: {found.why}", ""
    if found.low is None or found.high is None:
        return f"{found.mean:+.2f} s", found.why
    return f"{found.mean:+.2f} s", f"limits of agreement {found.low:+.2f} to {found.high:+.2f} s"


def _count_text(estimate: Estimate, what: str) -> str:
    return f"of {pluralize(estimate.n, what)}" if estimate.value is not None else ""


def _error(estimate: Estimate) -> str:
    if estimate.value is None or estimate.error is None:
        return ""
    return f"standard error {estimate.error:.3f}" if estimate.low is not None else estimate.why


def _clock(seconds: float) -> str:
    minutes, rest = divmod(seconds, 60)
    return f"{int(minutes)}:{rest:04.1f}"
