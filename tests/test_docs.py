"""Links in the documentation lead somewhere, and the index has every page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md")), *sorted((ROOT / "scenarios").rglob("*.md"))]
LINK = re.compile(r"(?<!!)\[[^\]]+\]\((?!https?:|#|mailto:)([^)#\s]+)[^)]*\)")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    targets = LINK.findall(page.read_text(encoding="utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []


def test_the_index_has_every_page() -> None:
    index = DOCS / "README.md"
    linked = {(DOCS / target).resolve() for target in LINK.findall(index.read_text(encoding="utf-8"))}
    pages = {page for page in DOCS.rglob("*.md") if "decisions" not in page.parts and page != index}
    assert sorted(str(page.relative_to(DOCS)) for page in pages - linked) == []


def test_every_field_of_every_record_is_documented() -> None:
    from typing import get_args

    from rise_engine.kernel.records import AnyRecord

    page = (DOCS / "reference" / "records.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    for record in get_args(AnyRecord):
        kind = record.__struct_config__.tag
        for field in set(record.__struct_encode_fields__) - {"seq", "t", "wall"}:
            assert f"`{field}`" in rows[kind], f"{kind}.{field} is not in docs/reference/records.md"
