"""Nobody can give a session another label: its journal says what it is, and what says otherwise is refused by name."""

from __future__ import annotations

import asyncio
import csv
import json
import re
import shutil
from collections import Counter
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.checks.devices import check_last_session
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.privacy.levels import LEVELS, ExportLevel
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.bundle.making import BundleOptions, make_bundle
from rise_engine.results.export.format import ExportError
from rise_engine.run.client.replay import ReplayClient
from rise_engine.run.client.shadow import ShadowClient
from rise_engine.run.protocol.client import EngineGone
from rise_engine.session.folder import INFO, read_info
from rise_engine.session.journal_format import with_checksum
from rise_engine.session.labels import RelabelledError, label_differences
from rise_engine.study.labels import outage_differences
from rise_engine.study.proof import prove_sessions
from rise_engine.study.sessions import SESSIONS
from rise_engine.study.state import OpenStudy, read_state
from rise_engine.study.study_log import LOG_FILE, read_log
from rise_engine.study.verdict import read_verdict
from tests.commands import typed
from tests.results.analysis.samples import make_study, play_session, recovered_session, sessions_of, short


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return make_study(tmp_path / "study")


def run(*arguments: object) -> tuple[int, str]:
    result = typed(*arguments)
    return result.exit_code, result.output


def edit(file: Path, pattern: str, new: str) -> None:
    text, changed = re.subn(pattern, new, file.read_text("utf-8"), count=1, flags=re.MULTILINE)
    assert changed, f"{file.name} has no {pattern}"
    file.write_text(text, "utf-8")


IN_INFO = [
    (r'^condition = ".*"', 'condition = "never"', "condition"),
    (r'^participant = ".*"', 'participant = "P03"', "participant"),
    (r"^run = \d", "run = 7", "run"),
    (r"^attempt = \d", "attempt = 4", "attempt"),
    (r"^slot = \d", "slot = 3", "slot"),
    (r'^purpose = ".*"', 'purpose = "training"', "purpose"),
    (r'^study_hash = ".*"', 'study_hash = "00"', "study_hash"),
    (r'^mode = ".*"', 'mode = "debug"', "mode"),
    (r'^robot = ".*"', 'robot = "pepper"', "robot"),
    (r"^seed = \d+", "seed = 1", "seed"),
    (r"^speed = .*", "speed = 4.0", "speed"),
    (r"^faults = .*", 'faults = ["Speech=fail"]', "faults"),
    (r'^title = ".*"', 'title = "Coffee"', "title"),
    (r'^scenario_hash = ".*"', 'scenario_hash = "00"', "scenario_hash"),
    (r'^\[factors\]\n"hesitation" = ".*"', '[factors]\n"hesitation" = "never"', "factors"),
]
"""What of a session.toml somebody edits, and what is named then."""
IN_LOG = [
    (r'"condition":"[^"]*"', '"condition":"never"', "condition"),
    (r'"participant":"P0\d"', '"participant":"P04"', "participant"),
    (r'"run":\d', '"run":7', "run"),
    (r'"mode":"real"', '"mode":"debug"', "mode"),
    (r'"scenario_hash":"[^"]*"', '"scenario_hash":"00"', "scenario_hash"),
]
"""The same of the entry of the session in study.jsonl."""


@pytest.mark.parametrize(("pattern", "new", "label"), IN_INFO, ids=[label for _, _, label in IN_INFO])
def test_a_session_toml_that_says_something_else(study: Path, pattern: str, new: str, label: str) -> None:
    folder = sessions_of(study)[1]
    true = getattr(read_info(folder), label)
    edit(folder / INFO, pattern, new)
    with pytest.raises(RelabelledError) as refused:
        read_info(folder)
    assert f"{INFO} says {label} = " in str(refused.value)
    assert f"journal.jsonl says {label} = " in str(refused.value)
    assert getattr(read_info(folder, compare=False), label) == true
    with pytest.raises(RelabelledError, match=f"says {label} = "):
        read_session(folder)
    status, said = run("study", "check", study)
    assert status == 1
    assert f"{SESSIONS}/{folder.name}:1:1: error other-label: {INFO} says {label} = " in said


def test_a_session_toml_that_asks_for_another_language(study: Path) -> None:
    folder = sessions_of(study)[1]
    edit(folder / INFO, r'^language = ".*"', 'language = "de"')
    with pytest.raises(RelabelledError, match=r'says language = "de", but journal\.jsonl says language = "en"'):
        read_session(folder)
    edit(folder / INFO, r'^language = ".*"', 'language = "EN"')
    assert read_info(folder).language == "EN"


@pytest.mark.parametrize(("pattern", "new", "label"), IN_LOG, ids=[label for _, _, label in IN_LOG])
def test_a_log_that_says_something_else(study: Path, pattern: str, new: str, label: str) -> None:
    folder = sessions_of(study)[1]
    lines = (study / LOG_FILE).read_text("utf-8").splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if '"kind":"session"' in line and folder.name in line)
    lines[at] = re.sub(pattern, new, lines[at], count=1)
    (study / LOG_FILE).write_text("".join(lines), "utf-8")
    with pytest.raises(RelabelledError, match=rf"study.jsonl, line {at + 1}, says {label} = .*journal.jsonl says"):
        read_session(folder)
    assert f"error other-label: {LOG_FILE}, line {at + 1}, says {label} = " in run("study", "check", study)[1]


def test_a_log_that_judges_a_session_otherwise(study: Path) -> None:
    folder = next(each for each in sessions_of(study) if read_verdict(each).report and "P01" in each.name)
    edit(study / LOG_FILE, rf'(?<="kind":"outcome")(.*{folder.name}.*)"status":"complete"', r'\1"status":"aborted"')
    with pytest.raises(
        RelabelledError, match=r'study.jsonl, line \d+, says status = "aborted", but journal.jsonl says'
    ):
        read_session(folder)
    status, said = run("study", "check", "--sessions", study)
    assert status == 1 and 'says status = "aborted", but journal.jsonl says status = "complete"' in said


def test_a_corrected_outcome_has_a_reason(study: Path) -> None:
    folder = [each for each in sessions_of(study) if "P03" in each.name][-1]
    assert run("study", "outcome", study, "P03", "aborted", "--reason", "the lamp fell")[0] == 0
    assert read_session(folder).facts.outcome == "aborted"
    edit(study / LOG_FILE, '"reason":"the lamp fell"', '"reason":""')
    with pytest.raises(RelabelledError, match="corrects the outcome and gives no reason"):
        read_session(folder)


def _bundle(study: Path, folder: Path, out: Path) -> tuple[int, str]:
    try:
        make_bundle(read_state(study), sessions_of(study)[1:], out, BundleOptions())
    except ExportError as error:
        return 1, str(error)
    return 0, ""


def _media(study: Path, folder: Path, out: Path) -> tuple[int, str]:
    film = study.parent / "film.mkv"
    film.touch()
    return run("media", "add", folder, film, "--at", f"{film}=0")


def _attach(study: Path, folder: Path, out: Path) -> tuple[int, str]:
    """As a second wizard, and to look at it on a console."""
    said: list[str] = []
    for client in (ShadowClient(folder, "ben"), ReplayClient(folder)):
        with pytest.raises(EngineGone) as refused:
            asyncio.run(client.attach())
        said.append(str(refused.value))
    assert said[0] == said[1]
    return 1, said[0]


def _check_before(study: Path, folder: Path, out: Path) -> tuple[int, str]:
    found = check_last_session(study / SESSIONS)
    return int(not found.passed), found.reason


READERS: dict[str, Callable[[Path, Path, Path], tuple[int, str]]] = {
    "replay": lambda study, folder, out: run("replay", folder),
    "export": lambda study, folder, out: run("export", study, "--format", "tables", "-o", out),
    "records": lambda study, folder, out: run("export", folder, "--format", "csv"),
    "bundle": _bundle,
    "report": lambda study, folder, out: run("report", study, "-o", out),
    "list": lambda study, folder, out: run("sessions", study),
    "media": _media,
    "attach": _attach,
    "check": _check_before,
}
"""Whatever reads a session, given the study, the session's folder and a new path: its status, and what it says."""


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("file", [INFO, LOG_FILE])
def test_whatever_reads_a_session_refuses_it(study: Path, tmp_path: Path, reader: str, file: str) -> None:
    folder = sessions_of(study)[-1]
    if file == INFO:
        edit(folder / INFO, r'^condition = ".*"', 'condition = "never"')
    else:
        edit(study / LOG_FILE, rf'"condition":"[^"]*"(?=.*{folder.name})', '"condition":"never"')
    status, said = READERS[reader](study, folder, tmp_path / "out")
    assert status != 0
    assert 'says condition = "never", but journal.jsonl says condition = "' in said.replace("\\", "")
    assert not (tmp_path / "out").exists()


def test_the_study_counts_what_the_journal_says(study: Path) -> None:
    folder = sessions_of(study)[1]
    edit(folder / INFO, r'^participant = ".*"', 'participant = "P03"')
    state = read_state(study)
    assert next(each for each in state.sessions if each.name == folder.name).entry.participant == "P01"
    sentence = f"{folder.name} was given another label: rise-engine study check says which"
    assert state.standing.due[0] == sentence
    status, said = run("study", "status", study)
    assert status == 1 and sentence in said


def test_the_journal_says_when_a_session_began(study: Path) -> None:
    """So another date in session.toml neither moves a session nor keeps its data longer. This is told."""
    folder = sessions_of(study)[1]
    before = [each.entry for each in read_state(study).sessions]
    edit(folder / INFO, r'^started = ".*"', 'started = "2031-01-01T10:00:00.000+00:00"')
    assert [each.entry for each in read_state(study).sessions] == before
    assert read_info(folder, compare=False).started == before[1].started
    with pytest.raises(RelabelledError, match='says started = "2031-01-01T10'):
        read_session(folder)
    status, listed = run("sessions", study)
    (told,) = [line for line in listed.splitlines() if "2031" in line]
    assert status == 1 and told.startswith(f"{folder.name}: session.toml says started = ")


@pytest.mark.parametrize(("seconds", "differs"), [(1.5, False), (-1.5, False), (30, True), (-30, True)])
def test_the_log_and_the_journal_say_the_same_of_when_a_session_began(
    study: Path, seconds: float, differs: bool
) -> None:
    folder = sessions_of(study)[1]
    began = datetime.fromisoformat(read_info(folder).started)
    moved = (began + timedelta(seconds=seconds)).isoformat(timespec="milliseconds")
    edit(study / LOG_FILE, rf'(?<="kind":"session")(.*{folder.name}",)"started":"[^"]*"', rf'\1"started":"{moved}"')
    status, said = run("study", "check", study)
    told = rf'other-label: study.jsonl, line \d+, says started = "{re.escape(moved)}", but the first record of journal'
    assert (status, bool(re.search(told, said))) == (int(differs), differs)


def test_a_session_has_one_time_without_engine_and_the_times_of_day_around_it_say_the_same(tmp_path: Path) -> None:
    folder = recovered_session(tmp_path / "sessions", noted=27.5)
    told = {level: read_session(folder, level=level).facts.downtime for level in LEVELS}
    assert set(told.values()) == {95.0} and outage_differences(folder) == []
    lines = (folder / "journal.jsonl").read_bytes().splitlines(keepends=True)
    at = next(number for number, line in enumerate(lines) if b'"session_recovered"' in line)
    for number, line in enumerate(lines[at + 1 :], at + 1):
        later = re.sub(rb'"wall":"2024-11-23T09', b'"wall":"2024-11-23T10', line)
        lines[number] = with_checksum(later[: later.rindex(b',"crc"')] + b"}")
    (folder / "journal.jsonl").write_bytes(b"".join(lines))
    differences = ["journal.jsonl says downtime = 95.000 at 27.500 s, but its times of day say 3695.000"]
    assert outage_differences(folder) == differences
    with pytest.raises(RelabelledError, match=r"but its times of day say 3695\.000"):
        read_session(folder)


def test_the_list_of_sessions_says_what_the_tables_say(study: Path, tmp_path: Path) -> None:
    """Also of somebody who was excluded after the sessions, whose outcomes stay in the log."""
    assert run("study", "exclude", study, "P01", "could not hear")[0] == 0
    assert run("export", study, "--all", "--format", "tables", "-o", tmp_path / "tables")[0] == 0
    with (tmp_path / "tables" / "sessions.csv").open(encoding="utf-8") as file:
        exported = {each["session"]: each["outcome"] for each in csv.DictReader(file)}
    listed = json.loads(run("sessions", study, "--json")[1])
    assert {Path(each["folder"]).name: each["outcome"] for each in listed} == exported
    assert {outcome for name, outcome in exported.items() if "P01" in name} == {"excluded"}


def test_a_session_of_no_study(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions", short(), until=20.0)
    assert run("replay", folder)[0] == 0
    edit(folder / INFO, r'^participant = ".*"', 'participant = "P09"')
    status, said = run("replay", folder)
    assert status == 1
    assert said.startswith(f'error: {folder.name} was given another label: session.toml says participant = "P09", ')


def test_a_session_whose_name_for_a_person_is_no_ascii(tmp_path: Path) -> None:
    started = SessionStarted(participant="Jürgen", condition='schön "1"', factors={"n": 1.0, "on": True})
    folder = play_session(tmp_path / "sessions", short(), started=started, until=20.0)
    assert read_info(folder).participant == "Jürgen"


def test_an_older_journal_is_compared_by_what_it_says(study: Path) -> None:
    """Its first record knows nothing of studies, and nothing is made up."""
    told = {"participant": "P01", "run": 2}
    assert label_differences({"participant": "P01"}, told, INFO) == []
    assert label_differences(None, told, INFO) == []
    assert label_differences({"run": 1}, told, INFO) == [f"{INFO} says run = 2, but journal.jsonl says run = 1"]


# --- study check --sessions -------------------------------------------------------------------------------------------


def check_sessions(study: Path) -> tuple[int, list[str]]:
    status, said = run("study", "check", "--sessions", study)
    return status, said.splitlines()


def test_a_whole_study_is_proved(study: Path) -> None:
    status, lines = check_sessions(study)
    assert status == 0, lines
    assert sum(": identical (" in line for line in lines) == 8
    assert any(line.startswith("8 of 8 sessions proved: ") for line in lines)
    document = json.loads(run("study", "check", "--sessions", "--json", study)[1])
    assert [each["proved"] for each in document["sessions"]] == [True] * 8


def _other_record(study: Path, folder: Path) -> None:
    text = (folder / "journal.jsonl").read_bytes()
    lines = text.splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if b'"status":"SUCCEEDED"' in line)
    body = lines[at][: lines[at].rindex(b',"crc"')].replace(b"SUCCEEDED", b"ABORTED") + b"}"
    lines[at] = with_checksum(body)
    (folder / "journal.jsonl").write_bytes(b"".join(lines))


def _other_plan(study: Path, folder: Path) -> None:
    slot = read_info(folder).slot
    text = (study / "plan.csv").read_text("utf-8")
    row = next(line for line in text.splitlines() if line.startswith(f"{slot},"))
    swapped = re.sub(r"(\w+) (\w+),", r"\2 \1,", row)
    assert swapped != row
    (study / "plan.csv").write_text(text.replace(row, swapped), "utf-8")


def _other_name(study: Path, folder: Path) -> None:
    other = folder.with_name(folder.name.replace("_P01_", "_P03_"))
    folder.rename(other)
    log = study / LOG_FILE
    log.write_text(log.read_text("utf-8").replace(folder.name, other.name), "utf-8")


def _other_reason(study: Path, folder: Path) -> None:
    log = study / LOG_FILE
    lines = log.read_text("utf-8").splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if folder.name in line and '"kind":"outcome"' in line)
    lines[at] = lines[at].replace('"reason":""', '"reason":"all fine"')
    log.write_text("".join(lines), "utf-8")


def _unnamed(study: Path, folder: Path) -> None:
    lines = (study / LOG_FILE).read_text("utf-8").splitlines(keepends=True)
    (study / LOG_FILE).write_text("".join(each for each in lines if folder.name not in each), "utf-8")


UNPROVED: dict[str, Callable[[Path, Path], object]] = {
    "study.jsonl names this session, and its folder is not there": lambda study, folder: shutil.rmtree(folder),
    "session.toml says run = 7, but journal.jsonl says run = 1": lambda study, folder: edit(
        folder / INFO, r"^run = \d", "run = 7"
    ),
    '`status` is "ABORTED", but the replay gives "SUCCEEDED"': _other_record,
    "plan.csv gives row ": _other_plan,
    "study.jsonl does not name this session": _unnamed,
    'the folder\'s name says "P03", but journal.jsonl says participant = "P01"': _other_name,
    'says reason = "all fine", but journal.jsonl says reason = ""': _other_reason,
}
"""What is said, and what somebody did to the study and to one session's folder before."""


@pytest.mark.parametrize("told", UNPROVED)
def test_what_is_not_proved_is_named(study: Path, told: str) -> None:
    folder = sessions_of(study)[1]
    UNPROVED[told](study, folder)
    status, lines = check_sessions(study)
    assert status == 1
    about = [line for line in lines if line.startswith((f"{folder.name}: ", f"{folder.name[:17]}_P03_"))]
    assert any(told in line for line in about), lines
    assert any(re.match(r"\d of 8 sessions proved", line) for line in lines)


def test_a_session_that_ran_the_scenario_of_another_level_is_not_proved(study: Path) -> None:
    state = read_state(study)
    (planned,) = (each for each in state.log if each.kind == "planned")
    (ran,) = planned.get("scenarios").values()
    factor, *others = state.study.factors

    def proofs(*scenarios: str) -> dict[bool, int]:
        levels = tuple(replace(level, scenario=name) for level, name in zip(factor.levels, scenarios, strict=True))
        changed = replace(state.study, factors=(replace(factor, levels=levels), *others))
        log = (*state.log[1:], replace(planned, fields={**planned.fields, "scenarios": {"one": ran, "two": "00"}}))
        found = list(prove_sessions(study, replace(state, study=changed, log=log)))
        told = "the scenario two, but the session ran one, as study.jsonl says in `planned`"
        return Counter(any(told in problem for problem in each.problems) for each in found)

    assert proofs("one", "one") == {False: 8}
    assert proofs("one", "two") == {False: 5, True: 3}


def test_the_proof_names_only_the_files_that_it_compared(study: Path) -> None:
    assert "session.toml, study.jsonl and plan.csv say the same of it" in "\n".join(check_sessions(study)[1])
    (study / "plan.csv").unlink()
    assert "session.toml and study.jsonl say the same of it" in "\n".join(check_sessions(study)[1])
    edit(study / "study.toml", "^title", "titel")
    assert "session.toml says the same of it" in "\n".join(check_sessions(study)[1])


def test_a_copied_session_does_not_count(study: Path, tmp_path: Path) -> None:
    """Also where the next program that opens the study has come by before anybody looks."""
    session = sessions_of(study)[1]
    copy = shutil.copytree(session, session.with_name(f"a copy of {session.name}"))
    counted = [each.entry for each in read_state(study).sessions]
    with OpenStudy(study) as opened:
        assert [each.entry for each in opened.state.sessions] == counted
    assert not [each for each in read_log(study) if copy.name in str(each.fields)]
    assert len(counted) == 8 and copy.name not in [each.folder for each in counted]
    told = f"it is a copy of {session.name}: both journals begin with the same record."
    status, lines = check_sessions(study)
    assert status == 1 and f"{copy.name}: not proved: {told} It does not count; move it out of sessions/" in lines
    assert f"error copied-session: {told}" in run("study", "check", study)[1]
    assert f"{copy.name}: {told}" in run("study", "status", study)[1]
    assert copy.name not in run("sessions", study)[1]
    status, said = run("export", study, "--format", "tables", "-o", tmp_path / "tables")
    assert status == 0 and f"note: {copy.name} is not in the export: {told}" in said
    with (tmp_path / "tables" / "sessions.csv").open(encoding="utf-8") as file:
        assert copy.name not in [each["session"] for each in csv.DictReader(file)]


# --- lost -------------------------------------------------------------------------------------------------------------


def _a_folder_instead(journal: Path) -> None:
    journal.unlink()
    journal.mkdir()


LOST: dict[str, Callable[[Path], object]] = {
    "no journal": lambda journal: journal.unlink(),
    "an empty one": lambda journal: journal.write_bytes(b""),
    "its header": lambda journal: journal.write_bytes(journal.read_bytes().splitlines(keepends=True)[0]),
    "a folder": _a_folder_instead,
}


@pytest.mark.parametrize("left", LOST)
def test_a_session_whose_journal_is_lost_is_told_and_its_run_is_not_asked_for_again(
    study: Path, tmp_path: Path, left: str
) -> None:
    folder = next(each for each in sessions_of(study) if "P01" in each.name and read_info(each).purpose == "counted")
    LOST[left](folder / "journal.jsonl")
    told = f"{folder.name} of P01 has no readable journal"
    state = read_state(study)
    assert [each for each in state.standing.due if each.startswith(told)] and state.state_of("P01") == "complete"
    with OpenStudy(study) as opened:
        assert len(opened.state.sessions) == 8
    status, said = run("study", "check", study)
    assert status == 1 and f"sessions/{folder.name}:1:1: error lost-session: it has no readable journal" in said
    status, lines = check_sessions(study)
    assert status == 1 and any(line.startswith(f"{folder.name}: not proved: it has no readable") for line in lines)
    status, said = READERS["export"](study, folder, tmp_path / "x")
    assert status == 1 and f"warning: {folder.name} is not in the export: it has no readable journal" in said
    assert f"{folder.name} has no readable journal" in run("report", study)[1]


@pytest.mark.parametrize("left", ["no journal", "a folder"])
def test_a_bundle_tells_of_a_session_whose_journal_is_lost(study: Path, tmp_path: Path, left: str) -> None:
    folder = sessions_of(study)[1]
    LOST[left](folder / "journal.jsonl")
    said = run("study", "bundle", study, "-o", tmp_path / "bundle", "--level", "full")[1]
    assert f"{folder.name} is not in the export: it has no readable journal" in said
    assert f"anything about {folder.name}: " in run("reproduce", tmp_path / "bundle")[1]


def test_a_session_that_only_its_session_toml_knows_is_told(study: Path) -> None:
    """Also when the log lost its lines: the engine had noted its clock, so it ran."""
    folder = sessions_of(study)[1]
    (folder / "clock").write_text("118.000")
    (folder / "journal.jsonl").unlink()
    lines = (study / LOG_FILE).read_text("utf-8").splitlines(keepends=True)
    (study / LOG_FILE).write_text("".join(each for each in lines if folder.name not in each), "utf-8")
    assert any(each.startswith(f"{folder.name} of P01 has no readable") for each in read_state(study).standing.due)


def test_an_engine_that_was_killed_at_once_leaves_no_session(study: Path) -> None:
    """It had written that the session begins, and its journal was still empty."""
    folder = sessions_of(study)[1]
    (folder / "journal.jsonl").write_bytes(b"")
    log = study / LOG_FILE
    lines = [each for each in log.read_text("utf-8").splitlines(keepends=True) if folder.name not in each]
    begins = '{"kind":"session","at":"2024-11-23T10:30:00.000+01:00","participant":"P01","slot":1,"run":1,"attempt":1,'
    log.write_text("".join([*lines, f'{begins}"purpose":"counted","folder":"{folder.name}"}}\n']), "utf-8")
    assert folder.name not in [each.name for each in read_state(study).sessions]
    assert "lost-session" not in run("study", "check", study)[1]


@pytest.mark.parametrize(
    "text", [None, b"", b"\xef\xbb\xbfformat = 1\n", b'wizard = "\xfcnna"\n', b"slot = 1\nslot = 2\n"]
)
def test_a_session_whose_session_toml_cannot_be_read_is_told(study: Path, tmp_path: Path, text: bytes | None) -> None:
    folder = sessions_of(study)[1]
    if text is None:
        shutil.rmtree(folder)
        folder.mkdir()
    else:
        (folder / INFO).write_bytes(text)
    status, said = run("study", "check", study)
    assert status == 1 and f"sessions/{folder.name}:1:1: error lost-session: it cannot be read: " in said
    status, said = READERS["export"](study, folder, tmp_path / "tables")
    assert status == 1 and f"warning: {folder.name} is not in the export: it cannot be read: " in said
    status, lines = check_sessions(study)
    assert status == 1 and any(line.startswith(f"{folder.name}: not proved: it cannot be read: ") for line in lines)


def test_a_journal_that_another_program_saved_with_other_line_ends_is_told_so(study: Path) -> None:
    folder = sessions_of(study)[1]
    journal = folder / "journal.jsonl"
    journal.write_bytes(journal.read_bytes().replace(b"\n", b"\r\n"))
    status, lines = check_sessions(study)
    assert status == 1 and any("its lines end with CR LF" in line for line in lines if folder.name in line)


@pytest.mark.parametrize("lost", [True, False], ids=["lost", "changed"])
def test_a_session_whose_copy_of_the_scenario_is_lost_is_not_proved(study: Path, lost: bool) -> None:
    folder = sessions_of(study)[1]
    edit(folder / INFO, "^scenario_folder = .*", f'scenario_folder = "{study / "scenario"}"')
    if lost:
        shutil.rmtree(folder / "scenario")
    else:
        edit(folder / "scenario" / "acts" / "all.xml", "Hello", "Hullo")
    status, lines = check_sessions(study)
    assert status == 1 and any(line.startswith("7 of 8 sessions proved") for line in lines)
    told = f"{folder.name}: the session's copy of the scenario is missing or was changed; "
    assert any(line.startswith(told) for line in lines)


def test_a_session_that_was_moved_away_is_no_error(study: Path) -> None:
    """As when data are deleted in time."""
    folder = sessions_of(study)[1]
    shutil.rmtree(folder)
    status, said = run("study", "check", study)
    assert (
        status == 0 and f"{folder.name}:1:1: warning lost-session: it is not in the study's sessions any more" in said
    )


def test_the_sessions_stay_when_the_study_gets_another_id(study: Path, tmp_path: Path) -> None:
    before = [each.entry for each in read_state(study).sessions]
    edit(study / "study.toml", '^id = ".*"', 'id = "lampz"')
    state = read_state(study)
    assert [each.entry for each in state.sessions] == before and state.standing.complete == 3
    told = 'study.toml says id = "lampz", but journal.jsonl says study = "hesitation"'
    status, said = run("study", "check", study)
    assert status == 1 and said.count(f"error other-label: {told}") == 8
    assert "was given another label" in run("study", "status", study)[1]
    status, lines = check_sessions(study)
    assert status == 1 and any(line.startswith("0 of 8 sessions proved") for line in lines)
    for reader in ("export", "report"):
        status, said = READERS[reader](study, sessions_of(study)[1], tmp_path / "out")
        assert status == 2 and told in said


@pytest.mark.parametrize("lines", [1, 2, 3, 60])
def test_a_journal_whose_end_is_missing_is_not_taken_for_the_session(study: Path, tmp_path: Path, lines: int) -> None:
    folder = next(each for each in sessions_of(study) if "P01" in each.name and read_info(each).purpose == "counted")
    journal = folder / "journal.jsonl"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:-lines]))
    status, said = run("study", "check", study)
    if lines == 1:  # the record of the last input: the replay gives it again
        assert status == 0 and "no-end" not in said
        return
    seconds = read_verdict(folder).seconds
    told = rf"study.jsonl, line \d+, says 120.000 s, journal.jsonl ends at {seconds:.3f} s: its end is missing"
    assert status == 1 and re.search(f"error other-label: {told}", said)
    assert f"{folder.name}:1:1: warning no-end: it counts as complete, and its record has no end" in said
    status, lines_ = check_sessions(study)
    assert status == 1 and any(line.startswith("7 of 8 sessions proved") for line in lines_)
    for reader in ("export", "report"):
        status, said = READERS[reader](study, folder, tmp_path / "out")
        assert status == 2 and re.search(told, said)


def test_a_session_that_was_judged_before_its_engine_vanished_has_no_end_and_is_told(
    study: Path, tmp_path: Path
) -> None:
    """That is no error: the log never had another end."""
    folder = next(each for each in sessions_of(study) if "P01" in each.name and read_info(each).purpose == "counted")
    journal = folder / "journal.jsonl"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:-2]))
    edit(study / LOG_FILE, rf'(?<="kind":"outcome")(.*{folder.name}.*)"seconds":120.0', r'\1"seconds":118.0')
    told = "counts as complete, and its record has no end"
    status, said = run("study", "check", study)
    assert status == 0 and f"{folder.name}:1:1: warning no-end: it {told}" in said
    status, said = READERS["export"](study, folder, tmp_path / "tables")
    assert status == 0 and f"note: {folder.name} {told}" in said
    said = " ".join(run("report", study)[1].replace("!!", "").split())
    assert f"{folder.name} {told}" in said


def test_a_line_of_the_log_that_cannot_be_read_is_told_by_whoever_uses_the_others(study: Path, tmp_path: Path) -> None:
    """Here it is the line that excluded somebody, saved in the encoding of another program."""
    assert run("study", "outcome", study, "P03", "excluded", "--reason", "Mxller was drunk")[0] == 0
    log = study / LOG_FILE
    line = len(log.read_bytes().splitlines())
    log.write_bytes(log.read_bytes().replace(b"Mxller", b"M\xfcller"))
    told = f"study.jsonl:{line}: this line is not UTF-8"
    status, said = run("study", "status", study)
    assert status == 1 and told in said.partition("to do")[2]
    assert f"warning: {told}" in run("study", "next", study)[1]
    folder = sessions_of(study)[-1]
    for reader in ("export", "records", "report"):
        status, said = READERS[reader](study, folder, tmp_path / reader)
        assert status == 1 and f"warning: {told}" in said, reader
    status, said = run("report", study)
    assert status == 1 and f"!! {told}" in said
    status, said = run("report", folder)
    assert status == 1 and f"warning: {told}" in said
    status, said = run("study", "bundle", study, "-o", tmp_path / "bundle")
    assert status == 1 and told in said and not (tmp_path / "bundle").exists()
    status, lines = check_sessions(study)
    assert status == 1 and any(each.startswith("0 of 8 sessions proved") for each in lines)
    assert f"{folder.name}: study.jsonl cannot be read whole, so what it says of it is not certain" in lines


def test_the_copy_of_a_session_in_a_bundle_does_not_count_beside_it(study: Path, tmp_path: Path) -> None:
    """Not even when somebody begins a session, whereby the log gets what the folders say."""
    before = [each.entry for each in read_state(study).sessions]
    make_bundle(read_state(study), sessions_of(study)[1:], tmp_path / "bundle", BundleOptions("shared"))
    shared = sessions_of(tmp_path / "bundle")[0]
    shutil.copytree(shared, study / SESSIONS / shared.name)
    with OpenStudy(study) as opened:
        assert [each.entry for each in opened.state.sessions] == before
    assert not [each for each in read_log(study) if each.get("folder") == shared.name]
    told = "its journal has no dates, as the copies in bundles, and other sessions have them."
    assert f"{SESSIONS}/{shared.name}:1:1: error copied-session: {told}" in run("study", "check", study)[1]
    assert f"{shared.name}: {told}" in run("study", "status", study)[1]
    status, lines = check_sessions(study)
    assert status == 1 and any(line.startswith(f"{shared.name}: not proved: {told}") for line in lines)
    bundle = tmp_path / "bundle"
    assert "copied-session" not in run("study", "check", bundle)[1], "there, no session has dates"


def test_two_sessions_of_one_run_and_attempt_are_told(study: Path, tmp_path: Path) -> None:
    """As when folders of two laboratories are put together."""
    first, second = (each for each in sessions_of(study) if "P03" in each.name)
    edit(second / INFO, r"^run = \d", "run = 1")
    edit(second / INFO, '^condition = ".*"', f'condition = "{read_info(first).condition}"')
    journal = second / "journal.jsonl"
    lines = [re.sub(rb'"run":2', b'"run":1', each) for each in journal.read_bytes().splitlines()]
    again = [with_checksum(each[: each.rindex(b',"crc"')] + b"}") for each in lines[1:]]
    journal.write_bytes(b"".join([lines[0] + b"\n", *again]))
    told = f"it is run 1, attempt 1 of P03, and so is {first.name}: only one of them can be, and both count."
    status, said = run("study", "check", study)
    assert status == 1 and f"{SESSIONS}/{second.name}:1:1: error repeated-session: {told}" in said
    assert f"{second.name}: {told}" in run("study", "status", study)[1]
    assert any(line == f"{second.name}: {told}" or told in line for line in check_sessions(study)[1])
    assert read_state(study).repeated == {
        second.name: f"{told} Find out which, and move the other one out of sessions/"
    }


def test_the_cells_are_those_of_the_sessions_also_when_somebody_has_changed_the_plan(study: Path) -> None:
    before = [(each.condition, each.complete, each.open) for each in read_state(study).standing.cells]
    for cell, other in (("yes", "no"), ("no", "yes")):
        plan = study / "plan.csv"
        row = next(line for line in plan.read_text("utf-8").splitlines() if line.startswith("1,"))
        if f",{cell}," in row:
            plan.write_text(plan.read_text("utf-8").replace(row, row.replace(f",{cell},", f",{other},")), "utf-8")
            break
    cells = read_state(study).standing.cells
    assert sorted((each.condition, each.complete, each.open) for each in cells) == sorted(before)
    assert run("study", "check", study)[0] == 1


# --- reassigned -------------------------------------------------------------------------------------------------------


@pytest.fixture
def moved(study: Path) -> Path:
    """P02's first session, which was aborted: P04 sat there."""
    folder = next(each for each in sessions_of(study) if read_verdict(each).report and "P02" in each.name)
    said = run("study", "reassign", study, folder.name, "P04", "--reason", "P04 sat there")
    assert said == (0, f"{folder.name} is P04's session now, and not P02's\n")
    return folder


def test_a_reassigned_session_is_its_new_participants_everywhere(moved: Path, study: Path, tmp_path: Path) -> None:
    facts = read_session(moved).facts
    assert (facts.participant, facts.slot, facts.attempt, facts.outcome) == ("P04", None, 1, "aborted")
    assert run("export", study, "--format", "tables", "-o", tmp_path / "tables")[0] == 0
    with (tmp_path / "tables" / "sessions.csv").open(encoding="utf-8") as file:
        rows = {each["session"]: each["participant"] for each in csv.DictReader(file)}
    assert rows[moved.name] == "P04" and list(rows.values()).count("P02") == 2
    exported = [each for each in read_log(study) if each.kind == "exported"][-1]
    assert "P04" in exported.get("participants")
    (standing,) = [each for each in read_state(study).standing.participants if each.participant == "P04"]
    assert [(each.run_as, each.reassigned) for each in standing.sessions if each.folder == moved.name] == [
        ("P02", "P04 sat there")
    ]
    assert re.search(rf"P04 .*aborted .*{moved.name}", run("sessions", study)[1])
    assert re.search(r"P04 .*aborted", run("study", "status", study)[1])
    report = " ".join(run("report", study)[1].split())
    assert "P04 run 1, attempt 1 run as P02 P04 sat there" in report
    assert "Run under another participant and reassigned: 1 session." in report
    shared = " ".join(run("report", study, "--level", "shared")[1].split())
    assert "P04 run 1, attempt 1 run as P02 [free text, 3 words]" in shared


@pytest.mark.parametrize("level", ["full", "public"])
def test_records_name_who_sat_there_and_tables_whom_it_was_run_under(
    moved: Path, study: Path, tmp_path: Path, level: str
) -> None:
    assert run("export", study, "--format", "jsonl", "--level", level, "-o", tmp_path / "records")[0] == 0
    begun = [json.loads(path.read_text("utf-8").splitlines()[0]) for path in (tmp_path / "records").glob("*.jsonl")]
    found = {(each["participant"], each["run"], each["attempt"]) for each in begun if each["purpose"] == "counted"}
    assert ("P04", 1, 1) in found and len(found) == 7
    ended = [json.loads(path.read_text("utf-8").splitlines()[-1]) for path in (tmp_path / "records").glob("*.jsonl")]
    assert {each["participant"] for each in ended if each["kind"] == "session"} <= {"", "P01", "P02", "P03", "P04"}
    text = "".join(path.read_text("utf-8") for path in (tmp_path / "records").glob("*P04*" if level != "full" else "x"))
    assert '"participant":"P02"' not in text
    assert level == "full" or (tmp_path / "records" / "P04_hesitation_real_run1.jsonl").exists()
    assert run("export", study, "--format", "tables", "--level", level, "-o", tmp_path / "tables")[0] == 0
    with (tmp_path / "tables" / "sessions.csv").open(encoding="utf-8") as file:
        assert [(each["participant"], each["run_as"]) for each in csv.DictReader(file) if each["run_as"]] == [
            ("P04", "P02")
        ]
    assert run("export", study, "--format", "bids", "--level", level, "-o", tmp_path / "bids")[0] == 0
    with (tmp_path / "bids" / "sub-P04" / "sub-P04_scans.tsv").open(encoding="utf-8") as file:
        assert "P02" in [each["run_as"] for each in csv.DictReader(file, delimiter="\t")]
    assert "Reassigned" in run("report", moved, "--level", level)[1]


def test_the_proof_accepts_just_this_difference_and_names_it(moved: Path, study: Path) -> None:
    status, said = run("study", "check", "--sessions", study)
    assert status == 0 and f"{moved.name}: run as P02, and reassigned to P04: P04 sat there" in said
    (row,) = [
        each
        for each in json.loads(run("study", "check", "--sessions", "--json", study)[1])["sessions"]
        if each["session"] == moved.name
    ]
    assert row["proved"] and row["problems"] == [] and row["note"].startswith("run as P02")
    edit(study / LOG_FILE, '"was":"P02"', '"was":"P03"')
    status, said = run("study", "check", "--sessions", study)
    assert status == 1 and 'says participant = "P03", but journal.jsonl says participant = "P02"' in said


def test_a_reassigned_session_is_still_proved_when_its_former_participant_has_withdrawn(
    moved: Path, study: Path, tmp_path: Path
) -> None:
    told = run("study", "withdraw", study, "P02", "--yes")[1]
    assert f"{moved.name}/session.toml, line" in told and "the session was run under this name and reassigned" in told
    assert f"the name of sessions/{moved.name}: the session was run under this name" in told
    assert "study.jsonl, line" not in told, "it names the folder, which stays"
    status, lines = check_sessions(study)
    assert (
        status == 0
        and f"{moved.name}: run as somebody who has withdrawn, and reassigned to P04: P04 sat there" in lines
    )
    assert read_session(moved).facts.participant == "P04"
    assert run("export", study, "--format", "tables", "-o", tmp_path / "tables")[0] == 0
    edit(study / LOG_FILE, r'"participant":"P04"', '"participant":"P01"')
    assert check_sessions(study)[0] == 1


def test_a_withdrawal_between_two_reassignments_leaves_who_it_was_run_under(moved: Path, study: Path) -> None:
    assert run("study", "reassign", study, moved.name, "P03", "--reason", "no, P03")[0] == 0
    assert run("study", "withdraw", study, "P04", "--yes")[0] in (0, 1)
    status, lines = check_sessions(study)
    assert status == 0, lines
    assert f"{moved.name}: run as P02, and reassigned to P03: no, P03" in lines
    assert read_session(moved).facts.run_as == "P02"


def test_a_withdrawal_says_which_sessions_ran_under_another_name(moved: Path, study: Path) -> None:
    said = run("study", "withdraw", study, "P04")[1]
    assert f"session {moved.name}, run as P02, and reassigned to P04: P04 sat there" in said


def test_a_bundle_keeps_it(moved: Path, study: Path, tmp_path: Path) -> None:
    make_bundle(read_state(study), sessions_of(study), tmp_path / "bundle", BundleOptions("shared"))
    folder = next(each for each in sessions_of(tmp_path / "bundle") if read_session(each).facts.outcome == "aborted")
    assert read_session(folder).facts.participant == "P04"


@pytest.mark.parametrize("level", ["shared", "public"])
def test_a_bundle_does_not_name_the_former_participant_who_has_withdrawn(
    moved: Path, study: Path, tmp_path: Path, level: ExportLevel
) -> None:
    run("study", "withdraw", study, "P02", "--yes")
    edit(study / "participants.csv", "^P02.*\n", "")
    report = make_bundle(read_state(study), [moved, sessions_of(study)[1]], tmp_path / "bundle", BundleOptions(level))
    assert report.sessions == 2
    files = [each for each in (tmp_path / "bundle").rglob("*") if each.is_file() and each.suffix != ".whl"]
    assert [each for each in files if b"P02" in each.read_bytes() or "P02" in each.name] == []
    folder = next(each for each in sessions_of(tmp_path / "bundle") if "P04" in each.name)
    facts = read_session(folder).facts
    assert (facts.participant, facts.run_as, facts.outcome) == ("P04", "withdrawn", "aborted")
    assert not [each for each in report.to_check if "reproduce" in each]


def test_a_session_that_is_reassigned_and_back_is_told_so(moved: Path, study: Path) -> None:
    said = run("study", "reassign", study, moved.name, "P02", "--reason", "it was P02 after all")
    assert said == (0, f"{moved.name} is P02's session now, and not P04's\n")
    status, lines = check_sessions(study)
    assert status == 0
    assert f"{moved.name}: run as P02, and reassigned and back: it was P02 after all" in "\n".join(lines)
    assert read_session(moved).facts.run_as == ""
