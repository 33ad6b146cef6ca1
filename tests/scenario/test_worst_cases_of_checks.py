"""What is checked for authors takes time in proportion to a file's length too: see `test_worst_cases`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rise_engine.scenario.loader import load
from tests.chance import some
from tests.scenario.folders import folder
from tests.scenario.test_worst_cases import (
    SIZE,
    _not_for_ever,  # noqa: F401  # gives up after some seconds of processor time
    act,
    many,
    rule,
)

QUIET = "<!-- check: allow unset-key: x -->"
MEMORY = '{"t": {' + ",".join(f'"k{n}": {n}' for n in range(20_000)) + '}, "l": [' + "1," * 50_000 + "1]}"


def speech(text: str) -> str:
    return act(f"<Speech><actionID>1</actionID><message>{text}</message></Speech>")


def templates(content: str, uses: str) -> dict[str, str | bytes]:
    """A file with a template `T`, and what follows it."""
    return {"acts/a.xml": f'<Dialogs><Template name="T">{content}</Template>{uses}</Dialogs>'}


CASES: dict[str, Callable[[], dict[str, str | bytes]]] = {
    "paths that end early": lambda: {
        "memory.json": MEMORY,
        "rules/r.xml": rule(many('<transition cond="t.y{} = l.x{}"/>')),
    },
    "paths that cannot be set": lambda: {
        "memory.json": MEMORY,
        "rules/r.xml": rule("<onEntry>" + many('<function assignValue="t.k1.z{} = 1"/>') + "</onEntry>"),
    },
    "separators": lambda: {"acts/a.xml": speech(many('{", "a{}}'))},
    "open separators": lambda: {"acts/a.xml": speech(many('{a} {" '))},
    "blanks in a slot": lambda: {"acts/a.xml": speech('{"a" a' + " " * SIZE + "x}")},
    "silencings": lambda: {"rules/r.xml": rule(many(QUIET))},
    "silencings and warnings": lambda: {"rules/r.xml": rule(many(QUIET + '<transition cond="q{}"/>'))},
    "silencings in a text": lambda: {"acts/a.xml": act(f"<Speech>{QUIET}<message>{many(QUIET)}</message></Speech>")},
    "silencings before open tags": lambda: {"rules/r.xml": rule(many(QUIET + '<a b="'))},
    "a long reason": lambda: {"rules/r.xml": rule(f"<!-- check: allow unset-key:{' ' * SIZE} -->")},
    "silencings in TOML": lambda: {"scenario.toml": many("# check: allow no-filler: x\n")},
    "silencings of the memory": lambda: {
        "scenario.toml": "[check]\nallow = [" + many('{code="unset-key",key="k{}",reason="x"},') + "]"
    },
    "open typographic marks": lambda: {"rules/r.xml": many("<a b=“x ")},
    "typographic marks": lambda: {"rules/r.xml": "<a b=“" + "”x" * (SIZE // 2)},
    "typographic marks in a value": lambda: {"rules/r.xml": '<a b="' + "”" * SIZE + '">'},
    "typographic marks in TOML": lambda: {"scenario.toml": 'a = "' + "”" * SIZE},
    "typographic marks in JSON": lambda: {"memory.json": '{"a' + "”" * SIZE},
    "short loops": lambda: {"rules/r.xml": rule(many('<transition after="1ms" cond="a{}" target="S"/>'))},
    "parts that are not there": lambda: {
        "memory.json": MEMORY,
        "rules/r.xml": rule(many('<transition cond="l[i].x{} = t[i][{}]"/>')),
    },
    "parts in one condition": lambda: {"rules/r.xml": rule(f'<transition cond="{many("a[{}] or ")[:99_000]} b"/>')},
    "parts in a text": lambda: {"acts/a.xml": speech(many("{a[{}].b}"))},
    "open parts in a text": lambda: {"acts/a.xml": speech('{a["' + '\\"' * SIZE)},
    "open indexes in a text": lambda: {"acts/a.xml": speech("{a" + "[" * SIZE)},
    "open indexes that are set": lambda: {
        "rules/r.xml": rule(many('<transition><function assignValue="a[[{} = 1"/></transition>'))
    },
    "rows that are too short": lambda: {"tables/t.csv": "a,b\n" + many("{}\n")},
    "rows that are too long": lambda: {"tables/t.csv": "a\n" + many("{},2\n")},
    "values that are no numbers": lambda: {
        "tables/t.csv": "a\n" + "x\n" * 9_000,
        "tables/t.toml": 'types.a = "number"',
    },
    "a quotation mark without its end": lambda: {"tables/t.csv": 'a,b\n"' + many("{},1\n")},
    "columns without names": lambda: {"tables/t.csv": "," * SIZE + "\n" + many("1,") + "\n"},
    "columns of tables that are not there": lambda: {
        "tables/t.csv": ",".join(f"c{n}" for n in range(200)) + "\n" + ("1," * 199 + "1\n") * 2_000,
        "rules/r.xml": rule(many('<transition cond="t[i].d{} = 1"/>')),
    },
    "uses of a template": lambda: templates('<parameter name="a"/><x/>', many('<use template="T" a="{}"/>')),
    "unknown templates": lambda: templates("<x/>", many('<use template="U{}"/>')),
    "arguments of a use": lambda: templates("<x/>", '<use template="T" ' + many('a{}="" ') + "/>"),
    "templates": lambda: templates("<x/>", many('<Template name="T{}"><use template="T{}"/></Template>')),
    "parameters": lambda: templates(many('<parameter name="p{}"/>') + "<x/>", '<use template="T"/>'),
    "parameters in a text": lambda: templates(
        '<parameter name="a"/>' + speech(many("{k{}${a}} ")), '<use template="T" a="x"/>'
    ),
    "conditions of a study": lambda: {"scenario.toml": "[study]\nconditions = [" + many('"c{}",') + "]"},
    "conditions that are not listed": lambda: {
        "scenario.toml": "[study]\nconditions = [" + many('"c{}",') + "]\n" + many("[conditions.d{}]\n")
    },
    "values of a condition": lambda: {"scenario.toml": "[conditions.A.memory]\n" + many("k{} = 1\n")},
    "private keys": lambda: {"scenario.toml": "private = [" + many('"k{}",') + "]"},
    "a condition twice": lambda: {"scenario.toml": "[study]\nconditions = [" + many('"c{}",') + '"c1"]'},
}


@pytest.mark.search
@pytest.mark.slow
@pytest.mark.parametrize("name", some(CASES))
def test_the_worst_is_read_soon(tmp_path: Path, name: str) -> None:
    load(folder(tmp_path, CASES[name]()))
