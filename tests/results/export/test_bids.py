"""BIDS: what the official validator says of our data sets, and of broken copies of them."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.kernel.records import NoteRecord
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import ActPart, Cue, Phase, PlayedAct, Point, SessionData, SessionFacts
from rise_engine.results.export.bids import write_bids
from rise_engine.results.export.bids_people import Labels
from rise_engine.results.export.bids_tables import ENTITIES, trial_columns
from rise_engine.results.export.format import ExportContext, ExportError
from rise_engine.study.model import Study
from rise_engine.study.study_toml import load_study
from tests.study.studies import DESIGN, write_study

VALIDATOR = Path(sys.executable).with_name("bids-validator-deno")
RECOMMENDED = {"HEDVersion", "CogAtlasID", "CogPOID"}
"""What a data set of behaviour needs not have, although BIDS recommends it."""
with_validator = pytest.mark.skipif(
    not VALIDATOR.exists(), reason="bids-validator-deno is not installed here: no wheel for this computer"
)
AGES = {"P01": "24", "P02": "91", "P03": ""}
SPOKEN = "one\ttwo\nthree \u2028 four"


def designed(folder: Path, report: dict[str, str] | None = None) -> Study:
    """A study with strata and further columns, and three participants."""
    design = DESIGN.replace("[consent]", '[strata]\nlanguage = ["de", "en"]\n\n[participants]\n{}\n\n[consent]', 1)
    design = design.replace("{}", 'columns = ["age", "sex"]').replace("spare =", 'strata = ["language"]\nspare =')
    people = "participant,language,consent_study,status,comment,age,sex\n"
    people += "".join(f"{name},de,2026-11-01,,a secret,{age},female\n" for name, age in AGES.items())
    write_study(folder, design, people, plan=False)
    study = load_study(folder).study
    assert study is not None
    return replace(study, report={"authors": "Doe, J.; Roe, M.", "license": "CC0-1.0"} if report is None else report)


def session(folder: Path, participant: str, run: int, level: ExportLevel = "shared", **facts: Any) -> SessionData:
    """A session in which a wizard answered a cue."""
    known: dict[str, Any] = {
        "session": f"{participant}_hesitation_real_{run}",
        "participant": participant,
        "condition": f"yes+{'quiet' if run == 1 else 'loud'}",
        "factors": {"hesitation": "yes", "noise": "quiet" if run == 1 else "loud"},
        "study": "hesitation",
        "run": run,
        "attempt": 1,
        "purpose": "counted",
        "mode": "real",
        "outcome": "complete",
        "title": "Sample",
        "scenario_hash": "0" * 64,
        "robot": "generic",
        "started": "2026-11-22T10:00:00.000+01:00" if level == "full" else "",
        "duration": 60.0,
        "ended": True,
        "versions": {"rise-tui": "0.2.0"},
    }
    part = ActPart(
        action="1",
        type="Speech",
        channels=("speech",),
        parameters={"message": SPOKEN},
        text=SPOKEN,
        accepted_at=1.6,
        ended_at=2.9,
        status="succeeded",
    )
    answer = PlayedAct(
        task=1,
        act="Greet",
        source="wizard:W1",
        by="wizard:W1",
        actor="wizard",
        status="SUCCEEDED",
        filler=False,
        cue_at=1.0,
        key_at=1.4,
        taken_at=1.41,
        accepted_at=1.41,
        started_at=1.42,
        robot_at=1.5,
        voice_at=1.6,
        ended_at=3.0,
        mark="late",
        parts=(part,),
        speaks=True,
    )
    filler = replace(answer, task=2, filler=True, mark=None, parts=())
    rejected = replace(answer, task=3, status="REJECTED", cue_at=None, started_at=None, robot_at=None, voice_at=None)
    rejected = replace(rejected, ended_at=None, mark=None, parts=())
    unended = replace(
        answer, task=4, cue_at=None, status="ACTIVE", ended_at=None, parts=(replace(part, ended_at=None),)
    )
    return SessionData(
        facts=SessionFacts(**{**known, **facts}),
        level=level,
        folder=folder,
        records=(NoteRecord(seq=1, t=0.5, wall="", text="[note, 2 words]", source="wizard:W1"),),
        acts=(answer, filler, rejected, unended),
        cues=(Cue(at=1.0, source="wizard:W1", answered_at=1.6, task=1),),
        phases=(
            Phase(rule="R", state="Start", start=0.0, end=0.0, trigger="start"),
            Phase(rule="R", state="Idle", start=0.0, end=60.0, trigger="/go"),
        ),
        points=(
            Point(at=0.5, kind="note", name="note", value="[note, 2 words]", source="wizard:W1"),
            *(Point(at=4 + number / 100, kind="event", name="/tick", source="rule:R") for number in range(1_100)),
        ),
    )


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three participants with two runs each."""
    root = tmp_path_factory.mktemp("bids")
    context = ExportContext("shared", designed(root / "study"))
    write_bids(root / "out", (session(root, name, run) for name in AGES for run in (1, 2)), context)
    assert context.warnings == []
    return root / "out"


def validate(folder: Path) -> tuple[int, set[str], list[dict[str, Any]]]:
    """The exit status, the codes of errors, and all findings, of every row."""
    command = [str(VALIDATOR), "--format", "json", "--max-rows", "-1", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    findings: list[dict[str, Any]] = json.loads(done.stdout)["issues"]["issues"]
    return done.returncode, {each["code"] for each in findings if each["severity"] == "error"}, findings


def lines(path: Path) -> list[list[str]]:
    return [line.split("\t") for line in path.read_text("utf-8").splitlines()]


def table(path: Path) -> list[dict[str, str]]:
    head, *rows = lines(path)
    return [dict(zip(head, row, strict=True)) for row in rows]


def column(rows: list[dict[str, str]], name: str, kind: str) -> list[str]:
    return [row[name] for row in rows if row["trial_type"] == kind]


# --- what the validator says ----------------------------------------------------------------------------------------


@with_validator
@pytest.mark.slow
def test_the_validator_finds_no_error_and_only_what_is_recommended(dataset: Path) -> None:
    status, errors, findings = validate(dataset)
    assert (status, errors) == (0, set())
    assert {each.get("subCode") for each in findings} == RECOMMENDED, findings


def _without_duration(text: str) -> str:
    return "".join("\t".join(row.split("\t")[:1] + row.split("\t")[2:]) for row in text.splitlines(keepends=True))


def _late_onset(text: str) -> str:
    """In a row behind the first 1000, which the validator reads too when it is told so."""
    rows = text.splitlines()
    rows[1_090] = "\t".join(["soon", *rows[1_090].split("\t")[1:]])
    return "\n".join(rows) + "\n"


EVENTS = "sub-P02/beh/sub-P02_task-hesitation_run-1_events.tsv"
BROKEN: list[tuple[str, Callable[[str], str], str]] = [
    (EVENTS, _without_duration, "TSV_COLUMN_MISSING"),
    (EVENTS.replace("run-1", "run-2"), _late_onset, "TSV_VALUE_INCORRECT_TYPE"),
    ("participants.tsv", lambda text: text + text.splitlines()[1] + "\n", "TSV_INDEX_VALUE_NOT_UNIQUE"),
]
"""A file, how it is changed, and the error that it is."""


@with_validator
@pytest.mark.slow
def test_the_validator_refuses_a_broken_copy(dataset: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(dataset, tmp_path / "copy"))
    for name, change, _ in BROKEN:
        (copy / name).write_text(change((copy / name).read_text("utf-8")), "utf-8")
    status, _, found = validate(copy)
    errors = {(each["code"], each.get("location", "")) for each in found if each["severity"] == "error"}
    assert status == 16 and {(error, f"/{name}") for name, _, error in BROKEN} <= errors, errors


# --- what is in it --------------------------------------------------------------------------------------------------


def test_events_are_sorted_and_say_what_happened(dataset: Path) -> None:
    rows = table(dataset / EVENTS)
    onsets = [float(row["onset"]) for row in rows]
    assert onsets == sorted(onsets)
    assert {row["condition"] for row in rows} == {"yes+quiet"}
    # the answer, its filler, the rejected one at the moment of its task, the one that never ended
    assert column(rows, "onset", "robot_act") == ["1.41", "1.5", "1.5", "1.5"]
    assert column(rows, "duration", "robot_act") == ["0", "1.5", "1.5", "n/a"]
    assert column(rows, "response_time", "robot_act") == ["n/a", "0.6", "n/a", "n/a"]
    assert column(rows, "status", "robot_act") == ["REJECTED", "SUCCEEDED", "SUCCEEDED filler", "ACTIVE"]
    assert column(rows, "value", "robot_action") == ["one two three four"] * 2
    assert column(rows, "duration", "cue") == ["0.6"]
    assert column(rows, "duration", "rule_state") == ["0", "60"]
    described = json.loads((dataset / "task-hesitation_events.json").read_text("utf-8"))
    assert set(rows[0]) <= set(described)
    assert {row["trial_type"] for row in rows} <= set(described["trial_type"]["Levels"])


def test_what_the_report_of_mne_bids_reads_is_there(dataset: Path) -> None:
    (beh,) = dataset.glob("task-*_beh.json")
    assert {"SamplingFrequency", "PowerLineFrequency"} <= json.loads(beh.read_text()).keys()
    assert isinstance(json.loads((dataset / "dataset_description.json").read_text())["Authors"], list)


def test_acts_have_the_parts_of_their_latency(dataset: Path) -> None:
    rows = table(dataset / EVENTS.replace("_events", "_beh"))
    assert [row["task_id"] for row in rows] == ["1", "2", "3", "4"]
    answer = rows[0]
    parts = [float(answer[f"{name}_s"]) for name in ("wizard", "way", "rules", "queue", "robot", "voice")]
    assert sum(parts) == pytest.approx(float(answer["response_time"]))
    assert (answer["mark"], answer["filler"], rows[1]["filler"]) == ("late", "false", "true")
    assert rows[1]["response_time"] == "n/a"


def test_participants_and_sessions(dataset: Path) -> None:
    people = table(dataset / "participants.tsv")
    assert [(each["participant_id"], each["age"], each["group"], each["language"]) for each in people] == [
        ("sub-P01", "24", "yes", "de"),
        ("sub-P02", "89", "yes", "de"),  # 91: nobody is known by an age
        ("sub-P03", "n/a", "yes", "de"),
    ]
    sessions = table(dataset / "sub-P01" / "sub-P01_scans.tsv")
    assert [(each["factor_noise"], each["rise_run"], each["outcome"]) for each in sessions] == [
        ("quiet", "1", "complete"),
        ("loud", "2", "complete"),
    ]
    assert all((dataset / "sub-P01" / each["filename"]).is_file() for each in sessions)
    assert "acq_time" not in sessions[0]
    described = json.loads((dataset / "sub-P01" / "sub-P01_scans.json").read_text("utf-8"))
    assert described["factor_noise"]["Levels"] == {"quiet": "noise = 0", "loud": "noise = 3"}
    text = "".join(path.read_text("utf-8") for path in dataset.rglob("*") if path.is_file())
    assert "a secret" not in text
    assert "consent" not in text


def test_a_trial_names_the_task_that_asked(dataset: Path) -> None:
    for path in dataset.rglob("*_events.tsv"):
        found = table(path)
        acts = {each["task_id"] for each in found if each["trial_type"] == "act"}
        asked = {each["asked_task"] for each in found if each["trial_type"] == "trial"}
        assert asked <= acts | {"n/a"} and (asked - {"n/a"} or not asked)


def test_no_column_is_called_as_an_entity(dataset: Path) -> None:
    """pybids takes what a sidecar says of `session` for the entity, and cannot count it."""
    for path in dataset.rglob("*.json"):
        assert not ENTITIES & set(json.loads(path.read_text("utf-8"))), path
    assert {"trial_task", "step"} <= set(trial_columns(["task", "step"])) and "task" not in trial_columns(["task"])


def test_the_stimuli_have_no_code_that_is_no_address(dataset: Path) -> None:
    described = json.loads((dataset / "task-hesitation_events.json").read_text("utf-8"))
    assert "Code" not in described["StimulusPresentation"]


def test_everything_is_private_to_its_owner(dataset: Path) -> None:
    for path in (dataset, *dataset.rglob("*")):
        assert path.stat().st_mode & 0o077 == 0, path


@pytest.mark.parametrize("level", ["shared", "public"])
def test_the_sources_are_records_of_the_level(dataset: Path, tmp_path: Path, level: ExportLevel) -> None:
    data = session(tmp_path, "P01", 1, level)
    (tmp_path / "session.toml").write_text("never to be read", "utf-8")
    (tmp_path / "journal.jsonl").write_text("never to be read", "utf-8")
    write_bids(tmp_path / "out", [data], ExportContext(level))
    sources = [path for path in (tmp_path / "out" / "sourcedata").rglob("*") if path.is_file()]
    assert [path.name for path in sources] == ["sub-P01_task-hesitation_run-1_records.jsonl"]
    (line,) = sources[0].read_text("utf-8").splitlines()
    assert json.loads(line)["text"] == "[note, 2 words]"


def test_at_level_full_the_session_itself_is_the_source_and_its_begin_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "2026-11-22_100000_P01_hesitation_real"
    (folder / "scenario" / "acts").mkdir(parents=True)
    for name in ("session.toml", "journal.jsonl", "media.json", "scenario/acts/a.xml", "clock", "journal.torn-1"):
        (folder / name).write_text(name, "utf-8")
    data = session(folder, "P01", 1, "full", session=folder.name)
    context = ExportContext("full", designed(tmp_path / "study", report={}))
    write_bids(tmp_path / "out", [data], context)
    source = tmp_path / "out" / "sourcedata" / "rise" / "sub-P01" / folder.name
    copied = {str(path.relative_to(source)) for path in source.rglob("*") if path.is_file()}
    assert copied == {"session.toml", "journal.jsonl", "media.json", "scenario/acts/a.xml"}
    (row,) = table(tmp_path / "out" / "sub-P01" / "sub-P01_scans.tsv")
    assert row["acq_time"] == "2026-11-22T10:00:00.000"
    assert "authors and license" in context.warnings[0]


@with_validator
@pytest.mark.slow
def test_names_that_bids_does_not_have(tmp_path: Path) -> None:
    """Debug sessions without a study: nobody's, two that differ in a hyphen, one begun again, a column of our own."""
    people = [
        session(tmp_path, name, 0, study="", title="Lab opening!", **facts)
        for name, facts in (
            ("P-1", {}),
            ("P1", {}),
            ("", {"purpose": "debug", "mode": "debug"}),
            ("P-1", {"attempt": 2}),
            ("P-1", {"attempt": 2}),
        )
    ]
    context = ExportContext("public")
    write_bids(tmp_path / "out", people, context)
    names = {path.name for path in (tmp_path / "out").rglob("*_events.tsv")}
    assert names == {
        "sub-P1_task-Labopening_run-1_events.tsv",
        "sub-P1_task-Labopening_acq-attempt2_run-2_events.tsv",
        "sub-P1_task-Labopening_acq-attempt2_run-3_events.tsv",
        "sub-P1x2_task-Labopening_run-1_events.tsv",
        "sub-unnamed_task-Labopening_acq-debug_run-1_events.tsv",
    }
    assert any("P-1: sub-P1" in each and "nobody: sub-unnamed" in each for each in context.warnings)
    assert validate(tmp_path / "out")[:2] == (0, set())


def test_labels_differ_also_where_file_names_have_no_capitals() -> None:
    labels = Labels()
    found = [labels.label(name) for name in ("p1", "P1", "P_1", "", "…", "p1")]
    assert len({each.casefold() for each in found[:-1]}) == 5
    assert found[-1] == found[0]


def test_two_sessions_of_one_run_have_two_names(tmp_path: Path) -> None:
    write_bids(tmp_path / "out", [session(tmp_path, "P01", 1)] * 2, ExportContext("shared"))
    assert len(list((tmp_path / "out").rglob("*_events.tsv"))) == 2


def test_columns_that_bids_defines_otherwise_get_another_name(tmp_path: Path) -> None:
    study = designed(tmp_path / "study")
    path = tmp_path / "study" / "participants.csv"
    path.write_text(path.read_text("utf-8").replace("female", "weiblich"), "utf-8")
    context = ExportContext("shared", study)
    write_bids(tmp_path / "out", [session(tmp_path, "P01", 1)], context)
    (person,) = table(tmp_path / "out" / "participants.tsv")
    assert (person["sex_as_written"], person["age"]) == ("weiblich", "24")
    assert any("sex_as_written" in each for each in context.warnings)


def test_nothing_to_export(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="no session"):
        write_bids(tmp_path / "out", [], ExportContext("shared"))
