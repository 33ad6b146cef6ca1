"""Edits of tables: cells and rows, with the separators, quotes and line ends that a file has."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.author.edit.edits import AddColumn, AddRow, Edit, RemoveRow, SetCell
from rise_engine.author.edit.plan import EditRefused, StudyState, apply_plan
from rise_engine.author.edit.planning import plan
from rise_engine.scenario.loader import LoadResult

TEXT = 'sep=;\r\nid;"say";n\r\nlamp; "Put; it"  ;1\r\n;;\r\nrug;Lay it ;2'
TEXT = TEXT.replace('"  ;', '";')


def changed(text: bytes, edit: Edit, **more: bytes) -> bytes:
    files = {
        "tables/items.csv": text,
        **{name.replace("__", "/").replace("_", "."): data for name, data in more.items()},
    }
    return apply_plan(files, plan(edit, StudyState(files, LoadResult(None, []), Path("study"))))["tables/items.csv"]


@pytest.mark.parametrize(
    ("edit", "old", "new"),
    [
        (SetCell("items", 0, "say", "Take it"), '"Put; it"', '"Take it"'),
        (SetCell("items", 0, "say", 'A "big" one'), '"Put; it"', '"A ""big"" one"'),
        (SetCell("items", 1, "say", "a; b"), "Lay it ", '"a; b"'),
        (SetCell("items", 1, "say", ""), "Lay it", ""),
        (SetCell("items", 1, "n", "3"), ";2", ";3"),
        (SetCell("items", 1, "n", "2"), "", ""),
        (AddRow("items", {"id": "cup", "n": "4"}), ";2", ";2\r\ncup;;4"),
        (AddRow("items", {"id": "cup"}, 1), 'lamp; "Put; it";1\r\n', 'lamp; "Put; it";1\r\ncup;;\r\n'),
        (AddRow("items", {"id": "cup"}, 0), '"say";n\r\n', '"say";n\r\ncup;;\r\n'),
        (RemoveRow("items", 0), 'lamp; "Put; it";1\r\n', ""),
        (RemoveRow("items", 1), "\r\nrug;Lay it ;2", ""),
    ],
)
def test_one_place_of_a_table_changes(edit: Edit, old: str, new: str) -> None:
    assert changed(TEXT.encode(), edit).decode() == (TEXT.replace(old, new) if old else TEXT)


@pytest.mark.parametrize(
    ("edit", "lines"),
    [
        (AddColumn("items", "m"), ["sep=;", 'id;"say";n;m', 'lamp; "Put; it";1;', ";;", "rug;Lay it ;2;"]),
        (AddColumn("items", "a;b", 2), ["sep=;", 'id;"say";"a;b";n', 'lamp; "Put; it";;1', ";;", "rug;Lay it ;;2"]),
        (AddColumn("items", "m", 0), ["sep=;", 'm;id;"say";n', ';lamp; "Put; it";1', ";;", ";rug;Lay it ;2"]),
    ],
)
def test_a_column_more(edit: Edit, lines: list[str]) -> None:
    assert changed(TEXT.encode(), edit).decode() == "\r\n".join(lines)


def test_windows_1252_stays_what_it_is() -> None:
    settings = {"tables__items_toml": b'encoding = "cp1252"\n'}
    assert changed("a,b\nö,1\n".encode("cp1252"), SetCell("items", 0, "a", "ü"), **settings) == "a,b\nü,1\n".encode(
        "cp1252"
    )
    with pytest.raises(EditRefused, match="is CP1252, which has no `Ω`"):
        changed(b"a,b\nx,1\n", SetCell("items", 0, "a", "Ω"), **settings)


@pytest.mark.parametrize(
    ("text", "edit", "why"),
    [
        ("a,b\n1,2\n", SetCell("itens", 0, "a", "x"), "no table `itens`; did you mean `items`"),
        ("a,b\n1,2\n", SetCell("items", 1, "a", "x"), "has 1 row; there is no row 2"),
        ("a,bb\n1,2\n", SetCell("items", 0, "bbb", "x"), "no column `bbb`; did you mean `bb`"),
        ("a,b\n,2\n", SetCell("items", 0, "b", " "), "without any value would not be read"),
        ("a,b\n1,2\n", AddColumn("items", "b"), "has a column `b` already"),
        ("a,b\n1,2\n", AddColumn("items", " "), "a column has a name"),
        ("a,b\n1,2\n", AddColumn("items", "c", 3), "cannot be inserted there"),
        ("a,b\n1,2\n", AddRow("items", {}), "without any value would not be read"),
        ("a,b\n1,2\n", AddRow("items", {"a": "1"}, 5), "cannot be inserted there"),
        ("a,b\n1,2,3\n", SetCell("items", 0, "a", "x"), "cannot be read as a table"),
        ('a,b\n"1,2\n', SetCell("items", 0, "a", "x"), "cannot be read as a table"),
        ("", RemoveRow("items", 0), "cannot be read as a table"),
    ],
)
def test_what_cannot_be_is_refused(text: str, edit: Edit, why: str) -> None:
    with pytest.raises(EditRefused, match=why):
        changed(text.encode(), edit)


def test_blanks_behind_a_value_that_gets_quotation_marks_go() -> None:
    assert changed(b"a;b\nx \t ;1\n", SetCell("items", 0, "a", ";")) == b'a;b\n";";1\n'
    assert changed(b"a\tb\nx \t1\n", SetCell("items", 0, "a", '"')) == b'a\tb\n""""\t1\n'
    assert changed(b"a;b\n1;x \t\r\n", SetCell("items", 0, "b", ";")) == b'a;b\n1;";"\r\n'


cells = st.text('ab;,"\n é\t', max_size=4)


@pytest.mark.slow
@given(
    st.lists(st.lists(cells, min_size=3, max_size=3), min_size=1, max_size=4),
    st.sampled_from(";,\t"),
    st.sampled_from(["\n", "\r\n"]),
    st.sampled_from([csv.QUOTE_ALL, csv.QUOTE_MINIMAL]),
    st.data(),
)
def test_any_edit_of_any_table(
    rows: list[list[str]], separator: str, newline: str, quoting: Literal[0, 1], data: st.DataObject
) -> None:
    rows = [["x" + row[0], *row[1:]] for row in rows]
    out = io.StringIO()
    csv.writer(out, delimiter=separator, lineterminator=newline, quoting=quoting).writerows([["a", "b", "c"], *rows])
    text = out.getvalue()
    number, column, value = data.draw(st.integers(0, len(rows) - 1)), data.draw(st.integers(0, 2)), data.draw(cells)
    edit = data.draw(
        st.sampled_from(
            [
                SetCell("items", number, "abc"[column], value),
                RemoveRow("items", number),
                AddRow("items", {"a": "x" + value}),
            ]
        )
    )
    match edit:
        case SetCell():
            rows[number][column] = value
        case RemoveRow():
            del rows[number]
        case AddRow():
            rows.append(["x" + value, "", ""])
    if any(not "".join(row).strip() for row in rows):
        return
    after = changed(text.encode(), edit).decode()
    found = list(csv.reader(io.StringIO(after, newline=""), delimiter=separator, skipinitialspace=True))
    stripped = [[value.strip().replace("\r\n", "\n") for value in row] for row in found if any(v.strip() for v in row)]
    assert stripped == [["a", "b", "c"], *([value.strip() for value in row] for row in rows)]


# --- participants.csv -------------------------------------------------------------------------------------------------

PEOPLE = 'participant;consent_study;comment\r\nP01;2026-11-01;"a; b"\r\nP02;;\r\n'
LOG = b'{"kind":"taken","at":"","slot":1,"participant":"P01"}\n'


def people_after(edit: Edit, log: bytes = LOG) -> str:
    files = {"participants.csv": PEOPLE.encode(), "study.toml": b'title = "S"\n', "study.jsonl": log}
    state = StudyState(files, LoadResult(None, []), Path("study"))
    return apply_plan(files, plan(edit, state))["participants.csv"].decode()


def test_participants_are_a_table_of_which_no_other_line_changes() -> None:
    new = AddRow("participants.csv", {"participant": "P03"})
    assert people_after(new) == f"{PEOPLE}P03;;\r\n"
    consent = SetCell("participants.csv", 1, "consent_study", "2026-11-02")
    assert people_after(consent) == PEOPLE.replace("P02;", "P02;2026-11-02")
    assert people_after(SetCell("participants.csv", 1, "participant", "P20")) == PEOPLE.replace("P02", "P20")
    assert people_after(RemoveRow("participants.csv", 1)) == PEOPLE.replace("P02;;\r\n", "")


@pytest.mark.parametrize(
    "edit", [SetCell("participants.csv", 0, "participant", "P09"), RemoveRow("participants.csv", 0)]
)
def test_who_was_recorded_stays(edit: Edit) -> None:
    with pytest.raises(EditRefused, match="P01 is already in study\\.jsonl"):
        people_after(edit)
    assert people_after(edit, b"") != PEOPLE


def test_a_scenario_has_no_participants() -> None:
    files = {"participants.csv": PEOPLE.encode()}
    state = StudyState(files, LoadResult(None, []), Path("study"))
    with pytest.raises(EditRefused, match="no table `participants"):
        plan(RemoveRow("participants.csv", 1), state)
