"""The report of a session as a console reads it from a study's folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.base.errors import StudyError
from rise_engine.ports.bridge import RosConnection
from rise_engine.results.report.page import page_text
from rise_tui.cli.study_folder import StudyFolder
from tests.results.analysis.samples import DESIGN, make_study, sessions_of


def test_a_blinded_study_calls_its_condition_by_the_label(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    first = sessions_of(study)[1]
    source = StudyFolder(str(study), RosConnection())
    assert source.report(first.name).title == "P01, run 1, yes+loud"
    labelled = DESIGN.replace('kind = "between"', 'kind = "between"\nlabels = { yes = "A", no = "B" }')
    (study / "study.toml").write_text(labelled, "utf-8")
    made = source.report(first.name)
    assert made.title == "P01, run 1, A+loud"
    assert "hesitation yes" not in page_text(made) and "yes+loud" not in page_text(made)


def test_a_session_that_is_not_there_is_refused_in_a_sentence(tmp_path: Path) -> None:
    source = StudyFolder(str(make_study(tmp_path / "study")), RosConnection())
    with pytest.raises(StudyError, match=r"journal\.jsonl"):
        source.report("2024-11-23_000000_P09_gone")
