"""Drawings and the numbers in them: every value is drawn once, within the drawing, on the right side of a limit."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.results.analysis.model import Phase, PlayedAct
from rise_engine.results.analysis.statistics import summarise
from rise_engine.results.report.charts import CourseOfSessions, DotRow, dot_plot, drift_figure, latency_figure
from rise_engine.results.report.course import FEW_ROWS, MAX_ROWS, MAX_RULES, omitted_rules, row_seconds
from rise_engine.results.report.session_facts import BANDS, BIN, LAST_BIN, SOURCES, band_of, histogram, latencies
from rise_engine.results.report.study_facts import pool
from tests.results.report.pages import PageReader

seconds = st.floats(min_value=0, max_value=200, allow_nan=False).map(lambda value: round(value, 6))


def act(response: float, *, filler: bool = False) -> PlayedAct:
    return PlayedAct(
        task=1,
        act="A",
        source="wizard:anna",
        by="wizard:anna",
        actor="wizard",
        status="SUCCEEDED",
        filler=filler,
        cue_at=10.0,
        key_at=10.0,
        accepted_at=10.0,
        started_at=10.0,
        robot_at=10.0 + response,
        voice_at=None,
        ended_at=10.0 + response,
    )


@given(st.lists(seconds, max_size=80))
def test_a_histogram_counts_every_value_once(values):
    counts = histogram(values)
    assert sum(counts) == len(values)
    assert counts[-1] == sum(value >= LAST_BIN for value in values)
    assert counts[2] == sum(2 * BIN <= value < 3 * BIN for value in values)


@pytest.mark.parametrize(("value", "band"), [(0.0, 0), (0.25, 0), (0.2501, 1), (1.0, 1), (2.0, 2), (4.0, 3), (4.01, 4)])
def test_a_limit_belongs_to_the_band_below_it(value, band):
    assert band_of(value) == band


def test_every_band_has_a_source_and_no_address():
    assert [band.limit for band in BANDS] == sorted(band.limit for band in BANDS)
    assert all(source.found and (not source.doi or re.fullmatch(r"10\.\d{4,}/\S+", source.doi)) for source in SOURCES)


@given(st.lists(seconds, min_size=1, max_size=30), st.lists(seconds, max_size=5))
def test_latencies_leave_fillers_apart_and_pool_adds_up(values, fillers):
    facts = latencies([*map(act, values), *(act(value, filler=True) for value in fillers)])
    assert facts.response.values == pytest.approx(values)
    assert sum(facts.in_bands) == len(values)
    both = pool([facts, facts])
    assert len(both.response.values) == 2 * len(values)
    assert both.response.summary is not None and facts.response.summary is not None
    assert both.response.summary.maximum == facts.response.summary.maximum
    for part in both.parts:
        assert len(part.values) == 2 * len(next(each for each in facts.parts if each.name == part.name).values)


def drawn(svg: str) -> PageReader:
    """An `<svg>` that is whole, in which nothing lies outside."""
    reader = PageReader(svg)
    width, height = map(float, re.findall(r'viewBox="0 0 (\S+) (\S+)"', svg)[0])
    for tag, name, value in reader.attributes:
        if tag in ("rect", "circle", "line", "text") and name in ("x", "x1", "x2", "cx"):
            assert -1 <= float(value) <= width + 1, (tag, name, value)
        if tag in ("rect", "circle", "line", "text") and name in ("y", "y1", "y2", "cy"):
            assert -1 <= float(value) <= height + 1, (tag, name, value)
        if name in ("width", "height"):
            assert float(value) >= 0
    return reader


@given(st.lists(seconds, min_size=1, max_size=40))
def test_nothing_is_drawn_outside(values):
    figure = latency_figure(latencies(map(act, values)))
    drawn(figure.svg[0])
    assert figure.text is not None and all(len(line) <= 80 for line in figure.text(80))
    row = DotRow("a", tuple(values), tuple("h" for _ in values), "n")
    dots = dot_plot("t", [row, DotRow("none", (), ())], "c")
    circles = [tag for tag in drawn(dots.svg[0]).tags if tag == "circle"]
    assert len(circles) == len(values)
    assert dots.text is not None and all(len(line) <= 80 for line in dots.text(80))
    course = CourseOfSessions("anna", (summarise(values), None, summarise(values[:1])), ("a", "b", "c"))
    drawn(drift_figure("t", [course], "c").svg[0])


def test_a_hundred_sessions_of_a_wizard_fit():
    course = CourseOfSessions("anna", tuple(summarise([1.0, 2.0]) for _ in range(200)), ("",) * 200)
    drawn(drift_figure("t", [course], "c").svg[0])


@given(st.floats(min_value=0.01, max_value=500_000, allow_nan=False))
def test_a_course_has_few_rows(duration):
    rows = duration / row_seconds(duration)
    assert rows <= (FEW_ROWS if duration <= 600 else MAX_ROWS) + 1e-6


def test_rules_without_a_lane_are_named():
    phases = [
        Phase(rule=f"R{rule}", state="S", start=float(rule), end=rule + 1.0, trigger="start") for rule in range(11)
    ]
    left = omitted_rules(phases)
    assert len(left) == 11 - MAX_RULES
    assert omitted_rules(phases[:MAX_RULES]) == []
