"""Charts that become rules: what the page shows, conditions as in ECMAScript, charts by chance, and the W3C suite.

Our own charts are always played. The suite itself (https://www.w3.org/Voice/2013/scxml-irp/, transformed to ECMAScript:
files `test144.scxml`) is no part of this project; where `RISE_SCXML_SUITE` names a folder with it, it is played, too.
"""

from __future__ import annotations

import os
import re
import shutil
from collections import Counter
from pathlib import Path
from random import Random

import pytest
from rise_exchange.scxml.rules_file import rules_text
from rise_exchange.scxml.script import ChartRefusedError, read_script
from rise_exchange.scxml.translation import UNDEFINED, Knowledge, Possible, TranslatedValue, translate_condition

from rise_engine.expression import Expression
from rise_engine.kernel.records import RuleRecord
from rise_engine.scenario.model import SourceLocation
from tests.chance import SEARCH, seeds, some
from tests.exchange.scxml.chart_words import chart, on, parallel, state
from tests.exchange.scxml.charts_refused import REFUSED
from tests.exchange.scxml.charts_that_pass import PASSING
from tests.exchange.scxml.importing import assignments, codes, convert, converted, end_of, session_of
from tests.exchange.scxml.random_charts import EVENTS, ChartMaker
from tests.exchange.scxml.script_cases import RESULTS, cases, node_results
from tests.exchange.scxml.standard_interpreter import EndlessError, Interpreter

# --- the page ---------------------------------------------------------------------------------------------------------


PAGE = (Path(__file__).parents[3] / "docs/reference/scxml-import.md").read_text(encoding="utf-8")


def test_the_example() -> None:
    chart, rules = (re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)[0] for kind in ("scxml", "xml"))
    text = rules_text(converted(chart), "visit.scxml")
    assert text[text.index("<InteractionRules>") :] == rules


def test_every_reason_has_a_row() -> None:
    rows = set(re.findall(r"`([a-z-]+)`", "\n".join(re.findall(r"^\| (`[^|]*) \|", PAGE, re.MULTILINE))))
    assert set(REFUSED) <= rows


# --- conditions -------------------------------------------------------------------------------------------------------


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


def said(script: str) -> TranslatedValue:
    """A condition in our words. Raises ChartRefusedError."""
    read = read_script(script, SourceLocation("c.scxml"))
    assert read.root is not None, script
    return translate_condition(read.root, KNOWN)


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


# --- charts by chance -------------------------------------------------------------------------------------------------


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


# --- the W3C suite ----------------------------------------------------------------------------------------------------


SUITE = os.environ.get("RISE_SCXML_SUITE", "")
_EXACT_ALL_THE_SAME = {"487"}
"""An assignment of what is no expression: that it fails is known beforehand. Counted as refused where the suite's
transformation puts the expression into a `<data>`."""
_UNKNOWN = (
    "150 151 152 153 155 156 159 194 199 286 287 302 303 304 309 311 312 318 335 339 376 378 396 401 402 496 521 "
    "550 551"
)
"""Charts with what the interpreter of the tests does not know: errors, scripts, `foreach`, `_event`, texts."""
_REFUSED_NUMBERS = [(number, code) for code, (numbers, _) in REFUSED.items() for number in numbers.split()]


def test_the_numbers() -> None:
    """76 are kept and 84 refused, of the mandatory ones; the optional ones are among the foreign types."""
    refused = [number for number, code in _REFUSED_NUMBERS if code != "foreign-type"]
    assert len(PASSING) == 76
    assert len(refused) + len(_EXACT_ALL_THE_SAME) == 84
    assert not {*refused, *_EXACT_ALL_THE_SAME} & set(PASSING)


@pytest.mark.parametrize("number", PASSING)
def test_a_chart_of_ours_for_each_assertion_that_is_kept(number: str, tmp_path: Path) -> None:
    assert end_of(PASSING[number][1], tmp_path) == "pass"


@pytest.mark.parametrize("number", sorted(set(PASSING) - set(_UNKNOWN.split())))
def test_the_standard_agrees_about_them(number: str) -> None:
    """Else such a chart would only show what this program does."""
    interpreter = Interpreter(PASSING[number][1])
    interpreter.pass_time(5000)
    assert (interpreter.running, interpreter.last) == (False, "pass")


@pytest.mark.parametrize("code", REFUSED)
def test_each_kind_of_reason(code: str) -> None:
    for text in REFUSED[code][1]:
        assert code in codes(text), text


def test_too_large_a_chart() -> None:
    def region(name: str) -> str:
        return state(name, *(state(f"{name}{n}", on(f"{name}e{n}", f"{name}{(n + 1) % 6}")) for n in range(6)))

    assert len(converted(chart(parallel("p", region("a"), region("b")))).states) == 36
    assert codes(chart(parallel("p", region("a"), region("b"), region("c")))) == {"size"}


@pytest.mark.skipif(not SUITE, reason="the W3C suite is not here: RISE_SCXML_SUITE names a folder with it")
@pytest.mark.parametrize("number", [*PASSING, *_EXACT_ALL_THE_SAME] if SUITE else [])
def test_the_suite_is_kept(number: str, tmp_path: Path) -> None:
    file = Path(SUITE) / f"test{number}.scxml"
    if not file.exists():
        pytest.skip(f"the suite has no {file.name}")
    assert end_of(file.read_text("utf-8-sig"), tmp_path, file.name) == "pass"


@pytest.mark.skipif(not SUITE, reason="the W3C suite is not here: RISE_SCXML_SUITE names a folder with it")
@pytest.mark.parametrize(("number", "code"), _REFUSED_NUMBERS if SUITE else [])
def test_the_suite_is_refused(number: str, code: str) -> None:
    file = Path(SUITE) / f"test{number}.scxml"
    if not file.exists():
        pytest.skip(f"the suite has no {file.name}")
    assert code in codes(file.read_text("utf-8-sig"))
