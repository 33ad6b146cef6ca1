"""A study's report: every number is counted anew from the exported tables, as somebody does who has only those."""

from __future__ import annotations

import csv
import io
import re
import statistics as python
from collections import Counter, defaultdict
from pathlib import Path
from types import SimpleNamespace

import pytest
from msgspec.structs import replace

from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.records import ScenarioRecord
from rise_engine.results.analysis.model import SessionFacts
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.analysis.statistics import Share
from rise_engine.results.export.format import load_format
from rise_engine.results.export.writing import export_context, export_sessions
from rise_engine.results.report.document import Facts, Paragraph
from rise_engine.results.report.making import MadeReport, make_study_report
from rise_engine.results.report.page import cells_wide, page_text, text_lines
from rise_engine.results.report.session_report import session_report
from rise_engine.results.report.sheet import _hashes_text, debriefed_text
from rise_engine.results.report.study_facts import SessionRow, StudyFigures, WizardPart, study_figures
from rise_engine.results.report.study_report import StudyReportInput, _assignment, _cells, study_report
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import encode_line
from rise_engine.session.journal_reader import read_journal
from rise_engine.study.publishing import ITEM_NAMES, REPORT_ITEMS
from rise_engine.study.state import read_state
from rise_engine.study.traces import Withdrawn
from tests.results.analysis.samples import DESIGN, make_study, play_session, sessions_of, task
from tests.results.report.pages import PageReader
from tests.results.report.test_page import assert_harmless
from tests.study.designs import make_study as design


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_study(tmp_path_factory.mktemp("report") / "study")


@pytest.fixture(scope="module")
def made(study: Path) -> MadeReport:
    return make_study_report(study)


@pytest.fixture(scope="module")
def given(study: Path) -> StudyReportInput:
    """What a report of the study is made of."""
    state = read_state(study)
    return StudyReportInput(state.study, state.standing, study_figures(read_sessions(sessions_of(study))))


@pytest.fixture(scope="module")
def page(made: MadeReport) -> PageReader:
    return assert_harmless(page_text(made.document))


@pytest.fixture(scope="module")
def tables(study: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[dict[str, str]]]:
    """acts.csv and sessions.csv of all sessions, and which of them count."""
    out = tmp_path_factory.mktemp("tables") / "out"
    folders = sessions_of(study)
    export_sessions(load_format("tables"), out, folders, export_context(folders, "full"))
    return {
        name: list(csv.DictReader(io.StringIO((out / f"{name}.csv").read_text("utf-8"))))
        for name in ("acts", "sessions")
    }


def complete(row: dict[str, str]) -> bool:
    return row["purpose"] == "counted" and row["outcome"] == "complete"


def responses(tables: dict[str, list[dict[str, str]]]) -> dict[str, list[float]]:
    """By session, of complete ones: from the rows of acts.csv."""
    found: dict[str, list[float]] = defaultdict(list)
    counted = {row["session"] for row in tables["sessions"] if complete(row)}
    for row in tables["acts"]:
        if row["session"] in counted and row["filler"] == "false" and row["response_s"]:
            found[row["session"]].append(float(row["response_s"]))
    return found


def test_a_session_that_went_on_with_changed_files_says_so_everywhere(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    folder = sessions_of(study)[1]
    last = list(read_journal(folder / JOURNAL).read_records())[-1]
    record = ScenarioRecord(last.seq + 1, last.t, last.wall, "ab" * 32, "cd" * 32, ("act Greet changed",), "node:root")
    with (folder / JOURNAL).open("ab") as file:
        file.write(encode_line(record))
    out = tmp_path / "out"
    export_sessions(load_format("tables"), out, [folder], export_context([folder], "full"))
    (session,) = csv.DictReader(io.StringIO((out / "sessions.csv").read_text("utf-8")))
    assert session["scenario_changed_to"] == "ab" * 32
    events = csv.DictReader(io.StringIO((out / "events.csv").read_text("utf-8")))
    assert [(each["value"], each["by"]) for each in events if each["kind"] == "scenario"] == [
        ("act Greet changed", "node:root")
    ]
    text = "\n".join(text_lines(make_study_report(study).document, 200))
    assert "!! Complete sessions ran 2 different versions of the scenario." in text
    assert "went on with changed files 1 time" in text
    (data,) = read_sessions([folder])
    text = "\n".join(text_lines(session_report(data), 200))
    assert re.search(r"Changed files +2:00 by node root: act Greet changed", text)


def test_a_condition_that_a_wizard_changed_by_hand_is_told(tmp_path: Path) -> None:
    began = SessionStarted(participant="P01", condition="yes", study="tea", memory={"hesitation": True, "noise": 3})
    script = [
        (1.0, task("assignValue", "hesitation = true")),
        (2.0, task("assignValue", "noise = 4", source="rule:Visit")),
        (62.0, task("assignValue", "hesitation = false")),
        (63.0, task("assignValue", "visits = 7")),
    ]
    folder = play_session(tmp_path / "sessions", script, started=began, until=70.0)
    (data,) = read_sessions([folder])
    assert data.facts.changed_keys == {"hesitation": 62.0}
    text = "\n".join(text_lines(session_report(data), 200))
    assert "!! A wizard changed what the condition had set: hesitation from 1:02 on." in text
    facts = replace(data.facts, purpose="counted", outcome="complete")
    figures = study_figures([replace(data, facts=facts)])
    study = read_state(make_study(tmp_path / "study"))
    text = "\n".join(text_lines(study_report(StudyReportInput(study.study, study.standing, figures)), 200))
    assert "!! A wizard changed what the condition had set in 1 complete session" in text
    assert "condition changed by hand: hesitation" in text


def test_the_scenarios_of_two_levels_are_not_two_versions(tmp_path: Path) -> None:
    loaded = read_state(make_study(tmp_path / "study")).study
    (first, second), *_ = (each.levels for each in loaded.factors)
    levels = (replace(first, scenario="one"), replace(second, scenario="two"))
    study = replace(loaded, factors=(replace(loaded.factors[0], levels=levels), *loaded.factors[1:]))

    def figures(*ran: tuple[str, str]) -> StudyFigures:
        facts = SessionFacts(session="s", purpose="counted", outcome="complete")
        name = study.factors[0].name
        told = [replace(facts, factors={name: level}, scenario_hash=hash) for level, hash in ran]
        return StudyFigures(tuple(SimpleNamespace(facts=each, is_complete=True) for each in told))  # type: ignore[arg-type]

    assert figures((first.name, "a"), (second.name, "b")).scenario_versions(study) == 1
    assert figures((first.name, "a"), (first.name, "b")).scenario_versions(study) == 2


def two(value: float) -> str:
    return f"{value:.2f}"


def test_conditions_are_those_of_the_tables(page, tables):
    by_condition: dict[str, list[str]] = defaultdict(list)
    for row in tables["sessions"]:
        if complete(row):
            by_condition[row["condition"]].append(row["session"])
    told = page.table("Complete sessions by condition")
    assert set(told) == set(by_condition) and len(told) == 4
    found = responses(tables)
    for condition, sessions in by_condition.items():
        medians = [python.median(found[session]) for session in sessions]
        assert told[condition]["sessions"] == str(len(sessions))
        assert told[condition]["answers"] == str(sum(len(found[session]) for session in sessions))
        assert told[condition]["median"] == two(python.median(medians))


def test_pooled_responses_are_those_of_the_tables(page, tables):
    values = [value for each in responses(tables).values() for value in each]
    row = page.table("From a cue to the robot's answer")["response (cue to answer)"]
    lower, middle, upper = python.quantiles(values, n=4, method="inclusive")
    assert (row["n"], row["median"]) == (str(len(values)), two(middle))
    assert row["middle half"] == f"{two(lower)}\u2013{two(upper)}"
    assert row["95 % within"] == two(python.quantiles(values, n=20, method="inclusive")[-1])


def test_each_session_is_told_as_the_table_of_sessions_has_it(page, tables):
    rows = next(rows for caption, rows in page.tables.items() if caption.startswith("Every session"))
    told = [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]
    assert len(told) == len(tables["sessions"]) == 8
    for mine, theirs in zip(told, tables["sessions"], strict=True):
        assert (mine["who"], mine["condition"]) == (theirs["participant"], theirs["condition"])
        assert int(mine["cues"]) == int(theirs["cues"]) - int(theirs["cues_undone"])
        assert ("failed" in mine["went wrong"]) == (theirs["failed_acts"] != "0")
        if theirs["response_median_s"]:
            assert mine["response"] == two(float(theirs["response_median_s"]))
    assert [row["outcome"] for row in told] == ["pilot", "complete", "complete", "aborted", *["complete"] * 4]


def test_wizards_are_those_of_the_acts(page, tables):
    counted = {row["session"] for row in tables["sessions"] if complete(row)}
    acts = [row for row in tables["acts"] if row["session"] in counted and row["by"] == "wizard:anna"]
    sessions = [row for row in tables["sessions"] if row["session"] in counted]
    keys = sum(int(row["wizard_keys"]) for row in sessions)
    told = page.table("Wizards in complete sessions")["anna"]
    assert told["sessions"] == "6"
    assert told["keys"] == str(keys)
    reacted = [row for row in acts if row["response_s"] and row["before_cue"] == "false" and row["filler"] == "false"]
    reactions = [float(row["wizard_s"]) for row in reacted if row["wizard_s"]]
    assert told["cue to key"] == two(python.median(reactions))
    marked = sum(int(row["mistakes"]) for row in sessions)
    assert told["per 100"].startswith(f"{100 * marked / keys:.1f} (")
    assert told["rehearsals"].startswith("1, 20")


def test_training_is_before_the_first_session_that_counts_even_if_it_was_aborted():
    def row(purpose, outcome, wizard="wizard:anna"):
        facts = SessionFacts(session=f"{purpose} {outcome}", purpose=purpose, outcome=outcome)
        part = WizardPart(wizard, 1, 0, ())
        return SessionRow(facts, None, (part,), {}, (), (), ())  # what was counted in it is not asked for

    pilot, aborted, training = row("pilot", None), row("counted", "aborted"), row("training", None)
    rows = (pilot, aborted, training, row("counted", "complete"))
    (course,) = StudyFigures(rows).wizards()
    assert course.rehearsals == (pilot,)
    others = (aborted, row("training", None, "wizard:ben"), row("counted", "complete", "wizard:ben"))
    (course,) = StudyFigures(others).wizards()
    assert [each.facts.purpose for each in course.rehearsals] == ["training"], "of their own sessions"


@pytest.mark.parametrize(
    ("between", "within", "words"),
    [([2], [2], "blocks, orders williams"), ([2], [], "blocks"), ([], [2], "orders williams"), ([], [], "")],
)
def test_only_the_assignment_that_there_is_is_told(between, within, words):
    assert _assignment(design(between, within)) == words


def test_participants_and_cells(page):
    text = page.text
    assert "3 of 3 wanted" in text and "1 pilot" in text
    cells = page.table("The plan and what happened")
    assert Counter({name: int(row["complete"]) for name, row in cells.items()}).total() == 3
    assert page.table("Results of each check")["disk"]["skipped"] == "6"


def test_the_reporting_sheet_says_what_is_known_and_lists_what_is_missing(study, made, tmp_path):
    assert "paraphrase the" in made.sheet and "10.5898/JHRI.1.1.Riek" in made.sheet
    assert f"{len(ITEM_NAMES)} items still to say" in made.sheet
    assert all(f"`{item.name}`: {item.question}" in made.sheet for item in REPORT_ITEMS)
    assert "anna in 6 sessions" in made.sheet
    other = make_study(tmp_path / "study")
    said = "\n".join(f'{name} = "Said of {name}, by *us*"' for name in ITEM_NAMES)
    (other / "study.toml").write_text(f"{DESIGN}\n[report]\n{said}\n", "utf-8")
    full = make_study_report(other)
    assert "still to say" not in full.sheet
    assert "Said of robot\\_make, by \\*us\\*" in full.sheet
    text = assert_harmless(page_text(full.document)).text
    assert all(f"Said of {name}" in text for name in ITEM_NAMES)
    assert "still to say" not in text


def test_every_item_is_asked_for_once(made):
    asked = [name for name in ITEM_NAMES if made.sheet.count(f"(`{name}`)") == 1]
    assert asked == list(ITEM_NAMES)


def test_in_a_terminal_no_line_is_wider_than_it(made):
    lines = text_lines(made.document)
    assert all(cells_wide(line) <= 80 for line in lines)
    assert "Conditions" in lines and "Reporting sheet" in lines


@pytest.mark.parametrize("level", ["shared", "public"])
def test_levels_tell_no_names_dates_or_reasons(study, level):
    made = make_study_report(study, level)
    for text in (page_text(made.document), made.sheet, "\n".join(text_lines(made.document))):
        for hidden in ("Zelda", "Quux", "anna", "2024-11-23", "felt sick", "in a hurry"):
            assert hidden not in text, (hidden, level)
    assert "W1" in page_text(made.document)


def test_a_study_that_hides_its_conditions_keeps_them_until_it_is_complete(tmp_path):
    study = make_study(tmp_path / "study")
    hidden = DESIGN.replace("n = 3", "n = 4").replace("spare = 0.5", "spare = 0.5\nhidden = true")
    (study / "study.toml").write_text(hidden, "utf-8")
    page = assert_harmless(page_text(make_study_report(study).document))
    assert "This study hides its conditions" in page.text and "Conditions" not in page.headings
    assert "yes+loud" not in page.text and "quiet+" not in page.text
    shown = assert_harmless(page_text(make_study_report(study, conditions=True).document))
    assert "Conditions" in shown.headings and "yes+loud" in shown.text


def test_a_study_without_sessions(tmp_path):
    study = make_study(tmp_path / "study")
    for folder in sessions_of(study):
        (folder / "journal.jsonl").rename(study / f"{folder.name}.kept")
        for path in sorted(folder.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        folder.rmdir()
    (study / "study.jsonl").unlink()
    made = make_study_report(study)
    text = assert_harmless(page_text(made.document)).text
    assert "No session has been recorded." in text and "0 of 3" in text
    assert "nan" not in "".join(text_lines(made.document))


def test_what_is_written_in_the_study_is_harmless(tmp_path):
    nasty = "<script>alert(1)</script> http://x url(y)"
    study = make_study(tmp_path / "study")
    design = DESIGN.replace('title = "Hesitation"', f"title = '{nasty}'")
    (study / "study.toml").write_text(f"{design}\n[report]\nplace = '{nasty}'\n", "utf-8")
    made = make_study_report(study)
    assert nasty in assert_harmless(page_text(made.document)).text
    assert "<script" not in made.sheet and "&lt;script\\>" in made.sheet


def test_the_example_of_report_in_the_reference_is_whole():
    text = (Path(__file__).parents[3] / "docs" / "reference" / "study.md").read_text("utf-8")
    for item in REPORT_ITEMS:
        assert f"`{item.name}`" in text, item.name


def test_withdrawn_people_are_counted_and_not_named(given):
    given = replace(given, figures=study_figures([]), withdrawn=Withdrawn(2, 1))
    blocks = [block for section in study_report(given).sections for block in section.blocks]
    flow = next(block for block in blocks if isinstance(block, Facts))
    assert ("Withdrawn", "2") in flow.rows
    assert "2 withdrawn" in " ".join(sentence for item in given.sheet for sentence in item.known)


def test_the_sheet_is_in_whole_sentences(given):
    assert debriefed_text(Share(0, 0)) == "No session is complete yet, so no debriefing is recorded."
    assert debriefed_text(Share(1, 2)).endswith(" complete sessions.")
    told = [sentence for item in given.sheet for sentence in item.known]
    assert told and all(each.endswith(".") for each in told)


def test_hashes_of_a_scenario_in_several_languages_say_which_is_which():
    assert _hashes_text({"a" * 64: "en", "b" * 64: "de"}) == f"{'a' * 16} (en), {'b' * 16} (de)"
    assert _hashes_text({"a" * 64: "en"}) == "a" * 16


def test_whose_robot_did_not_speak_their_language_is_named(given):
    assert {row.facts.language for row in given.figures.rows} == {"en"}
    strata = {"P01": "en", "P02": "de"}
    old = given.standing.participants
    people = tuple(replace(each, strata={"language": strata.get(each.participant, "")}) for each in old)
    report = study_report(replace(given, standing=replace(given.standing, participants=people)))
    text = "\n".join(text_lines(report, 200))
    told = "P02 run 1 (de) heard en; P02 run 2 (de) heard en."
    assert f"!! Complete sessions in another language than the study says: {told}" in text


def changed(given, **facts):
    """The same with other facts in every session."""
    rows = (replace(row, facts=replace(row.facts, **facts)) for row in given.figures.rows)
    return replace(given, figures=StudyFigures(tuple(rows)))


def test_sessions_at_another_speed_say_so(given):
    fast = changed(given, speed=4.0)
    told = "4 times real time in 6 of 6 complete sessions"
    assert ("Speed", told) in study_report(fast).facts
    assert any(told in known for item in fast.sheet for known in item.known)
    assert all(name != "Speed" for name, _ in study_report(given).facts)


def test_a_robot_that_did_not_move_is_told_with_its_faults(given):
    faulty = changed(given, injected_faults=("Speech=slow", "PointAt=fail@1"))
    known = " ".join(text for item in faulty.sheet for text in item.known)
    assert "generic (simulated: no robot moved) in 6 sessions." in known
    assert "Faults were injected in 6 sessions: Speech=slow, PointAt=fail@1." in known
    assert "faults injected: Speech=slow; PointAt=fail@1" in "\n".join(text_lines(study_report(faulty), 300))


def test_mode_and_banner_are_those_of_the_sessions_and_not_of_study_toml(given):
    assert given.study.mode == "real"
    in_debug = replace(given, study=replace(given.study, mode="debug"))
    edited = study_report(in_debug)
    assert edited.banner.startswith("SIMULATED: the robot was simulated in 6 complete sessions.")
    assert ("Mode", "real") in edited.facts
    said = "Sessions that count ran in mode real. study.toml now says debug."
    assert Paragraph(said, "warning") in [block for section in edited.sections for block in section.blocks]
    unchanged = study_report(given)
    assert unchanged.banner == edited.banner and "study.toml now says" not in str(unchanged)
    none = study_report(replace(in_debug, figures=StudyFigures(())))
    assert none.banner.startswith("DEBUG: study.toml says") and ("Mode", "debug") in none.facts


@pytest.mark.parametrize("planned", [0, 3])
def test_planned_rows_are_explained_only_where_there_are_some(planned):
    cell = SimpleNamespace(strata={}, condition="polite", complete=1, open=0, planned=planned)
    assert bool(_cells(SimpleNamespace(cells=(cell,), wanted=4)).note) is bool(planned)
