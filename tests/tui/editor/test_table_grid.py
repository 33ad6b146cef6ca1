"""Tables as grids: what has room, without a screen, and the page by its keys."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from textual import events

from rise_engine.author.edit.edits import AddColumn, AddRow, AnyEdit, SetCell, SetSetting
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.tables import WrittenCells
from rise_engine.author.edit.workspace import Workspace
from rise_engine.study.review import findings_of_files
from rise_tui.editor.model.draft import StudyDraft, draft_of
from rise_tui.editor.model.study_rows import find_at
from rise_tui.editor.model.table_grid import (
    NUMBER,
    Grid,
    GridRow,
    GridTable,
    cell_edits,
    cell_problem,
    columns_in_view,
    copied_row,
    grid_line,
    grid_of,
    hidden_columns,
    new_column,
    new_table,
    next_pseudonym,
    row_at_line,
)
from rise_tui.editor.screen import EditApp
from rise_tui.editor.study import EditedStudy
from rise_tui.editor.tables_page import TablesPage
from rise_tui.rendering.text import line_width, plain_text
from tests.study.studies import write_study
from tests.tui.editor.conftest import STUDIES, Editor, OneSession, editor

PRICES = (
    'id;name;long;price;note1;note2;note3;note4\r\n007;"Hello; you";some text that is quite long, and needs room;1,50;'
    'aaaaaaaaaaaaaaa;bbbbbbbbbbbbbbbbbbb;ccccccccccccccccc;last\r\n008;"two\r\nlines";x;2,50;a;b;c;d\r\n'
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The study with instructions in a table, and a second table of many columns."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    copy = tmp_path / "negation"
    shutil.copytree(STUDIES / "negation", copy)
    (copy / "tables" / "prices.csv").write_bytes(PRICES.encode())
    (copy / "tables" / "prices.toml").write_text('decimal = ","\n')
    (copy / "tables" / "empty.csv").write_text("a,b\n")
    return copy


@pytest.fixture
def draft(folder: Path) -> StudyDraft:
    return draft_of(Workspace(folder))


def grid_table(draft: StudyDraft) -> GridTable:
    return grid_of(draft).tables["prices"]


def test_values_are_as_they_are_written(draft: StudyDraft) -> None:
    cells = grid_table(draft).cells
    assert cells.rows[0][:4] == ("007", "Hello; you", "some text that is quite long, and needs room", "1,50")
    assert cells.rows[1][1] == "two\nlines" and cells.lines == (2, 3)


def test_all_tables_stand_under_each_other_and_rows_are_found(draft: StudyDraft) -> None:
    rows = grid_of(draft).rows
    assert [row.table for row in rows if row.number == -2] == ["empty", "instructions", "prices"]
    assert sum(row.table == "instructions" for row in rows) == 2 + 12
    for wanted, found in (
        ("FIREPLACE", [("instructions", 4)]),
        ("hello;", [("prices", 0)]),
        ("price", [("prices", 0), ("prices", 1)]),
    ):
        assert [row for row in grid_of(draft, wanted).rows if row.number >= 0] == found


@pytest.mark.parametrize("column", range(8))
@pytest.mark.parametrize("width", [30, 79, 119, 300])
def test_the_column_of_the_cursor_is_in_view_and_no_cell_is_wasted(draft: StudyDraft, width: int, column: int) -> None:
    table = grid_table(draft)
    shown = columns_in_view(table, column, width)
    assert column in [each.at for each in shown]
    assert [each.at for each in shown] == list(range(shown[0].at, shown[-1].at + 1))
    room, needed = width - NUMBER, sum(table.widths)
    assert sum(each.width for each in shown) <= room
    if needed <= room:
        assert [each.width for each in shown] == list(table.widths)
    before, behind = hidden_columns(table, column, width)
    assert before + len(shown) + behind == 8
    grid = grid_of(draft)
    for row in grid.rows:
        line = grid_line(grid, row, column, width, is_current=True)
        assert line_width(line) <= width
        assert ("▸" in plain_text(line)) is (row.number >= 0)


@pytest.mark.parametrize(
    ("was", "said", "edits"),
    [
        ("x", "x", ()),
        ("x", " x ", ()),
        ("x", "y", (SetCell("prices", 1, "long", "y"),)),
        ("x", "", (SetCell("prices", 1, "long", ""),)),
        ("a  b", "a b", (SetCell("prices", 1, "long", "a b"),)),
    ],
)
def test_what_is_typed_becomes_an_edit(was: str, said: str, edits: tuple[AnyEdit, ...]) -> None:
    assert cell_edits("prices", 1, "long", was, said) == edits


def test_a_new_row_begins_as_the_one_before_it(draft: StudyDraft) -> None:
    grid = grid_of(draft)
    assert copied_row("empty", grid.tables["empty"].cells, -1) == AddRow("empty", {"a": "…", "b": "…"}, 0)
    new = copied_row("prices", grid.tables["prices"].cells, 0)
    assert (new.at, new.values["id"], new.values["price"]) == (1, "007", "1,50")
    assert cell_problem("two\nlines") == "" and cell_problem("a\x07") != ""


@pytest.mark.parametrize(
    ("place", "row"),
    [("tables/prices.csv:1", 0), ("tables/prices.csv:2", 0), ("tables/prices.csv:4", 1), ("tables/none.csv:2", None)],
)
def test_a_finding_leads_to_its_row(draft: StudyDraft, place: str, row: int | None) -> None:
    file, _, line = place.rpartition(":")
    assert find_at(draft, file, int(line)) == ("tables", place)
    assert row_at_line(grid_of(draft), place) == (None if row is None else GridRow("prices", row))


def test_a_table_that_cannot_be_read_says_so_and_the_others_are_there(folder: Path) -> None:
    (folder / "tables" / "prices.csv").write_bytes(b'a,b\n"1,2\n')
    grid = grid_of(draft_of(Workspace(folder)))
    assert isinstance(grid, Grid) and list(grid.tables) == ["empty", "instructions"]
    row = next(each for each in grid.rows if each.table == "prices")
    assert "✗ tables/prices.csv cannot be read" in plain_text(grid_line(grid, row, 0, 119, is_current=False))


# --- the page -------------------------------------------------------------------------------------------------------


def page_of(it: Editor) -> TablesPage:
    page = it.screen.opened
    assert isinstance(page, TablesPage)
    return page


def file_of(it: Editor, name: str) -> str:
    return it.screen.study.draft.files[f"tables/{name}.csv"].decode()


async def open_at(it: Editor, place: str) -> TablesPage:
    await it.open("tables", place)
    await it.until(lambda: page_of(it).row is not None)
    return page_of(it)


@pytest.mark.slow
async def test_a_cell_is_changed_and_nothing_else_of_its_file(folder: Path) -> None:
    async with editor(folder) as it:
        page = await open_at(it, "tables/prices.csv:2")
        await it.press("right", "right", "right", "enter")
        assert page.field.text == "1,50"
        await it.press("backspace")
        await it.type("5")
        await it.press("tab")
        await it.until(lambda: file_of(it, "prices") == PRICES.replace("1,50", "1,55"))
        await it.until(lambda: it.screen.page.is_typing)
        assert page.field.text.startswith("aaaa"), "tab goes on to the next column"
        await it.press("escape", "ctrl+u")
        await it.until(lambda: file_of(it, "prices") == PRICES)
        page = await open_at(it, "tables/prices.csv:3")
        await it.press("right", "enter")
        assert page.field.text == "two\nlines"
        page.field.post_message(events.Paste("!\n!"))
        await it.until(lambda: page.field.text == "two\nlines! !")
        await it.press("enter")
        await it.until(lambda: "lines! !" in file_of(it, "prices"))
        cells = grid_of(it.screen.study.draft).tables["prices"].cells
        assert cells.rows[1][1] == "two\nlines! !", "line ends in a cell stay, and pasted ones are blanks"


@pytest.mark.slow
async def test_arrows_go_through_rows_columns_and_tables_and_rows_are_found_added_and_removed(folder: Path) -> None:
    async with editor(folder) as it:
        page = await open_at(it, "tables/instructions.csv:13")
        assert page.value == "cat"
        await it.press("left", "right", "right", "right")
        assert page.column == 2
        await it.press("down")
        assert page.row is not None and page.row[0] == GridRow("prices", 0) and page.column == 2
        await it.press("end", *["right"] * 9)
        assert (page.value, page.column) == ("d", 7)
        assert "◂" in page.parting.text and "▸d" in page.grid.text
        await it.press("slash")
        await it.type("fireplace")
        await it.until(lambda: page.row is not None and page.value.startswith("Do not hang the picture"))
        await it.press("enter", "escape")
        await it.until(lambda: sum(row.number >= 0 for row in page.grid.grid.rows) == 14)
        assert page.place is not None and (page.place.file, page.place.line) == ("tables/instructions.csv", 6)
        page = await open_at(it, "tables/instructions.csv:3")
        before = file_of(it, "instructions")
        await it.press("a")
        await it.until(lambda: file_of(it, "instructions").count("\nchair,") == 2)
        await it.until(lambda: page.row is not None and page.row[0].number == 2)
        await it.press("delete")
        await it.until(lambda: file_of(it, "instructions") == before)
        await it.press("home")
        assert page.grid.current == GridRow("empty", -1)
        await it.press("enter", "delete")
        assert "there is no row under the cursor" in it.notice
        await it.press("a")  # also the first of a table
        await it.until(lambda: file_of(it, "empty") == "a,b\n…,…\n")
        await it.until(lambda: page.row is not None and page.row[0] == GridRow("empty", 0))
        await it.press("right", "enter", "backspace", "enter")
        await it.until(lambda: file_of(it, "empty") == "a,b\n…,\n")
        await it.press("left", "enter", "backspace")
        await it.until(lambda: "a row of tables/empty.csv without any value would not be read" in page.remarks.text)
        await it.press("enter")
        await it.until(lambda: "without any value" in it.notice, "what is wrong is said while it is typed")
        assert file_of(it, "empty") == "a,b\n…,\n"


@pytest.mark.slow
async def test_a_study_without_tables_says_so_and_makes_one(study: Path) -> None:
    async with editor(study) as it:
        await it.open("tables")
        await it.press("enter", "delete", "left", "right", "tab")
        assert "this study has no tables yet: n adds one" in page_of(it).head.text and "no tables yet" in it.notice
        await it.press("a")
        await it.type("items")
        await it.press("enter")
        await it.type("id, text")
        await it.press("enter")
        await it.until(lambda: file_of(it, "items") == "id,text\n")
        await it.press("a")
        await it.until(lambda: file_of(it, "items") == "id,text\n…,…\n")
        await it.press("right", "A")
        await it.type("text.de")
        await it.press("enter")
        await it.until(lambda: file_of(it, "items") == "id,text,text.de\n…,…,\n")


@pytest.mark.slow
async def test_participants_are_added_and_wrong_dates_are_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    write_study(tmp_path / "study", plan=False)
    before = (tmp_path / "study" / "participants.csv").read_text()
    workspace = Workspace(tmp_path / "study", also_check=findings_of_files)
    app = EditApp(EditedStudy(workspace, draft_of(workspace)), sessions=OneSession())
    async with app.run_test(size=(100, 30)) as pilot:
        it = Editor(pilot, app.edit_screen, tmp_path / "study")
        await it.until(lambda: it.screen.home.rows.count)
        assert "People" in it.screen.home.rows.text and "ACTS" not in it.screen.home.rows.text
        await it.press("a")
        assert it.screen.study.draft.files["participants.csv"].decode() == before, "no act is added to a study"
        await it.open("tables")
        await it.press("a", "enter")
        await it.until(lambda: it.screen.study.draft.files["participants.csv"].decode() == f"{before}P09,,,\n")
        await it.press("right", "enter")
        await it.type("1.11.2026")
        await it.until(lambda: "dates are written year-month-day: `2026-11-01`" in page_of(it).remarks.text)
        await it.press("escape", "A")
        await it.type("age")
        await it.press("enter")
        await it.until(lambda: b"age" in it.screen.study.draft.files["study.toml"])
        assert it.screen.study.draft.checked.errors == []


@pytest.mark.parametrize(
    ("name", "columns", "problem"),
    [
        ("1x", "a", "a table's name has letters"),
        ("a.b", "a", "a table's name has letters"),
        ("Prices", "a", "there is a table Prices already"),
        ("x", "a,,b", "each column has a name"),
        ("x", "a, a", "no two have the same"),
        ("x", 'a"b', "cannot be called"),
    ],
)
def test_what_is_no_new_table(name: str, columns: str, problem: str) -> None:
    with pytest.raises(EditRefused, match=problem):
        new_table(["prices"], name, columns)


def test_a_new_column_of_participants_stands_in_the_design_too() -> None:
    named = SetSetting(("participants", "columns"), ["language", "age"], file="study.toml")
    assert new_column("participants.csv", " age ", 2, ["language"]) == (AddColumn("participants.csv", "age", 2), named)
    for table, column in (("participants.csv", "language"), ("participants.csv", "consent_film"), ("items", "age")):
        assert new_column(table, column, 1, ["language"]) == (AddColumn(table, column, 1),)


@pytest.mark.parametrize(
    ("last", "following"), [("P08", "P09"), ("P99", "P100"), ("007", "008"), ("Anna", ""), (None, "P01")]
)
def test_the_next_pseudonym(last: str | None, following: str) -> None:
    cells = WrittenCells("participants.csv", ("participant",), ((last,),) if last else (), (2,))
    assert next_pseudonym(cells) == following
