"""`[questionnaire.NAME]` of study.toml, and the file that a survey tool gave."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.study.model import Study
from rise_engine.study.participants import load_participants
from rise_engine.study.questionnaires import Questionnaire, find_missing, load_questionnaire
from rise_engine.study.review import review_study
from rise_engine.study.study_toml import load_study
from tests.study.designs import DESIGN, HEADER, study_folder

PEOPLE = HEADER + "P01,de,2026-11-20,,\nP02,en,2026-11-20,,\nP03,en,2026-11-20,,\n"
TABLE = '\n[questionnaire.godspeed]\nfile = "questionnaires/godspeed.csv"\n'
FILE = "questionnaires/godspeed.csv"


def read(path: Path, data: str | bytes, toml: str = TABLE) -> tuple[Questionnaire, list[str]]:
    study_folder(path, DESIGN + toml, PEOPLE)
    (path / "questionnaires").mkdir()
    (path / FILE).write_bytes(data.encode() if isinstance(data, str) else data)
    study = load_study(path, check_scenarios=False).study
    assert study is not None, load_study(path, check_scenarios=False).diagnostics
    found = load_questionnaire(study, study.questionnaires[0], load_participants(study).participants, runs=2)
    return found, [str(each) for each in found.diagnostics]


ROWS = "participant,q1,mood\nP01,3,calm\nP02,4.5,\n"


@pytest.mark.parametrize(
    "data",
    [
        ROWS,
        ROWS.replace(",", ";"),
        ROWS.replace(",", "\t"),
        "\ufeff" + ROWS.replace(",", ";").replace("\n", "\r\n"),
        "participant,q1,mood\nHow are you?,How friendly?,Your mood?\n"
        '"{""ImportId"":""QID1""}","{""ImportId"":""QID2""}","{""ImportId"":""QID3""}"\nP01,3,calm\nP02,4.5,\n',
    ],
    ids=["REDCap", "SoSci Survey", "tabs", "LimeSurvey for Excel", "Qualtrics, three heading lines"],
)
def test_every_survey_tool_is_read(tmp_path: Path, data: str) -> None:
    found, told = read(tmp_path, data)
    assert told == []
    assert [(each.participant, each.run, each.values) for each in found.rows] == [
        ("P01", None, {"q1": "3", "mood": "calm"}),
        ("P02", None, {"q1": "4.5", "mood": ""}),
    ]
    about = "How friendly?" if "ImportId" in data else ""
    assert [(each.name, each.type, each.about) for each in found.items] == [
        ("q1", "number", about),
        ("mood", "string", "Your mood?" if about else ""),
    ]


def test_descriptions_levels_runs_and_what_is_left_out(tmp_path: Path) -> None:
    toml = TABLE + (
        'key = "code"\nrun = "visit"\nleave_out = ["seconds"]\ncolumns.q1 = "Unfriendly to friendly"\n'
        'columns.q2 = { about = "Alone?", levels = { 1 = "yes", 2 = "no" } }\n'
    )
    found, told = read(tmp_path, "seconds,code,visit,q1,q2\n7,P01,1,3,1\n9,P01,2,4,\n", toml)
    assert told == []
    assert [(each.name, each.about, each.levels, each.type) for each in found.items] == [
        ("q1", "Unfriendly to friendly", {}, "integer"),
        ("q2", "Alone?", {"1": "yes", "2": "no"}, "integer"),
    ]
    assert [(each.participant, each.run, each.line) for each in found.rows] == [("P01", 1, 2), ("P01", 2, 3)]


# What stands in the file, and the findings about it.
@pytest.mark.parametrize(
    ("data", "toml", "place", "told"),
    [
        ("participant,q1\np01,3\n", "", "2:1", "participants.csv has no `p01`"),
        ("participant,q1\n,3\n", "", "2:1", "this row names no participant"),
        ("participant,q1\nP01,3\nP02,1\nP01,4\n", "", "4:1", "`P01` is in line 2 already"),
        ("subject,q1\nP01,3\n", "", "1:1", "there is no column `participant`"),
        ("participant,q1\nP01,3\n", 'run = "visit"\n', "1:1", "there is no column `visit`, which"),
        ("participant,visit\nP01,3\n", 'run = "visit"\n', "2:5", "`visit` says which run it was"),
        ("participant,Nachname\nP01,x\n", "", "1:13", "the column `Nachname` seems to hold a name"),
        ("participant,q1\nP01,a.b@c.example\n", "", "2:5", "`a.b@c.example` looks like a mail address"),
        ("participant,condition\nP01,x\n", "", "1:13", "tables have a column `condition`"),
        ("participant,q1\nP01,5\n", 'columns.q1.levels = { 1 = "a" }\n', "2:5", "`q1` is one of `1`"),
        ("participant,q1\nP01,5\n", 'columns.q2 = "x"\n', "1:1", "there is no column `q2`"),
        (b"participant,q1\nP01,\xfc\n", "", "2:5", "this file is not UTF-8"),
        ("participant,q1\nP01\n", "", "2:4", "this row has 1 values"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(
    tmp_path: Path, data: str | bytes, toml: str, place: str, told: str
) -> None:
    _, said = read(tmp_path, data, TABLE + toml)
    assert len(said) == 1 and said[0].startswith(f"{FILE}:{place}: ") and told in said[0], said


# What stands in the file, and the places of all findings about it.
@pytest.mark.parametrize(
    ("data", "toml", "told"),
    [
        (
            "participant,condition,q1\np01,x,9\nP01,x,a.b@c.example\nP02\n",
            'columns.q1.levels = { 1 = "a" }\n',
            ["1:13 `condition`", "2:1 `p01`", "3:7 mail address", "3:7 `q1` is one of", "4:4 this row has 1 values"],
        ),
        (
            "subject,q1\nP01,9\nP02,a.b@c.example\n",
            'columns.q1.levels = { 1 = "a" }\n',
            ["1:1 `participant`", "2:5 `q1` is one of", "3:5 mail address", "3:5 `q1` is one of"],
        ),
        ("participant,q1\nP9,3\nP01,3\nP01,4\n", 'run = "visit"\n', ["1:1 `visit`", "2:1 `P9`"]),
        ("participant,q1,q1\nP01,1\n", "", ["1:16 column 2 is called `q1`", "2:6 this row has 2 values"]),
    ],
    ids=["a bad name of a column", "no key", "no run", "a name twice"],
)
def test_a_wrong_header_does_not_hide_what_is_wrong_in_rows(
    tmp_path: Path, data: str, toml: str, told: list[str]
) -> None:
    found, said = read(tmp_path, data, TABLE + toml)
    assert found.rows == found.items == ()
    assert len(said) == len(told), said
    for sentence, expected in zip(said, told, strict=True):
        place, _, words = expected.partition(" ")
        assert sentence.startswith(f"{FILE}:{place}: ") and words in sentence


# What study.toml says, and the findings about it.
@pytest.mark.parametrize(
    ("toml", "told"),
    [
        ("[questionnaire.a]\n", "`file` is missing"),
        ('[questionnaire.a-b]\nfile = "a.csv"\n', "a questionnaire has a name of letters"),
        ('[questionnaire.a]\nfile = "../a.csv"\n', "leads out of the study's folder"),
        ('[questionnaire.a]\nfile = "/tmp/a.csv"\n', "leads out of the study's folder"),
        ('[questionnaire.a]\nfile = "a.xlsx"\n', "it has to end in .csv, .tsv or .txt"),
        ('[questionnaire.a]\nfile = ".a/b.csv"\n', "begins with a dot"),
        ('[questionnaire.a]\nfile = "a.csv"\nkye = "x"\n', "did you mean `key`?"),
        ('[questionnaire]\na = "a.csv"\n', "a questionnaire is a table"),
        ('[questionnaire.a]\nfile = "a.csv"\ncolumns.q = 3\n', "`q` is a text, or a table"),
        ('[questionnaire.a]\nfile = "a.csv"\ncolumns.q.levels = { 1 = 2 }\n', "`1` is a text"),
        ('[questionaire.a]\nfile = "a.csv"\n', "did you mean `questionnaire`?"),
    ],
)
def test_what_study_toml_says_wrong(tmp_path: Path, toml: str, told: str) -> None:
    study_folder(tmp_path, DESIGN + toml, PEOPLE)
    errors = load_study(tmp_path, check_scenarios=False).errors
    assert len(errors) == 1 and told in errors[0].message, errors


def test_a_link_out_of_the_study_is_refused(tmp_path: Path) -> None:
    study_folder(tmp_path / "study", DESIGN + TABLE, PEOPLE)
    (tmp_path / "godspeed.csv").write_text(ROWS)
    (tmp_path / "study" / "questionnaires").mkdir()
    (tmp_path / "study" / FILE).symlink_to(tmp_path / "godspeed.csv")
    (error,) = load_study(tmp_path / "study", check_scenarios=False).errors
    assert error.code == "outside-study"


def test_no_file_yet_is_a_warning(tmp_path: Path) -> None:
    study_folder(tmp_path, DESIGN + TABLE, PEOPLE)
    (found,) = [each for each in review_study(tmp_path).diagnostics if each.code == "no-questionnaire"]
    assert found.severity == "warning" and found.location.file == FILE


def test_the_check_of_a_study_tells_of_the_file(tmp_path: Path) -> None:
    read(tmp_path, "participant,q1\nP9,3\n")
    assert "unknown-participant" in [each.code for each in review_study(tmp_path).errors]


def test_who_has_withdrawn_is_to_be_taken_out_by_people(tmp_path: Path) -> None:
    found, _ = read(tmp_path, "participant,q1\nP09,3\nP01,1\n")
    study: Study = load_study(tmp_path, check_scenarios=False).study  # type: ignore[assignment]
    people = load_participants(study).participants
    found = load_questionnaire(study, found.settings, people, has_withdrawn=lambda name: name == "P09")
    assert "`P09` has withdrawn: delete this row yourself" in found.errors[0].message
    assert [each.participant for each in found.rows] == ["P01"]


def test_who_took_part_and_is_not_in_it_is_told_by_their_line(tmp_path: Path) -> None:
    found, _ = read(tmp_path, "participant,visit,q1\nP01,1,3\n", TABLE + 'run = "visit"\n')
    study: Study = load_study(tmp_path, check_scenarios=False).study  # type: ignore[assignment]
    told = find_missing(found, [("P01", 1), ("P01", 2), ("P03", 1)], load_participants(study).participants)
    assert [(each.location.line, each.message.partition(" (")[0]) for each in told] == [
        (2, f"`P01` has no row for run 2 in {FILE}"),
        (4, f"`P03` has no row for run 1 in {FILE}"),
    ]


def test_a_row_of_somebody_who_took_no_part_is_told_by_its_line(tmp_path: Path) -> None:
    """Such as the former participant's of a session that was reassigned: no export has it."""
    found, _ = read(tmp_path, "participant,visit,q1\nP01,1,3\nP02,1,4\nP01,2,5\n", TABLE + 'run = "visit"\n')
    study: Study = load_study(tmp_path, check_scenarios=False).study  # type: ignore[assignment]
    told = find_missing(found, [("P01", 1)], load_participants(study).participants)
    assert [(each.code, each.location.file, each.location.line, each.message) for each in told] == [
        ("no-session", FILE, 3, "`P02`, run 1, has no session that counts, so no export has this row"),
        ("no-session", FILE, 4, "`P01`, run 2, has no session that counts, so no export has this row"),
    ]


def test_the_plan_does_not_depend_on_questionnaires(tmp_path: Path) -> None:
    with_one = load_study(study_folder(tmp_path / "a", DESIGN + TABLE), check_scenarios=False).study
    without = load_study(study_folder(tmp_path / "b", DESIGN), check_scenarios=False).study
    assert with_one is not None and without is not None and with_one.design_hash == without.design_hash
