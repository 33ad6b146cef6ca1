"""How long people waited: the same section for a session and for all sessions of a study."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rise_engine.results.report.bands import BANDS, CAVEATS, SOURCES
from rise_engine.results.report.charts import latency_figure
from rise_engine.results.report.document import Block, Paragraph, ReportTable, Section, number_text, percent_text
from rise_engine.results.report.latency import LIMITS, LatencyFacts, LatencyPart
from rise_engine.results.report.wording import source_name

_HEAD = ("", "n", "median", "middle half", "95 % within", *(f"over {limit:g} s" for limit in LIMITS))
_NUMBERS = frozenset(range(1, len(_HEAD)))


def latency_section(facts: LatencyFacts, by_source: Sequence[LatencyPart]) -> Section:
    """Latencies in parts over the reference bands, fillers apart, with sources and caveats.

    :param facts: the numbers.
    :param by_source: responses of each who acted.
    """
    return Section("Latency", tuple(_blocks(facts, by_source)))


def _blocks(facts: LatencyFacts, by_source: Sequence[LatencyPart]) -> Iterable[Block]:
    if facts.response.summary is None:
        yield Paragraph("No act answered a cue, so nobody knows how long the participant waited.")
    else:
        yield latency_figure(facts)
        yield ReportTable(
            caption="From a cue to the robot's answer, in seconds. The parts of each act add up to its response: the "
            "wizard presses a key, the key reaches the engine (of an act without a key, all until the engine has "
            "it), the act waits for its turn, the robot confirms its first action, and, where it speaks, its speech",
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
    if facts.to_filler.values:
        yield ReportTable(
            caption="Fillers, apart: from the cue until the first filler, and until the answer of cues with and "
            "without one",
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
        caption="Responses in the reference bands, and what is known of these",
        head=("band", "n", "share", "what is known"),
        rows=tuple(
            (band.name, str(count), percent_text(count / n), band.known)
            for band, count in zip(BANDS, facts.in_bands, strict=True)
        ),
        numbers=frozenset({1, 2}),
    )
