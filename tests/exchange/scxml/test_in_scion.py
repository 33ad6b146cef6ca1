"""Exported rules do in SCION what they do in a session, and the comparison notices when they do not.

Needs node, and SCION from npm (`npm install @scion-scxml/scxml`) in a folder that `RISE_SCION` names; what SCION did
with fixed rules is kept for other machines (tests/exchange/scxml/test_export.py).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tests.chance import SEARCH, seeds
from tests.exchange.scxml.playing import Steps, alone, document_of, needs_scion, play, run_documents
from tests.exchange.scxml.traces import Case, random_cases, shipped_cases

pytestmark = pytest.mark.slow


def differing(modules: Path, cases: list[Case], change: Callable[[str], str] = str) -> list[str]:
    """The names of the cases in which a document, perhaps changed, does something else than the kernel."""
    results = run_documents(modules, [(change(case.document), case.played.steps) for case in cases])
    return [case.name for case, lines in zip(cases, results, strict=True) if lines != case.played.lines]


@cache
def some_cases() -> list[Case]:
    return [*shipped_cases(2), *random_cases(range(1000, 1160))]


def test_all_rules_of_the_shipped_studies_do_the_same() -> None:
    cases = list(shipped_cases(10))
    assert len({case.rule.name for case in cases}) == 17
    assert differing(needs_scion(), cases) == []


@pytest.mark.search
def test_random_rules_do_the_same() -> None:
    modules, drawn = needs_scion(), seeds(100, 100)
    cases = list(random_cases(drawn))
    assert SEARCH or len(cases) > len(drawn) * 2 // 3
    assert differing(modules, cases) == []


def without(pattern: str) -> Callable[[str], str]:
    return lambda document: re.sub(pattern, "", document, flags=re.DOTALL)


def instead(old: str, new: str) -> Callable[[str], str]:
    return lambda document: document.replace(old, new)


MISTAKES = {
    "nothing is cancelled": without(r"<cancel [^>]*/>"),
    "a time that is up counts though it is another one": instead(
        "countdown === countdowns", "countdown !== countdowns"
    ),
    "a condition that was true is not taken again": without(
        r'<transition cond="held(?:(?!</transition>).)*</transition>'
    ),
    "what was true in the last state counts in this one": without(r'<assign location="held" expr="\[\]"/>'),
    "onExit is left out": without(r"<onexit>\s*<(?!cancel)(?:(?!</onexit>).)*</onexit>"),
    "numbers below 0 are true": instead("return value > 0;", "return value !== 0;"),
    "texts are never true": instead("value !== ''", "false"),
    "a key is not looked for in objects": instead("names.reduce(inner,", "((_, value) => undefined)(inner,"),
    "equality crosses types": instead("return a === b;", "return a == b;"),
    "chance draws otherwise": instead("BigInt(27)", "BigInt(26)"),
    "raised events go first": lambda document: re.sub(
        r'<send event="(?!after)(\w+)"/>', r'<raise event="\1"/>', document
    ),
    "an error does not end a block": lambda document: re.sub(
        r"throw (missingPart\(\)|new Error\('this is no number'\));", "return 0;", document
    ),
    "memory changes are not heard": instead('event="memory forgotten"', 'event="nothing"'),
    "all endings of an act are one": lambda document: re.sub(
        r"(ended\.\w+)\.(succeeded|failed|stopped)", r"\1", document
    ),
    "the else is always taken": lambda document: document.replace("<else/>", '</if><if cond="true">'),
    "a computed time is in seconds": instead("value * (unit || 1)", "value"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_the_documents_is_noticed(mistake: str) -> None:
    modules = needs_scion()
    assert differing(modules, some_cases(), MISTAKES[mistake])


def test_a_time_that_was_cancelled_too_late_is_not_taken() -> None:
    """An interpreter may have delivered a delayed event when it is cancelled (section 6.3 of the standard)."""
    modules = needs_scion()
    case = next(each for each in shipped_cases(1) if each.rule.name == "Gaze")
    scenario, rule = case.scenario, case.rule
    timed = next(
        (id, index)
        for id, state in rule.states.items()
        for index, transition in enumerate(state.transitions)
        if transition.after is not None
    )
    name = f"after.s{list(rule.states).index(timed[0])}.{timed[1]}"
    played = play(scenario, rule, [["wait", 0.1]])
    for countdown in (0, None):
        stale = {"name": name, "data": {"countdown": countdown}, "after": 0, "first": False}
        played.steps.append({"t": 0.2, "timer": False, "feed": [stale]})
        played.lines.append([["pending", played.lines[-1][-1][1]]])
    (lines,) = run_documents(modules, [(document_of(alone(scenario, rule), rule), played.steps)])
    expected: Steps = played.lines
    assert lines == expected
