"""A study in which things went wrong: what its report and its tables say of people, failures, stops and recoveries."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from rise_engine.kernel.inputs import CheckReport, OutcomeReport
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.export.format import load_format
from rise_engine.results.export.writing import export_context
from rise_engine.results.report.document import ReportTable
from rise_engine.results.report.making import make_study_report
from rise_engine.results.report.page import text_lines
from rise_engine.study.begin import BeginRequest, plan_session
from rise_engine.study.judge import judge_session
from rise_engine.study.state import OpenStudy, StudyStatus, read_state
from rise_engine.study.withdrawal import withdraw
from tests.results.analysis.samples import WIZARD, make_study, play_session, recovered_session, sessions_of, short

CHECK = """
[[check]]
id = "participant-debriefed"
ask = "The participant was debriefed"
when = "after"
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """P01 has withdrawn, P02 was aborted once, P03 is excluded, P04 had a recovery and was debriefed by a program."""
    folder = make_study(tmp_path_factory.mktemp("people") / "study")
    with (folder / "study.toml").open("a", encoding="utf-8") as file:
        file.write(CHECK)
    with OpenStudy(folder) as open:
        plan = plan_session(open.state, BeginRequest("P04"))
        first = plan.first_input(open.state.study)
        open.log.append("excluded", participant="P03", reason="knew the robot", source=WIZARD)
    recovered_session(folder / "sessions", at=26.0, scenario=Path(plan.run.scenario), started=first, seed=plan.seed)
    people = folder / "participants.csv"
    withdraw(folder, "P01")
    rows = people.read_text("utf-8").splitlines(keepends=True)
    people.write_text("".join(row for row in rows if not row.startswith("P01,")), "utf-8")
    with OpenStudy(folder) as open:
        plan = plan_session(open.state, BeginRequest("P04"))
        first = plan.first_input(open.state.study)
    by_program = CheckReport(id="participant-debriefed", result="passed", source="ros:/survey")
    script = [*short(), (18.0, by_program), (19.0, OutcomeReport(status="complete", source=WIZARD))]
    play_session(folder / "sessions", script, scenario=Path(plan.run.scenario), started=first, seed=plan.seed, until=20)
    return folder


def said(study: Path) -> str:
    return "\n".join(text_lines(make_study_report(study).document, 200))


def test_everybody_who_began_is_counted(study: Path) -> None:
    text = said(study)
    assert "4 (1 of them has withdrawn since)" in text
    sheet = make_study_report(study).sheet
    assert "3 listed now, 4 (1 of them has withdrawn since) began" in sheet
    assert "1 excluded, 1 withdrawn." in sheet
    assert "knew the robot" in text and "Zelda felt sick" in text


def test_debriefing_is_one_fact_whoever_reports_it(study: Path) -> None:
    """A program told the session; report, sheet and `study status` say the same."""
    state = read_state(study)
    open_ = [each for each in state.standing.due if "debriefed" in each]
    assert [each for each in open_ if each.startswith("P04, run 2")] == []
    assert any(each.startswith("P02, run 1") for each in open_)
    made = make_study_report(study)
    assert "A debriefing is recorded after 1 of 4 " in made.sheet, "complete sessions of P02 and P04"
    assert "No check asks" not in made.sheet
    with OpenStudy(study) as open:
        told = [each for each in open.log.entries() if each.kind == "checked" and each.get("when") == "after"]
    assert [(each.get("participant"), each.get("source")) for each in told] == [("P04", "ros:/survey")]


def test_what_went_wrong_is_in_report_and_tables(study: Path, tmp_path: Path) -> None:
    text = said(study)
    assert "recovered 1 time, " in text
    assert "act failed" in text or "acts failed" in text
    folders = sessions_of(study)
    load_format("tables").write(tmp_path / "out", read_sessions(folders), export_context(folders, "full"))
    with (tmp_path / "out" / "sessions.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["outcome"] for row in rows} >= {"complete", "aborted", "excluded"}
    assert sum(int(row["recoveries"]) for row in rows) == 1
    assert {row["attempt"] for row in rows} == {"1", "2"}
    assert all(sum(int(row[name]) for row in rows) for name in ("failed_acts", "stops", "faults", "acts_repeated"))


def test_a_judgement_that_was_changed_is_told_with_the_earlier_one(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    with OpenStudy(study) as open:
        plan = plan_session(open.state, BeginRequest("P04"))
        first = plan.first_input(open.state.study)
    script = short(outcome="aborted", reason="Zelda left")
    play_session(study / "sessions", script, scenario=Path(plan.run.scenario), started=first, seed=plan.seed, until=20)
    for participant, status, reason in (
        ("P01", "aborted", "wrong instructions"),
        ("P02", "aborted", "too loud"),
        ("P02", "complete", "still clear"),
        ("P03", "excluded", "knew the robot"),
        ("P04", "complete", "came back after all"),
    ):
        with OpenStudy(study) as open:
            judge_session(open, participant, status, reason, session=read_last(open.state, participant))
    full = judged_table(study, "full")
    assert [row[:2] for row in full] == [
        ("P01", "run 2, attempt 1 aborted (was complete)"),
        ("P02", "run 1, attempt 1 aborted"),
        ("P02", "run 2, attempt 1 complete (was complete, then aborted)"),
        ("P03", "excluded"),
        ("P03", "run 2, attempt 1 excluded (was complete)"),
        ("P04", "run 1, attempt 1 complete (was aborted)"),
    ]
    assert [row[2] for row in full if "was" in row[1]] == [
        "wrong instructions",
        "still clear",
        "knew the robot",
        "came back after all",
    ]
    shared = judged_table(study, "shared")
    assert [row[:2] for row in shared] == [row[:2] for row in full]
    assert all("[free text, " in row[2] for row in shared)


def read_last(state: StudyStatus, participant: str) -> str:
    """The folder of a participant's last session that counts."""
    return next(each.sessions[-1].folder for each in state.standing.participants if each.participant == participant)


def judged_table(study: Path, level: ExportLevel) -> tuple[tuple[str, ...], ...]:
    blocks = [block for part in make_study_report(study, level).document.sections for block in part.blocks]
    caption = "Excluded participants, and sessions that were aborted, judged again or reassigned, with reasons"
    return next(each.rows for each in blocks if isinstance(each, ReportTable) and each.caption == caption)
