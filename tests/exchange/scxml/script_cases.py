"""Conditions in ECMAScript by chance, with values for their variables, and what Node.js says of them.

.venv/bin/python -m tests.exchange.scxml.script_cases       works out `script_results.txt` anew; needs Node.js
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from random import Random
from typing import Any

RESULTS = Path(__file__).with_name("script_results.txt")
"""`1` where a case holds, `0` where it does not, in the order of the cases."""
COUNT = 3000
_VALUES: dict[str, list[Any]] = {
    "n": [-2, -1, 0, 0.5, 1, 3],
    "m": [-1, 0, 1, 2],
    "f": [True, False],
    "w": ["", "a", "b", "10"],
    "u": [None],
    "x": [None, 0, 2, -1],
    "y": [None, "", "b"],
}
"""`u` is undefined, `x` undefined or a number, `y` undefined or a text."""


def cases() -> list[tuple[str, dict[str, Any]]]:
    """The scripts and the values; None is `undefined`."""
    random = Random(18)
    return [(_condition(random, 3), {name: random.choice(all) for name, all in _VALUES.items()}) for _ in range(COUNT)]


def _number(random: Random, depth: int) -> str:
    if depth == 0 or random.random() < 0.4:
        return random.choice(("n", "m", "0", "1", "2", "-1", "0.5"))
    a, b = _number(random, depth - 1), _number(random, depth - 1)
    return random.choice(
        (f"{a} + {b}", f"({a} - {b})", f"{a} * {b}", f"-({a})", f"{a} / 2", f"Math.floor({a})", f"Math.abs({a})")
    )


def _condition(random: Random, depth: int) -> str:
    if depth and random.random() < 0.6:
        a, b = _condition(random, depth - 1), _condition(random, depth - 1)
        return random.choice((f"{a} && {b}", f"{a} || {b}", f"!({a})", f"({a} || {b})", f"({a}) && !({b})"))
    sign = random.choice(("==", "!=", "===", "!==", "<", "<=", ">", ">="))
    equal = random.choice(("==", "!=", "===", "!=="))
    words = ("w", "'a'", "'b'", "''", "'10'")
    return random.choice(
        (
            f"{_number(random, 2)} {sign} {_number(random, 2)}",
            f"{_number(random, 2)} {sign} {_number(random, 1)}",
            _number(random, 2),
            f"{random.choice(words)} {sign} {random.choice(words)}",
            random.choice(("n", "m", "f", "w", "u", "x", "y", "'a'", "''", "0", "true", "null", "undefined")),
            f"f {equal} {random.choice(('true', 'false', 'f', '1', 'n', 'w'))}",
            f"{random.choice('nmfwuxy')} {equal} {random.choice(('undefined', 'null', 'u', '1', words[2]))}",
            f"typeof {random.choice('nmfwuxy')} {equal} {random.choice(['number', 'string', 'undefined', 'object'])!r}",
        )
    )


def node_results(node: str) -> str:
    """What Node.js says."""
    written = [
        [script, {name: value for name, value in given.items() if value is not None}] for script, given in cases()
    ]
    program = (
        "const cases = JSON.parse(require('fs').readFileSync(0, 'utf8'));"
        f"const names = {json.dumps(list(_VALUES))};"
        "console.log(cases.map(([script, values]) => "
        "new Function(...names, `return (${script})`)(...names.map(name => values[name])) ? 1 : 0).join(''));"
    )
    ran = subprocess.run([node, "-e", program], input=json.dumps(written), capture_output=True, text=True, check=True)
    return ran.stdout.strip()


if __name__ == "__main__":
    RESULTS.write_text(node_results("node") + "\n", encoding="utf-8")
