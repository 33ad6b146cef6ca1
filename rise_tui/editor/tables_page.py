"""The tables of a study in rows and columns. The cell under the cursor is changed below them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

from textual import on
from textual.geometry import Size

from rise_engine.author.edit.edits import AddRow, AnyEdit, RemoveRow
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.tables import WrittenCells, table_names
from rise_engine.base.text import clean, pluralize
from rise_engine.scenario.files.study_paths import PARTICIPANTS_FILE, STUDY_FILE
from rise_tui.editor.model.draft import FilePlace, is_study_alone
from rise_tui.editor.model.table_grid import (
    Grid,
    GridRow,
    cell_edits,
    cell_problem,
    copied_row,
    grid_line,
    grid_of,
    hidden_columns,
    is_selectable,
    new_column,
    new_table,
    next_pseudonym,
    row_at_line,
)
from rise_tui.editor.page import EditFrame
from rise_tui.editor.sentence_page import SentencePage
from rise_tui.rendering.text import ListRow, StyledLine, TextRole, crop, plain_text, wrap
from rise_tui.widgets.lines import RowView

EMPTY = "this study has no tables yet: n adds one"


class TableGrid(RowView):
    """Rows of all tables, made when they are painted. Left and right move through the columns."""

    def __init__(self) -> None:
        super().__init__(id="grid")
        self.grid, self.column = Grid({}, {}, ()), 0

    @property
    def count(self) -> int:
        return len(self.grid.rows)

    def row_at(self, index: int) -> ListRow:
        row, here = self.grid.rows[index], self.current
        is_current = here is not None and row.table == here.table and (row.number < 0 or row == here)
        line = grid_line(self.grid, row, self.column, max(20, self.row_width), is_current=is_current)
        return ListRow(f"{row.table}\0{row.number}", line, selectable=is_selectable(self.grid, row))

    @property
    def current(self) -> GridRow | None:
        """The row under the cursor."""
        return self.grid.rows[self.cursor] if 0 <= self.cursor < len(self.grid.rows) else None

    @property
    def text(self) -> str:
        """The characters of all rows."""
        return "\n".join(plain_text(self.row_at(index).line).rstrip() for index in range(self.count))

    def show(self, grid: Grid) -> None:
        """Show these tables. The cursor stays on its row, or goes to the nearest one."""
        before, self.grid = self.current, grid
        self.virtual_size = Size(self.row_width, len(grid.rows))
        rows = [index for index, row in enumerate(grid.rows) if is_selectable(grid, row)]
        same = next((index for index in rows if grid.rows[index] == before), None)
        at = min(rows, key=lambda index: abs(index - max(self.cursor, 0)), default=-1) if same is None else same
        self.move_cursor(at, by_wizard=False)
        self.refresh()

    def select(self, row: GridRow) -> None:
        """Put the cursor on a row, if it exists."""
        if row in self.grid.rows:
            self.move_cursor(self.grid.rows.index(row), by_wizard=False)
            self.refresh()


class TablesPage(SentencePage):
    """All tables, one below the other."""

    KIND: ClassVar[str] = "tables"
    CAN_FILTER = True
    MIN_DETAIL = 4

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        """`name`: the first place of the cursor, `tables/items.csv:3`; empty: the first row."""
        self.grid = TableGrid()
        super().__init__(frame, name, self.grid, exact=True)
        self._begins_at = name

    @property
    def hints(self) -> Mapping[str, str]:
        words = {"edit.open": "change", "edit.add": "row", "edit.behind": "column", "edit.remove": "remove row"}
        if self.is_of_study:
            return {**words, "edit.add": "participant"}
        return {**(words if self.grid.current is not None else {}), "edit.new-state": "new table"}

    @property
    def is_of_study(self) -> bool:
        """Whether the files are those of a study with participants, without a scenario."""
        return is_study_alone(self.draft)

    @property
    def own_hints(self) -> Sequence[tuple[str, str]]:
        return (*super().own_hints, *([("←→", "column")] if self.row is not None else []))

    @property
    def row(self) -> tuple[GridRow, WrittenCells] | None:
        """The row under the cursor, and its table."""
        row = self.grid.current
        return (row, self.grid.grid.tables[row.table].cells) if row is not None and row.number >= 0 else None

    @property
    def column(self) -> int:
        """The index of the cursor's column in its table."""
        return min(self.grid.column, len(self.row[1].columns) - 1) if self.row is not None else 0

    @property
    def value(self) -> str:
        """The cell under the cursor."""
        if self.row is None:
            return ""
        row, table = self.row
        values = table.rows[row.number]
        return values[self.column] if self.column < len(values) else ""

    @property
    def place(self) -> FilePlace | None:
        if self.row is None:
            return None
        row, table = self.row
        line = table.lines[row.number]
        return FilePlace(table.file, line, line + "".join(table.rows[row.number]).count("\n"))

    # --- drawing ----------------------------------------------------------------------------------------------------

    def draw(self) -> None:
        self.grid.show(grid_of(self.draft, self.wanted))
        grid = self.grid.grid
        if (begin := row_at_line(grid, self._begins_at)) is not None:
            self.grid.select(begin)
        self._begins_at = ""
        number = len(grid.tables) + len(grid.problems)
        note = EMPTY if not number else f"find {self.wanted}" if self.wanted else pluralize(number, "table")
        title = " PARTICIPANTS" if self.is_of_study else " TABLES"
        head: StyledLine = ((title, "strong"), (f"  {clean(note)}", "wait" if self.wanted else "muted"))
        self.head.show(crop(head, max(20, self.size.width)))
        if self.is_typing and self.row is None:
            self.close_field()
        self.draw_detail()

    @on(RowView.CursorMoved)
    def _moved(self) -> None:
        self.grid.refresh()  # another table has other marked columns
        self.draw_detail()

    def draw_detail(self) -> None:
        if self.row is None:
            self.parting.show()
            self.show_detail([])
            return
        row, table = self.row
        width = max(20, self.size.width)
        before, behind = hidden_columns(self.grid.grid.tables[row.table], self.column, max(20, self.grid.row_width))
        more = [f"◂ {before} more"] if before else []
        more += [f"{behind} more ▸"] if behind else []
        left: StyledLine = (
            (f" {clean(row.table)}", "accent"),
            (f"  row {row.number + 1} of {len(table.rows)}, ", "muted"),
            (clean(table.columns[self.column]), "strong"),
            (f"  column {self.column + 1} of {len(table.columns)}  {'  '.join(more)}", "muted"),
        )
        self.parting.show(crop(left, width))
        role: TextRole = "plain" if self.value else "muted"
        pieces = [] if self.is_typing else wrap(self.value or "–", width - 3)
        self.show_detail([((f"  {piece}", role),) for piece in pieces])

    # --- keys -------------------------------------------------------------------------------------------------------

    def turn(self, step: int) -> bool:
        self._go_to_column(self.column + step)
        return True

    def _go_to_column(self, column: int) -> None:
        if self.row is not None and 0 <= column < len(self.row[1].columns):
            self.grid.column = column
            self.grid.refresh()
            self.draw_detail()
            self.frame.draw_bars()

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        calls: dict[str, Callable[[], object]] = {
            "edit.open": self.open_current,
            "edit.remove": self.remove_row,
            "edit.behind": self.add_column,
            "edit.add": self.add,
        }
        if not self.is_of_study:
            calls["edit.new-state"] = self.add_table
            calls["edit.add"] = self.add if self.grid.grid.rows else self.add_table
        return calls

    @property
    def _why_not(self) -> str:
        return "there is no row under the cursor" if self.grid.grid.rows else EMPTY

    def open_current(self) -> None:
        """Change the cell under the cursor."""
        if self.row is None:
            raise EditRefused(self._why_not)
        if problem := cell_problem(self.value):
            raise EditRefused(f"{problem}: e opens its file")
        self.open_field(self.row[1].columns[self.column], self.value)

    def edits_typed(self, typed: str) -> tuple[AnyEdit, ...]:
        if self.row is None:
            return ()
        row, table = self.row
        return cell_edits(row.table, row.number, table.columns[self.column], self.value, typed)

    def go_on(self, step: int, *, changed: bool) -> None:
        """Go to the next column; after the last one, to the first of the next row."""
        if not step or self.row is None:
            return
        column = self.column + step
        if not 0 <= column < len(self.row[1].columns):
            before = self.grid.cursor
            self.grid.action_step(step)
            if self.grid.cursor == before or self.row is None:
                return
            column = 0 if step > 0 else len(self.row[1].columns) - 1
        self._go_to_column(column)
        self.open_current()

    def add(self) -> None:
        """Add a row after the one under the cursor, with the same values."""
        current = self.grid.current
        if current is None or current.table not in self.grid.grid.tables:
            raise EditRefused(self._why_not)
        name, after = current.table, max(current.number, -1)
        table = self.grid.grid.tables[name].cells
        if name == PARTICIPANTS_FILE:
            end = len(table.rows)
            self.frame.ask_text(
                "A new participant", next_pseudonym(table),
                lambda typed: self._make_row(AddRow(name, {"participant": typed.strip()}, end)),
                hint="A pseudonym of letters and digits: P09.",
            )  # fmt: skip
        else:
            self._make_row(copied_row(name, table, after))

    def _make_row(self, edit: AddRow) -> None:
        new = GridRow(edit.table, edit.at or 0)

        def go_to_new() -> None:
            self.grid.select(new)
            self.draw_detail()
            self.frame.draw_bars()

        self.make(edit, then=go_to_new)

    def add_column(self) -> None:
        """Add a column after the one under the cursor."""
        current = self.grid.current
        if current is None or current.table not in self.grid.grid.tables:
            raise EditRefused(self._why_not)
        name, width = current.table, len(self.grid.grid.tables[current.table].cells.columns)
        at = min(self.grid.column, width - 1) + 1
        participants = self.draft.values_in(STUDY_FILE).get("participants", {})
        further = participants.get("columns", []) if isinstance(participants, dict) else []
        self.frame.ask_text(
            f"A new column of {name}", "",
            lambda typed: self.make(*new_column(name, typed, at, further), then=lambda: self._go_to_column(at)),
            hint="Its name; a translation is called text.de.",
        )  # fmt: skip

    def add_table(self) -> None:
        """Add a table with columns and without rows."""

        def ask_columns(name: str) -> None:
            def make(columns: str) -> None:
                edit = new_table(table_names(self.draft.files), name, columns)
                self.make(edit, then=lambda: self.grid.select(GridRow(name, -1)))

            self.frame.ask_text(
                f"The columns of {name}", "", make, hint="Names with commas between them: id, text, text.de"
            )

        self.frame.ask_text(
            "A new table", "", lambda typed: ask_columns(typed.strip()), hint="Its name for texts: items."
        )

    def remove_row(self) -> None:
        """Remove the row under the cursor."""
        if self.row is None:
            raise EditRefused(self._why_not)
        self.make(RemoveRow(self.row[0].table, self.row[0].number))
