"""Export, and the commands `rise-engine replay` and `rise-engine export`."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest
from click.testing import CliRunner, Result

from rise_engine.base.errors import SessionError
from rise_engine.cli import main
from rise_engine.kernel.records import AnyRecord
from rise_engine.results.analysis.session_records import SessionRecords
from rise_engine.results.export.records import COLUMNS, table_cell, write_records
from rise_engine.session.folder import INFO, find_session
from rise_engine.session.journal_format import encode_record
from tests.forked import run_engine

from .journals import Made


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Made:
    monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "sessions"))
    return Made(tmp_path, ended=True)


def exported(made: Made, format: Any) -> tuple[bytes, list[str]]:
    out = io.BytesIO()
    export = SessionRecords(made.folder)
    write_records(export, format, out)
    return out.getvalue(), export.problems


def table(data: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(data.decode("utf-8"), newline="")))


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(each) for each in arguments])


# --- export ---


def test_lines_are_the_records_alone(made: Made) -> None:
    data, problems = exported(made, "jsonl")
    assert data == b"".join(encode_record(record) + b"\n" for record in made.records)
    assert problems == []
    assert all(list(json.loads(line))[:4] == ["kind", "seq", "t", "wall"] for line in data.splitlines())


def test_the_table_has_every_field_of_every_record() -> None:
    fields = {name for record in get_args(AnyRecord) for name in record.__struct_encode_fields__}
    assert fields | {"session", "kind"} == set(COLUMNS)
    assert len(set(COLUMNS)) == len(COLUMNS)
    assert COLUMNS[:6] == ("session", "mode", "seq", "t", "wall", "kind")


def test_the_table_round_trips(made: Made) -> None:
    data, problems = exported(made, "csv")
    rows = table(data)
    assert problems == [] and len(rows) == len(made.records)
    assert data.endswith(b"\r\n") and data.startswith(",".join(COLUMNS).encode() + b"\r\n")
    for row, record in zip(rows, made.records, strict=True):
        assert (row.pop("session"), row.pop("mode")) == (made.folder.name, "debug")
        value = json.loads(encode_record(record))
        value.pop("mode", None)
        for name, text in row.items():
            each = value.get(name)
            if each is None:
                assert text == ""
            elif isinstance(each, str):
                assert text == each
            else:
                assert json.loads(text) == each and type(json.loads(text)) is type(each)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, ""),
        (True, "true"),
        (False, "false"),
        (0, "0"),
        (1.5, "1.5"),
        ("", ""),
        ("true", "true"),
        ("a\nb\r\n", "a\nb\r\n"),
        ([], "[]"),
        ({"a": [1, None, "é"]}, '{"a":[1,null,"é"]}'),
        (10**30, "1" + "0" * 30),
    ],
)
def test_cells(value: Any, text: str) -> None:
    assert table_cell(value) == text


def test_what_cannot_be_read_is_said_and_the_rest_is_exported(made: Made) -> None:
    lines = list(made.lines)
    bad_record, bad_input = made.step_lines[3] + 1, made.step_lines[6]
    for index in (bad_record, bad_input):
        lines[index] = b"#" + lines[index][1:]
    made.write(b"".join(lines) + b'{"kind":')
    data, problems = exported(made, "jsonl")
    assert len(data.splitlines()) == len(made.records) - 1
    assert [problem.split(" cannot")[0] for problem in problems[:2]] == [
        f"journal.jsonl: line {bad_record + 1}",
        f"journal.jsonl: line {bad_input + 1}",
    ]
    assert problems[2].endswith(f"line {bad_record + 1} is damaged, and it was record 12")
    assert problems[3].endswith(f"line {bad_input + 1} is damaged, and it was input 7")
    assert "the last 8 bytes cannot be read" in problems[4]
    result = run("export", made.folder, "--format", "jsonl")
    assert (result.exit_code, result.stdout_bytes) == (1, data)
    assert result.stderr.count("warning: ") == 5


def test_without_session_file_the_mode_is_that_of_the_journal(made: Made) -> None:
    (made.folder / INFO).unlink()
    data, problems = exported(made, "csv")
    assert {row["mode"] for row in table(data)} == {"debug"}
    assert problems == [f"{made.folder} has no {INFO}; the mode was taken from the journal"]


def test_records_before_any_readable_input_are_exported(made: Made) -> None:
    lines = list(made.lines)
    lines[0] = lines[1] = b"#\n"
    made.write(b"".join(lines))
    data, _ = exported(made, "jsonl")
    assert len(data.splitlines()) == len(made.records)


def test_a_journal_without_steps_is_an_empty_table(made: Made) -> None:
    made.write(made.lines[0])
    assert exported(made, "csv") == (",".join(COLUMNS).encode() + b"\r\n", [])
    assert exported(made, "jsonl") == (b"", [])


# --- which session ---


def test_a_session_is_found_by_path_name_or_file(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    assert find_session(str(made.folder)) == made.folder
    assert find_session(made.folder.name) == made.folder
    assert find_session(f"{made.folder.name}/") == made.folder
    assert find_session(str(made.journal)) == made.folder
    monkeypatch.chdir(made.folder)
    assert find_session(".").resolve() == made.folder


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("/nowhere/at/all", "there is no folder /nowhere/at/all"),
        ("", "name a session"),
        ("..", "is not a session"),
        ("no\0thing", "there is no session"),
    ],
)
def test_no_such_session(made: Made, text: str, says: str) -> None:
    with pytest.raises(SessionError, match=says):
        find_session(text)


def test_the_nearest_name_is_offered(made: Made) -> None:
    with pytest.raises(SessionError, match=f"did you mean `{made.folder.name}`"):
        find_session(made.folder.name[:-2])


# --- the commands ---


def test_replay_identical(made: Made) -> None:
    result = run("replay", made.folder.name)
    assert (result.exit_code, result.stderr) == (0, "")
    inputs, records = len(made.session.steps), len(made.records)
    assert result.stdout == f"identical: {inputs} inputs, {records} records, 12.8 s of session time\n"
    found = json.loads(run("replay", made.folder, "--json").stdout)
    assert found == {
        "session": str(made.folder),
        "identical": True,
        "inputs": inputs,
        "records": records,
        "seconds": 12.75,
        "difference": None,
        "damaged": [],
        "missing": 0,
        "notes": [],
    }


def test_replay_different(made: Made) -> None:
    acts = made.study / "acts" / "all.xml"
    acts.write_text(acts.read_text("utf-8").replace("How are you", "How do you do"), "utf-8")
    result = run("replay", made.folder, "--scenario", made.study)
    assert result.exit_code == 1
    note, different, before = result.stdout.splitlines()
    assert note.startswith("note: ") and before == "(14 records before it are identical)"
    assert different.endswith(
        '`parameters` is {"message":"How are you?"}, but the replay gives {"message":"How do you do?"}'
    )
    difference = json.loads(run("replay", made.folder, "--scenario", made.study, "--json").stdout)["difference"]
    assert (difference["file"], difference["seq"], difference["field"]) == ("journal.jsonl", 15, "parameters")
    assert made.lines[difference["line"] - 1] == b"".join(x for x in made.lines if b'"seq":15,' in x)


def test_replay_damaged(made: Made) -> None:
    lines = list(made.lines)
    lines[5] = b"#\n"
    made.write(b"".join(lines))
    result = run("replay", made.folder)
    assert result.exit_code == 1
    assert "different: journal.jsonl:6 cannot be read: it has no check sum at its end" in result.stdout
    found = json.loads(run("replay", made.folder, "--json").stdout)
    assert (found["identical"], found["missing"]) == (False, 1)
    assert found["damaged"] == [{"line": 6, "reason": "it has no check sum at its end"}]


@pytest.mark.parametrize("command", [("replay",), ("export", "--format", "csv"), ("replay", "--json")])
def test_what_cannot_be_read_is_a_sentence_and_2(made: Made, command: tuple[str, ...]) -> None:
    made.write(b"")
    result = run(command[0], made.folder, *command[1:])
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == f"error: {made.journal} is empty: nothing was ever recorded\n"
    result = run(command[0], "nothing-like-it", *command[1:])
    assert result.exit_code == 2 and "there is no session `nothing-like-it` in" in result.stderr


def test_replay_with_a_scenario_that_is_not_there(made: Made) -> None:
    result = run("replay", made.folder, "--scenario", made.study / "nowhere")
    assert result.exit_code == 2 and "there is no folder" in result.stderr


def test_export_to_a_new_file_only(made: Made, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    assert run("export", made.folder, "--format", "csv", "-o", out).exit_code == 0
    before = out.read_bytes()
    assert len(table(before)) == len(made.records)
    result = run("export", made.folder, "--format", "jsonl", "-o", out)
    assert result.exit_code == 2 and "is there already" in result.stderr
    assert out.read_bytes() == before
    result = run("export", made.folder, "--format", "jsonl", "-o", tmp_path / "no" / "folder")
    assert result.exit_code == 2 and "there is no folder" in result.stderr
    result = run("export", made.folder, "--format", "jsonl", "-o", tmp_path)
    assert result.exit_code == 2 and "is there already" in result.stderr


def test_nothing_is_left_behind_when_there_is_nothing_to_export(made: Made, tmp_path: Path) -> None:
    made.write(b"")
    assert run("export", made.folder, "--format", "csv", "-o", tmp_path / "out.csv").exit_code == 2
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.slow
def test_as_processes(made: Made) -> None:
    """Once for real: standard output, a closed pipe, a full disk."""
    call = ("export", made.folder.name, "--format", "jsonl")
    done = run_engine(*call)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.encode() == b"".join(encode_record(record) + b"\n" for record in made.records)
    reader, writer = os.pipe()
    os.close(reader)
    done = run_engine(*call, stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")
    if Path("/dev/full").exists():
        with Path("/dev/full").open("wb") as full:
            done = run_engine(*call, stdout=full)
        assert (done.returncode, done.stderr) == (74, "error: standard output cannot be written: the disk is full\n")


# --- the documentation ---


@pytest.mark.skipif(shutil.which("jq") is None, reason="needs jq")
def test_the_lines_of_the_documentation_that_use_jq(made: Made) -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "sessions.md").read_text("utf-8")
    commands = [line for line in page.splitlines() if line.startswith("jq ")]
    assert len(commands) >= 4
    for command in commands:
        done = subprocess.run(
            command, shell=True, cwd=made.folder, capture_output=True, text=True, timeout=60, check=False
        )
        assert (done.returncode, done.stderr) == (0, ""), command
        assert done.stdout, command


def test_the_columns_are_documented() -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "sessions.md").read_text("utf-8")
    rows = page.partition("## Export")[2]
    places = [rows.find(f"`{column}`") for column in COLUMNS]
    assert -1 not in places, [column for column, at in zip(COLUMNS, places, strict=True) if at == -1]


def test_the_check_sum_is_what_the_documentation_says(made: Made) -> None:
    from zlib import crc32

    for line in made.lines:
        body, _, rest = line.rpartition(b',"crc":"')
        assert rest == b'%08x"}\n' % crc32(body)
        assert msgspec.json.decode(line)["crc"] == f"{crc32(body):08x}"
