"""docs/reference/exports.md has every column; `python -m tests.results.export.test_page` writes its lists anew."""

from __future__ import annotations

import re
import textwrap
from itertools import groupby
from pathlib import Path

from rise_engine.results.export.format import format_names
from rise_engine.results.export.session_tables import FACTS
from rise_engine.results.export.table_schema import Column
from rise_engine.results.export.tables import TABLES

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "exports.md"
_QUOTED = re.compile(r"`[^`]+`")
_BY_WALL_CLOCK = " by the wall clock, as wall_s; empty: as in session time."
_OF_A_TIME = {
    "outage_s": re.compile(r"Seconds without an engine during (.+); empty: none\. Session time stands still then\."),
    "wall_s": re.compile(
        r"(.+) by the wall clock: divided by speed, and including outage_s; empty: as in session time\."
    ),
    "interrupted": re.compile(
        r"What interrupted (.+), of several the first here; empty: nothing\. Reports leave it out then\."
    ),
}
"""What several tables say about columns of these names, and columns of other names about another time."""
_SAID_ONCE = (
    "; the key together with session",
    " The first sound comes later.",
    " Cues that were taken back do not count.",
)
"""What the page says above its lists."""
_SHORT = 8
"""Words that are not worth a reference."""
_MARK = re.compile(r"(<!-- columns: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


class Told:
    """What the page has explained already, with the table where it does."""

    def __init__(self) -> None:
        self.columns: dict[str, str] = {}
        self.times: dict[str, str] = {}

    def about(self, table: str, column: Column) -> str:
        """What a column means: in full the first time, later as a reference."""
        about = column.about.replace("Session time when", "When")
        for said in _SAID_ONCE:
            about = about.replace(said, "")
        for name, template in _OF_A_TIME.items():
            if found := template.fullmatch(about):
                if column.name != name:
                    return f"As `{name}`, for {found[1]}."
                if (place := self.times.setdefault(name, table)) != table:
                    return f"As in {place}, for {found[1]}."
        levels = "; ".join(f"`{name}`: {text}" for name, text in column.levels.items())
        whole = f"{about} {levels}".rstrip()
        known = self.columns.setdefault(f"{column.name}: {whole}", table)
        return f"As in {known}." if known != table and len(whole.split()) > _SHORT else whole


def kind_of(column: Column) -> str:
    """The type in brackets, except of texts; numbers with a unit have only the unit."""
    if column.unit:
        return f" ({column.unit})" if column.type == "number" else f" ({column.type}, {column.unit})"
    return "" if column.type == "string" else f" ({column.type})"


def column_list(table: str, columns: tuple[Column, ...], told: Told) -> str:
    """In Markdown. Neighbours that are only the same times by the wall clock are one item."""
    items = []
    for by_wall, group in groupby(columns, lambda column: column.about.endswith(_BY_WALL_CLOCK)):
        if by_wall:
            same = list(group)
            names = ", ".join(f"`{column.name}`" for column in same)
            what = "these times" if len(same) > 1 else same[0].about.removesuffix(_BY_WALL_CLOCK)
            items.append(f"{names}{kind_of(same[0])}: {what} by the wall clock, as `wall_s`.")
        else:
            items += [f"`{column.name}`{kind_of(column)}: {told.about(table, column)}" for column in group]
    return "\n".join(_wrapped(f"- {item}") for item in items)


def _wrapped(item: str) -> str:
    """An item of a list in lines of at most 120 columns, none of which divides a quoted name."""
    whole = _QUOTED.sub(lambda found: found[0].replace(" ", "\0"), item)
    lines = textwrap.wrap(whole, 120, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines).replace("\0", " ")


def page_text(text: str) -> str:
    """The page with every list of columns as it should be."""
    told = Told()
    tables = {"facts": column_list("every table", FACTS, told)}
    for schema in TABLES:
        key = ", ".join(f"`{name}`" for name in schema.key)
        refers = [
            f"{', '.join(f'`{name}`' for name in each.columns)} → {each.table}.csv"
            for each in schema.references
            if each.table != "sessions"
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
