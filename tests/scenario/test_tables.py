"""Tables: what a CSV file is read as, what is wrong with one, and whether what reads it can be right."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.reading.tables import MAX_ROWS, TABLES_FOLDER, read_tables
from rise_engine.scenario.serialization import decode_scenario, encode_scenario
from tests.commands import typed
from tests.scenario.folders import act, folder, found, in_state, loaded

USE = {"rules/r.xml": in_state('<function assignValue="n = length(items)"/>')}
"""So that the table is used."""


def read(tmp_path: Path, csv: str | bytes, toml: str = "") -> LoadResult:
    files: dict[str, str | bytes] = {**USE, "tables/items.csv": csv}
    return loaded(tmp_path, files | ({"tables/items.toml": toml} if toml else {}))


# What stands in the file, in its toml, and what is read.
READ: dict[str, tuple[str | bytes, str, list[dict[str, Any]]]] = {
    "numbers, texts, truth, nothing": (
        "id,text,ok,rt,none\n1,one,true,0.5,\n2,,FALSE,1e3,\n-3,three,,,\n",
        "",
        [
            {"id": 1, "text": "one", "ok": True, "rt": 0.5, "none": None},
            {"id": 2, "text": None, "ok": False, "rt": 1000.0, "none": None},
            {"id": -3, "text": "three", "ok": None, "rt": None, "none": None},
        ],
    ),
    "a column is a number only if all its values are": (
        "a,b\n1,1\nx,2\n",
        "",
        [{"a": "1", "b": 1}, {"a": "x", "b": 2}],
    ),
    "codes keep their zeros": ("a\n007\n008\n", "", [{"a": "007"}, {"a": "008"}]),
    "what no memory can hold is text": ("a\n99999999999999999999\n", "", [{"a": "99999999999999999999"}]),
    "an exponent beyond all numbers is text": ("a\n1e999\n", "", [{"a": "1e999"}]),
    "Excel: semicolons, CRLF, BOM": ("\ufeffa;b\r\n1;x, y\r\n", "", [{"a": 1, "b": "x, y"}]),
    "Excel: sep=": ("sep=|\na|b\n1|2\n", "", [{"a": 1, "b": 2}]),
    "tabs": ("a\tb\n1\tx, y; z\n", "", [{"a": 1, "b": "x, y; z"}]),
    "quotation marks": ('a,b\n"x, ""y""","1\r\n2"\n', "", [{"a": 'x, "y"', "b": "1\n2"}]),
    "a separator in the header's quotation marks": ('"a,b";c\n1;2\n', "", [{"a,b": 1, "c": 2}]),
    "blanks around values": ('a , b\n x ,  "y, z" \n'.replace('" \n', '"\n'), "", [{"a": "x", "b": "y, z"}]),
    "empty lines and rows": ("a;b\n\n1;2\n;\n3;4\n;\n\n", "", [{"a": 1, "b": 2}, {"a": 3, "b": 4}]),
    "no end of the last line": ("a,b\n1,2", "", [{"a": 1, "b": 2}]),
    "what Excel leaves of deleted columns": ("a;b;;\n1;2;;\n3;4;;\n", "", [{"a": 1, "b": 2}, {"a": 3, "b": 4}]),
    "only a header": ("a,b\n", "", []),
    "any name": ("Reaction time,Größe\n1,2\n", "", [{"Reaction time": 1, "Größe": 2}]),
    "types": (
        "a,b,c\n1,0.5,TRUE\n",
        '[types]\na = "text"\nb = "text"\nc = "text"\n',
        [{"a": "1", "b": "0.5", "c": "TRUE"}],
    ),
    "decimal comma": ("a;b\n1,5;x\n2;y\n", 'decimal = ","\n', [{"a": 1.5, "b": "x"}, {"a": 2, "b": "y"}]),
    "a separator of its own": ("a|b,c\n1|2\n", 'separator = "|"\n', [{"a": 1, "b,c": 2}]),
    "Windows-1252": ("a;b\nGrüße – 5 €;1\n".encode("cp1252"), 'encoding = "cp1252"\n', [{"a": "Grüße – 5 €", "b": 1}]),
}


@pytest.mark.parametrize("case", READ)
def test_read(tmp_path: Path, case: str) -> None:
    text, toml, expected = READ[case]
    result = read(tmp_path, text, toml)
    assert result.scenario is not None, result.diagnostics
    assert result.diagnostics == []
    records = result.scenario.tables["items"].records
    assert records == expected
    assert [[type(value) for value in row.values()] for row in records] == [
        [type(value) for value in row.values()] for row in expected
    ]


# What stands in the file, in its toml; the finding, and something of what it says.
WRONG: dict[str, tuple[str | bytes, str, str, str]] = {
    "not UTF-8": (
        b"a;b\n1;Gr\xfc\xdfe\n",
        "",
        "items.csv:2:5 encoding",
        'write encoding = "cp1252" into tables/items.toml',
    ),
    "no cp1252": (b"a;b\n1;\x81\n", 'encoding = "cp1252"\n', "items.csv:2:3 encoding", "not CP1252"),
    "UTF-16": ("a;b\n".encode("utf-16"), "", "items.csv:1:1 encoding", "save it as UTF-8"),
    "nothing": ("\n\n", "", "items.csv:1:1 table-form", "its first row has the names"),
    "a value too many": ("a,b\n1,2\n3,4,5\n", "", "items.csv:3:5 table-form", "a comma in it needs quotation marks"),
    "a value too many behind a comma in a text": (
        'a,b\n"x, y",2, z\n',
        "",
        "items.csv:2:11 table-form",
        "more than the header",
    ),
    "a value too few": (
        "a,b,c\n1,2\r\n",
        "",
        "items.csv:2:4 table-form",
        "this row has 2 values, and the header 3 names",
    ),
    "behind a value of two lines": ('a,b\n"1\n2",3\n4\n', "", "items.csv:4:2 table-form", "this row has 1 values"),
    "no closing quotation mark": ('a,b\n1,"two\n3,4\n', "", "items.csv:2:3 table-form", "is never closed"),
    "a quotation mark within": (
        'a;b\n1;"say "hi" now"\n',
        "",
        "items.csv:2:9 table-form",
        "a semicolon or the end of the line",
    ),
    "a lone carriage return": ("a,b\r1,2\r", "", "items.csv:1:4 table-form", "a carriage return alone ends no line"),
    "a name twice": ("a, b,a\n1,2,3\n", "", "items.csv:1:6 table-form", "column 1 is called `a` already"),
    "values without a name": ("a,,c\n1,2,3\n", "", "items.csv:1:3 table-form", "column 2 has values and no name"),
    "values behind the names": ("a,,\n1,3,\n", "", "items.csv:1:3 table-form", "column 2 has values and no name"),
    "another separator": ("a|b\n1|2\n", "", "items.csv:1:1 table-form", 'separator = "|"'),
    "a separator that it does not have": (
        "a;b\n1;2\n",
        'separator = ","',
        "items.csv:1:1 table-form",
        'separator = ";"',
    ),
    "no number": (
        "a,b\n1,x\n,2\n",
        'types.b = "number"\n',
        "items.csv:2:3 table-value",
        "`b` is a number, and this is not: `x`",
    ),
    "no truth": ("a\ntrue\nmaybe\n", 'types.a = "bool"\n', "items.csv:3:1 table-value", "`a` is true or false"),
    "a comma in a number": (
        "a;b\n1;2\n1;2,5\n",
        "",
        "items.csv:3:3 decimal-comma",
        'write decimal = "," into tables/items.toml',
    ),
    "too long": (f"a\n{'x' * 10_001}\n", "", "items.csv:2:1 table-form", "more than 10,000 characters"),
    "far too long": (f"a\n{'x' * 200_000}\n", "", "items.csv:2:1 table-form", "is a quotation mark never closed?"),
    "too many rows": (
        "a\n" + "1\n" * (MAX_ROWS + 1),
        "",
        f"items.csv:{MAX_ROWS + 2}:1 table-form",
        "at most 10,000 rows",
    ),
    "too many columns": (",".join(f"c{n}" for n in range(201)), "", "items.csv:1:1 table-form", "at most 200 columns"),
    "too large": ("a\n" + "x" * 2_000_000, "", "items.csv:1:1 too-large", "larger than 2 MB"),
    "a merge": ("<<<<<<< HEAD\na\n=======\nb\n>>>>>>> other\n", "", "items.csv:1:1 merge-conflict", ""),
    "a column that is not there": (
        "text\nx\n",
        'types.txt = "text"\n',
        "items.toml:1:7 unknown-key",
        "did you mean `text`?",
    ),
    "an unknown setting": ("a\nx\n", 'delimiter = ";"\n', "items.toml:1:1 unknown-key", ""),
    "an unknown type": ("a\nx\n", 'types.a = "date"\n', "items.toml:1:11 wrong-value", '"text", "number" or "bool"'),
    "an unknown encoding": ("a\nx\n", 'encoding = "latin1"\n', "items.toml:1:12 wrong-value", '"utf-8" or "cp1252"'),
    "a separator of two": ("a\nx\n", 'separator = ";;"\n', "items.toml:1:13 wrong-value", ""),
    "a separator that is a list": ("a\nx\n", 'separator = [";"]\n', "items.toml:1:13 wrong-value", ""),
    "a broken toml": ("a\nx\n", "types = \n", "items.toml:1:9 toml-syntax", ""),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_has_its_place(tmp_path: Path, case: str) -> None:
    text, toml, expected, says = WRONG[case]
    result = read(tmp_path, text, toml)
    assert found(result) == [f"tables/{expected}"], result.diagnostics
    assert says in result.diagnostics[0].message
    assert (result.scenario is None) == ("decimal-comma" not in expected)


def test_a_limit_that_another_library_raised_changes_nothing(tmp_path: Path) -> None:
    """`csv.field_size_limit` belongs to the whole process, and frictionless sets it where it is imported."""
    before = csv.field_size_limit(2**31 - 1)
    try:
        test_what_is_wrong_has_its_place(tmp_path, "far too long")
    finally:
        csv.field_size_limit(before)


def test_names_of_tables(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        **USE,
        "tables/items.csv": "a\n1\n",
        "tables/items.CSV": "a\n1\n",
        "tables/the items.csv": "a\n1\n",
        "tables/true.csv": "a\n1\n",
        "tables/a.b.csv": "a\n1\n",
        "tables/itemz.toml": "",
        "tables/.hidden.csv": "broken",
        "tables/notes.txt": "for people",
        "memory.json": '{"items": 1, "items.0.a": 2}',
    }
    assert sorted(found(loaded(tmp_path, files))) == [
        "memory.json:1:14 duplicate-key",
        "memory.json:1:2 duplicate-key",
        "tables/a.b.csv:1:1 bad-name",
        "tables/items.csv:1:1 duplicate-name",
        "tables/itemz.toml:1:1 table-form",
        "tables/the items.csv:1:1 bad-name",
        "tables/true.csv:1:1 bad-name",
    ]


# --- what reads and what would change a table -------------------------------------------------------------------------

TABLE = "id;text;condition\n1;one;A\n2;two;B\n"
MEMORY = '{"i": 0, "name": "x", "list": [1, 2], "texts": {"A": ["a"], "B": ["b"]}, "later": null, "set": [1]}'


def speech(text: str) -> dict[str, str | bytes]:
    return {"acts/a.xml": act(f"<Speech><actionID>1</actionID><message>{text}</message></Speech>")}


def condition(text: str) -> dict[str, str | bytes]:
    return {"rules/r.xml": in_state(f'<if cond="{text}"><function assignValue="set = [2]"/></if>')}


def assignment(text: str) -> dict[str, str | bytes]:
    return {"rules/r.xml": in_state(f'<function assignValue="{text}"/>')}


CHECKED: dict[str, tuple[dict[str, str | bytes], str, str]] = {
    "a column": (speech("{items[i].text}"), "", ""),
    "no column": (speech("Now {items[i].txt}"), "2:44 unknown-path", "has no column `txt`; did you mean `text`?"),
    "no such column at all": (speech("{items[i].zzz}"), "2:40 unknown-path", "it has `id`, `text`, `condition`"),
    "the second of two": (speech("{items[i].text} {items[i].txt}"), "2:56 unknown-path", "`txt`"),
    "no column, but a fallback": (speech("{items[i].txt|-}"), "", ""),
    "the last row": (speech("{items[1].text}"), "", ""),
    "beyond the last row": (
        speech("{items[2].text}"),
        "2:40 unknown-path",
        "has the rows 0 to 1, and no 2; rows count from 0",
    ),
    "before the first row": (condition("items[-1].id = 1"), "3:20 unknown-path", "and no -1"),
    "half a row": (condition("items[0.5].id = 1"), "3:20 unknown-path", "the number 0.5 is not a row"),
    "a row by dot": (condition("items.1.id = 1"), "", ""),
    "no row by dot": (condition("items.2.id = 1"), "3:20 unknown-path", "and no 2"),
    "no column by dot": (condition("items.1.idd = 1"), "3:20 unknown-path", "did you mean `id`?"),
    "no row": (
        speech("{items.text}"),
        "2:40 unknown-path",
        "write the row first, then the column: `items[i].text`",
    ),
    "a column first": (condition("items['text'] = 'x'"), "3:20 unknown-path", "`items[i].text`"),
    "an index in an index": (condition("items[list[i]].text = 'x'"), "", ""),
    "a missing column in an index": (condition("list[items[i].n] = 1"), "3:20 unknown-path", "has no column `n`"),
    "behind a value": (condition("items[i].text.x = 1"), "3:20 unknown-path", "which has no parts"),
    "a column by name": (condition("items[i]['text'] = items[i][name]"), "", ""),
    "a whole table said": (
        speech("{items}"),
        "2:40 unknown-path",
        "cannot be said; name a row and a column: {items[i].id}",
    ),
    "a whole row said": (speech("{items[i]}"), "2:40 unknown-path", "`items[i]` is a row of the table"),
    "an index without a value": (speech("{items[k].text}"), "2:40 unset-key", "sets the memory key `k`"),
    "defined": (condition("defined(items[7]) and defined(items[i].x)"), "", ""),
    "a table is set": (assignment("items = 1"), "3:33 read-only", "`items` is a table"),
    "a row is set": (
        assignment("items[0].text = 'x'"),
        "3:33 read-only",
        "use a key of your own for a value that changes",
    ),
    "a dotted row is set": (assignment("items.0.text = 'x'"), "3:33 read-only", "`items` is a table"),
    "a part of a list": (assignment("list[i] = items[i].id"), "", ""),
    "a part of nothing": (assignment("lits[i] = length(items)"), "3:33 unset-key", "did you mean `list`?"),
    "a part of an object that is there": (assignment("texts[name] = length(items)"), "", ""),
    "an entry of the start values": (
        condition("list[2] = 1"),
        "3:20 unknown-path",
        "`list` is a list of 2, with the entries 0 to 1",
    ),
    "a name that no entry has": (condition("texts[name].b = 1"), "3:20 unknown-path", "`texts[name]` is a list"),
    "an entry of what comes later": (condition("later[2].x = 1"), "", ""),
    "an entry of what is set": (condition("set[5] = 1"), "", ""),
    "a start value without parts": (condition("name[i] = 1"), "3:20 unknown-path", "which has no parts"),
}


@pytest.mark.parametrize("case", CHECKED)
def test_what_can_be_proved_is_checked(tmp_path: Path, case: str) -> None:
    files, expected, says = CHECKED[case]
    also = {"rules/use.xml": USE["rules/r.xml"].replace('"R"', '"U"')}
    result = loaded(tmp_path, {"tables/items.csv": TABLE, "memory.json": MEMORY, **also, **files})
    assert [each.partition(":")[2] for each in found(result)] == ([expected] if expected else []), result.diagnostics
    assert not says or any(says in diagnostic.message for diagnostic in result.diagnostics)


def test_nothing_sets_a_part_of_what_the_engine_keeps(tmp_path: Path) -> None:
    rules = in_state("<function assignValue=\"session['cue'] = true\"/>")
    assert found(loaded(tmp_path, {"rules/r.xml": rules})) == ["rules/r.xml:3:33 read-only"]


def test_a_table_called_session_is_the_scenarios_own(tmp_path: Path) -> None:
    rules = in_state('<if cond="session[0].cue"><function assignValue="n = session[0].id"/></if>')
    result = loaded(tmp_path, {"rules/r.xml": rules, "tables/session.csv": "id,cue\n1,true\n"})
    assert result.scenario is not None and not result.scenario.reads_session, result.diagnostics


def test_a_key_of_the_keyboard_changes_no_table(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        **USE,
        "tables/items.csv": TABLE,
        "scenario.toml": '[keys]\nx = { set = "items[0].id = 2" }\n',
    }
    assert found(loaded(tmp_path, files)) == ["scenario.toml:2:13 read-only"]


def test_a_table_that_nobody_reads_is_a_warning(tmp_path: Path) -> None:
    result = loaded(tmp_path, {**USE, "tables/items.csv": TABLE, "tables/more.csv": TABLE})
    assert found(result) == ["tables/more.csv:1:1 unused-table"]
    assert "its rows are read as more[i].id" in result.diagnostics[0].message


def test_warnings_about_tables_can_be_silenced(tmp_path: Path) -> None:
    allowed = "\n".join(
        f'  {{ code = "{code}", key = "{key}", reason = "meant so" }},'
        for code, key in (("unused-table", "more"), ("decimal-comma", "items.rt"))
    )
    files: dict[str, str | bytes] = {
        **USE,
        "tables/items.csv": "id;rt\n1;1,5\n",
        "tables/more.csv": TABLE,
        "scenario.toml": f"[check]\nallow = [\n{allowed}\n]\n",
    }
    result = loaded(tmp_path, files)
    assert result.diagnostics == [] and len(result.suppressed) == 2


def test_templates_stand_in_an_index(tmp_path: Path) -> None:
    speech = "<Speech><actionID>1</actionID><message>{{items[${{row}}].{}}}</message></Speech>"
    template = '<Template name="Say"><parameter name="row"/>' + speech + "</Template>"
    use = '<Dialog name="A"><use template="Say" row="order[i]"/></Dialog>'
    files: dict[str, str | bytes] = {"tables/items.csv": TABLE, "memory.json": '{"order": [1], "i": 0}'}
    right = loaded(tmp_path / "a", {**files, "acts/a.xml": f"<Dialogs>{template.format('text')}{use}</Dialogs>"})
    assert right.scenario is not None and right.diagnostics == []
    wrong = loaded(tmp_path / "b", {**files, "acts/a.xml": f"<Dialogs>{template.format('txt')}{use}</Dialogs>"})
    assert [each.code for each in wrong.diagnostics] == ["unknown-path"]
    expanded = typed("expand", tmp_path / "a", "-o", tmp_path / "c")
    assert "parts of values by index (1)" in expanded.output
    assert (tmp_path / "c" / "tables" / "items.csv").read_text("utf-8") == TABLE


def test_tables_belong_to_the_scenario(tmp_path: Path) -> None:
    """They are in its hash, in the copy that a session keeps, and in what a console gets."""
    files: dict[str, str | bytes] = {**USE, "tables/items.csv": TABLE, "tables/items.toml": 'types.id = "text"\n'}
    result = loaded(tmp_path / "a", files)
    assert result.scenario is not None
    assert result.files["tables/items.csv"] == TABLE.encode() and "tables/items.toml" in result.files
    copy = loaded(tmp_path / "copy", dict(result.files))
    other = loaded(tmp_path / "b", {**files, "tables/items.csv": TABLE.replace("one", "eins")})
    assert copy.scenario is not None and other.scenario is not None
    assert copy.scenario.hash == result.scenario.hash != other.scenario.hash
    received = decode_scenario(encode_scenario(result.scenario))
    assert received.tables == result.scenario.tables
    assert received.tables["items"].records[1] == {"id": "2", "text": "two", "condition": "B"}
    assert received.tables["items"].size_text == "2 rows x 3 columns"


CELLS = (
    st.text(st.characters(codec="utf-8", exclude_characters="\r\x00"), min_size=1, max_size=8)
    .map(str.strip)
    .filter(bool)
)


@given(
    st.lists(st.lists(CELLS, min_size=3, max_size=3), min_size=1, max_size=6),
    st.sampled_from(",;\t"),
    st.sampled_from(["\n", "\r\n"]),
)
def test_what_the_csv_module_writes_is_read(rows: list[list[str]], separator: str, end: str) -> None:
    written = io.StringIO()
    writer = csv.writer(written, delimiter=separator, lineterminator=end, quoting=csv.QUOTE_ALL)
    writer.writerows([["a", "b", "c"], *rows])
    types = "".join(f'types.{name} = "text"\n' for name in "abc")
    assert [list(row.values()) for row in _tables(written.getvalue().encode(), types)["items"].records] == rows


@given(st.binary(max_size=80) | st.text("ab1,;\t\"'\r\n.|= ", max_size=60).map(str.encode))
def test_any_file_is_read_or_has_a_finding(data: bytes) -> None:
    tables, findings = _tables_and_findings(data, "")
    assert ("items" in tables) == (not any(finding.severity == "error" for finding in findings))
    for finding in findings:
        assert finding.message and finding.location.line >= 1 and finding.location.column >= 1


def _tables(data: bytes, toml: str) -> dict[str, Any]:
    tables, findings = _tables_and_findings(data, toml)
    assert findings == []
    return tables


def _tables_and_findings(data: bytes, toml: str) -> tuple[dict[str, Any], list[Any]]:
    import tempfile

    with tempfile.TemporaryDirectory() as place:
        home = folder(Path(place), {f"{TABLES_FOLDER}/items.csv": data, f"{TABLES_FOLDER}/items.toml": toml})
        draft, diagnostics = ScenarioDraft(), Diagnostics()
        read_tables(FileReader(home, diagnostics), draft, diagnostics)
        return draft.tables, diagnostics.sorted()
