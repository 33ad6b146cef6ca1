"""What a study says as a table, and back: an untouched table changes nothing, a changed cell changes one text."""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from rise_engine.author.edit.edits import (
    AddAct,
    AddColumn,
    AddLanguage,
    AnyEdit,
    SetCell,
    SetParameter,
    SetTranslation,
    SetUseParameter,
)
from rise_engine.author.texts import table
from rise_engine.author.texts.importing import TextImport, import_table, summary
from rise_engine.author.texts.table import (
    ReadRow,
    ReadTable,
    TextRow,
    TextTable,
    make_table,
    read_csv,
    read_po,
    read_xlsx,
    usual_separator,
    write_csv,
    write_po,
    write_xlsx,
)
from rise_engine.base.errors import ExchangeError
from rise_engine.scenario.loader import LoadResult, load
from tests.scenario.folders import act

LABLINKING = Path(__file__).parents[3] / "scenarios" / "lablinking"
KINDS = {"csv": (write_csv, read_csv), "xlsx": (write_xlsx, read_xlsx), "po": (write_po, read_po)}
NASTY = [
    "=1+1",
    "+49 521",
    "-3",
    "@x",
    "1/2",
    "3.10",
    "007",
    'He said "hi"',
    "a;b,c\td",
    "ä € 🙂",
    "\u202eabc",
    "'",
    "1e5",
    "TRUE",
]


def back(
    table: ReadTable, loaded: LoadResult | None = None, *, new: bool = False, languages: tuple[str, ...] = ()
) -> TextImport:
    loaded = loaded or load(LABLINKING)
    return import_table(table, loaded, languages, new=new)


def rows_of(table: ReadTable) -> dict[str, ReadRow]:
    return {row.values["id"]: row for row in table.rows}


def changed(table: ReadTable, row_id: str, /, **cells: str) -> ReadTable:
    """The table with other cells in one row."""
    rows = (replace(row, values={**row.values, **cells}) if row.values["id"] == row_id else row for row in table.rows)
    return replace(table, rows=tuple(rows))


def exported() -> ReadTable:
    return read_csv(write_csv(make_table(load(LABLINKING))))


@pytest.mark.parametrize("kind", KINDS)
def test_an_untouched_table_changes_nothing(kind: str) -> None:
    write, read = KINDS[kind]
    found = back(read(write(make_table(load(LABLINKING)))))
    assert (found.edits, found.refused, found.noticed, found.rows) == ((), (), (), 72)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_table_comes_back_as_any_program_saves_it(separator: str, encoding: str) -> None:
    """Rows and columns in another order, more of them, other line ends."""
    made = list(csv.reader(io.StringIO(write_csv(make_table(load(LABLINKING)), ",").decode("utf-8-sig"))))
    stream = io.StringIO()
    writer = csv.writer(
        stream, delimiter=separator, lineterminator="\n", quoting=csv.QUOTE_ALL if separator == ";" else 0
    )
    for number, row in enumerate([made[0], *reversed(made[1:]), [""] * len(made[0])]):
        writer.writerow([*reversed(row), "comment" if number == 0 else str(number)])
    found = back(read_csv(stream.getvalue().encode(encoding)))
    assert (found.edits, found.refused, found.rows) == ((), (), 72)
    assert found.noticed == ("not read: the column `comment`; for a new language, add --language TAG",)


EDITS: list[tuple[str, dict[str, str], AnyEdit]] = [
    (
        "R_Praise/2/2",
        {"text": " Well  done,\nyou & I! "},
        SetParameter("R_Praise", "2", "message", "Well done, you & I!", 1),
    ),
    ("R_Break/2", {"text": "Stop."}, SetParameter("R_Break", "2", "message", "Stop.", 0)),
    ("R_Task1_Step2/5", {"text": "X."}, SetUseParameter("acts/task_1.xml", 12, "Instruction", "second", "X.")),
    ("R_Praise/2/2", {"de": "Klasse!"}, SetTranslation("de", "R_Praise", "2/2", "Klasse!")),
]


@pytest.mark.parametrize(("id", "cells", "edit"), EDITS)
def test_a_changed_cell_is_one_edit(id: str, cells: dict[str, str], edit: AnyEdit) -> None:
    assert back(changed(exported(), id, **cells)).edits == (edit,)


def test_a_translation_in_the_same_row_is_one_of_the_new_text() -> None:
    """The original is changed first: what a translation is `of` is what the act says then."""
    found = back(changed(exported(), "R_Praise/2/1", text="Great!", de="Toll!"))
    assert [type(each) for each in found.edits] == [SetParameter, SetTranslation]
    assert summary(found) == "2 changes in 72 texts"


def study(text: str = "Good.", german: str = 'text = "Gut.", of = "Good."', more: str = "") -> LoadResult:
    acts = act(f"<Speech><actionID>1</actionID><message>{text}</message></Speech>") + more
    held: dict[str, bytes | None] = {
        "scenario.toml": b'language = "en"',
        "acts/a.xml": f"<Dialogs>{acts}</Dialogs>".encode(),
    }
    if german:
        held["texts/de.toml"] = f"[A]\n1 = {{ {german} }}".encode()
    loaded = load("nowhere", held=held)
    assert loaded.scenario is not None, loaded.diagnostics
    return loaded


def one_row(**cells: str) -> ReadTable:
    """What was exported from `study()`, with these cells changed."""
    table = read_csv(write_csv(make_table(study())))
    return changed(table, "A/1", **cells)


@pytest.mark.parametrize(
    ("cells", "now", "refusal"),
    [
        (
            {"text": "Great."},
            study("Fine."),
            "the text was changed since the table was made: it is “Fine.” now, and was “Good.”",
        ),
        ({"de": "Schön."}, study("Fine."), "the text was changed since the table was made"),
        ({"de": "Schön."}, study(german='text = "Fein.", of = "Good."'), "`de` was changed in the study, too"),
        ({"de": ""}, study(), "the cell `de` is empty; the text stays “Gut.”"),
        ({"text": ""}, study(), "the text is empty"),
        ({"text": "Good {name."}, study(), "a `{` without its `}`"),
        ({"de": "Gut, {name}."}, study(), "`de`: the translation has {name}, which the text does not have"),
        ({"de": "<speak>Gut."}, study(), "`de`: "),
        ({"de": "Schön.", "check": ""}, study(), "the table does not say (in `check`) what `de` was"),
        ({"de": "Schön.", "of": ""}, study(), "its cell `of` is empty"),
        ({"id": "A/2", "de": "Schön."}, study(), "there is no such text any more; did you mean `A/1`?"),
        ({"id": "", "de": "Schön."}, study(), "this row has no id; with --new it becomes an act"),
    ],
)
def test_what_both_have_changed_is_refused_by_itself(cells: dict[str, str], now: LoadResult, refusal: str) -> None:
    found = back(one_row(**cells), now)
    assert found.edits == () and len(found.refused) == 1
    assert str(found.refused[0]).startswith("row 2") and refusal in str(found.refused[0])


@pytest.mark.parametrize(
    "now",
    [study("Fine."), study(german='text = "Fein.", of = "Good."'), study("Fine.", 'text = "Fein.", of = "Fine."')],
)
def test_what_only_the_study_has_changed_stays(now: LoadResult) -> None:
    found = back(one_row(), now)
    assert (found.edits, found.refused) == ((), ())


def test_one_row_that_is_refused_does_not_hold_up_the_others() -> None:
    table = changed(changed(exported(), "R_Yes/2/1", de="{x}"), "R_Yes/2/2", de="Richtig.")
    found = back(table)
    assert found.edits == (SetTranslation("de", "R_Yes", "2/2", "Richtig."),)
    assert summary(found) == "1 change in 72 texts; 1 row refused"


def test_a_new_language_is_named() -> None:
    loaded = load(LABLINKING)
    table = read_csv(write_csv(make_table(loaded, ["FR", "DE"])))
    assert table.columns[6:8] == ("FR", "de")
    table = changed(table, "R_Break/2", FR="Une pause.")
    assert back(table, languages=("fr",)).edits == (SetTranslation("fr", "R_Break", "2", "Une pause."),)
    assert back(table).edits == ()


def test_rows_without_id_become_acts() -> None:
    rows = [
        {"act": "New", "text": "Hi.", "de": "Hallo."},
        {"act": "A", "text": "x"},
        {"act": "B"},
        {"text": "x"},
        {"act": "New", "text": "Ho."},
    ]
    table = one_row()
    table = replace(table, rows=(*table.rows, *(ReadRow(3 + number, values) for number, values in enumerate(rows))))
    found = back(table, study(), new=True)
    assert found.edits == (AddAct("New", "Hi."), SetTranslation("de", "New", "1", "Hallo."))
    assert [str(each).partition(": ")[2] for each in found.refused] == [
        "there is an act of this name already",
        "a new act needs a text, in `text`",
        "a new act needs a name, in `act`",
        "there is an act of this name already",
    ]


def test_texts_that_come_from_more_than_one_parameter_are_left_to_an_editor() -> None:
    template = act("<Speech><actionID>1</actionID><message>So ${p}.</message></Speech>", "B")
    more = f'<Template name="T"><parameter name="p"/>{template}</Template><use template="T" p="it is"/>'
    loaded = study(more=more)
    table = changed(read_csv(write_csv(make_table(loaded))), "B/1", text="So it was.")
    found = back(table, loaded)
    assert found.edits == () and "template" in found.refused[0].why and "acts/a.xml, line" in found.refused[0].why


def test_only_what_lacks_something() -> None:
    loaded = study(german="")
    assert [row.id for row in make_table(loaded, ["de"], "missing").rows] == ["A/1"]
    stale = study("Fine.")
    assert make_table(stale, only="missing").rows == () and len(make_table(stale, only="stale").rows) == 1
    assert make_table(stale).rows[0].note == "de: the text has changed since this translation; it was “Good.”"
    assert make_table(study(), only="stale").rows == ()


def test_gettext_calls_stale_translations_fuzzy_and_takes_them_when_nobody_does_any_more() -> None:
    stale = study("Fine.")
    text = write_po(make_table(stale)).decode()
    assert "#, fuzzy" in text and 'msgctxt "A/1"' in text and '"Language: de\\n"' in text
    assert back(read_po(text.encode()), stale).edits == ()
    confirmed = read_po(text.replace("#, fuzzy\n", "").encode())
    assert back(confirmed, stale).edits == (SetTranslation("de", "A", "1", "Gut."),)
    with pytest.raises(ExchangeError, match="for one language"):
        write_po(make_table(stale, ["de", "fr"]))


def nasty_table(texts: list[str]) -> TextTable:
    rows = (
        TextRow(f"A/{number}", "A", "1", "at once", "", text, {"de": text}, "", 1.0, "a.xml:1")
        for number, text in enumerate(texts)
    )
    return TextTable(("de",), tuple(rows))


@pytest.mark.parametrize("kind", KINDS)
def test_nasty_texts_survive(kind: str) -> None:
    write, read = KINDS[kind]
    found = rows_of(read(write(nasty_table(NASTY))))
    assert [row.values["of"] for row in found.values()] == NASTY == [row.values["de"] for row in found.values()]


TEXTS = st.lists(
    st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff"), min_size=1)
    .map(str.strip)
    .filter(bool),
    max_size=40,
)


@given(TEXTS, st.sampled_from([",", ";"]))
def test_any_texts_survive_csv(texts: list[str], separator: str) -> None:
    found = read_csv(write_csv(nasty_table(texts), separator))
    assert [row.values["de"] for row in found.rows] == texts


def test_thousand_texts_survive_excel() -> None:
    texts = [f"{NASTY[number % len(NASTY)]}{'x' * (number % 7)} {number}" for number in range(1000)]
    assert [row.values["text"] for row in read_xlsx(write_xlsx(nasty_table(texts))).rows] == texts


def test_ids_are_no_dates_and_no_formulas() -> None:
    acts = act("<Speech><actionID>2</actionID><message>Hi.</message></Speech>", "3")
    loaded = load("nowhere", held={"acts/a.xml": acts.encode()})
    table = read_csv(write_csv(make_table(loaded)))
    assert table.rows[0].values["id"] == "act 3/2"
    table = replace(table, rows=(replace(table.rows[0], values={**table.rows[0].values, "text": "Ho."}),))
    assert back(table, loaded).edits == (SetParameter("3", "2", "message", "Ho.", 0),)


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ("id;of\nä".encode("cp1252"), "save it again as `CSV UTF-8`"),
        (b"", "this file is empty"),
        (b"Id;text\n", "the table has no column `id`; did you mean `Id`?"),
        (b"id;text\n", "the table has no column `of`"),
        (b"id;of;de;de\n", "several columns `de`"),
        (b'id;of\n"a', "this is no CSV file"),
    ],
)
def test_what_is_no_table_is_told(data: bytes, sentence: str) -> None:
    with pytest.raises(ExchangeError) as refused:
        back(read_csv(data))
    assert sentence in str(refused.value)


def test_an_excel_file_that_becomes_too_large_is_not_opened() -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", bytes(table.MAX_BYTES + 1))
    with pytest.raises(ExchangeError, match="becomes 100,000,001 bytes"):
        read_xlsx(stream.getvalue())


@pytest.mark.parametrize("read", [read_xlsx, read_po])
def test_what_is_no_such_file_is_told(read: Callable[[bytes], ReadTable]) -> None:
    with pytest.raises(ExchangeError, match=r"this is no|does not say"):
        read(b"\xff\xff nonsense")


def test_the_separator_is_that_of_the_country(monkeypatch: pytest.MonkeyPatch) -> None:
    assert usual_separator() in ",;"
    monkeypatch.setattr("locale.localeconv", lambda: {"decimal_point": ","})
    assert usual_separator() == ";"
    assert write_csv(make_table(study())).startswith(b"\xef\xbb\xbfid;act;no.;when;with;text;de;note;")


def with_items(items: str = "text,text.de\ncup,Tasse\nplate,\n7,\n", also: str = '["de"]') -> LoadResult:
    acts = act("<Speech><actionID>1</actionID><message>{items[0].text}</message></Speech>")
    toml = f'language = "en"\n[languages]\nalso = {also}\n'
    held: dict[str, bytes | None] = {"scenario.toml": toml.encode(), "acts/a.xml": acts.encode()}
    loaded = load("nowhere", held={**held, "tables/items.csv": items.encode()})
    assert loaded.scenario is not None, loaded.diagnostics
    return loaded


@pytest.mark.parametrize("kind", KINDS)
def test_the_texts_of_tables_stand_in_it_and_come_back(kind: str) -> None:
    write, read = KINDS[kind]
    loaded = with_items()
    table = read(write(make_table(loaded)))
    assert back(table, loaded) == TextImport((), (), (), 4)
    assert back(changed(table, "items[1].text", de="Teller"), loaded).edits == (
        SetCell("items", 1, "text.de", "Teller"),
    )
    assert [row.id for row in make_table(loaded, only="missing").rows] == ["items[1].text", "items[2].text"]


def test_a_text_of_a_table_is_changed_where_it_stands() -> None:
    loaded = with_items()
    table = read_csv(write_csv(make_table(loaded)))
    found = back(changed(table, "items[0].text", text="mug", de="Becher"), loaded)
    assert found.edits == (SetCell("items", 0, "text", "mug"), SetCell("items", 0, "text.de", "Becher"))
    now = with_items("text,text.de\nmug,Tasse\nplate,\n7,\n")
    assert "the text was changed since" in back(changed(table, "items[0].text", de="Becher"), now).refused[0].why


def test_a_first_translation_makes_the_column_and_the_language() -> None:
    loaded = with_items("text\ncup\n", '["de"]')
    table = changed(read_csv(write_csv(make_table(loaded, ["de", "fr"]))), "items[0].text", de="Tasse", fr="tasse")
    assert back(table, loaded, languages=("fr",)).edits == (
        AddLanguage("fr"),
        AddColumn("items", "text.fr"),
        AddColumn("items", "text.de"),
        SetCell("items", 0, "text.fr", "tasse"),
        SetCell("items", 0, "text.de", "Tasse"),
    )


def test_a_po_file_that_names_a_file_is_not_that_file(tmp_path: Path) -> None:
    other = tmp_path / "other.po"
    other.write_text('msgctxt "R_Yes/1"\nmsgid "Yes"\nmsgstr "Ja"\n', "utf-8")
    with pytest.raises(ExchangeError, match=r"no \.po file"):
        read_po(str(other).encode(), "de")
    (row,) = read_po(other.read_bytes(), "de").rows
    assert row.values["of"] == "Yes"
