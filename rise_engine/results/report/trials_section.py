"""Two sections of reports: a study's trials by condition, each a dot, and the waiting times for answers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from msgspec import Struct

from rise_engine.base.text import clean, pluralize
from rise_engine.results.analysis.statistics import median, median_interval, summarise
from rise_engine.results.analysis.trials import NoNumber
from rise_engine.results.report.charts import WIDTH, latency_figure
from rise_engine.results.report.document import (
    Block,
    Figure,
    Paragraph,
    ReportTable,
    Section,
    number_text,
    percent_text,
    source_name,
)
from rise_engine.results.report.page import Drawing
from rise_engine.results.report.session_facts import BANDS, CAVEATS, LIMITS, SOURCES, LatencyFacts, LatencyPart
from rise_engine.results.report.study_facts import SessionRow

UNDECLARED = (
    "No scenario of this study says what a trial is. Write [trials] in scenario.toml, with the state of a rule that "
    'begins one: state = "Ask". In sessions from then on, the dependent variable is shown here by condition, and '
    "trials.csv has a row for each trial."
)
_REASONS: dict[NoNumber, str] = {
    "outage": "because the engine was away",
    "standstill": "because the engine stood still",
    "stop": "because everything was stopped",
    "back": "because a wizard stepped back before there was a {measure}",
    "silent": "because the robot said nothing",
    "cut": "because the robot did not speak to the end",
    "end": "because we cannot tell when the robot fell silent",
    "cue": "because there was no cue",
    "key": "because the wizard pressed no key",
    "speech": "because no speech of the participant is known",
    "unset": "because {measure} has no value",
    "value": "because {measure} is not a number",
}
_INTERVAL = "95 % interval of the median by order statistics (at least 95 %, exact; none for fewer than 6 trials)"


class TrialRow(Struct, frozen=True):
    """The trials of one condition."""

    name: str
    measure: str
    values: tuple[float, ...]
    hovers: tuple[str, ...]
    """The participant, run and trial of each value."""
    trials: int
    """All trials, also those without a value."""
    people: int
    omitted: tuple[tuple[str, NoNumber], ...] = ()
    """Trials without a value, with the reason."""

    @property
    def interval(self) -> tuple[float, float] | None:
        """The interval of the median."""
        return median_interval(self.values)


def trial_rows(conditions: Iterable[tuple[str, Sequence[SessionRow]]]) -> list[TrialRow]:
    """Make a row for each measure and condition. Empty: no session has a trial.

    :param conditions: names, with the complete sessions of each.
    """
    found = []
    by_name = [(name, [row for row in sessions if row.measure]) for name, sessions in conditions]
    several_runs = any(row.facts.run > 1 for _, sessions in by_name for row in sessions)

    def trial_name(row: SessionRow, number: int) -> str:
        run = f", run {row.facts.run}" if several_runs else ""
        return f"{row.facts.participant or row.facts.session}{run}, trial {number}"

    for measure in dict.fromkeys(row.measure for _, sessions in by_name for row in sessions):
        for name, sessions in by_name:
            theirs = [row for row in sessions if row.measure == measure]
            pairs = [
                (value, f"{trial_name(row, number)}: {number_text(value)}")
                for row in theirs
                for number, value in enumerate(row.trials, 1)
                if value is not None
            ]
            if trials := sum(len(row.trials) for row in theirs):
                people = len({row.facts.participant for row in theirs})
                values, hovers = tuple(value for value, _ in pairs), tuple(hover for _, hover in pairs)
                omitted = tuple((trial_name(row, number), why) for row in theirs for number, why in row.omitted)
                found.append(TrialRow(name, measure, values, hovers, trials, people, omitted))
    return found


def trials_section(rows: Sequence[TrialRow], *, declared: bool) -> Section:
    """Make the section.

    :param rows: from `trial_rows`.
    :param declared: whether any scenario defines trials.
    """
    if not rows:
        sentence = "No complete session has a trial yet." if declared else UNDECLARED
        return Section("Trials", (Paragraph(sentence, "note"),))
    blocks: list[Block] = []
    for measure in dict.fromkeys(row.measure for row in rows):
        theirs = [row for row in rows if row.measure == measure]
        if any(row.values for row in theirs):
            blocks.append(_figure(measure, theirs))
        blocks.append(_table(measure, theirs))
    return Section("Trials", tuple(blocks))


def trials_summary(rows: Sequence[TrialRow]) -> str:
    """Write the first sentence of the report: the dependent variable by condition. Empty: there is none."""
    medians = [
        f"{number_text(median(row.values))}{_unit(row.measure)}{f' in {row.name}' if row.name else ''} "
        f"(n {len(row.values)}{_interval_words(row)})"
        for row in rows
        if row.values and row.measure == rows[0].measure
    ]
    return f"Median {rows[0].measure} of trials: {', '.join(medians)}." if medians else ""


def _unit(measure: str) -> str:
    return " s" if measure.endswith("_s") else ""


def _interval_words(row: TrialRow) -> str:
    if row.interval is None:
        return ""
    low, high = row.interval
    return f", 95 % {number_text(low)}\u2013{number_text(high)}"


def _table(measure: str, rows: Sequence[TrialRow]) -> ReportTable:
    table = []
    for row in rows:
        summary = summarise(row.values)
        table.append(
            (
                row.name,
                str(row.people),
                str(row.trials),
                str(len(row.values)),
                number_text(summary.median) if summary is not None else "",
                f"{number_text(row.interval[0])}\u2013{number_text(row.interval[1])}" if row.interval else "",
                f"{number_text(summary.lower)}\u2013{number_text(summary.upper)}" if summary is not None else "",
            )
        )
    omitted = [each for row in rows for each in row.omitted]
    notes = ""
    for why, words in _REASONS.items():
        if names := "; ".join(name for name, reason in omitted if reason == why):
            notes += f" Not measured {words.format(measure=measure)}: {names}."
    return ReportTable(
        caption=f"Trials of complete sessions by condition: {measure}{' in seconds' if _unit(measure) else ''}",
        head=("condition", "people", "trials", "measured", "median", "95 % interval", "middle half"),
        rows=tuple(table),
        numbers=frozenset({1, 2, 3, 4, 5, 6}),
        note=f"{_INTERVAL}. It assumes independent trials, but trials of one participant are not independent. So "
        f"this is a description and not a test.{notes}",
    )


def _scale(rows: Sequence[TrialRow]) -> tuple[float, float]:
    values = [value for row in rows for value in row.values]
    low, high = min(0.0, *values), max(0.0, *values)
    return low, high if high > low else low + 1.0


def _figure(measure: str, rows: Sequence[TrialRow]) -> Figure:
    line, label, right = 40.0, 190.0, 170.0
    title = f"{measure} by condition"
    described = "; ".join(f"{row.name or 'all'}: {_words(row)}" for row in rows)
    drawing = Drawing(WIDTH, len(rows) * line + 44, title, described, name="dots")
    low, high = _scale(rows)
    room, top = WIDTH - label - right, 18.0
    unit = room / (high - low)
    for at, row in enumerate(rows):
        middle = top + at * line + line / 2
        drawing.line(label, middle, label + room, middle, "base")
        drawing.text(label - 10, middle + 4, clean(row.name or "all"), "lane", "end")
        drawing.text(label + room + 10, middle + 4, _words(row), "chart-note")
        if row.interval is not None:
            left, wide = (row.interval[0] - low) * unit, (row.interval[1] - row.interval[0]) * unit
            drawing.box(label + left, middle - 8, max(1.0, wide), 16, "half", f"95 % interval{_interval_words(row)}")
        for number, (value, hover) in enumerate(zip(row.values, row.hovers, strict=True)):
            drawing.dot(label + (value - low) * unit, middle + (number % 5 - 2) * 3.0, 2.6, "dot", hover)
        if (found := median(row.values)) is not None:
            x = label + (found - low) * unit
            drawing.line(x, middle - 14, x, middle + 14, "median", f"median {number_text(found)}{_unit(measure)}")
    bottom = top + len(rows) * line
    drawing.line(label, bottom, label + room, bottom, "axis-line")
    for part in range(5):
        value = low + (high - low) * part / 4
        drawing.text(label + room * part / 4, bottom + 14, f"{number_text(value)}{_unit(measure)}", "axis", "middle")
    return Figure(
        caption=f"Each dot is one trial of a complete session. The line is their median. The bar is the {_INTERVAL}.",
        svg=(drawing.whole(),),
        text=lambda width: _lines(measure, rows, width),
    )


def _words(row: TrialRow) -> str:
    found = median(row.values)
    return f"{pluralize(row.trials, 'trial')}, median {number_text(found)}" if found is not None else "nothing measured"


def _lines(measure: str, rows: Sequence[TrialRow], width: int) -> list[str]:
    """Draw the same in characters."""
    label = min(24, max(len(clean(row.name or "all")) for row in rows) + 2)
    room = max(20, width - label - 12)
    low, high = _scale(rows)

    def cell(value: float) -> int:
        return min(room - 1, int((value - low) / (high - low) * room))

    lines = []
    for row in rows:
        cells = ["\u00b7"] * room
        if row.interval is not None:
            for at in range(cell(row.interval[0]), cell(row.interval[1]) + 1):
                cells[at] = "\u2500"
        for value in row.values:
            cells[cell(value)] = "\u25cf"
        found = median(row.values)
        if found is not None:
            cells[cell(found)] = "\u2503"
        text = f"{number_text(found)}{_unit(measure)}" if found is not None else "none"
        lines.append(clean(row.name or "all")[: label - 1].ljust(label) + "".join(cells) + f" {text}")
    ends = number_text(low), f"{number_text(high)}{_unit(measure)}"
    lines.append(" " * label + ends[0] + ends[1].rjust(room - len(ends[0])))
    lines.append(f"\u25cf a trial's {measure}   \u2503 the median   \u2500 its 95 % interval by order statistics")
    return lines


# --- latencies --------------------------------------------------------------------------------------------------------

_HEAD = ("", "n", "median", "middle half", "95 % within", *(f"over {limit:g} s" for limit in LIMITS))
_NUMBERS = frozenset(range(1, len(_HEAD)))


def latency_section(facts: LatencyFacts, by_source: Sequence[LatencyPart]) -> Section:
    """Make the section on latencies: parts over the reference bands, fillers separately, sources and caveats.

    :param facts: the numbers.
    :param by_source: responses by actor.
    """
    return Section("Latency", tuple(_blocks(facts, by_source)))


def _blocks(facts: LatencyFacts, by_source: Sequence[LatencyPart]) -> Iterable[Block]:
    if facts.response.summary is None:
        if not omitted_answers(facts):
            yield Paragraph("No act answered a cue, so we cannot tell how long the participant waited.")
    else:
        yield latency_figure(facts)
        yield ReportTable(
            caption="From a cue to the robot's answer, in seconds. The parts of an act add up to its response. The "
            "part rules includes what rules did and waited for, and attempts that failed. Only acts that speak have "
            "the part voice",
            head=_HEAD,
            rows=tuple(_row(part) for part in (*facts.parts, facts.response) if part.values),
            numbers=_NUMBERS,
        )
        if len(by_source) > 1:
            yield ReportTable(
                caption="Responses by who asked for the act",
                head=_HEAD,
                rows=tuple(_row(LatencyPart(source_name(each.name), "", each.values)) for each in by_source),
                numbers=_NUMBERS,
            )
    if omitted := omitted_answers(facts):
        yield Paragraph(omitted, "note")
    if facts.to_filler.values:
        yield ReportTable(
            caption="Fillers: from the cue to the first filler, and to the answer of cues with and without a filler",
            head=_HEAD,
            rows=tuple(map(_row, (facts.to_filler, facts.after_filler, facts.without_filler))),
            numbers=_NUMBERS,
        )
    if facts.response.summary is not None:
        yield _bands(facts)
        yield Paragraph(" ".join(CAVEATS), "note")
        yield ReportTable(
            caption="Sources of the bands",
            head=("publication", "what it found, in our words"),
            rows=tuple((f"{each.citation}{f', doi {each.doi}' if each.doi else ''}", each.found) for each in SOURCES),
            page_only=True,
        )


def omitted_answers(facts: LatencyFacts) -> str:
    """Return how many answers these numbers omit, as a sentence. Empty: none."""
    counts = (
        (facts.before_cue, "requested before the cue"),
        (facts.interrupted.get("outage", 0), "across an outage of the engine"),
        (facts.interrupted.get("standstill", 0), "across a standstill of the engine"),
        (facts.interrupted.get("stop", 0), "while everything was stopped"),
    )
    reasons = [f"{pluralize(count, 'answer')} {why}" for count, why in counts if count]
    return f"Left out of all times: {' and '.join(reasons)}." if reasons else ""


def _row(part: LatencyPart) -> tuple[str, ...]:
    summary = part.summary
    name = f"{part.name} ({part.about})" if part.about else part.name
    if summary is None:
        return (name, "0", *("" for _ in _HEAD[2:]))
    shares = (part.over(limit) for limit in LIMITS)
    return (
        name,
        str(summary.n),
        number_text(summary.median),
        f"{number_text(summary.lower)}\u2013{number_text(summary.upper)}",
        number_text(summary.p95),
        *(percent_text(share.fraction or 0.0) for share in shares),
    )


def _bands(facts: LatencyFacts) -> ReportTable:
    n = len(facts.response.values)
    return ReportTable(
        caption="Responses in the reference bands, and what is known about the bands",
        head=("band", "n", "share", "what is known"),
        rows=tuple(
            (band.name, str(count), percent_text(count / n), band.known)
            for band, count in zip(BANDS, facts.in_bands, strict=True)
        ),
        numbers=frozenset({1, 2}),
    )
