"""A session's report: every number is what somebody counts who has only the records."""

from __future__ import annotations

import re
import statistics as python
from collections import Counter
from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.kernel.inputs import ControlChanged, Note, RobotChanged
from rise_engine.kernel.records import (
    ActionRecord,
    CheckRecord,
    CueRecord,
    MistakeRecord,
    RecordingRecord,
    RuleRecord,
    SyncRecord,
    TaskRecord,
    TimingRecord,
)
from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.analysis.reading import read_session
from rise_engine.results.report.document import clock_text, length_text
from rise_engine.results.report.making import make_session_report, replay_words
from rise_engine.results.report.page import cells_wide, page_text, text_lines
from rise_engine.results.report.session_facts import session_figures
from rise_engine.results.report.session_report import session_report
from rise_engine.session.folder import JOURNAL
from rise_engine.session.media import FoundMark, MediaFile
from rise_engine.session.replay import ReplayComparison, ReplayDifference
from tests.results.analysis.samples import WIZARD, act, play_session, recovered_session, task, torn_session
from tests.results.report.pages import PageReader
from tests.results.report.test_page import assert_harmless


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return play_session(tmp_path_factory.mktemp("report") / "sessions")


@pytest.fixture(scope="module")
def data(folder: Path) -> SessionData:
    return read_session(folder)


@pytest.fixture(scope="module")
def page(data: SessionData) -> PageReader:
    return assert_harmless(page_text(session_report(data)))


def empty(**facts: object) -> SessionData:
    return SessionData(
        facts=SessionFacts(session="2024-11-23_093000_P01_tea_real", **facts),  # type: ignore[arg-type]
        level="full",
        folder=Path("/nowhere"),
        records=(),
    )


def median(values: list[float]) -> str:
    return f"{python.median(values):.2f}"


# --- latency: counted anew from the records of kind `timing` and `cue` ---


def waits(data: SessionData) -> list[float]:
    """From `cue` records alone: the mark, and the `voice_at` or `robot_at` of the act that answered it."""
    timings = {record.task: record for record in data.records if isinstance(record, TimingRecord)}
    speaking = {record.task for record in data.records if isinstance(record, ActionRecord) and record.type == "Speech"}
    marked, found = 0.0, []
    for record in data.records:
        if isinstance(record, CueRecord) and record.status == "marked":
            marked = record.t if record.key_at is None else record.key_at
        if isinstance(record, CueRecord) and record.status == "answered" and record.task is not None:
            timing = timings[record.task]
            began = timing.voice_at if record.task in speaking else timing.robot_at
            assert began is not None
            found.append(began - marked)
    return found


def test_responses_are_those_of_the_records(data, page):
    found = waits(data)
    assert len(found) == 3
    row = page.table("From a cue to the robot's answer")["response (cue to answer)"]
    assert row["n"] == "3"
    assert row["median"] == median(found)
    assert row["over 1 s"] == f"{100 * sum(each > 1 for each in found) / 3:.0f}\u00a0%"
    assert row["over 2 s"] == f"{100 * sum(each > 2 for each in found) / 3:.0f}\u00a0%"
    quartiles = python.quantiles(found, n=4, method="inclusive")
    assert row["middle half"] == f"{quartiles[0]:.2f}\u2013{quartiles[2]:.2f}"


def test_parts_are_those_of_the_timings(data, page):
    answered = {record.task for record in data.records if isinstance(record, CueRecord) and record.status == "answered"}
    timings = [record for record in data.records if isinstance(record, TimingRecord) and record.task in answered]
    table = page.table("From a cue to the robot's answer")
    wizard = [each.key_at - each.cue_at for each in timings if each.key_at is not None and each.cue_at is not None]
    assert (table["wizard (cue to key)"]["n"], table["wizard (cue to key)"]["median"]) == ("2", median(wizard))
    way = [each.accepted_at - each.key_at for each in timings if each.key_at is not None]
    assert table["way (key to engine)"]["median"] == median(way)
    no_key = [each.accepted_at - each.cue_at for each in timings if each.key_at is None and each.cue_at is not None]
    assert table["no key (cue to request)"]["median"] == median(no_key)
    queue = [each.started_at - each.accepted_at for each in timings if each.started_at is not None]
    assert table["queue (request to turn)"]["median"] == median(queue)
    robot = [each.robot_at - each.started_at for each in timings if each.robot_at and each.started_at is not None]
    assert table["robot (turn to confirmation)"]["median"] == median(robot)


def test_fillers_stand_apart(data, page):
    filled = [record for record in data.records if isinstance(record, CueRecord) and record.status == "filled"]
    table = page.table("Fillers: from the cue")
    assert table["filler (cue to filler)"]["n"] == str(len(filled)) == "2"
    assert table["with a filler (cue to answer)"]["n"] == "2"
    assert table["without (cue to answer)"]["n"] == "1"


def test_bands_count_every_response_once(data, page):
    found = waits(data)
    table = page.table("Responses in the reference bands")
    limits = {"up to 0.25 s": (-1, 0.25), "up to 1 s": (0.25, 1), "up to 2 s": (1, 2), "up to 4 s": (2, 4)}
    for name, (low, high) in limits.items():
        assert table[name]["n"] == str(sum(low < each <= high for each in found)), name
    assert sum(int(row["n"]) for row in table.values()) == 3


# --- acts, rules, mistakes, checks, notes, recordings ---


def test_acts_are_those_of_the_tasks(data, page):
    table = page.table("Acts, the most frequent first")
    begun = {
        record.id: "say" if record.function == "say" else record.behavior
        for record in data.records
        if isinstance(record, TaskRecord)
        and record.function in ("say", "startCommunicationRobotAct")
        and record.status == "ACTIVE"
    }
    counts = Counter(begun.values())
    assert {name: int(row["begun"]) for name, row in table.items() if row["begun"] != "0"} == dict(counts)
    assert table["Nodd"]["not succeeded"] == "1 REJECTED"
    assert table["Hm"]["caused by"] == "wizard 1, 1 as filler"
    assert table["Ask"]["caused by"] == "wizard 2, program 1"


def test_phases_are_those_of_the_rules(data, page):
    rows = next(rows for caption, rows in page.tables.items() if caption.startswith("Phases"))
    visits = Counter(
        record.state for record in data.records if isinstance(record, RuleRecord) and record.status == "entered"
    )
    assert {row[1]: int(row[2]) for row in rows[1:]} == dict(visits)
    assert sum("by stepping back" in row[-1] for row in rows) == 1


def test_mistakes_with_their_interval(data, page):
    marks = {record.task: record.mark for record in data.records if isinstance(record, MistakeRecord)}
    standing = [mark for mark in marks.values() if mark != "none"]
    refused = {record.id for record in data.records if isinstance(record, TaskRecord) and record.status == "REJECTED"}
    keys = {
        record.id
        for record in data.records
        if isinstance(record, TaskRecord)
        and record.source == WIZARD
        and record.cause is None
        and record.function != "markMistake"
    } - refused
    assert len(standing) == 1
    told = page.text.replace("\u00a0", " ")
    assert len(keys) == 25
    assert "1 of 25 (4.0 %)" in told
    assert "4.0 (0.7\u201320)" in told  # Wilson: 1 of 25
    assert "1 late" in told


def test_checks_skips_notes_and_marks_are_told(page):
    assert page.table("Checks before and after")["disk"]["reason"] == "in a hurry"
    assert "Skipped: disk." in page.text
    assert page.table("1 note")["0:54"]["note"] == "Zelda looks away"
    assert page.table("Recorders")["camera"]["status"] == "stopped"
    assert "1 at 0.20\u00a0s (sound), 2 at 117.00\u00a0s (sound)" in page.text


def test_media_have_offset_and_drift(data):
    media = MediaFile(
        path="/videos/room.mp4",
        kind="video",
        duration=130.0,
        offset=4.2,
        rate=1.00005,
        aligned_by="marks",
        marks=(FoundMark(1, 0.2, 4.4, 9.0), FoundMark(2, 117.0, 121.2, 8.0)),
    )
    short = replace(media, path="short.mp4", within=0.025)
    loose = MediaFile(path="a.wav", kind="audio")
    page = PageReader(page_text(session_report(replace(data, media=(media, short, loose)))))
    rows = page.table("Files on the session's clock")
    assert rows["room.mp4"]["offset in s"] == "4.200"
    assert rows["room.mp4"]["drift in ppm"] == "50.0"
    assert rows["short.mp4"]["drift in ppm"] == "50.0 \u00b1 428"
    assert rows["room.mp4"]["marks found"] == "1, 2"
    assert rows["a.wav"]["aligned by"] == "not aligned"
    assert "/videos" not in page.text


# --- levels, banners, odd sessions ---


def test_shared_and_public_tell_no_names(folder):
    shared = page_text(make_session_report(folder, "shared").document)
    for hidden in ("Zelda", "Quux", "anna", "2024-11-23", "in a hurry", "looks away", "/data"):
        assert hidden not in shared, hidden
    assert "W1" in shared and "P01" in shared
    public = page_text(make_session_report(folder, "public").document)
    assert "shall we go on" in shared and "shall we go on" not in public


def test_debug_and_rehearsals_have_a_banner():
    assert "DEBUG" in session_report(empty(mode="debug", ended=True)).banner
    assert "PILOT" in session_report(empty(purpose="pilot", mode="real", ended=True)).banner
    simulated = session_report(empty(purpose="pilot", mode="real", driver="simulated", ended=True)).banner
    assert simulated.startswith("SIMULATED") and simulated.endswith("PILOT: this session does not count.")
    assert session_report(empty(mode="real", ended=True)).banner == ""
    assert "no end" in session_report(empty(mode="real")).banner


@pytest.mark.parametrize(
    "script",
    [
        [],
        [(2.0, task("markCue"))],
        [(2.0, task("markCue")), act("Greet", 2.5)],
        [act("Greet", 1.0)],
        [(1.0, Note(text="only a note", source=WIZARD))],
    ],
    ids=["nothing", "a cue", "a cue and its answer", "an act", "a note"],
)
def test_sessions_in_which_little_happened(tmp_path, script):
    made = make_session_report(play_session(tmp_path / "sessions", script, until=10.0))
    reader = assert_harmless(page_text(made.document))
    cells = [cell for rows in reader.tables.values() for row in rows for cell in row]
    assert not {"nan", "None", "inf"} & set(cells)
    assert all(cells_wide(line) <= 80 for line in text_lines(made.document))


def test_a_session_of_which_nothing_is_known():
    made = session_report(empty())
    reader = assert_harmless(page_text(made))
    assert "Nothing happened in it." in reader.text
    assert "No act answered a cue" in reader.text
    assert text_lines(made)


def test_torn_damaged_and_recovered_sessions(tmp_path):
    torn = make_session_report(torn_session(tmp_path / "torn"))
    assert any("torn" in problem for problem in torn.problems)
    shared = assert_harmless(page_text(make_session_report(torn.folders[0], "shared").document)).text
    assert "1 thing could not be read and is missing here." in shared and "journal" not in shared
    assert "torn" in assert_harmless(page_text(torn.document)).text
    recovered = make_session_report(recovered_session(tmp_path / "recovered"))
    told = assert_harmless(page_text(recovered.document)).text.replace("\u00a0", " ")
    assert "recovered 1 time, without a running engine for 1 min 35 s in all" in told
    assert "Outages of the engine 1 outage, 1 min 35 s in all by the wall clock" in " ".join(told.split())
    assert told.count("no engine for 1 min 35 s; session time stood still") == 2  # under When, and in order
    assert told.count("and 1 min 35 s without an engine") >= 4  # two states, an answer, and the course's titles


def test_the_first_sentences_are_so(tmp_path):
    """An answer without a time that counts is an answer; who only marks the cue is a wizard; a failure waited."""
    script = [act("Answer", 9.0), (10.0, task("markCue", source="wizard:ben"))]
    data = read_session(play_session(tmp_path, script, until=30.0, faults=()))
    assert ([each.before_cue for each in data.acts], data.cues[0].answered_at) == ([False], None)
    late = replace(data.acts[0], cue_at=8.0, response_outage_s=9.0, response_interrupted="outage")
    cue = replace(data.cues[0], answered_at=9.5, answer_s=None, task=late.task)
    document = session_report(replace(data, acts=(late,), cues=(cue,)))
    assert "The robot answered 1 of 1 cue, but no answer has a time that counts." in document.summary
    assert "The robot answered none of 1 cue." in session_report(replace(data, acts=(), cues=(data.cues[0],))).summary
    assert dict(document.facts)["Wizards"] == "anna, ben"


def test_acts_in_order_are_of_who_caused_them(folder):
    """Also an act that a rule began because of a wizard's key, and one that a rule began by itself."""
    data = read_session(folder)
    via = next(each for each in data.acts if each.via and each.actor == "wizard")
    told = " ".join(assert_harmless(page_text(session_report(data))).text.split()).replace("\u00a0", " ")
    in_order = told.partition("Everything in order")[2]
    assert f"{via.act} {via.by.removeprefix('wizard:')}, through {' > '.join(via.via)}" in in_order


def test_whether_it_replays_is_told_without_what_was_recorded(folder, tmp_path, monkeypatch):
    assert re.fullmatch(r"identical: \d+ inputs, \d+ records", replay_words(folder))
    difference = ReplayDifference(JOURNAL, 9, 12, 4, "note", "text", "Zelda", "Zoe")
    for found, words in (
        (ReplayComparison(3, 11, 2.0, difference), "different from record 12 on (note)"),
        (ReplayComparison(3, 11, 2.0, missing=1), "identical as far as it can be read: 11 records"),
    ):
        monkeypatch.setattr("rise_engine.results.report.making.compare_replay", lambda folder, found=found: found)
        assert replay_words(folder) == words
    monkeypatch.undo()
    assert replay_words(tmp_path) == "cannot be replayed; rise-engine replay says why"


def test_a_long_session_is_drawn_in_a_few_rows(tmp_path):
    script = [(1.0 + 12 * n, task("markCue")) for n in range(150)]
    script += [act("Thanks" if n % 2 else "Ask", 2.0 + 12 * n + n % 7 / 5) for n in range(150)]
    script.sort(key=lambda each: each[0])
    data = read_session(play_session(tmp_path / "sessions", script, until=1830.0))
    assert len(list(data.records)) > 1_200
    made = page_text(session_report(data))
    reader = assert_harmless(made)
    assert 1 < made.count('class="course"') <= 6
    assert reader.table("From a cue")["response (cue to answer)"]["n"] == str(len(waits(data)))
    assert len(made) < 600_000


def test_a_hostile_session(data):
    nasty = '<script src="http://x">url(http://x)</script>'
    source = f"wizard:{nasty}"
    records = (
        CheckRecord(1, 0.0, "", nasty, nasty, "skipped", nasty, nasty, source),
        RecordingRecord(2, 0.0, "", nasty, "failed", nasty, 3, nasty, source),
        SyncRecord(3, 1.0, "", 1, nasty, nasty, source),
    )
    acts = tuple(replace(each, act=nasty, source=source) for each in data.acts)
    phases = tuple(replace(each, rule=nasty, state=nasty, trigger=nasty) for each in data.phases)
    points = tuple(replace(each, name=nasty, value=nasty, source=source) for each in data.points)
    facts = replace(
        data.facts, participant=nasty, condition=nasty, title=nasty, factors={nasty: nasty}, versions={nasty: nasty}
    )
    attacked = replace(
        data,
        facts=facts,
        acts=acts,
        phases=phases,
        points=points,
        checks=(records[0],),
        recordings=(records[1],),
        syncs=(records[2],),
        problems=(nasty,),
        media=(MediaFile(path=nasty, kind="other"),),
        cues=tuple(replace(each, text=nasty, source=source) for each in data.cues),
    )
    assert_harmless(page_text(session_report(attacked, nasty)))
    assert all(cells_wide(line) <= 80 for line in text_lines(session_report(attacked, nasty)))


def test_a_degraded_robot_is_not_lost_and_a_wizard_who_comes_back_is_no_other(tmp_path):
    """Control counts when it passes to another person, not when the engine of the same one dies."""

    def control(at, status, holder):
        return at, ControlChanged(status=status, by="wizard:anna", holder=holder)

    script = [
        control(0.5, "taken", "wizard:anna"),
        control(1.0, "released", None),
        control(1.5, "taken", "wizard:anna#2"),
        control(2.0, "given", "wizard:ben"),
        (3.0, RobotChanged(status="degraded", detail="its face may still move")),
        (4.0, RobotChanged(status="degraded", detail="its arms too")),
        (5.0, RobotChanged(status="lost")),
        (6.0, RobotChanged(status="degraded")),
        (7.0, RobotChanged(status="connected")),
    ]
    data = read_session(play_session(tmp_path / "sessions", script, until=69.997))
    found = session_figures(data).mistakes
    assert (found.robot_lost, found.robot_degraded, found.control_changes) == (1, 1, 1)
    told = " ".join(" ".join(text_lines(session_report(data))).split())
    assert "Robot lost 1" in told and "Robot partly lost 1" in told and "Control changed hands 1" in told


def test_a_length_is_rounded_in_one_way():
    for seconds in (0.4, 38.992, 59.5, 69.997, 3599.6):
        minutes, rest = divmod(round(seconds), 60)
        assert clock_text(seconds).endswith(f"{rest:02d}"), "as in the words for people"
        assert length_text(seconds).replace("\u00a0", " ").startswith((f"{minutes} min", f"{rest} s", "1 h"))
