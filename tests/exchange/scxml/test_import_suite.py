"""What the W3C suite tests: kept by rules, or refused with the reason, by the numbers of its tests.

Our own charts are always played. The suite itself (https://www.w3.org/Voice/2013/scxml-irp/, transformed to ECMAScript:
files `test144.scxml`) is no part of this project; where `RISE_SCXML_SUITE` names a folder with it, it is played, too.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.exchange.scxml.chart_words import chart, on, parallel, state
from tests.exchange.scxml.charts_refused import REFUSED
from tests.exchange.scxml.charts_that_pass import PASSING
from tests.exchange.scxml.importing import codes, converted, end_of
from tests.exchange.scxml.standard_interpreter import Interpreter

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
