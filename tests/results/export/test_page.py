"""docs/reference/exports.md has every column; `python -m tests.results.export.test_page` writes its lists anew."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path

from rise_engine.results.export.format import format_names
from rise_engine.results.export.session_tables import FACTS
from rise_engine.results.export.table_schema import Column
from rise_engine.results.export.tables import TABLES

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "exports.md"
_QUOTED = re.compile(r"`[^`]+`")
_MARK = re.compile(r"(<!-- columns: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def column_list(table: str, columns: tuple[Column, ...], told: dict[str, str]) -> str:
    """In Markdown. `told` has the levels that the page explains already, with the place where it does."""
    items = []
    for column in columns:
        kind = f"{column.type}, {column.unit}" if column.unit else column.type
        about = column.about.replace("Session time when", "When")
        levels = "; ".join(f"`{name}`: {text}" for name, text in column.levels.items())
        if levels in told:
            levels = f"Levels: as in {told[levels]}."
        elif levels:
            told[levels] = f"`{column.name}` of {table}"
        items.append(_wrapped(f"- `{column.name}` ({kind}): {about} {levels}".rstrip()))
    return "\n".join(items)


def _wrapped(item: str) -> str:
    """An item of a list in lines of at most 120 columns, none of which divides a quoted name."""
    whole = _QUOTED.sub(lambda found: found[0].replace(" ", "\0"), item)
    lines = textwrap.wrap(whole, 120, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines).replace("\0", " ")


def page_text(text: str) -> str:
    """The page with every list of columns as it should be."""
    told: dict[str, str] = {}
    tables = {"facts": column_list("every table", FACTS, told)}
    for schema in TABLES:
        key = " and ".join(f"`{name}`" for name in schema.key)
        refers = [
            f"{' and '.join(f'`{name}`' for name in each.columns)} → {each.table}.csv" for each in schema.references
        ]
        about = [schema.about, f"Key: {key}.", *([f"{'; '.join(refers)}."] if refers else [])]
        columns = column_list(f"{schema.name}.csv", schema.columns, told)
        tables[schema.name] = f"{' '.join(about)}\n\n{columns}"
    return _MARK.sub(lambda found: f"{found[1]}{tables[found[2]]}\n{found[3]}", text)


def test_the_page_has_every_column() -> None:
    text = PAGE.read_text("utf-8")
    assert {found[1] for found in _MARK.findall(text)} == {"facts", *(schema.name for schema in TABLES)}
    assert page_text(text) == text, "write them: python -m tests.results.export.test_page"


def test_the_page_has_every_format() -> None:
    text = PAGE.read_text("utf-8")
    for name in format_names():
        assert f"[`{name}`](#" in text, f"no row for the format {name}"


if __name__ == "__main__":
    PAGE.write_text(page_text(PAGE.read_text("utf-8")), "utf-8")
