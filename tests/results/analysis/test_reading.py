"""What a session becomes when it is read for exports and reports."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.records import ENGINE, ActionRecord, NoteRecord, SessionRecord, StopRecord, TimingRecord
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.course import (
    OutageCollector,
    PointCollector,
    interruption_between,
    records_by_wall_clock,
    seconds_without_engine,
)
from rise_engine.results.analysis.model import Cue, PlayedAct, SessionData, SessionFacts
from rise_engine.results.analysis.reading import read_session, read_sessions
from rise_engine.results.analysis.session_records import SessionRecords
from rise_engine.results.report.page import text_lines
from rise_engine.results.report.session_report import session_report
from rise_engine.session.folder import INFO, JOURNAL, SCENARIO_COPY, mark_abandoned
from rise_engine.session.journal_format import encode_record, read_line, with_checksum
from rise_engine.session.journal_reader import JournalContents
from rise_engine.session.media import MEDIA_FILE
from rise_engine.session.replay import compare_replay
from rise_engine.study.study_log import LockedLog

from .samples import (
    WIZARD,
    act,
    make_study,
    play_session,
    recovered_session,
    sessions_of,
    short,
    task,
    torn_session,
    write_scenario,
)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> SessionData:
    return read_session(play_session(tmp_path_factory.mktemp("lab") / "sessions"))


def of(data: SessionData, number: int) -> PlayedAct:
    return next(each for each in data.acts if each.task == number)


def test_the_parts_of_a_latency_add_up_to_it(data: SessionData) -> None:
    answer = of(data, 8)
    assert (answer.act, answer.cue_at, answer.filler) == ("Answer", 9.97, False)
    assert (answer.wizard_s, answer.way_s, answer.rules_s, answer.queue_s) == (2.51, 0.02, 0, 0)
    assert (answer.robot_s, answer.voice_s) == (0.02, 1.0)
    assert answer.response_s == 3.55  # to the voice: it looks first
    answered = [each for each in data.acts if each.cue_at is not None]
    assert len(answered) == 5
    for each in answered:
        parts = (
            each.wizard_s,
            each.way_s,
            each.rules_s,
            each.queue_s,
            each.robot_s,
            each.voice_s if each.speaks else 0.0,
        )
        assert each.response_s == pytest.approx(sum(part or 0.0 for part in parts), abs=1e-6)


def test_a_session_began_when_its_clock_was_at_zero(tmp_path: Path) -> None:
    """The engine reads its first wall clock a little later: 0.15 s here."""
    folder = play_session(tmp_path / "sessions", short(), until=20.0)
    assert read_session(folder).facts.started == "2024-11-23T09:30:00.000+01:00"
    lines = (folder / JOURNAL).read_bytes().splitlines()
    late = [
        with_checksum(encode_record(replace(record, t=0.15, wall="2024-11-23T09:30:00.150+01:00")))
        if isinstance(record := read_line(line), SessionRecord) and record.status == "started"
        else line + b"\n"
        for line in lines
    ]
    (folder / JOURNAL).write_bytes(b"".join(late))
    assert read_session(folder).facts.started == "2024-11-23T09:30:00.000+01:00"
    assert read_session(folder, level="shared").facts.started == ""


def test_every_cue_has_its_answer_or_none(data: SessionData) -> None:
    told = [(cue.at, cue.filled_at, cue.answered_at, cue.task, cue.undone_at) for cue in data.cues]
    assert told == [
        (9.97, 11.02, 13.52, 8, None),
        (24.0, None, 24.82, 10, None),
        (28.0, None, None, None, 28.9),
        (46.0, 46.82, 49.02, 21, None),
        (90.0, None, None, None, None),
    ]


def test_a_study_is_read_one_session_after_the_other(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    found = list(read_sessions(sessions_of(study)))
    assert [(each.facts.participant, each.facts.run, each.facts.outcome) for each in found] == [
        ("P01", 1, None),
        ("P01", 1, "complete"),
        ("P01", 2, "complete"),
        ("P02", 1, "aborted"),
        ("P02", 1, "complete"),
        ("P02", 2, "complete"),
        ("P03", 1, "complete"),
        ("P03", 2, "complete"),
    ]
    assert not any(each.problems for each in found)


@pytest.mark.parametrize("level", ["shared", "public"])
def test_nothing_private_is_in_what_is_read(tmp_path: Path, level: ExportLevel) -> None:
    study = make_study(tmp_path / "study")
    for data in read_sessions(sessions_of(study), level=level):
        text = repr(data).replace(repr(data.folder), "").casefold()
        for word in ("zelda", "quux", "anna", "2024", "mkv", "hurry", "sick"):
            assert word not in text, word


def test_recovered_and_torn_sessions(tmp_path: Path) -> None:
    recovered = read_session(recovered_session(tmp_path / "sessions"))
    assert (recovered.facts.recoveries, recovered.facts.downtime, recovered.facts.ended) == (1, 95.0, True)
    torn = read_session(torn_session(tmp_path / "sessions"))
    assert not torn.facts.ended and len(torn.problems) == 1


def test_samples_are_real_sessions(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    for folder in (
        sessions_of(study)[1],
        recovered_session(tmp_path / "sessions"),
        torn_session(tmp_path / "sessions"),
    ):
        assert compare_replay(folder).identical


# --- acts ---


def test_time_without_an_engine_begins_with_its_last_sign_of_life(tmp_path: Path) -> None:
    data = read_session(recovered_session(tmp_path, at=26.0, away=95.0, noted=31.5))
    (outage,) = data.outages
    (recovered,) = [each for each in data.points if each.kind == "recovery"]
    told = next(each for each in data.records if isinstance(each, SessionRecord) and each.status == "recovered")
    assert (outage.at, outage.seconds, told.downtime, recovered.at) == (31.5, 95.0, 95.0, 31.5)
    shared = read_session(data.folder, level="shared")  # which tells no wall clock
    assert shared.outages == data.outages and shared.facts.downtime == 95.0
    broken = [each for each in data.phases if each.start < 31.5 <= each.end]
    assert broken and all(seconds_without_engine(data.outages, each.start, each.end) == 95.0 for each in broken)
    whole = [each for each in data.phases if each.end < 31.5]
    assert whole and not any(seconds_without_engine(data.outages, each.start, each.end) for each in whole)


def test_who_asked_for_an_act_and_what_became_of_it(data: SessionData) -> None:
    told = [(each.task, each.act, each.actor, each.status, each.filler, each.mark) for each in data.acts]
    assert told == [
        (5, "Greet", "wizard", "SUCCEEDED", False, None),  # a rule asked for it, which a wizard's key had started
        (7, "Hm", "wizard", "SUCCEEDED", True, "late"),
        (8, "Answer", "wizard", "SUCCEEDED", False, None),  # its mark was taken back
        (10, "Nod", "wizard", "SUCCEEDED", False, None),
        (13, "Ask", "wizard", "SUCCEEDED", False, None),
        (14, "Thanks", "wizard", "SUCCEEDED", False, None),
        (15, "Nod", "wizard", "SUCCEEDED", False, None),
        (16, "Nodd", "wizard", "REJECTED", False, None),
        (17, "Point", "wizard", "ABORTED", False, None),
        (18, "Point", "wizard", "SUCCEEDED", False, None),
        (20, "Think", "wizard", "SUCCEEDED", True, None),
        (21, "Ask", "program", "SUCCEEDED", False, None),
        (26, "Ask", "wizard", "SUCCEEDED", False, None),
        (28, "say", "wizard", "SUCCEEDED", False, None),
        (30, "Answer", "wizard", "CANCELED", False, None),
        (32, "Greet", "wizard", "CANCELED", False, None),
    ]


def test_actions_with_their_channels_and_words(data: SessionData) -> None:
    look, speech = of(data, 8).parts
    assert (look.type, look.channels, look.text, look.started_at, look.accepted_at, look.ended_at) == (
        *("LookAt", ("gaze",), "(1, 0, 0)"),
        *(12.5, 12.52, 13.5),
    )
    assert (speech.channels, speech.accepted_at, speech.status) == (("speech",), 13.52, "succeeded")
    waits = of(data, 13).parts[1]
    assert (waits.type, waits.channels, waits.text, waits.accepted_at) == ("Wait", (), "500 ms", None)
    assert of(data, 16).parts == () and not of(data, 16).speaks


def test_a_key_that_arrives_late_is_compared_by_its_press(tmp_path: Path) -> None:
    """The engine stands still for a moment: cue and key arrive together, and were pressed 0.5 s apart."""
    script = [
        (1.0, task("startInteractionRule", "Visit", pressed=1.0)),
        (9.85, task("markCue", pressed=8.139)),
        (9.86, task("raiseEventTopic", "/tea", pressed=8.64)),
    ]
    data = read_session(play_session(tmp_path / "sessions", script, until=20))
    asked = next(each for each in data.acts if each.act == "Ask")
    assert (data.cues[0].at, asked.cue_at, asked.key_at, asked.before_cue) == (8.139, 8.139, 8.64, False)
    assert (asked.wizard_s, asked.way_s) == (0.501, 1.22) and asked.response_s is not None and asked.response_s > 1.7
    assert [(key.function, key.at) for key in data.keys[1:]] == [("markCue", 8.139), ("raiseEventTopic", 8.64)]


LEAD = (
    '<InteractionRule name="Lead" initial="A"><State id="A">'
    '<onEntry><function startCommunicationRobotAct="Nod"/></onEntry>'
    '<transition eventTopic="/Nod_end" target="B"/></State>'
    '<State id="B"><onEntry><function startCommunicationRobotAct="Ask"/></onEntry></State></InteractionRule>'
)


def test_the_way_of_a_key_ends_where_the_engine_takes_it(tmp_path: Path) -> None:
    """What rules do until the act is requested is no way: whoever looks for a slow network would find one."""
    scenario = write_scenario(tmp_path / "lead")
    (scenario / "rules" / "lead.xml").write_text(LEAD, "utf-8")
    script = [(2.0, task("markCue", pressed=2.0)), (3.01, task("startInteractionRule", "Lead", pressed=3.0))]
    data = read_session(play_session(tmp_path / "sessions", script, scenario=scenario, until=20))
    nod, ask = data.acts
    assert (nod.key_at, nod.way_s, nod.rules_s) == (3.0, 0.01, 0.0) == (ask.key_at, ask.way_s, 0.0)
    assert ask.taken_at == 3.01 and nod.ended_at is not None
    assert ask.rules_s == pytest.approx(nod.ended_at - 3.01, abs=0.01) and ask.rules_s > 1


def test_an_answer_that_waited_before_its_cue(tmp_path: Path) -> None:
    script = [act("Ask", 1.0), act("Thanks", 1.5), (2.0, task("markCue"))]
    found = read_session(play_session(tmp_path / "sessions", script, until=20)).acts[1]
    assert (found.act, found.cue_at, found.key_at, found.before_cue) == ("Thanks", 2.0, 1.48, True)
    assert (found.wizard_s, found.way_s, found.rules_s) == (None, None, None)
    assert found.started_at is not None and found.started_at > 2.0
    parts = (found.wizard_s, found.way_s, found.rules_s, found.queue_s, found.robot_s, found.voice_s)
    assert found.response_s == pytest.approx(sum(part or 0.0 for part in parts), abs=1e-6)


def test_only_one_act_answers_a_cue(tmp_path: Path) -> None:
    script = [(1.0, task("markCue")), act("Ask", 2.0), act("Thanks", 2.1), act("Hm", 9.0)]
    data = read_session(play_session(tmp_path / "sessions", script, until=20))
    assert [(each.act, each.cue_at, each.response_s, each.filler) for each in data.acts] == [
        ("Ask", 1.0, 1.02, False),
        ("Thanks", None, None, False),
        ("Hm", None, None, False),  # no cue is open, so it bridges nothing
    ]
    assert [each.task for each in data.cues] == [data.acts[0].task]


def test_a_cue_whose_answer_was_never_heard(tmp_path: Path) -> None:
    script = [(1.0, task("markCue")), act("Answer", 2.0), (2.3, task("stopCommunicationRobotAct", "Answer"))]
    data = read_session(play_session(tmp_path / "sessions", script, until=20))
    answer, cue = data.acts[0], data.cues[0]
    assert (answer.speaks, answer.robot_at, answer.voice_at, answer.response_s) == (True, 2.02, None, None)
    assert (cue.task, cue.answered_at) == (answer.task, None)


def test_what_old_journals_do_not_say_is_worked_out(data: SessionData, tmp_path: Path) -> None:
    """Timings of format 1 have neither source nor filler nor voice_at."""
    folder = play_session(tmp_path / "sessions")

    def older(contents: JournalContents) -> object:
        for record in read_records(contents):
            if isinstance(record, TimingRecord):
                record.source, record.filler, record.voice_at = "", False, None
            yield record

    read_records = JournalContents.read_records
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(JournalContents, "read_records", older)
        found = read_session(folder)
    assert found.acts == data.acts and found.cues == data.cues


# --- rules, points, repairs ---


def test_states_of_rules(data: SessionData) -> None:
    told = [(each.rule, each.state, each.start, round(each.end, 3), each.ended_by) for each in data.phases]
    assert told == [
        ("Lamp", "Off", 0.5, 20.5, ""),
        ("Visit", "Start", 1.0, 1.0, ""),
        ("Visit", "Welcome", 1.0, 2.586, ""),
        ("Visit", "Talk", 2.585714, 55.0, ""),
        ("Lamp", "On", 20.5, 80.6, "stopped"),
        ("Visit", "Tea", 55.0, 58.2, ""),
        ("Visit", "Talk", 58.2, 80.6, "stopped"),
        ("Visit", "Talk", 84.0, 120.0, ""),
    ]
    assert [each.source for each in data.phases if each.source] == ["rule-starter", WIZARD, WIZARD]
    assert [each.start for each in data.phases if each.stepped_back] == [58.2]


def test_moments(data: SessionData) -> None:
    told = [
        (each.at, each.name, each.value) for each in data.points if each.kind in ("mistake", "fault", "sync", "note")
    ]
    assert told == [
        (0.2, "1", "sound"),
        (41.0, "Point", "action 1 (PointAt) failed: it went wrong on the robot (simulated fault)"),
        (52.0, "late", "Hm"),
        (54.0, "note", "Zelda looks away"),
        (117.0, "2", "sound"),
    ]
    assert [each.at for each in data.points] == sorted(each.at for each in data.points)


def test_repairs_are_counted(data: SessionData, tmp_path: Path) -> None:
    repairs = data.repairs
    assert (repairs.repeated, repairs.stepped_back, repairs.cues_undone, repairs.canceled, repairs.released) == (
        *(1, 1, 1, 1, 1),
    )
    assert repairs.total == 4, "stopping everything, and releasing that, is no repair"
    script = [
        act("Ask", 1.0),
        act("Thanks", 1.5, calling="Interrupt"),  # by a wizard: counts
        act("Ask", 10.0),
        act("Thanks", 10.5, calling="Interrupt", source="ros:/chooser"),  # by a program: does not
        act("Ask", 20.0),
        act("Thanks", 20.1),
        (20.2, task("cancelTask", "6")),  # had not begun
        (20.3, task("stopAll", source="engine")),  # not by a wizard
    ]
    found = read_session(play_session(tmp_path / "sessions", script, until=40))
    assert [each.status for each in found.acts] == [
        *("CANCELED", "SUCCEEDED", "CANCELED", "SUCCEEDED", "CANCELED", "CANCELED")
    ]
    assert found.repairs.canceled == 1


# --- facts ---


def test_what_is_true_of_the_whole_session(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    facts = read_session(sessions_of(study)[4]).facts
    assert (facts.participant, facts.condition, facts.factors) == (
        *("P02", "no+quiet"),
        {"hesitation": "no", "noise": "quiet"},
    )
    assert (facts.study, facts.slot, facts.run, facts.attempt, facts.purpose) == ("hesitation", 2, 1, 2, "counted")
    assert (facts.mode, facts.outcome, facts.robot, facts.title) == ("real", "complete", "generic", "Tea")
    assert (facts.started, facts.duration, facts.ended) == ("2024-11-23T13:30:00.000+01:00", 120.0, True)
    assert read_session(sessions_of(study)[4], level="shared").facts.started == ""


def test_what_the_study_says_of_a_session_counts(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    folder = sessions_of(study)[1]
    with LockedLog(study) as log:
        log.append("outcome", session=folder.name, participant="P01", status="aborted", reason="Anna was ill")
    assert (read_session(folder).facts.outcome, read_session(folder).facts.outcome_reason) == (
        "aborted",
        "Anna was ill",
    )
    assert read_session(folder, level="shared").facts.outcome_reason == "[free text, 3 words]"
    with LockedLog(study) as log:
        log.append("excluded", participant="P01", reason="too young")
    assert (read_session(folder).facts.outcome, read_session(folder).facts.outcome_reason) == ("excluded", "too young")


def test_one_that_was_given_up(tmp_path: Path) -> None:
    folder = torn_session(tmp_path / "sessions")
    assert read_session(folder).facts.outcome is None
    mark_abandoned(folder)
    assert read_session(folder).facts.outcome == "aborted"


def test_without_session_file_the_journal_says_it(tmp_path: Path) -> None:
    started = SessionStarted(participant="P07", condition="calm", factors={"noise": "loud"}, run=2, attempt=1)
    folder = play_session(tmp_path / "sessions", short(), started=started, until=20)
    before = read_session(folder)
    (folder / INFO).unlink()
    found = read_session(folder)
    assert len(found.problems) == 2 and found.acts == before.acts
    for name in ("participant", "condition", "factors", "run", "attempt", "mode", "robot", "seed", "scenario_hash"):
        assert getattr(found.facts, name) == getattr(before.facts, name), name
    with pytest.raises(SessionError, match="it is not known which memory keys are private"):
        read_session(folder, level="shared")


def test_a_scenario_that_cannot_be_loaded_is_said(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions")
    before = read_session(folder)
    (folder / SCENARIO_COPY / "acts" / "all.xml").write_text("<Dialogs/>", "utf-8")
    (tmp_path / "scenario" / "acts" / "all.xml").write_text("<Dialogs/>", "utf-8")
    found = read_session(folder)
    assert (
        len(found.problems) == 1
        and "its trials are not known, and it is not certain which parts of the robot" in found.problems[0]
    )
    assert found.acts == before.acts


def test_one_scenario_is_loaded_once_and_a_changed_one_anew(tmp_path: Path) -> None:
    folders = [play_session(tmp_path / "sessions", short(), until=20) for _ in range(2)]
    first, second = (SessionRecords(folder).load_scenario() for folder in folders)
    assert first is second
    (folders[1] / SCENARIO_COPY / "memory.json").write_text("{}", "utf-8")
    (tmp_path / "scenario" / "memory.json").write_text("{}", "utf-8")
    with pytest.raises(SessionError):
        SessionRecords(folders[1]).load_scenario()


def test_a_media_file_that_cannot_be_read_is_said(tmp_path: Path) -> None:
    folder = play_session(tmp_path / "sessions", short(), until=20)
    (folder / MEDIA_FILE).write_text("{", "utf-8")
    found = read_session(folder)
    assert found.media == () and len(found.problems) == 1 and MEDIA_FILE in found.problems[0]
    assert read_session(folder, level="shared").problems == ()


# --- several ---


def test_a_person_has_one_name_in_all_sessions_of_a_study(tmp_path: Path) -> None:
    study = make_study(tmp_path / "study")
    folders = []
    for who in ("wizard:bob", "wizard:anna", "wizard:bob"):
        started = SessionStarted(participant="P09", study="hesitation", run=1, purpose="pilot")
        script = [act("Greet", 1.0, source=who)]
        root, scenario = study / "sessions", study / "scenario"
        folders.append(play_session(root, script, scenario=scenario, started=started, until=10))
    found = list(read_sessions(folders, level="shared"))
    assert [data.acts[0].source for data in found] == ["wizard:W1", "wizard:W2", "wizard:W1"]


def test_names_of_sessions_are_unique(tmp_path: Path) -> None:
    folders = [play_session(tmp_path / where / "sessions", short(), until=20) for where in "abc"]
    name = folders[0].name
    assert [each.facts.session for each in read_sessions(folders)] == [name, f"{name}-2", f"{name}-3"]


def test_sessions_are_read_when_they_are_asked_for(tmp_path: Path) -> None:
    folders = [play_session(tmp_path / "sessions", short(), until=20) for _ in range(2)]
    found = read_sessions(folders)
    assert next(found).facts.session == folders[0].name
    (folders[1] / JOURNAL).unlink()
    with pytest.raises(SessionError):
        next(found)
    said: list[Path] = []
    assert len(list(read_sessions(folders, on_unreadable=lambda folder, error: said.append(folder)))) == 1
    assert said == [folders[1]]


def test_whatever_is_left_of_a_journal_is_read(tmp_path: Path) -> None:
    """Cut anywhere, and damaged anywhere: nothing raises but what is said, and times stay in their order."""
    folder = play_session(tmp_path / "sessions")
    whole = (folder / JOURNAL).read_bytes()
    lines = whole.splitlines(keepends=True)
    damaged = [b"".join([*lines[:n], b"#" + lines[n][1:], *lines[n + 1 :]]) for n in range(0, len(lines), 9)]
    for data in (*(whole[:size] for size in range(0, len(whole), 1_999)), *damaged):
        (folder / JOURNAL).write_bytes(data)
        try:
            found = read_session(folder)
        except SessionError:
            assert len(data) < 100
            continue
        for played in found.acts:
            times = [played.accepted_at, played.started_at, played.robot_at, played.voice_at]
            known = [each for each in times if each is not None]
            assert known == sorted(known)
        assert all(each.start <= each.end <= found.facts.duration for each in found.phases)
        assert all(isinstance(each, ActionRecord) or each.t >= 0 for each in found.records)


@pytest.mark.parametrize(
    ("cue", "state"),
    [
        (Cue(at=1.0, source="wizard:anna"), "open"),
        (Cue(at=1.0, source="wizard:anna", task=3), "unheard"),  # its act was stopped before it spoke
        (Cue(at=1.0, source="wizard:anna", task=3, answered_at=2.0), "answered"),
        (Cue(at=1.0, source="wizard:anna", undone_at=2.0), "undone"),
    ],
)
def test_what_became_of_a_cue(cue: Cue, state: str) -> None:
    assert cue.state == state


@pytest.mark.parametrize(
    ("downtime", "wall", "told"),
    [
        (None, "10:00:10", 0.0),  # an engine that began again at once
        (None, "09:00:30", None),  # the computer began in the past
        (None, "", None),
        (0.0, "", 0.0),
        (12.5, "", 12.5),
    ],
)
def test_every_recovery_is_an_interruption(downtime: float | None, wall: str, told: float | None) -> None:
    """Also if nobody knows how long the session had no engine."""
    label = f"2026-11-29T{wall}.000+00:00" if wall else ""
    collector = OutageCollector()
    collector.add(NoteRecord(1, 10.0, "2026-11-29T10:00:10.000+00:00", "x", "engine"))
    found = collector.add(SessionRecord(2, 10.0, label, status="recovered", downtime=downtime))
    assert (found, len(collector.outages)) == (told, int(told is not None))
    assert interruption_between(collector.interruptions(), 5.0, 15.0) == "outage"


def test_a_clock_that_was_set_back_hides_no_outage(tmp_path: Path) -> None:
    """A computer without a battery for its clock begins in the past."""
    script = [(25.0, task("markCue", pressed=24.9)), act("Thanks", 30.0)]
    data = read_session(recovered_session(tmp_path, at=26.0, away=-3600.0, script=script))
    (told,) = [each for each in data.records if isinstance(each, SessionRecord) and each.status == "recovered"]
    assert (told.downtime, data.facts.downtime, data.facts.recoveries, data.outages) == (None, None, 1, ())
    assert (data.acts[0].response_interrupted, data.acts[0].answer_s) == ("outage", None)
    text = " ".join(" ".join(text_lines(session_report(data))).split())
    assert "recovered 1 time, without a running engine for an unknown time" in text
    assert "1 outage, of unknown length" in text


def test_two_outages_at_one_session_time_keep_their_lengths() -> None:
    """The second engine died before the session's time had gone on."""

    def record(seq: int, wall: str, status: Any, downtime: float | None = None) -> SessionRecord:
        return SessionRecord(seq=seq, t=5.0, wall=f"2026-11-24T09:{wall}+01:00", status=status, downtime=downtime)

    records = [record(1, "00:05", "started"), record(2, "03:25", "recovered"), record(3, "04:15", "recovered")]
    away, points = OutageCollector(), PointCollector()
    for each in records:
        points.add(each, away.add(each))
    assert [each.outage_s for each in points.points()] == [200.0, 50.0]
    assert [each.seconds for each in away.outages] == [200.0, 50.0]
    data = SimpleNamespace(records=records, facts=SessionFacts(session="x"))
    assert [at for at, _ in records_by_wall_clock(data)] == [5.0, 205.0, 255.0]  # type: ignore[arg-type]


def test_the_stop_before_the_end_is_nobodys_unless_something_did_not_stop() -> None:
    def collected(*records: StopRecord) -> list[tuple[str, str]]:
        collector = PointCollector()
        for record in records:
            collector.add(record)
        return [(point.name, point.value) for point in collector.points()]

    def stop(status: Any, source: str = "", unconfirmed: tuple[str, ...] = ()) -> StopRecord:
        return StopRecord(seq=1, t=1.0, wall="", status=status, source=source, unconfirmed=unconfirmed)

    by_anna = [stop("requested", "wizard:anna"), stop("latched"), stop("released", "wizard:anna")]
    before_end = [stop("requested", ENGINE), stop("latched")]
    assert collected(*by_anna, *before_end) == [("requested", ""), ("latched", ""), ("released", "")]
    assert collected(stop("requested", ENGINE), stop("latched", unconfirmed=("arms",))) == [
        ("latched", "not confirmed: arms")
    ]
