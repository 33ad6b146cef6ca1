"""The agreement of wizards about the same cues, over sessions: overall and by condition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import combinations

from msgspec import Struct, field

from rise_engine.results.analysis.agreement import (
    Differences,
    Estimate,
    cohen_kappa,
    confusion_counts,
    icc_a1,
    krippendorff_alpha,
    limits_of_agreement,
    percent_agreement,
)
from rise_engine.results.analysis.judged_cues import JudgedCue, JudgedSession, MarkedAct

ALL = ""
"""The group of all units."""
FEW = 30
"""With fewer units, statistics of two wizards are hardly more than an anecdote."""


NO_TIMES = "there is no cue to which all of them did something"
LEAST_TIMED = 3
"""With fewer units, an ICC is arbitrary."""


class CellCount(Struct, frozen=True):
    """How often a pair of decisions occurred: the first wizard's and the second's."""

    first: str
    second: str
    count: int


class PairStatistics(Struct, frozen=True, kw_only=True):
    """The statistics of two wizards over what both have judged."""

    first: str
    second: str
    percent: Estimate
    kappa: Estimate
    confusion: tuple[CellCount, ...]
    """The most frequent pair first."""
    icc: Estimate
    """ICC(A,1) of the latencies where both did something."""
    latency: Differences
    """Latency of the second wizard minus that of the first, in seconds."""


class GroupStatistics(Struct, frozen=True, kw_only=True):
    """The statistics of all wizards over one group of units."""

    group: str
    """The condition. Empty: all units."""
    units: int
    """The number of units that at least two have judged."""
    alpha: Estimate
    icc: Estimate
    """ICC of all wizards, over the cues on which each of them did something."""
    pairs: tuple[PairStatistics, ...]


class AgreementReport(Struct, kw_only=True):
    """The result of a comparison."""

    wizards: list[str] = field(default_factory=list)
    """Those who ran sessions come first, then those who judged."""
    cues: list[JudgedCue] = field(default_factory=list)
    groups: list[GroupStatistics] = field(default_factory=list)
    """All cues first, then each condition if there are several."""
    marks: list[MarkedAct] = field(default_factory=list)
    marked: GroupStatistics | None = None
    """Statistics of the marks for mistakes. None: fewer than two have marked any."""
    sessions: int = 0
    undone: int = 0
    """The number of undone cues."""
    remarks: list[str] = field(default_factory=list)


def compare_wizards(sessions: Iterable[JudgedSession]) -> AgreementReport:
    """Compare the decisions in sessions, which are read one after the other."""
    report = AgreementReport()
    live: dict[str, None] = {}
    judges: dict[str, None] = {}
    for session in sessions:
        report.sessions += 1
        report.undone += session.undone
        report.cues += session.cues
        report.marks += session.acts
        report.remarks += session.remarks
        live[session.live] = None
        judges.update(dict.fromkeys(name for cue in session.cues for name in cue.decisions))
    report.wizards = list(dict.fromkeys([*live, *judges]))
    conditions = sorted({cue.facts.condition for cue in report.cues})
    report.groups = [_compare_cues(ALL, report.cues, report.wizards)]
    if len(conditions) > 1:
        report.groups += [
            _compare_cues(each or "(none)", [cue for cue in report.cues if cue.facts.condition == each], report.wizards)
            for each in conditions
        ]
    report.marked = _compare_marks(report.marks)
    return report


def _compare_cues(group: str, cues: Sequence[JudgedCue], wizards: Sequence[str]) -> GroupStatistics:
    present = [name for name in wizards if any(name in cue.decisions for cue in cues)]
    pairs = []
    for first, second in combinations(present, 2):
        both = [
            (cue.decisions[first], cue.decisions[second])
            for cue in cues
            if first in cue.decisions and second in cue.decisions
        ]
        if both:
            timed = [
                (one.latency, other.latency)
                for one, other in both
                if one.latency is not None and other.latency is not None
            ]
            pairs.append(_pair(first, second, [(one.label, other.label) for one, other in both], timed))
    latencies = [[cue.decisions[name].latency for name in present if name in cue.decisions] for cue in cues]
    complete = [
        [each for each in row if each is not None]
        for row in latencies
        if len(row) == len(present) > 1 and None not in row
    ]
    judged = [[cue.decisions[name].label if name in cue.decisions else None for name in present] for cue in cues]
    return GroupStatistics(
        group=group,
        units=sum(len(cue.decisions) > 1 for cue in cues),
        alpha=krippendorff_alpha(judged),
        icc=_icc(complete),
        pairs=tuple(pairs),
    )


def _pair(
    first: str, second: str, labels: Sequence[tuple[str, str]], timed: Sequence[tuple[float, float]]
) -> PairStatistics:
    counts = Counter(confusion_counts(labels))
    return PairStatistics(
        first=first,
        second=second,
        percent=percent_agreement(labels),
        kappa=cohen_kappa(labels),
        confusion=tuple(CellCount(one, other, count) for (one, other), count in counts.most_common()),
        icc=_icc(timed),
        latency=limits_of_agreement(timed) if timed else Differences(why=NO_TIMES),
    )


def _icc(rows: Sequence[Sequence[float]]) -> Estimate:
    if not rows:
        return Estimate(why=NO_TIMES)
    if len(rows) < LEAST_TIMED:
        return Estimate(n=len(rows), why=f"it needs {LEAST_TIMED} cues to which all of them did something")
    return icc_a1(rows)


def _compare_marks(acts: Sequence[MarkedAct]) -> GroupStatistics | None:
    coders = list(dict.fromkeys(name for act in acts for name in act.marks))
    if len(coders) < 2:
        return None
    pairs = []
    for first, second in combinations(coders, 2):
        both = [(act.marks[first], act.marks[second]) for act in acts if first in act.marks and second in act.marks]
        if both:
            pairs.append(_pair(first, second, both, []))
    return GroupStatistics(
        group=ALL,
        units=sum(len(act.marks) > 1 for act in acts),
        alpha=krippendorff_alpha([[act.marks.get(name) for name in coders] for act in acts]),
        icc=Estimate(),
        pairs=tuple(pairs),
    )
