"""A law of the console that is cited can be read (docs/explanation/console.md)."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[3]
LAW = re.compile(r"^\*\*(\d+\.\d+) ", re.MULTILINE)
CITED = re.compile(r"console\.md ((?:\d[\d.]*)(?:(?:, | and | to )\d[\d.]*)*)")
FOLDERS = ("rise_engine", "rise_tui", "adapters", "tests", "benchmarks")


def test_every_law_that_is_cited_is_in_the_page() -> None:
    laws = set(LAW.findall((ROOT / "docs/explanation/console.md").read_text(encoding="utf-8")))
    assert len(laws) > 20
    cited: dict[str, str] = {}
    for folder in FOLDERS:
        for path in (ROOT / folder).rglob("*.py"):
            for numbers in CITED.findall(path.read_text(encoding="utf-8")):
                cited |= {
                    number.rstrip("."): str(path.relative_to(ROOT)) for number in re.split(r", | and | to ", numbers)
                }
    assert len(cited) >= 10
    assert {number: path for number, path in cited.items() if number not in laws} == {}


def test_nobody_cites_a_law_in_another_form() -> None:
    loose = re.compile(r"\(law \d|\blaw \d+\b|[Ll]aws \d", re.IGNORECASE)
    found = [
        f"{path.relative_to(ROOT)}: {hit}"
        for folder in FOLDERS
        for path in (ROOT / folder).rglob("*.py")
        if path != Path(__file__)
        for hit in loose.findall(path.read_text(encoding="utf-8"))
    ]
    assert found == []
