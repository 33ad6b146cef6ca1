"""`rise-engine export`: which sessions are meant, and what is said of it."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest
from click.testing import Result

from rise_engine.kernel.inputs import SessionStarted
from rise_engine.results.export.format import format_names
from rise_engine.session.folder import JOURNAL
from rise_engine.study.withdrawal import plan_withdrawal, withdraw
from tests.commands import typed
from tests.results.analysis.samples import make_study, play_session, sessions_of, short, torn_session


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "sessions"))
    return make_study(tmp_path / "study")


def export(*arguments: object) -> Result:
    return typed("export", *arguments)


def sessions_in(path: str) -> list[str]:
    with Path(path).open(encoding="utf-8", newline="") as file:
        return list(dict.fromkeys(row["session"] for row in csv.DictReader(file)))


def test_of_a_study_what_counts_and_has_ended(study: Path) -> None:
    result = export("study", "--format", "csv", "-o", "out.csv")
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr.splitlines() == [
        "note: 1 session of study is not in the export (1 pilot): --all includes them",
        "7 sessions exported to out.csv",
    ]
    assert sessions_in("out.csv") == [each.name for each in sessions_of(study)[1:]]


def test_all_of_a_study(study: Path) -> None:
    first = SessionStarted(participant="P04", study="hesitation", slot=4, run=1, attempt=1, purpose="counted")
    torn = torn_session(study / "sessions", scenario=study / "scenario", started=first)
    assert export("study/study.toml", "--format", "csv", "-o", "counted.csv").stderr.splitlines()[0] == (
        "note: 2 sessions of study are not in the export (1 pilot, 1 unfinished): --all includes them"
    )
    result = export("study", "--format", "csv", "--all", "-o", "all.csv")
    assert result.exit_code == 1 and "is torn at its end" in result.stderr
    assert set(sessions_in("all.csv")) == {each.name for each in sessions_of(study)} and torn.name in sessions_in(
        "all.csv"
    )


def test_studies_and_sessions_together_each_once(study: Path, tmp_path: Path) -> None:
    alone = play_session(tmp_path / "sessions", short(), until=20)
    pilot = sessions_of(study)[0]
    result = export("study", pilot, alone.name, sessions_of(study)[2], "--format", "csv", "-o", "out.csv")
    assert result.exit_code == 0, result.stderr
    found = sessions_in("out.csv")
    assert len(found) == 9 and {pilot.name, alone.name} <= set(found)


def test_rows_of_several_sessions_say_whose_they_are(study: Path) -> None:
    export("study", "--format", "csv", "-o", "out.csv", "--level", "shared")
    with Path("out.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {(row["participant"], row["run"], row["attempt"], row["mode"]) for row in rows} == {
        *(("P01", "1", "1", "real"), ("P01", "2", "1", "real"), ("P02", "1", "1", "real"), ("P02", "1", "2", "real")),
        *(("P02", "2", "1", "real"), ("P03", "1", "1", "real"), ("P03", "2", "1", "real")),
    }
    assert {row["factors"] for row in rows if row["participant"] == "P02" and row["run"] == "2"} == {
        '{"hesitation":"no","noise":"loud"}'
    }


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nowhere", "--format", "csv"], "there is no session `nowhere`"),
        (["study", "--format", "tabels"], "there is no format 'tabels'; did you mean `tables`?"),
        (["study", "--format", "tables"], "use -o with the name of a new folder"),
        (["study", "--format", "csv"], "use -o with the name of a new file, such as sessions.csv"),
        (["study", "--format", "jsonl", "-o", "-"], "use -o with the name of a new folder"),
        (["study", "--format", "tables", "-o", "study"], "study is there already, and files are never overwritten"),
        (["study", "--format", "tables", "-o", "no/where"], "no/where cannot be made: there is no folder no"),
    ],
)
def test_what_cannot_be_done_is_said(study: Path, arguments: list[str], says: str) -> None:
    before = (study / "study.jsonl").read_bytes()
    result = export(*arguments)
    assert result.exit_code == 2 and says in result.stderr
    assert (study / "study.jsonl").read_bytes() == before
    assert sorted(path.name for path in Path().iterdir()) == ["study"]


def test_help_says_what_every_format_is() -> None:
    text = export("--help").stdout
    for name in format_names():
        assert f"\n  {name} " in text


def test_a_study_that_is_not_right_says_everything(study: Path) -> None:
    (study / "study.toml").write_text('titel = "x"\n', "utf-8")
    result = export("study", "--format", "tables", "-o", "out")
    assert result.exit_code == 2 and all(line.startswith("study.toml:") for line in result.stderr.splitlines())
    assert len(result.stderr.splitlines()) > 1


def test_a_study_without_sessions(study: Path) -> None:
    shutil.rmtree(study / "sessions")
    result = export("study", "--format", "tables", "-o", "out")
    assert result.exit_code == 2
    lines = result.stderr.splitlines()
    assert lines[0] == "error: there is no session to export" and len(lines) == 9
    assert lines[1].endswith("is not in the export: it is not in the study's sessions any more")


def test_what_is_private_cannot_be_known_of_one(study: Path) -> None:
    broken = sessions_of(study)[3]
    shutil.rmtree(broken / "scenario")
    told = (broken / "session.toml").read_text("utf-8")
    (broken / "session.toml").write_text(told.replace("scenario_folder = ", 'scenario_folder = "/nowhere" #'), "utf-8")
    result = export("study", "--format", "csv", "--level", "shared", "-o", "out.csv")
    assert result.exit_code == 1
    assert f"warning: {broken.name} is not in it: it is not known which memory keys are private" in result.stderr
    assert "6 sessions exported to out.csv" in result.stderr


def test_every_format_is_written_for_one_session_and_for_a_study(study: Path) -> None:
    """Whatever formats there are: none leaves anything beside what it was asked for."""
    one = sessions_of(study)[1]
    for name in format_names():
        for what, source in (("one", one), ("all", study)):
            out = Path(f"{what}-{name}")
            result = export(source, "--format", name, "--level", "shared", "-o", out)
            assert result.exit_code == 0, (name, what, result.stderr)
            assert out.exists()
    assert len(list(Path().iterdir())) == 1 + 2 * len(format_names())


def test_who_withdraws_is_taken_out_of_every_export(study: Path) -> None:
    kept = study / "notes.txt"
    kept.write_text("mine")
    for name in ("tables", "jsonl", "csv"):
        assert export("study", "--format", name, "-o", f"study/{name}").exit_code == 0
    left = Path("study/.tables.unfinished-leftover")  # as a kill leaves it
    left.mkdir()
    (left / "acts.csv").write_text("P01")
    plan = plan_withdrawal(study.resolve(), "P01")
    assert len(plan.exports) == 3 and len(plan.export_folders) == 2
    report = withdraw(study.resolve(), "P01")
    assert not left.exists() and not any((study / name).exists() for name in ("tables", "jsonl", "csv"))
    assert len(report.make_again) == 3 and kept.exists()
    result = export("study", "--format", "tables", "--all", "-o", "again")
    assert result.exit_code == 0 and "P01" not in Path("again/sessions.csv").read_text("utf-8")


def test_one_that_has_withdrawn_and_left_a_folder_is_not_exported(study: Path, tmp_path: Path) -> None:
    folder = sessions_of(study)[1]
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    withdraw(study.resolve(), "P01")
    shutil.copytree(copy, folder)  # from somebody's backup
    result = export("study", "--format", "csv", "--all", "-o", "out.csv")
    assert f"note: {folder.name} is not in the export: its participant has withdrawn" in result.stderr
    assert folder.name not in sessions_in("out.csv") and (folder / JOURNAL).exists()
    result = export(folder, "--format", "csv")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == f"error: {folder.name} is not exported: its participant has withdrawn\n"
