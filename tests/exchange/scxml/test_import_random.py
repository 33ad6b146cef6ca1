"""Charts by chance, flattened and played by the kernel, do what the standard says: assignment for assignment, state for
state, event for event."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from rise_engine.kernel.records import RuleRecord
from tests.chance import SEARCH, seeds, some
from tests.exchange.scxml.importing import assignments, convert, session_of
from tests.exchange.scxml.random_charts import EVENTS, ChartMaker
from tests.exchange.scxml.standard_interpreter import EndlessError, Interpreter

_NAMES = ("last", "n", "m")
_CLOSEST = 12
"""Milliseconds. What the chart sends through the external queue takes 1 ms each time; where other things happen nearer
to one another than this, their order is not compared."""


def play(seed: int, folder: Path) -> str:
    """Play one chart in both. What came of it: `same`, or why it was not compared to the end."""
    random = Random(seed)
    text = ChartMaker(random, parallel=seed % 3 != 0, sends=seed % 2 == 0).make()
    outside = (*EVENTS, "i1")
    made, findings = convert(text, outside=outside)
    if made is None:
        assert {finding.code for finding in findings} <= {"size", "pending", "endless"}, (seed, findings)
        return "refused"
    if set(made.exclusive) & set(outside):
        return "refused"
    active = {state.name: sorted(each.id for each in state.configuration) for state in made.flat.states}
    ours = session_of(made, folder)
    try:
        theirs = Interpreter(text)
        theirs.pass_time(20)
        ours.rule(made.name)
        ours.wait(0.02)
        seen = compared = 0
        for _ in range(25):
            records, seen = ours.records[seen:], len(ours.records)
            assert not any(isinstance(record, RuleRecord) and record.status == "faulted" for record in records), seed
            if theirs.closest < _CLOSEST:
                return "near"
            state = ours.states.get(made.name)
            now = (assignments(records, _NAMES), active[state] if state else [])
            assert now == (theirs.trace[compared:], sorted(theirs.active)), (seed, text)
            compared = len(theirs.trace)
            if not theirs.running:
                return "same"
            event = random.choice(outside)
            theirs.event(event)
            theirs.pass_time(70)
            ours.event(f"/{event}")
            ours.wait(0.07)
    except EndlessError:
        return "endless"
    return "same"


@pytest.mark.search
@pytest.mark.slow
@pytest.mark.parametrize("first", some(range(0, 160, 20), every=4))
def test_random_charts(first: int, tmp_path: Path) -> None:
    outcomes = [play(seed, tmp_path) for seed in seeds(20, first)]
    assert SEARCH or outcomes.count("same") >= len(outcomes) // 2, outcomes
