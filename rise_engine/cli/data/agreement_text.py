"""A comparison of wizards, as text for people and as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from textwrap import wrap
from typing import Any

from rise_engine.base.text import pluralize
from rise_engine.cli.terminal import table_lines
from rise_engine.results.analysis.agreement import Differences, Estimate
from rise_engine.results.analysis.judged_cues import JudgedCue
from rise_engine.results.analysis.model import SessionFacts
from rise_engine.results.analysis.wizard_agreement import FEW, AgreementReport, GroupStatistics, PairStatistics

WIDTH = 100
VALUES = 44
"""The column in which values stand."""
MOST_CELLS = 12
"""Disagreements that are listed of one pair."""
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
    "Alpha is for any number of wizards, and for cues that some did not see. No value is good in itself; say it with "
    "its interval and with the disagreements themselves. Where nearly all cues get the same decision, kappa is low "
    "however well two agree.",
    "Doing nothing until the next cue counts as a decision. Decisions are compared by what was pressed: another act "
    "with the same meaning counts as a disagreement, and all free speech as the same.",
    "Latencies are from the cue to the key. The first wizard heard the participant and marked the cue; the others saw "
    "it marked. The limits of agreement hold 95 % of the differences. ICC(A,1) counts a constant difference between "
    "two as disagreement; it is for cues to which all of them did something, whatever that was.",
)


def agreement_text(report: AgreementReport) -> str:
    """All of it, for a terminal."""
    return "\n".join([*_head(report), *_cue_table(report), *_statistics(report), *_marks(report), *_end(report), ""])


def agreement_csv(report: AgreementReport) -> str:
    """One row for each cue and wizard."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\r\n")
    writer.writerow(COLUMNS)
    for cue in report.cues:
        facts = cue.facts
        for name, decision in cue.decisions.items():
            latency = "" if decision.latency is None else f"{decision.latency:.6g}"
            row = (
                facts.session,
                facts.participant,
                facts.condition,
                cue.number,
                f"{cue.at:.6f}".rstrip("0").rstrip("."),
            )
            writer.writerow((*row, name, decision.label, latency, decision.why))
    return out.getvalue()


def agreement_json(report: AgreementReport) -> dict[str, Any]:
    """Everything: each cue, each marked act, and all statistics."""
    cues = [
        {**_of_session(cue.facts), "cue": cue.number, "cue_at_s": cue.at, "decisions": cue.decisions}
        for cue in report.cues
    ]
    marks = [{**_of_session(act.facts), "task": act.task, "act": act.act, "marks": act.marks} for act in report.marks]
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


def _of_session(facts: SessionFacts) -> dict[str, Any]:
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
        yield from _entry("Krippendorff's alpha, all wizards", _value(group.alpha), _of(group.alpha, "cue"))
        yield from _entry("ICC(A,1) of latencies, all wizards", _value(group.icc), _of(group.icc, "cue"))
    for pair in group.pairs:
        yield f"  {pair.first} and {pair.second}"
        yield from _pair(pair)
        if not several:
            yield from _entry("Krippendorff's alpha", _value(group.alpha), _of(group.alpha, "cue"))


def _pair(pair: PairStatistics) -> Iterator[str]:
    yield from _entry("the same decision", _percent(pair.percent), _of(pair.percent, "cue"))
    yield from _entry("Cohen's kappa", _value(pair.kappa), _error(pair.kappa))
    yield from _entry("ICC(A,1) of latencies", _value(pair.icc), _of(pair.icc, "cue"))
    yield from _entry(f"latency of {pair.second} minus {pair.first}", *_difference(pair.latency))
    yield from _disagreements(pair)


def _disagreements(pair: PairStatistics) -> Iterator[str]:
    differing = [cell for cell in pair.confusion if cell.first != cell.second]
    for cell in differing[:MOST_CELLS]:
        yield f"      {cell.count} x  {pair.first}: {cell.first}   {pair.second}: {cell.second}"
    if len(differing) > MOST_CELLS:
        yield f"      and {len(differing) - MOST_CELLS} other kinds of disagreement (--format json has them all)"


def _marks(report: AgreementReport) -> Iterator[str]:
    if report.marked is None:
        return
    yield "Marks for mistakes"
    for pair in report.marked.pairs:
        yield f"  {pair.first} and {pair.second}"
        yield from _entry("the same mark, or both none", _percent(pair.percent), _of(pair.percent, "act"))
        yield from _entry("Cohen's kappa", _value(pair.kappa), _error(pair.kappa))
        yield from _disagreements(pair)
    yield from _entry("Krippendorff's alpha", _value(report.marked.alpha), _of(report.marked.alpha, "act"))
    yield ""


def _end(report: AgreementReport) -> Iterator[str]:
    yield "How to read this"
    for text in CAVEATS:
        yield from (f"  {line}" for line in wrap(text, WIDTH - 2))
    if any(pair.percent.n < FEW for pair in report.groups[0].pairs):
        yield f"  Fewer than {FEW} cues: intervals are wide, and that of kappa is too narrow."
    for remark in dict.fromkeys(report.remarks):
        yield from wrap(f"note: {remark}", WIDTH, subsequent_indent="      ")


# --- values -----------------------------------------------------------------------------------------------------------


def _entry(name: str, value: str, more: str = "") -> Iterator[str]:
    told = f"{value}   ({more})" if more else value
    first, *rest = wrap(told, WIDTH - VALUES, break_long_words=False) or [""]
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


def _of(estimate: Estimate, what: str) -> str:
    return f"of {pluralize(estimate.n, what)}" if estimate.value is not None else ""


def _error(estimate: Estimate) -> str:
    if estimate.value is None or estimate.error is None:
        return ""
    return f"standard error {estimate.error:.3f}" if estimate.low is not None else estimate.why


def _clock(seconds: float) -> str:
    minutes, rest = divmod(seconds, 60)
    return f"{int(minutes)}:{rest:04.1f}"
