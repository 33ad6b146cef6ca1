"""participants.csv: what is read, what is wrong, and what is no pseudonym."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.study.csv_table import mail_address_in, personal_column
from rise_engine.study.model import Participant
from rise_engine.study.participants import header_line, load_participants
from rise_engine.study.study_toml import load_study
from tests.study.designs import DESIGN, HEADER, study_folder

P01 = Participant("P01", {"language": "de"}, {"study": "2026-11-20"}, "", "left-handed", 2)
P02 = Participant("P02", {"language": "en"}, {"study": ""}, "invited", "", 3)


def read(path: Path, csv: str | bytes, toml: str = DESIGN) -> tuple[list[Participant], list[str]]:
    study_folder(path, toml)
    (path / "participants.csv").write_bytes(csv.encode() if isinstance(csv, str) else csv)
    study = load_study(path, check_scenarios=False).study
    assert study is not None
    loaded = load_participants(study)
    return list(loaded.participants), [str(each) for each in loaded.diagnostics]


ROWS = "P01,de,2026-11-20,,left-handed\nP02,en,,invited,\n"


@pytest.mark.parametrize(
    "csv",
    [
        HEADER + ROWS,
        (HEADER + ROWS).replace(",", ";"),
        (HEADER + ROWS).replace(",", "\t"),
        "\ufeff" + (HEADER + ROWS).replace(",", ";").replace("\n", "\r\n"),
        "sep=;\n" + (HEADER + ROWS).replace(",", ";"),
        (HEADER + ROWS).rstrip("\n"),
        (HEADER + ROWS).replace("left-handed", '"left-handed"'),
    ],
    ids=["commas", "semicolons", "tabs", "as Excel has it", "sep=", "no last end of line", "quotation marks"],
)
def test_every_form_of_the_file_is_read(tmp_path: Path, csv: str) -> None:
    people, told = read(tmp_path, csv)
    assert told == []
    at = 1 if csv.startswith("sep") else 0
    assert people == [replace(each, line=each.line + at) for each in (P01, P02)]


def test_columns_come_in_any_order_and_those_that_are_no_must_can_be_left_out(tmp_path: Path) -> None:
    people, told = read(tmp_path, "consent_study,participant,language\n2026-11-20,P01,de\n")
    assert told == []
    assert people == [Participant("P01", {"language": "de"}, {"study": "2026-11-20"}, "", "", 2)]


def test_further_columns_and_further_consents(tmp_path: Path) -> None:
    toml = DESIGN + '\n[participants]\ncolumns = ["age"]\n'
    people, told = read(
        tmp_path, HEADER.rstrip() + ",age,consent_video\n" + "P01,de,2026-11-20,,,33,2026-11-21\n", toml
    )
    assert told == []
    assert people[0].consent == {"study": "2026-11-20", "video": "2026-11-21"}


def test_there_may_be_nobody_yet(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER) == ([], [])


def test_no_file(tmp_path: Path) -> None:
    study = load_study(study_folder(tmp_path)).study
    assert study is not None
    (tmp_path / "participants.csv").unlink()
    (found,) = load_participants(study).diagnostics
    assert "its first line is participant,language,consent_study,status,comment" in found.message
    assert header_line(study) == HEADER.rstrip()


# What stands in the file, and the findings about it.
WRONG: dict[str, tuple[str, list[str]]] = {
    "empty": ("", ["participants.csv:1:1: error table-form: this file is empty"]),
    "a misspelt column": (
        HEADER.replace("language", "langauge") + "P01,de,2026-11-20,,\n",
        [
            "participants.csv:1:1: error missing-column: the column `language` is missing",
            "participants.csv:1:13: error unknown-column: unknown column `langauge`; did you mean `language`?",
        ],
    ),
    "a misspelt consent": (
        HEADER.replace("consent_study", "consent_studi") + "P01,de,2026-11-20,,\n",
        [
            "participants.csv:1:1: error missing-column: the column `consent_study` is missing",
            "participants.csv:1:22: error unknown-column: unknown column `consent_studi`; did you mean",
        ],
    ),
    "another column": (
        HEADER.rstrip() + ",handedness\nP01,de,,,,left\n",
        [
            "participants.csv:1:51: error unknown-column: unknown column `handedness`; write it into study.toml if it "
            "is meant: [participants] columns = [...]"
        ],
    ),
    "a column for names": (
        HEADER.rstrip() + ",Vorname\nP01,de,,,,x\n",
        ["participants.csv:1:51: error personal-data: the column `Vorname` seems to hold a name: this folder knows"],
    ),
    "a mail address in a comment": (
        HEADER + "P01,de,,,ask maria.m@uni.example first\n",
        ["participants.csv:2:10: error personal-data: `maria.m@uni.example` looks like a mail address: this folder"],
    ),
    "a name": (
        HEADER + "Maria M.,de,,,\n",
        ["participants.csv:2:1: error bad-name: a pseudonym has letters and digits only (A-Z, a-z, 0-9), as P07, not"],
    ),
    "a mail address as a name": (HEADER + "m@uni.example,de,,,\n", ["participants.csv:2:1: error personal-data:"]),
    "nobody": (HEADER + ",de,,,\n", ["participants.csv:2:1: error missing-value: this row has no participant"]),
    "somebody twice": (
        HEADER + "P01,de,,,\nP02,de,,,\np01,en,,,\n",
        ["participants.csv:4:1: error duplicate-name: `p01` is in line 2 already; upper and lower case"],
    ),
    "another stratum": (
        HEADER + "P01,ed,,,\n",
        ["participants.csv:2:5: error wrong-value: `language` is one of `de`, `en`, not `ed`"],
    ),
    "no stratum": (
        HEADER + "P01,,,,\n",
        ["participants.csv:2:5: error wrong-value: `language` is one of `de`, `en`, and must be there"],
    ),
    "a German date": (
        HEADER + "P01,de,20.11.2026,,\n",
        ["participants.csv:2:8: error wrong-value: dates are written year-month-day: `2026-11-20`, not `20.11.2026`"],
    ),
    "a day that is none": (
        HEADER + "P01,de,2026-02-30,,\n",
        ["participants.csv:2:8: error wrong-value: `2026-02-30` is not a date; write year-month-day"],
    ),
    "yes for a date": (HEADER + "P01,de,yes,,\n", ["participants.csv:2:8: error wrong-value: `yes` is not a date"]),
    "another status": (
        HEADER + "P01,de,,exclude,\n",
        ["participants.csv:2:9: error wrong-value: `status` is `invited`, `excluded` or empty"],
    ),
    "a value too many": (
        HEADER + "P01,de,,,a,b\n",
        ["participants.csv:2:12: error table-form: this row has a value more"],
    ),
    "a value too few": (HEADER + "P01,de\n", ["participants.csv:2:7: error table-form: this row has 2 values"]),
    "a quotation mark": (HEADER + 'P01,de,,,"a\n', ["participants.csv:2:10: error table-form: this quotation mark is"]),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_told(tmp_path: Path, case: str) -> None:
    csv, expected = WRONG[case]
    _, told = read(tmp_path, csv)
    assert len(told) == len(expected), told
    for line, part in zip(told, expected, strict=True):
        assert line.startswith(part)


def test_everything_is_told_at_once(tmp_path: Path) -> None:
    rows = "Maria M,xx,yesterday,out,\nP02,de\nP03,de,,,a@b.example\n"
    _, told = read(tmp_path, HEADER + rows)
    assert [line.split(":")[1] for line in told] == ["2", "2", "2", "2", "3", "4"]


def test_an_excel_file_of_another_encoding(tmp_path: Path) -> None:
    _, told = read(tmp_path, (HEADER + "P01,de,,,Müller\n").encode("cp1252"))
    assert told[0].startswith("participants.csv:2:11: error encoding: this file is not UTF-8 (byte 0xFC); in Excel")


def test_somebody_excluded_needs_no_stratum(tmp_path: Path) -> None:
    assert read(tmp_path, HEADER + "P01,,,excluded,\n")[1] == []


PERSONAL = (
    "name Name surname first_name firstName last-name Nachname Vorname Familienname nom prénom apellido naam "
    "email E-Mail e_mail mailadresse Telefonnummer phone Phone_Number tel Handy date_of_birth birthday Geburtsdatum "
    "Geburtstag dob address Adresse Anschrift Straße PLZ zip_code Wohnort Matrikelnummer participant_name username"
)


@pytest.mark.parametrize("column", [*PERSONAL.split(), "full name", "ZIP code", "Name des Kindes"])
def test_columns_that_are_of_a_person(column: str) -> None:
    assert personal_column(column)


NOT_PERSONAL = "age handedness gender group score rt room order mobile pass cell filter native_language années"


@pytest.mark.parametrize("column", NOT_PERSONAL.split())
def test_columns_that_are_not(column: str) -> None:
    assert personal_column(column) == ""


@pytest.mark.parametrize(("text", "found"), [("x@y.de", "x@y.de"), ("<x@y.de>", "x@y.de"), ("@ 5 pm", ""), ("a@b", "")])
def test_mail_addresses(text: str, found: str) -> None:
    assert mail_address_in(text) == found
