"""`rise-engine texts`: a table out, a table in, and what has changed on the disk then."""

from __future__ import annotations

import csv
import io
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from rise_engine.author.edit.edits import SetTranslation
from rise_engine.author.edit.workspace import Workspace
from tests.commands import typed

LABLINKING = Path(__file__).parents[3] / "scenarios" / "lablinking"
Change = Callable[[list[dict[str, str]]], None]


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return Path(shutil.copytree(LABLINKING, tmp_path / "study"))


def texts(*arguments: object) -> Result:
    return typed("texts", *arguments)


def content(folder: Path) -> dict[str, bytes]:
    return {each.relative_to(folder).as_posix(): each.read_bytes() for each in folder.rglob("*") if each.is_file()}


def exported(study: Path, name: str, *more: str) -> Path:
    path = study.parent / name
    found = texts("export", study, "-o", path, *more)
    assert found.exit_code == 0, found.output
    return path


def changed(path: Path, change: Change) -> Path:
    """A CSV file, with other rows."""
    rows = list(csv.DictReader(io.StringIO(path.read_bytes().decode("utf-8-sig"), newline="")))
    change(rows)
    stream = io.StringIO()
    writer = csv.DictWriter(stream, [key for key in rows[0] if key], restval="")
    writer.writeheader()
    writer.writerows(rows)
    path.write_text(stream.getvalue(), "utf-8")
    return path


def cell(id: str, column: str, text: str) -> Change:
    def change(rows: list[dict[str, str]]) -> None:
        next(row for row in rows if row["id"] == id)[column] = text

    return change


@pytest.mark.parametrize("name", ["t.csv", "t.xlsx", "t.po"])
def test_an_untouched_table_leaves_every_byte(study: Path, name: str) -> None:
    before = content(study)
    found = texts("import", study, exported(study, name))
    assert found.exit_code == 0 and found.output == "0 changes in 72 texts: there is nothing to change\n"
    assert content(study) == before


def test_a_changed_sentence_is_one_line(study: Path) -> None:
    before = content(study)
    table = changed(exported(study, "t.csv"), cell("R_Apology/5", "text", "I try again, & better."))
    dry = texts("import", study, table, "--dry-run")
    assert dry.exit_code == 0 and content(study) == before and not list((study.parent / "state").rglob("*.jsonl"))
    assert "+    <message>I try again, &amp; better.</message>" in dry.output
    found = texts("import", study, table)
    assert found.exit_code == 0 and found.output.endswith("1 change in 72 texts: acts/feedback.xml\n")
    after = content(study)
    assert [name for name in after if after[name] != before[name]] == ["acts/feedback.xml"]
    old, new = (each["acts/feedback.xml"].decode().split("\n") for each in (before, after))
    lines = [(one, other) for one, other in zip(old, new, strict=True) if one != other]
    assert lines == [
        ("    <message>I will try to say it better.</message>", "    <message>I try again, &amp; better.</message>")
    ]
    checked = texts("check", study)
    assert checked.exit_code == 1 and "changed  R_Apology/5" in checked.output
    assert texts("export", study, "--only", "stale").output.count("\n") == 2


def test_texts_of_templates_and_translations_and_new_acts(study: Path) -> None:
    def change(rows: list[dict[str, str]]) -> None:
        cell("R_Task2_Step1/2", "text", "Take the big bowl.")(rows)
        cell("R_Task2_Step1/2", "de", "Nimm die große Schüssel.")(rows)
        rows.append({"act": "R_Sorry", "text": "Sorry.", "de": "Tut mir leid."})

    found = texts("import", study, changed(exported(study, "t.csv"), change), "--new")
    assert found.exit_code == 0, found.output
    assert b'first="Take the big bowl."' in (study / "acts/task_2.xml").read_bytes()
    german = (study / "texts/de.toml").read_text("utf-8")
    assert '2 = { text = "Nimm die große Schüssel.", of = "Take the big bowl." }' in german
    assert '[R_Sorry]\n1 = { text = "Tut mir leid.", of = "Sorry." }' in german
    assert texts("check", study).output == "de: 73 of 73 texts translated\n"


def test_a_new_language_from_a_table(study: Path) -> None:
    table = exported(study, "t.csv", "--language", "fr")
    assert (
        texts("import", study, changed(table, cell("R_Break/2", "fr", "Une pause.")), "--language", "fr").exit_code == 0
    )
    assert (
        (study / "texts/fr.toml")
        .read_text("utf-8")
        .startswith('[R_Break]\n2 = { text = "Une pause.", of = "Let us stop')
    )
    assert texts("check", study, "--language", "fr").output.startswith("fr: 1 of 72 texts translated, 71 missing\n")


def test_one_row_is_refused_and_the_others_are_taken(study: Path) -> None:
    table = changed(exported(study, "t.csv"), cell("R_Yes/2/1", "de", "Ja!"))
    table = changed(table, cell("R_Yes/2/2", "de", "Ja, {x}!"))
    found = texts("import", study, table)
    assert found.exit_code == 1 and "row 7, R_Yes/2/2: `de`: the translation has {x}" in found.output
    assert found.stdout.endswith("1 change in 72 texts; 1 row refused: texts/de.toml\n")
    assert "Ja!" in (study / "texts/de.toml").read_text("utf-8")


def test_what_would_be_an_error_changes_nothing(study: Path) -> None:
    """A text with a part of a value that has none: what the row alone cannot tell."""
    before = content(study)
    table = changed(exported(study, "t.csv"), cell("R_Yes/2/1", "text", "Yes, {participant_number.points}."))
    found = texts("import", study, table)
    assert found.exit_code == 1 and "nothing is saved while there is an error" in found.output, found.output
    assert found.output.endswith("; nothing was changed\n") and content(study) == before
    assert Workspace(study).draft is None


def test_what_an_editor_has_not_saved_is_in_the_way(study: Path) -> None:
    table = changed(exported(study, "t.csv"), cell("R_Break/2", "text", "Stop."))
    editor = Workspace(study)
    editor.apply(SetTranslation("de", "R_Break", "2", "Halt."))
    assert "here you can only look" in texts("import", study, table).output
    editor.close()
    found = texts("import", study, table)
    assert found.exit_code == 1 and "an editor has left changes in this study that are not saved" in found.output
    assert Workspace(study).draft is not None


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("export", LABLINKING, "-o", "t.ods"), "a table of texts is a .csv, an .xlsx or a .po file"),
        (("export", LABLINKING, "--language", "german"), "`german` is not a language tag; write de"),
        (("export", LABLINKING, "-o", __file__.replace(".py", ".csv")), "is already"),
        (("export", LABLINKING, "-o", "t.po", "--language", "de", "--language", "fr"), "for one language"),
        (("import", LABLINKING, "nothing.csv"), "nothing.csv: it cannot be read"),
        (("import", LABLINKING, "nothing.doc"), "a table of texts is a .csv"),
    ],
)
def test_what_cannot_be_used_is_told(
    arguments: tuple[object, ...], sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if sentence == "is already":
        (tmp_path / "t.csv").write_text("mine")
        arguments, sentence = (*arguments[:-1], "t.csv"), "there is a file t.csv already; name a new one"
    found = texts(*arguments)
    assert found.exit_code == 2 and sentence in found.output
    assert not (tmp_path / "t.ods").exists()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("soffice") is None, reason="LibreOffice is not installed")
def test_through_libreoffice_and_back(study: Path, tmp_path: Path) -> None:
    """CSV to Excel to CSV: nothing has changed."""
    table = exported(study, "t.csv")
    for kind in ("xlsx", "csv"):
        command = ["soffice", f"-env:UserInstallation=file://{tmp_path}/office", "--headless", "--convert-to", kind]
        subprocess.run([*command, "--outdir", str(tmp_path / kind), str(table)], check=True, capture_output=True)
        table = tmp_path / kind / f"t.{kind}"
        assert texts("import", study, table).output.startswith("0 changes in 72 texts")
