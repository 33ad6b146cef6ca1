"""The check `auto = "explored"`: nothing can get stuck or fail in the session that is about to begin."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from rise_engine.checks.kinds import KEPT, check_explored
from rise_engine.checks.runner import run_check
from rise_engine.study.model import StudyCheck
from rise_engine.study.participants import SessionKind
from rise_engine.study.plan import planned_run
from rise_engine.study.study_toml import load_study
from tests.checks.samples import context

STUDY = Path(__file__).parents[1] / "study" / "kinds"
"""In English, the direct condition asks for a column that the table does not have."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(STUDY, tmp_path / "study"))


def kind_of(folder: Path, condition: str, language: str) -> SessionKind:
    study = load_study(folder).study
    assert study is not None
    levels = condition.split("+")
    return SessionKind(
        planned_run(study, dict(zip((each.name for each in study.factors), levels, strict=True))), language
    )


@pytest.mark.slow
async def test_it_is_about_the_session_that_is_to_begin(folder: Path) -> None:
    study = load_study(folder).study
    assert study is not None
    check = StudyCheck("explored", auto="explored")
    bad = context(study, mode="debug", kind=kind_of(folder, "direct+back", "en"))
    outcome = await run_check(check, bad)
    assert outcome.result == "failed"
    assert outcome.reason.startswith("R_Ask failed at action 1 when it was played: "), outcome
    good = check_explored(folder, kind_of(folder, "direct+back", "de"), None, "debug")
    assert good.passed and good.value.startswith("explored and played 1 kind of session (in de): "), good


def test_of_no_session_every_kind_counts(folder: Path) -> None:
    found = check_explored(folder, None, None, "debug")
    assert not found.passed and found.reason.startswith("R_Ask failed at action 1")


def test_what_has_not_changed_is_looked_at_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    english, german = (kind_of(folder, "polite+back", language) for language in ("en", "de"))
    for kind in (english, german):
        assert check_explored(folder, kind, None, "debug").passed
    with monkeypatch.context() as patched:
        patched.setattr("rise_engine.checks.kinds._explore_kind", None)
        assert check_explored(folder, english, None, "debug").passed
    (folder / KEPT).write_text("{")
    assert check_explored(folder, english, None, "debug").passed


def test_a_study_with_errors_has_not_passed(folder: Path) -> None:
    kind = kind_of(folder, "polite+back", "de")
    next((folder / "scenario" / "rules").iterdir()).write_text("<InteractionRule")
    assert "has errors" in check_explored(folder, kind, None, "debug").reason
