"""The programs that read tables into SPSS and R, read here by their own grammars as far as they use them.

PSPP 1.6.2 and R 4.2 have read such tables by hand; neither is needed here.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

from rise_engine.results.export.table_schema import Column
from rise_engine.results.export.tables import FORMAT, R_FILE, SPSS_FILE, TABLES, DescribedTable, r_text, spss_text
from rise_engine.results.export.writing import export_context, export_sessions
from tests.results.analysis.samples import play_session

_QUOTED = re.compile(r"'(?:[^']|'')*'")
_R_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"')


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lab")
    session = play_session(folder)
    export_sessions(FORMAT, folder / "out", [session], export_context([session], "full"))
    return folder / "out"


def commands(text: str) -> list[str]:
    """SPSS: each ends with a dot at the end of a line; a text between quotes can hold anything."""
    texts: list[str] = []
    plain = _QUOTED.sub(lambda found: texts.append(found[0]) or f"<{len(texts) - 1}>", text)  # type: ignore[func-returns-value]
    found = [each.strip() for each in re.split(r"\.[ \t]*\n", plain + "\n") if each.strip()]
    return [re.sub(r"<(\d+)>", lambda match: texts[int(match[1])], each) for each in found]


def header(file: Path) -> list[str]:
    with file.open(encoding="utf-8", newline="") as opened:
        return next(csv.reader(opened))


def test_spss_reads_every_column_of_every_table_and_labels_it(tables: Path) -> None:
    text = (tables / SPSS_FILE).read_text("utf-8")
    assert max(len(line.encode()) for line in text.splitlines()) <= 256
    found = list(commands(re.sub(r"^\*.*\.$", "", text, flags=re.MULTILINE)))
    assert found[:2] == ["CD '.'", "SET DECIMAL=DOT"]
    read = [each for each in found if each.startswith("GET DATA")]
    labelled = [each for each in found if each.startswith("VARIABLE LABELS")]
    assert len(read) == len(labelled) == len(TABLES)
    assert [each.split()[2] for each in found if each.startswith("DATASET COPY")] == [each.name for each in TABLES]
    for schema, data, labels in zip(TABLES, read, labelled, strict=True):
        assert f"/FILE='{schema.file}' /ENCODING='UTF8'" in data
        variables = data.partition("/VARIABLES=")[2].split()
        names, formats = variables[::2], variables[1::2]
        assert len(names) == len(header(tables / schema.file))
        assert all(re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) for name in names)
        assert all(re.fullmatch(r"A[1-9]\d*|F16\.[06]", each) for each in formats)
        assert [each.split()[0].lstrip("/") for each in labels.splitlines()[1:]] == names
    assert "'SUCCEEDED' 'completed'" in text
    assert "  /by_ 'by: Who caused it" in text


def test_widths_hold_every_cell_and_every_level(tables: Path) -> None:
    data = next(each for each in commands((tables / SPSS_FILE).read_text("utf-8")) if "'acts.csv'" in each)
    variables = data.partition("/VARIABLES=")[2].split()
    with (tables / "acts.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))[1:]
    for at, each in enumerate(variables[1::2]):
        if each.startswith("A"):
            assert int(each[1:]) >= max(len(row[at].encode()) for row in rows)
    assert variables[variables.index("status") + 1] == "A9"  # SUCCEEDED


def test_r_reads_every_column_of_every_table_and_labels_it(tables: Path) -> None:
    text = (tables / R_FILE).read_text("utf-8")
    plain = _R_QUOTED.sub("''", re.sub(r"^#.*", "", text, flags=re.MULTILINE))
    for left, right in ("()", "{}", "[]"):
        assert plain.count(left) == plain.count(right)
    assert not re.search(r",\s*\)", plain) and "''  '" not in plain
    calls = re.findall(r"^(\w+) <- read_table\((.*?)^\)", text, flags=re.MULTILINE | re.DOTALL)
    assert [name for name, _ in calls] == [each.name for each in TABLES]
    for schema, (_, call) in zip(TABLES, calls, strict=True):
        types = call.partition("c(")[2].partition("\n  ),")[0]
        assert [each[1:-1] for each in _R_QUOTED.findall(types)[::2]] == header(tables / schema.file)
        assert set(_R_QUOTED.findall(types)[1::2]) <= {'"character"', '"numeric"', '"logical"'}
    assert '"completed" = "SUCCEEDED"' in text


def _table(*columns: Column, line_ends: bool = False) -> DescribedTable:
    return DescribedTable("q", "q.csv", "One row is one.", columns, (3,) * len(columns), line_ends)


def test_names_and_texts_that_are_hard() -> None:
    column = Column("to[1]", 'It\'s "so"\nand so ' + "ü" * 300, type="integer", levels={"1": "it's", "2": "no"})
    spss = spss_text([_table(column, Column("TO_1", "the same"))])
    assert "    to_1 F16.0\n    TO_1_2 A3\n" in spss
    assert """'to[1]: It''s "so" and so üü""" in spss and "\n    1 'it''s'\n" in spss
    assert max(len(line.encode()) for line in spss.splitlines()) <= 256
    r = r_text([_table(column)])
    assert '"to[1]" = "It\'s \\"so\\" and so' in r and '"to[1]" = c("it\'s" = 1, "no" = 2)' in r


def test_a_table_whose_cells_have_several_lines_is_not_read_wrongly() -> None:
    text = spss_text([_table(Column("a", "b"), line_ends=True)])
    assert "GET DATA" not in text and "* q.csv is left out" in text
