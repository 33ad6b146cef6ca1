"""`rise-engine export --level`: what is told to others, and what never is."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import inspect

from rise_engine.base.errors import SessionError
from rise_engine.kernel.inputs import CheckReport, Note, OutcomeReport, RecordingReport, SessionEnded, Submit
from rise_engine.kernel.records import AnyRecord, MemoryRecord, NoteRecord, TaskRecord
from rise_engine.privacy.levels import ExportLevel, _without_free_speech, without_dates_and_places
from rise_engine.privacy.private_values import NAMES_FIELDS, PrivateValues
from rise_engine.results.analysis.session_records import SessionRecords
from rise_engine.results.export.records import write_records
from rise_engine.scenario.loader import load
from tests.chance import examples
from tests.commands import typed
from tests.kernel.harness import Session
from tests.session.journals import TOML, Made, Recording

from .test_redaction import finish

PRIVATE = TOML + 'private = ["name"]\n'


def submit(session: Session, function: str, behavior: str, source: str = "wizard:anna") -> None:
    session.do(Submit(function=function, behavior=behavior, source=source))


def exported(made: Made, level: ExportLevel, **more: Any) -> list[dict[str, Any]]:
    out = io.BytesIO()
    write_records(SessionRecords(made.folder, level=level, **more), "jsonl", out)
    return [json.loads(line) for line in out.getvalue().splitlines()]


def text_of(made: Made, level: ExportLevel) -> str:
    """Everything that an export has, in both formats, also what JSON escapes."""
    text = json.dumps(exported(made, level), ensure_ascii=False)
    out = io.BytesIO()
    write_records(SessionRecords(made.folder, level=level), "csv", out)
    return text + out.getvalue().decode()


def of_kind(records: list[dict[str, Any]], kind: str, **fields: Any) -> list[dict[str, Any]]:
    return [
        each for each in records if each["kind"] == kind and all(each[name] == value for name, value in fields.items())
    ]


@pytest.fixture
def made(tmp_path: Path) -> Made:
    made = Made(tmp_path, toml=PRIVATE)
    session = made.session
    finish(session)
    session.do(
        CheckReport(id="lamp", text="The lamp is on", result="skipped", reason="Zoë was late", source="wizard:anna")
    )
    session.do(CheckReport(id="disk", text="space", result="passed", value="34 GB free"))
    submit(session, "say", "Moin Zoë")
    finish(session)
    submit(session, "assignValue", 'name = "Zoë Müller"')
    submit(session, "startCommunicationRobotAct", "Greet", "wizard:bob")
    finish(session)
    submit(session, "assignValue", "greeting = name")
    submit(session, "assignValue", "name = Zoë Müller")
    submit(session, "assignValue", "name = Ulrike")
    submit(session, "markCue", "Zoë nods")
    submit(session, "no such thing", "Zoë")
    session.do(RecordingReport(name="camera", status="started", path="/home/anna/2026/p07.mkv"))
    session.do(Note(text="Zoë seems tired", source="wizard:anna"))
    session.do(Note(text="something else", source="observer:quinn"))
    session.do(OutcomeReport(status="aborted", reason="felt sick", source="wizard:anna"))
    submit(session, "stopAll", "", "wizard:bob")
    session.do(SessionEnded(reason="ended by wizard:anna"))
    made.write_session()
    return made


def test_everything_is_told_as_it_was_recorded(made: Made) -> None:
    assert "Zoë seems tired" in text_of(made, "full")


@pytest.mark.parametrize("level", ["shared", "public"])
def test_nothing_of_a_person_is_told(made: Made, level: ExportLevel) -> None:
    text = text_of(made, level)
    for word in ("zoë", "müller", "ulrike", "tired", "felt sick", "nods", "anna", "bob", "quinn", "mkv", "2026"):
        assert word not in text.casefold(), word


def test_private_keys_and_speech(made: Made) -> None:
    records = exported(made, "shared")
    assert {each["value"] for each in of_kind(records, "memory", key="name")} == {"{name}"}
    assert of_kind(records, "memory", key="greeting")[0]["value"] == "{name}"
    said = [each["parameters"]["message"] for each in of_kind(records, "action", act="Greet", action="1")]
    assert set(said) == {"Hello, {name|stranger}!"}
    assert of_kind(records, "action", act="say")[0]["parameters"] == {"message": "Moin {name}"}
    assigned = [each["behavior"] for each in of_kind(records, "task", function="assignValue", source="wizard:W2")]
    assert assigned == ["name = {name}", "greeting = name", "name = {name}", "name = {name}"]


def test_what_people_typed_is_counted(made: Made) -> None:
    records = exported(made, "shared")
    notes = [(each["source"], each["text"]) for each in of_kind(records, "note")]
    assert ("wizard:W2", "[note, 3 words]") in notes and ("observer:O1", "[note, 2 words]") in notes
    assert any(source == "engine" and "is not a memory key" in text for source, text in notes)
    assert of_kind(records, "cue")[0]["text"] == "[free text, 2 words]"
    assert [(each["reason"], each["value"]) for each in of_kind(records, "check")] == [
        ("[free text, 3 words]", ""),
        ("", "34 GB free"),
    ]
    assert of_kind(records, "outcome")[0]["reason"] == "[free text, 2 words]"
    assert of_kind(records, "recording")[0]["path"] == ""


def test_free_speech_is_not_public(made: Made) -> None:
    records = exported(made, "public")
    assert of_kind(records, "action", act="say")[0]["parameters"] == {"message": "[free speech, 2 words]"}
    assert {each["behavior"] for each in of_kind(records, "task", function="say")} == {"[free speech, 2 words]"}
    assert of_kind(records, "task", function="no such thing")[0]["behavior"] == "[free text, 1 word]"
    assert of_kind(records, "action", act="Greet", action="3")[0]["parameters"] == {"message": "How are you?"}


def test_the_language_of_free_speech_is_public() -> None:
    said = {"kind": "action", "act": "say", "parameters": {"message": "Moin Zo\u00eb", "language": "de"}}
    told = _without_free_speech(said)
    assert told["parameters"] == {"message": "[free speech, 2 words]", "language": "de"}


def test_no_time_of_day(made: Made) -> None:
    records = exported(made, "shared")
    assert {each["wall"] for each in records} == {""}
    assert [each["t"] for each in records] == [each.t for each in made.records]
    export = SessionRecords(made.folder, level="shared")
    assert export.name == "sample-study_debug" and made.folder.name.endswith(f"_{export.name}")


def test_wizards_have_numbers_or_what_the_study_calls_them(made: Made) -> None:
    records = exported(made, "shared")
    sources = {each["source"] for each in records if "source" in each}
    assert {"wizard:W1", "wizard:W2", "wizard:W3", "observer:O1"} <= sources
    assert records[-1]["reason"] == "ended by wizard:W2"
    given = exported(made, "shared", wizards={"anna": "W7", "bob": "W1"})
    assert given[-1]["reason"] == "ended by wizard:W7"
    assert of_kind(given, "stop", status="requested")[0]["source"] == "wizard:W1"


def test_further_private_keys(made: Made) -> None:
    records = exported(made, "shared", private=["greeting"])
    assert of_kind(records, "memory", key="greeting")[0]["value"] == "{greeting}"


def test_without_the_scenario_nobody_knows_what_is_private(made: Made) -> None:
    shutil.rmtree(made.folder / "scenario")
    shutil.rmtree(made.study)
    SessionRecords(made.folder)
    with pytest.raises(SessionError, match="it is not known which memory keys are private"):
        SessionRecords(made.folder, level="shared")


def test_the_command(made: Made, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    result = typed("export", made.folder, "--format", "csv", "--level", "shared", "-o", out)
    assert result.exit_code == 0, result.output
    assert out.stat().st_mode & 0o777 == 0o600
    rows = list(csv.DictReader(io.StringIO(out.read_text("utf-8"), newline="")))
    assert {row["session"] for row in rows} == {"sample-study_debug"} and len(rows) == len(made.records)
    assert "Zoë" not in out.read_text("utf-8")
    assert typed("export", made.folder, "--format", "csv", "--level", "secret").exit_code == 2


# --- nothing of a private value, whatever it is and wherever it is said ---

NAMES = st.sampled_from(["Zoë", "Xanthippe", "Jean-Luc", "O'Quay", "Žižek", "李雷", "Weiß", "Q😀Q", "ÄÖÜ"])
VALUES = st.one_of(
    NAMES,
    st.tuples(NAMES, NAMES).map(" ".join),
    st.lists(NAMES, min_size=1, max_size=2),
    st.dictionaries(NAMES, NAMES, min_size=1, max_size=2),
    st.integers(100_000, 999_999),
)
WAYS = st.sampled_from(
    ["say", "assign", "bare", "broken", "note", "cue", "other", "greet", "event", "unknown", "robot"]
)


def tell(session: Recording, way: str, value: Any) -> None:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    match way:
        case "say":
            submit(session, "say", f"Oh, {text}s, {text.upper()}!")
        case "assign":
            submit(session, "assignValue", f"name = {json.dumps(value)}")
        case "bare":
            submit(session, "assignValue", f"name = {text}")
        case "broken":
            submit(session, "assignValue", f"name = = {text} ++")
        case "note":
            session.do(Note(text=f"that is {text}", source="wizard:w"))
        case "cue":
            submit(session, "markCue", text)
        case "other":
            submit(session, "assignValue", "copy = name")
        case "greet":
            submit(session, "startCommunicationRobotAct", "Greet")
        case "event":
            submit(session, "raiseEventTopic", f"/{text}")
        case "unknown":
            submit(session, "startCommunicationRobotAct", text)
        case "robot":
            goal = next(iter(session.goals), "none/1")
            session.report(goal, "failed", f"I cannot say {text}")
    session.wait(0.25)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield tmp_path_factory.mktemp("random")


def leaves(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for each in value.values():
            yield from leaves(each)
    elif isinstance(value, list):
        for each in value:
            yield from leaves(each)
    else:
        yield str(value)


@pytest.mark.slow
@settings(max_examples=examples(40))
@given(VALUES, st.lists(WAYS, max_size=8))
def test_nothing_of_a_private_value(root: Path, value: Any, ways: list[str]) -> None:
    for path in root.iterdir():
        shutil.rmtree(path)
    made = Made(root, toml=PRIVATE)
    for way in [*ways, "assign"]:
        tell(made.session, way, value)
    made.session.do(SessionEnded())
    made.write_session()
    assert any(isinstance(each, MemoryRecord) and each.key == "name" and each.value == value for each in made.records)
    for level in ("shared", "public"):
        text = text_of(made, level).casefold()
        for leaf in leaves(value):
            for each in {leaf, *leaf.split()}:
                assert each.casefold() not in text, (level, each)


def test_as_it_comes_a_value_is_hidden_from_then_on(tmp_path: Path) -> None:
    made = Made(tmp_path, toml=PRIVATE)
    scenario = load(made.study).scenario
    assert scenario is not None
    private = PrivateValues(scenario)
    note = NoteRecord(1, 0.0, "", "`Zoë` is not a memory key and was taken as a text", "engine")
    assert private.hide(note).text == "`…` is not a memory key and was taken as a text"
    task = TaskRecord(2, 0.0, "", 1, "say", "Hi Zoë", "", "wizard:w", "ACTIVE")
    assert private.hide(task) is task
    memory = MemoryRecord(3, 0.0, "", "name", "Zoë", None, "wizard:w")
    assert private.hide(memory) == MemoryRecord(3, 0.0, "", "name", "{name}", None, "wizard:w")
    assert private.hide(task).behavior == "Hi {name}"
    assert private.read("name", "Zoë") == "{name}" and private.read("count", 3) == 3
    made_of_it = MemoryRecord(4, 0.0, "", "Zoë_laughs", True, None, "wizard:w", created=True)
    assert private.hide(made_of_it).key == "{name}_laughs"


def test_without_private_keys_records_stay_the_same(tmp_path: Path) -> None:
    made = Made(tmp_path)
    private = PrivateValues(made.scenario)
    assert all(private.hide(each) is each for each in made.records)


def test_no_field_of_few_words_can_become_another_one() -> None:
    """Whoever hides a value must not make a record that is none: a field with certain words only is no text."""
    for record in get_args(AnyRecord):
        for field in inspect.type_info(record).fields:  # type: ignore[attr-defined]
            kinds = getattr(field.type, "types", (field.type,))
            if any(isinstance(each, inspect.LiteralType) for each in kinds):
                assert field.encode_name in NAMES_FIELDS, (record, field.name)


@pytest.mark.parametrize("value", ["passed", "started", "submit", "wizard", "Speech", 12345.5, 123456])
def test_a_private_value_that_is_a_word_of_the_record_breaks_nothing(tmp_path: Path, value: Any) -> None:
    made = Made(tmp_path, toml=PRIVATE)
    made.session.do(CheckReport(id="a", text="b", result="passed"))
    made.session.do(RecordingReport(name="camera", status="started", bytes=123456))
    submit(made.session, "assignValue", f"name = {json.dumps(value)}")
    made.session.t = 12345.5
    finish(made.session)
    submit(made.session, "startCommunicationRobotAct", "Greet")
    finish(made.session)
    private = PrivateValues(made.scenario)
    for record in made.records:
        private.note(record)
    for record in made.records:
        assert type(private.hide(record)) is type(record)


@pytest.mark.parametrize(
    ("sentence", "told"),
    [
        ("`scenario` is as it was on 2026-11-22", "`scenario` is as it was on [date]"),
        (
            "2026-11-22 20:52 UTC, whether a time server sets it is not known",
            "[date], whether a time server sets it is not known",
        ),
        ("since 2026-11-22T20:52:01.250+01:00 at least", "since [date] at least"),
        ("in 2026-11-22_205206_P03_lab_real", "in [date]_P03_lab_real"),
        (
            "ffmpeg ended with exit status 1: file:/home/mueller/v/P01.mkv: Permission denied",
            "ffmpeg ended with exit status 1: [place] Permission denied",
        ),
        ("/data/videos is full; ~/videos, C:\\Users\\Mueller", "[place] is full; [place], [place]"),
        ("nothing publishes /camera/image or /tf; a/b, 1/2", "nothing publishes /camera/image or /tf; a/b, 1/2"),
        ("34.1 GB free, P03, run 2 of 2, 2026-112, 1.2.2026", "34.1 GB free, P03, run 2 of 2, 2026-112, 1.2.2026"),
    ],
)
def test_no_dates_in_what_the_program_says(sentence: str, told: str) -> None:
    assert without_dates_and_places(sentence) == told
