"""Conditions of charts mean here what they mean in ECMAScript."""

from __future__ import annotations

import shutil
from collections import Counter

import pytest
from rise_exchange.scxml.script import ChartRefusedError, read_script
from rise_exchange.scxml.translation import UNDEFINED, Knowledge, Possible, Said, say_condition

from rise_engine.expression import Expression
from rise_engine.scenario.model import SourceLocation
from tests.exchange.scxml.script_cases import RESULTS, cases, node_results

NUMBER, TEXT, TRUTH = (Possible(frozenset({kind})) for kind in ("number", "text", "boolean"))
KNOWN: Knowledge = {
    "n": NUMBER,
    "m": NUMBER,
    "f": TRUTH,
    "w": TEXT,
    "u": UNDEFINED,
    "x": NUMBER.joined(UNDEFINED),
    "y": TEXT.joined(UNDEFINED),
}


def said(script: str) -> Said:
    """A condition in our words. Raises ChartRefusedError."""
    read = read_script(script, SourceLocation("c.scxml"))
    assert read.root is not None, script
    return say_condition(read.root, KNOWN)


def test_they_hold_when_they_hold_in_ecmascript() -> None:
    counts: Counter[str] = Counter()
    for (script, values), expected in zip(cases(), RESULTS.read_text(encoding="utf-8").strip(), strict=True):
        try:
            ours = said(script)
        except ChartRefusedError:
            counts["refused"] += 1
            continue
        assert Expression.parse(ours.text).as_condition(values) == (expected == "1"), (script, ours.text, values)
        counts[expected] += 1
    assert min(counts["0"], counts["1"]) > 600, counts


def test_node_says_so() -> None:
    """What is kept in the file is what a real interpreter of ECMAScript says."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node.js is not here; its answers are kept in script_results.txt")
    assert node_results(node) == RESULTS.read_text(encoding="utf-8").strip()


@pytest.mark.parametrize(
    ("script", "ours"),
    [
        ("n", "n < 0 or n > 0"),
        ("!n", "not (n < 0 or n > 0)"),
        ("x", "x != null and (x < 0 or x > 0)"),
        ("w && f", "w and f"),
        ("typeof x === 'undefined'", "x = null"),
        ("typeof x != 'undefined'", "x != null"),
        ("typeof n == 'number'", "true"),
        ("n + 1 == 2 * m || w != 'a'", 'n + 1 = 2 * m or w != "a"'),
        ("(n - (m - 1)) / 2 < 0.5", "(n - (m - 1)) / 2 < 0.5"),
        ("Math.floor(n) >= -m", "floor(n) >= -m"),
    ],
)
def test_in_our_words(script: str, ours: str) -> None:
    assert said(script).text == ours
