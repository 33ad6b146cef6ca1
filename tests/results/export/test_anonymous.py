"""`study withdraw --keep-anonymous`: numbers stay, and nothing that says whose they are."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from rise_engine.base.errors import StudyError
from rise_engine.base.files import Disk
from rise_engine.results.export.session_tables import rows_to_keep
from rise_engine.study.traces import KEPT_FILE, WORK_FOLDER, add_rows
from rise_engine.study.withdrawal import plan_withdrawal
from rise_engine.study.withdrawal import withdraw as withdraw_participant
from tests.commands import typed
from tests.results.analysis.samples import make_study


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """P01 and P02 have agreed that something is kept of them; P03 has not."""
    folder = make_study(tmp_path / "study")
    people = "participant,consent_study,consent_anonymous,status,comment\n"
    people += "P01,2026-11-01,2026-11-01,,\nP02,2026-11-02,2026-11-02,,\nP03,2026-11-03,,,\nP04,2026-11-04,,,\n"
    (folder / "participants.csv").write_text(people, "utf-8")
    return folder


def rows_of(study: Path) -> list[dict[str, str]]:
    with (study / KEPT_FILE).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def run(study: Path, *arguments: str) -> tuple[int, str, str]:
    result = typed("study", "withdraw", study, *arguments)
    return result.exit_code, result.stdout, result.stderr


def test_numbers_stay_under_a_fresh_id(study: Path) -> None:
    status, said, _ = run(study, "P01", "--yes", "--keep-anonymous")
    assert status == 1  # their line in participants.csv is people's to delete
    rows = rows_of(study)
    assert [row["run"] for row in rows] == ["1", "2"]
    assert len({row["id"] for row in rows}) == 1
    assert f"2 rows of numbers stay in {KEPT_FILE}, as {rows[0]['id']}" in said
    assert {row["factor_hesitation"] for row in rows} == {"yes"}
    assert [(float(row["duration_s"]), row["acts"], row["outcome"]) for row in rows] == [(120.0, "16", "complete")] * 2
    assert float(rows[0]["response_median_s"]) > 0
    text = (study / KEPT_FILE).read_text("utf-8")
    assert not any(
        word in text for word in ("P01", "2024", "2026", "anna", "wizard:", "sha", "slot", "seed", "hesitation_real")
    )
    assert not list((study / "sessions").glob("*P01*"))
    assert (study / KEPT_FILE).stat().st_mode & 0o077 == 0


def test_of_several_people_the_order_says_nothing(study: Path) -> None:
    run(study, "P01", "--yes", "--keep-anonymous")
    first = {row["id"] for row in rows_of(study)}
    run(study, "P02", "--yes", "--keep-anonymous")
    rows = rows_of(study)
    assert [row["id"] for row in rows] == sorted(row["id"] for row in rows)
    assert len(rows) == 5  # P02's first session was broken off, and counts as such
    assert first < {row["id"] for row in rows}


def test_a_reassigned_session_says_nothing_of_whom_it_was_run_under(study: Path) -> None:
    session = next(path.name for path in sorted((study / "sessions").iterdir()) if "P02" in path.name)
    for participant in ("P04", "P02"):
        arguments = ["study", "reassign", str(study), session, participant, "--reason", "they sat there"]
        assert typed(*arguments).exit_code == 0
    run(study, "P02", "--yes", "--keep-anonymous")
    text = (study / KEPT_FILE).read_text("utf-8")
    assert len(rows_of(study)) == 3 and "run_as" not in text and "P0" not in text


def test_who_has_not_agreed_is_not_kept_and_nothing_is_erased(study: Path) -> None:
    before = sorted(path.name for path in (study / "sessions").iterdir())
    status, _, errors = run(study, "P03", "--yes", "--keep-anonymous")
    assert status == 1
    assert "P03 has not agreed that anything is kept" in errors
    assert sorted(path.name for path in (study / "sessions").iterdir()) == before
    assert not (study / KEPT_FILE).exists()
    (study / "study.toml").write_text("nonsense", "utf-8")
    with pytest.raises(StudyError, match="has errors"):
        rows_to_keep(study, "P01", [])


def test_without_the_option_nothing_stays(study: Path) -> None:
    run(study, "P01", "--yes")
    assert not (study / KEPT_FILE).exists()


class _Killed(BaseException):
    """The program ends in the middle."""


class _DyingDisk(Disk):
    """Ends the program when it is about to sync for the `steps`-th time."""

    def __init__(self, steps: int) -> None:
        self.left = steps

    def sync(self, descriptor: int) -> None:
        self.left -= 1
        if self.left < 0:
            raise _Killed
        super().sync(descriptor)


def test_a_kill_at_any_moment_keeps_the_rows_once(tmp_path: Path, study: Path) -> None:
    """Said again without rows, as the sessions may be gone by then: what was listed is kept."""
    rows = rows_to_keep(study, "P01", plan_withdrawal(study, "P01").sessions)
    for steps in (1, 2, 3, 4, 6, 9, 14, 20):
        copy = tmp_path / f"copy{steps}"
        make_study(copy)
        try:
            withdraw_participant(copy, "P01", _DyingDisk(steps), keep=rows)
        except _Killed:
            left = list((copy / "sessions").glob("*P01*"))
            withdraw_participant(copy, "P01", keep=rows if len(left) == 3 else ())
        assert rows_of(copy) == rows, steps
        assert not (copy / WORK_FOLDER).exists()


def test_rows_are_added_once(tmp_path: Path) -> None:
    add_rows(tmp_path, [{"id": "A2", "run": "1", "acts": "3"}], Disk())
    add_rows(tmp_path, [{"id": "A1", "run": "1", "cues": "2"}, {"id": "A2", "run": "1", "acts": "3"}], Disk())
    assert rows_of(tmp_path) == [
        {"id": "A1", "run": "1", "acts": "", "cues": "2"},
        {"id": "A2", "run": "1", "acts": "3", "cues": ""},
    ]
