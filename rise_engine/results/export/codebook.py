"""Programs that read the tables of an export into SPSS (or PSPP) and R: types, labels of variables and of values, from
the same columns as datapackage.json."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence

from msgspec import Struct

from rise_engine.results.export.table_schema import Column

SPSS_FILE, R_FILE = "read_tables.sps", "read_tables.R"
_LONGEST_NAME, _LONGEST_LABEL, _LONGEST_VALUE_LABEL, _LONGEST_TEXT = 64, 230, 110, 32_767
"""Bytes that SPSS takes, and that a line of its syntax has room for."""
_RESERVED = frozenset({"all", "and", "by", "comment", "eq", "ge", "gt", "le", "lt", "ne", "not", "or", "to", "with"})
"""Words that no variable of SPSS is called; `comment` is one of PSPP (1.6.2), which skips the rest of the command."""
_NO_NAME = re.compile(r"[^A-Za-z0-9_]+")
_NUMBERS = ("integer", "number")
_R_TYPES = {"integer": "numeric", "number": "numeric", "boolean": "logical"}
"""All others are texts. Whole numbers can be larger than R's integers."""


class DescribedTable(Struct, frozen=True):
    """A table that was written."""

    name: str
    file: str
    about: str
    columns: tuple[Column, ...]
    widths: tuple[int, ...]
    """Of each column: the bytes of its longest cell."""
    has_line_ends: bool = False
    """Whether a cell has several lines: SPSS takes each for a row."""


def spss_text(tables: Iterable[DescribedTable]) -> str:
    """SPSS syntax that reads each table as a data set of its name."""
    lines = [
        "* Encoding: UTF-8.",
        "* Reads the tables of this folder, each as a data set of its name: acts, cues, sessions, and so on.",
        "* Say first where the folder is. An empty cell is missing; true and false are texts.",
        "CD '.'.",
        "SET DECIMAL=DOT.",
    ]
    for table in tables:
        if table.has_line_ends:
            lines += ["", f"* {table.file} is left out: it has cells of several lines, which SPSS takes for rows."]
        else:
            lines += ["", f"* {table.about.rstrip('.')}.", *_spss_table(table)]
    return "\n".join([*lines, ""])


def _spss_table(table: DescribedTable) -> Iterator[str]:
    names = spss_names([column.name for column in table.columns])
    yield "GET DATA /TYPE=TXT"
    yield f"  /FILE={_spss_quoted(table.file)} /ENCODING='UTF8'"
    yield "  /ARRANGEMENT=DELIMITED /DELCASE=LINE /FIRSTCASE=2 /DELIMITERS=',' /QUALIFIER='\"'"
    yield "  /VARIABLES="
    for name, column, width in zip(names, table.columns, table.widths, strict=True):
        yield f"    {name} {_spss_format(column, width)}"
    yield "  ."
    yield "VARIABLE LABELS"
    for at, (name, column) in enumerate(zip(names, table.columns, strict=True)):
        about = column.about if name == column.name else f"{column.name}: {column.about}"
        yield f"  {'/' * (at > 0)}{name} {_spss_quoted(about, _LONGEST_LABEL)}"
    yield "  ."
    labelled = [(name, column) for name, column in zip(names, table.columns, strict=True) if column.levels]
    if labelled:
        yield "VALUE LABELS"
        for at, (name, column) in enumerate(labelled):
            yield f"  {'/' * (at > 0)}{name}"
            for value, label in column.levels.items():
                told = value if column.type in _NUMBERS else _spss_quoted(value)
                yield f"    {told} {_spss_quoted(label, _LONGEST_VALUE_LABEL)}"
        yield "  ."
    yield f"DATASET COPY {table.name}."  # DATASET NAME does not keep it in PSPP, where the next table replaces it


def _spss_format(column: Column, width: int) -> str:
    if column.type == "integer":
        return "F16.0"
    if column.type == "number":
        return "F16.6"
    longest = max([1, width, *(len(value.encode()) for value in column.levels)])
    return f"A{min(longest, _LONGEST_TEXT)}"


def spss_names(names: Sequence[str]) -> list[str]:
    """What SPSS calls variables: ASCII letters, digits and `_`, at most 64, no word of its own, none twice.

    >>> spss_names(["by", "G01[SQ1]", "2nd", "Score", "score"])
    ['by_', 'G01_SQ1', 'v2nd', 'Score', 'score_2']
    """
    taken: set[str] = set()
    found = []
    for name in names:
        plain = _NO_NAME.sub("_", name).strip("_") or "v"
        plain = plain if plain[0].isalpha() else f"v{plain}"
        plain = f"{plain}_" if plain.casefold() in _RESERVED else plain[: _LONGEST_NAME - 4]
        free = (plain if number == 1 else f"{plain}_{number}" for number in range(1, len(names) + 2))
        given = next(each for each in free if each.casefold() not in taken)
        taken.add(given.casefold())
        found.append(given)
    return found


def _spss_quoted(text: str, longest: int = _LONGEST_TEXT) -> str:
    """A text on one line, cut at a number of bytes."""
    text = " ".join(text.split())
    if len(text.encode()) > longest:
        text = text.encode()[: longest - 3].decode(errors="ignore") + "..."
    return "'" + text.replace("'", "''") + "'"


def r_text(tables: Iterable[DescribedTable]) -> str:
    """An R script that reads each table as a data frame of its name."""
    lines = [
        "# Reads the tables of this folder, each as a data frame of its name: acts, cues, sessions, and so on.",
        '# In R: setwd("the folder"), then source("read_tables.R", encoding = "UTF-8").',
        '# attr(acts$status, "label") says what a column holds, attr(acts$status, "labels") what its values mean:',
        "# as the packages haven, labelled and sjlabelled have it.",
        "read_table <- function(file, types, about, values) {",
        '  table <- read.csv(file, colClasses = types, na.strings = "", check.names = FALSE, fileEncoding = "UTF-8")',
        '  for (name in names(about)) attr(table[[name]], "label") <- about[[name]]',
        '  for (name in names(values)) attr(table[[name]], "labels") <- values[[name]]',
        "  table",
        "}",
    ]
    for table in tables:
        types = {column.name: _R_TYPES.get(column.type, "character") for column in table.columns}
        lines += ["", f"# {' '.join(table.about.split())}", f"{table.name} <- read_table("]
        lines += [f"  {_r_quoted(table.file)},"]
        lines += ["  c(", *_r_items({name: _r_quoted(each) for name, each in types.items()}), "  ),"]
        about = {column.name: _r_quoted(" ".join(column.about.split())) for column in table.columns}
        lines += ["  list(", *_r_items(about), "  ),"]
        lines += ["  list(", *_r_items({column.name: _r_values(column) for column in table.columns if column.levels})]
        lines += ["  )", ")"]
    return "\n".join([*lines, ""])


def _r_items(items: dict[str, str]) -> list[str]:
    last = len(items) - 1
    return [f"    {_r_quoted(name)} = {value}{',' * (at < last)}" for at, (name, value) in enumerate(items.items())]


def _r_values(column: Column) -> str:
    told = (
        f"{_r_quoted(label)} = {value if column.type in _NUMBERS else _r_quoted(value)}"
        for value, label in column.levels.items()
    )
    return f"c({', '.join(told)})"


def _r_quoted(text: str) -> str:
    """A text of R: what JSON escapes, R escapes in the same way."""
    return json.dumps(text, ensure_ascii=False)
