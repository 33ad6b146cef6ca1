"""docs/reference/scxml-import.md shows what comes of a chart, and has every kind of reason."""

from __future__ import annotations

import re
from pathlib import Path

from rise_exchange.scxml.rules_file import rules_text

from tests.exchange.scxml.charts_refused import REFUSED
from tests.exchange.scxml.importing import converted

PAGE = (Path(__file__).parents[3] / "docs/reference/scxml-import.md").read_text(encoding="utf-8")


def test_the_example() -> None:
    chart, rules = (re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)[0] for kind in ("scxml", "xml"))
    text = rules_text(converted(chart), "visit.scxml")
    assert text[text.index("<InteractionRules>") :] == rules


def test_every_reason_has_a_row() -> None:
    rows = set(re.findall(r"`([a-z-]+)`", "\n".join(re.findall(r"^\| (`[^|]*) \|", PAGE, re.MULTILINE))))
    assert set(REFUSED) <= rows
