"""The tables of a study as grids: their rows and columns, and which of them fit."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple

from rise_engine.author.edit.edits import AddColumn, AddRow, AnyEdit, ReplaceFile, SetCell, SetSetting
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.tables import WrittenCells, table_names, written_cells
from rise_engine.base.text import pluralize
from rise_engine.scenario.files.study_paths import PARTICIPANTS_FILE, STUDY_FILE
from rise_engine.scenario.reading.memory import is_writable_key
from rise_engine.scenario.reading.tables import TABLES_FOLDER
from rise_tui.editor.model.draft import StudyDraft
from rise_tui.rendering.text import StyledLine, StyledSpan, cell_width, clean, crop, fixed_span

NUMBER = 5
"""Cells for the number before a row."""
MIN_COLUMN_WIDTH, MAX_COLUMN_WIDTH = 4, 24
"""Cells of a column if not all columns get their full width."""
_MEASURED = 400
"""Number of rows that are measured for the width of a column."""


class GridRow(NamedTuple):
    """A row of the page: the name of a table, its columns, or one of its rows."""

    table: str
    number: int
    """The number of the table's row, from 0; -1: the names of its columns; -2: its own name."""


class GridColumn(NamedTuple):
    """A visible column."""

    at: int
    """Its index, from 0."""
    width: int


class GridTable(NamedTuple):
    """A table and its widths."""

    cells: WrittenCells
    widths: tuple[int, ...]
    """Cells that each column needs to show everything in it."""


class Grid(NamedTuple):
    """All tables, one below the other."""

    tables: dict[str, GridTable]
    """The readable tables."""
    problems: dict[str, str]
    """Why the other tables cannot be read."""
    rows: tuple[GridRow, ...]


def grid_of(draft: StudyDraft, wanted: str = "") -> Grid:
    """The tables of a study.

    :param wanted: show only rows with this text in a value; all rows if it is in the table's name.
    """
    tables: dict[str, GridTable] = {}
    problems: dict[str, str] = {}
    rows: list[GridRow] = []
    for name in table_names(draft.files):
        found = _cells(draft, name)
        if isinstance(found, str):
            problems[name] = found
            rows.append(GridRow(name, -2))
            continue
        tables[name] = found
        every = wanted.casefold() in name.casefold()
        rows += [GridRow(name, -2), GridRow(name, -1)]
        rows += [
            GridRow(name, number)
            for number, values in enumerate(found.cells.rows)
            if every or wanted.casefold() in "\n".join(values).casefold()
        ]
    return Grid(tables, problems, tuple(rows))


def _cells(draft: StudyDraft, name: str) -> GridTable | str:
    own = tuple((file, data) for file, data in draft.files.items() if _belongs_to(file, name))
    return _read_cells(name, own)


def _belongs_to(file: str, name: str) -> bool:
    if name == PARTICIPANTS_FILE:
        return file in (PARTICIPANTS_FILE, STUDY_FILE)
    folder, _, rest = file.rpartition("/")
    return folder == "tables" and rest.rpartition(".")[0] == name


@lru_cache(maxsize=16)
def _read_cells(name: str, files: tuple[tuple[str, bytes], ...]) -> GridTable | str:
    """Read a table, or the reason why not. Cached by its files, so that a cursor move reads no table again."""
    try:
        cells = written_cells(dict(files), name)
        return GridTable(cells, _natural_widths(cells))
    except EditRefused as refused:
        return str(refused)


def row_at_line(grid: Grid, place: str) -> GridRow | None:
    """The row at a line, `tables/items.csv:3`; None: none."""
    file, _, line = place.rpartition(":")
    for name, table in grid.tables.items():
        if table.cells.file == file and line.isdigit():
            before = [number for number, first in enumerate(table.cells.lines) if first <= int(line)]
            return GridRow(name, before[-1]) if before else GridRow(name, 0)
    return None


def is_selectable(grid: Grid, row: GridRow) -> bool:
    """Whether the cursor can be on this row: on rows, and on the columns of a table without rows."""
    table = grid.tables.get(row.table)
    return row.number >= 0 or (row.number == -1 and table is not None and not table.cells.rows)


# --- widths ---------------------------------------------------------------------------------------------------------


def _natural_widths(table: WrittenCells) -> tuple[int, ...]:
    shown = (table.columns, *table.rows[:_MEASURED])
    return tuple(
        max(MIN_COLUMN_WIDTH, *(cell_width(clean(row[index])) for row in shown if index < len(row))) + 2
        for index in range(len(table.columns))
    )


def columns_in_view(table: GridTable, column: int, width: int) -> list[GridColumn]:
    """The columns that fit, including the one with the cursor.

    If all columns fit, each gets its full width. Otherwise none is wider than `MAX_COLUMN_WIDTH`, cut columns share
    the rest, and columns before the cursor's are hidden.

    :param column: the index of the column with the cursor. :param width: cells of a row.
    """
    room, natural = width - NUMBER, table.widths
    if sum(natural) <= room:
        return [GridColumn(index, each) for index, each in enumerate(natural)]
    widths = [min(each, MAX_COLUMN_WIDTH, room) for each in natural]
    first = 0
    while sum(widths[first : column + 1]) > room:
        first += 1
    fitting = sum(1 for total in accumulate(widths[first:]) if total <= room)
    left = room - sum(widths[first : first + fitting])
    while left > 0 and (cut := [at for at in range(first, first + fitting) if widths[at] < natural[at]]):
        for at in cut:  # in equal parts, until nothing is cut or no room is left
            more = min(max(1, left // len(cut)), natural[at] - widths[at], left)
            widths[at], left = widths[at] + more, left - more
    found = [GridColumn(at, widths[at]) for at in range(first, first + fitting)]
    if left > MIN_COLUMN_WIDTH + 2 and first + fitting < len(widths):  # the beginning of the next one
        found.append(GridColumn(first + fitting, left))
    return found


def grid_line(grid: Grid, row: GridRow, column: int, width: int, *, is_current: bool) -> StyledLine:
    """One row of the page.

    :param column: the cursor's column, in the cursor's table. :param is_current: whether this is the cursor's row.
    """
    if row.table in grid.problems:
        return crop(((f" {row.table}", "accent"), (f"  ✗ {clean(grid.problems[row.table])}", "fault")), width)
    table = grid.tables[row.table].cells
    if row.number == -2:
        size = f"{pluralize(len(table.rows), 'row')} x {pluralize(len(table.columns), 'column')}"
        return crop(((f" {row.table}", "accent"), (f"  {size}  {table.file}", "muted")), width)
    column = min(column, len(table.columns) - 1)
    shown = columns_in_view(grid.tables[row.table], column, width)
    head = f"{row.number + 1:>{NUMBER - 2}}" if row.number >= 0 else ""
    line: list[StyledSpan] = [fixed_span(f" {head}", NUMBER, "muted")]
    values = table.columns if row.number < 0 else table.rows[row.number]
    for index, cells in shown:
        value = values[index] if index < len(values) else ""
        is_here = is_current and index == column
        line.append(("▸" if is_here and row.number >= 0 else " ", "accent"))
        if row.number < 0:
            line.append(fixed_span(value, cells - 1, "accent" if is_here else "muted"))
        else:
            line.append(fixed_span(value, cells - 1, "strong" if is_here else "plain"))
    return crop(tuple(line), width)


def hidden_columns(table: GridTable, column: int, width: int) -> tuple[int, int]:
    """The number of hidden columns on the left and on the right."""
    shown = columns_in_view(table, min(column, len(table.widths) - 1), width)
    return shown[0].at, len(table.widths) - 1 - shown[-1].at


# --- edits ----------------------------------------------------------------------------------------------------------


def cell_problem(value: str) -> str:
    """Why a value can only be changed in its file; empty: it can be changed here."""
    return "" if clean(value, keep="\n") == value else "it has invisible characters"


def cell_edits(table: str, row: int, column: str, was: str, typed: str) -> tuple[AnyEdit, ...]:
    """The edits that change a cell; none if it already has this value."""
    return (SetCell(table, row, column, typed),) if typed.strip() != was else ()


def copied_row(name: str, table: WrittenCells, after: int) -> AddRow:
    """A new row with the values of the row before it, because a table has no empty cells."""
    values: Sequence[str] = table.rows[min(after, len(table.rows) - 1)] if table.rows else ["…"] * len(table.columns)
    return AddRow(name, dict(zip(table.columns, values, strict=False)), after + 1)


def new_table(names: Sequence[str], name: str, columns: str) -> ReplaceFile:
    """A table with columns and without rows.

    :param names: the existing tables. :param columns: the typed names, separated by commas.
    :raises EditRefused: the name is invalid or taken, or there are no columns, or one occurs twice.
    """
    if not is_writable_key(name) or "." in name:
        raise EditRefused(f"a table's name has letters, digits and _, and begins with a letter; not “{name}”")
    if name.casefold() in (each.casefold() for each in names):
        raise EditRefused(f"there is a table {name} already")
    given = [each.strip() for each in columns.split(",")]
    if not all(given) or len({*given}) < len(given):
        raise EditRefused("each column has a name, and no two have the same: id, text, condition")
    if odd := next((each for each in given if any(sign in each for sign in '";\t')), ""):
        raise EditRefused(f"a column cannot be called “{odd}” here")
    return ReplaceFile(f"{TABLES_FOLDER}/{name}.csv", ",".join(given) + "\n")


def new_column(table: str, column: str, at: int, further: Sequence[str]) -> tuple[AnyEdit, ...]:
    """A column, empty in all rows. A column of participants.csv is also added to study.toml.

    :param further: the columns that `[participants]` names.
    """
    column = column.strip()
    if table != PARTICIPANTS_FILE or column.startswith("consent_"):
        return (AddColumn(table, column, at),)
    named = SetSetting(("participants", "columns"), [*further, column], file=STUDY_FILE)
    return AddColumn(table, column, at), *(() if column in further else (named,))


def next_pseudonym(cells: WrittenCells) -> str:
    """A likely name for the next participant: P09 after P08; empty: there is none."""
    at = cells.columns.index("participant") if "participant" in cells.columns else -1
    last = cells.rows[-1][at] if cells.rows and at >= 0 else "P00"
    digits = last[len(last.rstrip("0123456789")) :]
    return f"{last[: len(last) - len(digits)]}{int(digits) + 1:0{len(digits)}}" if digits else ""
