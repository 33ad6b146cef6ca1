"""A study's folder as consoles use it: read anew when it changes, its sessions started and judged, all in sentences."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.base.errors import StudyError
from rise_engine.base.exit_status import REFUSED
from rise_engine.kernel.inputs import CheckReport, Note, SessionEnded
from rise_engine.ports.bridge import RosConnection
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server import spawn
from rise_engine.session.journal_format import encode_header, encode_input
from rise_engine.study.model import SessionEntry
from rise_tui.cli import study_folder
from rise_tui.cli.command_line import CommandLine
from rise_tui.cli.start import find_study_session, is_study
from rise_tui.cli.study_folder import StudyFolder, open_study
from rise_tui.config.launch import SessionRequest
from tests.tui.fake import DEMO, FakeClient, demo
from tests.tui.study_files import DESIGN, PEOPLE, write_study

PASSED = (CheckReport(id="consent", result="passed"), CheckReport(id="lamp", result="passed"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "forks"
    path.mkdir()
    write_study(path)
    return path


@pytest.fixture
def source(folder: Path) -> StudyFolder:
    return StudyFolder(str(folder), RosConnection())


def entry(participant: str, folder: str, **changes: object) -> SessionEntry:
    usual = SessionEntry(participant, 1, 1, "counted", folder, "2026-11-21T14:15:03+01:00", "ended")
    return replace(usual, **changes)  # type: ignore[arg-type]


def test_a_study_is_its_folder_or_its_study_toml(folder: Path) -> None:
    assert is_study(str(folder)) and is_study(str(folder / "study.toml"))
    assert not is_study(DEMO) and not is_study("") and not is_study(str(folder / "scenario"))
    assert open_study(str(folder / "study.toml"), RosConnection()).folder == str(folder)


def test_it_is_read_with_who_is_next_and_the_checks_after(source: StudyFolder) -> None:
    loaded = source.load()
    assert loaded.problems == () and loaded.standing is not None and loaded.study is not None
    assert loaded.standing.next == "P01" and [each.check.id for each in loaded.after] == ["debrief"]
    states = {each.participant: each.state for each in loaded.standing.participants}
    assert states == {"P01": "waiting", "P02": "waiting", "P03": "no-consent", "P04": "waiting"}


def test_every_finding_is_told_at_once_with_its_place(folder: Path, source: StudyFolder) -> None:
    broken = DESIGN.replace('scenario = "scenario"', 'scenerio = "scenario"').replace("n = 4", "n = 0")
    (folder / "study.toml").write_text(broken, "utf-8")
    problems = source.load().problems
    assert len(problems) >= 2 and all(problem.startswith("study.toml:") for problem in problems)
    assert any("`scenario`" in problem for problem in problems)
    (folder / "study.toml").write_text(DESIGN, "utf-8")
    (folder / "participants.csv").write_text(PEOPLE.replace("P02,", "P 2,"), "utf-8")
    assert any(problem.startswith("participants.csv:3") for problem in source.load().problems)
    with pytest.raises(StudyError, match=r"participants\.csv:3"):
        source.plan(SessionRequest("P01"), "anna")


def test_a_change_of_any_file_is_seen(folder: Path, source: StudyFolder) -> None:
    source.load()
    before = source.fingerprint()
    assert source.fingerprint() == before
    for name in ("study.toml", "participants.csv", "plan.csv", "study.jsonl"):
        with (folder / name).open("a", encoding="utf-8") as file:
            file.write("\n")
        assert source.fingerprint() != before, name
        before = source.fingerprint()
    (folder / "sessions").mkdir()
    assert source.fingerprint() != before


def test_what_would_run_is_the_plans(folder: Path, source: StudyFolder) -> None:
    plan = source.plan(SessionRequest("P01"), "anna")
    assert (plan.slot, plan.attempt, plan.runs, plan.mode) == (1, 1, 1, "real")
    assert plan.run.condition in ("left", "right") and plan.run.memory == {"side": plan.run.condition}
    assert [each.check.id for each in plan.checks] == ["consent", "lamp"] and "g" in plan.keys
    assert (plan.recorders, plan.unrecorded) == ("", "")
    assert plan.recorded == str(folder / "sessions") and plan.title == "Demo study"
    assert plan.context.wizard == "anna" and not (folder / "sessions").exists()
    for participant, why in (("P03", "has not consented"), ("P09", "there is no participant")):
        with pytest.raises(StudyError, match=why):
            source.plan(SessionRequest(participant), "anna")


def test_what_records_a_session_is_told_before_it_begins_or_why_nothing_does(tmp_path: Path) -> None:
    people = PEOPLE.replace("consent_study,", "consent_study,consent_recording,").replace("-02,,", "-02,2026-11-02,,")
    people = people.replace("-03,,", "-03,,,").replace("P03,,,", "P03,,,,").replace("-04,,", "-04,,,")
    recording = '[recording]\nlsl = true\nsync = true\ncamera = { by = "obs" }\n'
    write_study(tmp_path, DESIGN.replace("[[check]]", f"{recording}\n[[check]]", 1), people)
    source = StudyFolder(str(tmp_path), RosConnection())
    plan = source.plan(SessionRequest("P01"), "anna")
    assert (plan.recorders, plan.unrecorded) == ("camera (obs), markers on LSL", "")
    plan = source.plan(SessionRequest("P02"), "anna")
    assert plan.recorders == "markers on LSL" and "P02 has not consented to it (consent_recording" in plan.unrecorded
    plan = source.plan(SessionRequest("P01", "debug"), "anna")
    assert not plan.recorders and plan.unrecorded.startswith("nothing is recorded: this is a session in debug mode")


def test_a_rehearsal_takes_no_slot_and_in_debug_mode_makes_no_checks(source: StudyFolder) -> None:
    plan = source.plan(SessionRequest("P01", "debug", "right"), "anna")
    assert (plan.slot, plan.mode, plan.checks, plan.run.condition) == (None, "debug", (), "right")
    pilot = source.plan(SessionRequest("P01", "pilot"), "anna")
    assert pilot.mode == "real" and len(pilot.checks) == 2


def test_a_check_is_made_and_written_down(folder: Path, source: StudyFolder) -> None:
    plan = source.plan(SessionRequest("P01"), "anna")
    outcome = asyncio.run(source.check(plan.checks[0].check, plan.context))
    assert (outcome.result, outcome.value) == ("passed", "study 2026-11-02")
    source.note_check(plan.checks[1].check, plan.context, PASSED[1])
    last = json.loads((folder / "study.jsonl").read_text("utf-8").splitlines()[-1])
    assert (last["kind"], last["id"], last["participant"], last["result"]) == ("checked", "lamp", "P01", "passed")
    (folder / "study.jsonl").write_text("{not json\n{}\n", "utf-8")
    with pytest.raises(StudyError, match="the result of the check lamp cannot be saved"):
        source.note_check(plan.checks[1].check, plan.context, PASSED[1])


class Engine:
    """Answers in the place of `start_engine`."""

    def __init__(self, answer: spawn.StartOutcome) -> None:
        self.answer = answer
        self.asked: list[SessionOptions] = []

    def __call__(self, options: SessionOptions, report: Callable[[str], object]) -> spawn.StartOutcome:
        self.asked.append(options)
        report("recovering")
        return self.answer


def test_the_engine_is_told_the_study_and_whose_session_it_is(
    folder: Path, source: StudyFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine = Engine(spawn.EngineStarted("forks-000000", str(folder)))
    monkeypatch.setattr(study_folder, "start_engine", engine)
    said: list[str] = []
    source.start(source.plan(SessionRequest("P01"), "anna"), PASSED, "anna", said.append)
    asked = engine.asked[0]
    assert (asked.study, asked.participant, asked.purpose, asked.wizard) == (str(folder), "P01", "counted", "anna")
    assert asked.checks == PASSED and asked.mode is None and asked.unfinished == "ask" and said == ["recovering"]
    source.start(source.plan(SessionRequest("P02", "debug", "left"), "anna"), (), "anna", said.append)
    asked = engine.asked[1]
    assert (asked.mode, asked.condition, asked.purpose) == ("debug", "left", "debug")
    source.recover(entry("P01", "2026_P01", status="unfinished"), "anna", said.append)
    asked = engine.asked[2]
    assert (asked.participant, asked.unfinished) == ("P01", str(folder / "sessions" / "2026_P01"))


def test_an_engine_that_refuses_is_a_sentence(source: StudyFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    refused = Engine(spawn.EngineRefused(REFUSED, ["P01 has not consented", "the check `lamp` was not made"]))
    monkeypatch.setattr(study_folder, "start_engine", refused)
    with pytest.raises(StudyError, match="P01 has not consented; the check `lamp` was not made"):
        source.start(source.plan(SessionRequest("P01"), "anna"), (), "anna", lambda sentence: None)


def test_what_cannot_be_attached_to_or_judged_is_a_sentence(source: StudyFolder) -> None:
    with pytest.raises(StudyError, match="is just beginning or ending"):
        source.attach(entry("P01", "2026_P01", status="running"), "anna")
    with pytest.raises(StudyError, match="P01 has no session 2026_P01"):
        source.judge(entry("P01", "2026_P01"), "complete", "", "anna")


def test_how_far_a_session_came_that_nobody_has_judged_is_in_its_journal(tmp_path: Path) -> None:
    journal = tmp_path / "journal.jsonl"
    assert study_folder._last_time(journal) == 0.0
    journal.write_bytes(encode_header("rise-tui 1"))
    assert study_folder._last_time(journal) == 0.0
    note, ended = Note(text="x" * 300_000, t=871.5), SessionEnded(reason="done", t=872.5)
    journal.write_bytes(encode_header("rise-tui 1") + encode_input(1, note) + encode_input(2, ended))
    assert study_folder._last_time(journal) == 872.5
    with journal.open("ab") as file:
        file.write(b'{"n":3,"inp')  # a torn line says nothing
    assert study_folder._last_time(journal) == 872.5


def test_a_session_that_is_of_no_study_has_none() -> None:
    client = FakeClient(demo())
    assert study_folder.find_study(client.attach_reply(), RosConnection()) is None


def test_no_session_of_it_runs(folder: Path) -> None:
    assert find_study_session(str(folder)) == ""


def test_what_a_study_says_itself_is_not_said_on_the_command_line() -> None:
    given = CommandLine(folder="x", robot="nao", mode="real", condition="calm", sets=("a=1",), recover=True)
    assert given.only_for_scenarios == ["--robot", "--mode", "--condition", "--set", "--recover"]
    assert CommandLine(folder="x", participant="P07", wizard="anna").only_for_scenarios == []
