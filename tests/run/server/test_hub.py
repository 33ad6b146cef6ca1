"""Who may do what: the rules of control, one row each, on a real engine and without sockets."""

from __future__ import annotations

from typing import Any
from unicodedata import normalize

import pytest

from rise_engine.kernel.commands import CancelOpenGoals
from rise_engine.kernel.inputs import (
    CheckReport,
    Note,
    OutcomeReport,
    RecordingReport,
    RobotChanged,
    SessionRecovered,
    Submit,
    SyncMark,
)
from rise_engine.kernel.records import (
    AnyRecord,
    CheckRecord,
    ControlRecord,
    NoteRecord,
    OpenGoal,
    OutcomeRecord,
    RecordingRecord,
    SessionRecord,
    SyncRecord,
    TaskRecord,
)
from rise_engine.kernel.view import SessionView
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.run.protocol.client import ClientInput, JournalStatus, Rejected, Reply
from rise_engine.run.server.hub import AttachedClient, SessionHub
from rise_engine.run.server.process import _SessionProcess
from tests.run.engine.samples import GREETING, profile, scenario

REPORTS: dict[str, ClientInput] = {
    "checks": CheckReport(id="lights", result="passed", source="wizard:eve"),
    "records": RecordingReport(name="camera", status="running", source="wizard:eve"),
    "syncs": SyncMark(number=1, medium="sound", source="wizard:eve"),
    "judges": OutcomeReport(status="complete", source="wizard:eve"),
}


class HubSession:
    """A hub with an engine in virtual time, and what came of it."""

    def __init__(self, *, start: bool = True, **more: Any) -> None:
        clock = VirtualClock()
        self.engine = Engine(scenario(GREETING), make_robot(profile(), "debug", clock, 1, ()), clock, 1)
        self.hub = SessionHub(self.engine, **more)
        self.records: list[AnyRecord] = []
        self.hub.subscribe(self.records.append)  # type: ignore[arg-type]
        self.clients: dict[str, AttachedClient] = {}
        if start:
            self.engine.start()

    def does(self, what: str) -> str:
        """`anna attaches`, `bob takes`, `anna leaves`, `anna acts`, ...; gives the rejection, or nothing."""
        who, verb = what.split()
        role: Any = {"w": "wizard", "o": "observer", "n": "node"}[who[0]]
        answers: list[Reply] = []
        if verb == "attaches":
            self.clients[who] = self.hub.attach(who[1:], role)
            return ""
        client = self.clients[who]
        match verb:
            case "leaves":
                self.hub.detach(client)
                return ""
            case "takes" | "asks" | "gives" | "releases":
                self.hub.change_control(client, verb.removesuffix("s"), answers.append)  # type: ignore[arg-type]
            case "acts":
                task = Submit(function="startCommunicationRobotAct", behavior="Greet", source="wizard:eve")
                self.hub.submit(client, task, answers.append)
            case "stops":
                self.hub.submit(client, Submit(function="stopAll"), answers.append)
            case "frees":
                self.hub.submit(client, Submit(function="releaseStop"), answers.append)
            case "marks":
                self.hub.submit(client, Submit(function="markMistake", behavior="1 late"), answers.append)
            case "cues":
                self.hub.submit(client, Submit(function="markCue"), answers.append)
            case "notes":
                self.hub.submit(client, Note(text="x", source="wizard:eve"), answers.append)
            case "checks" | "records" | "syncs" | "judges":
                self.hub.submit(client, REPORTS[verb], answers.append)
            case "ends":
                self.hub.end_session(client, "", answers.append)
        (reply,) = answers
        assert reply.accepted or reply.reason, "a rejection says why"
        return "" if reply.accepted else reply.reason

    @property
    def control(self) -> list[tuple[str, str, str | None]]:
        return [(r.status, r.by, r.holder) for r in self.records if isinstance(r, ControlRecord)]


A, B, C = "wizard:a", "wizard:b", "wizard:c"
TAKEN = ("taken", A, A)

RULES: list[tuple[str, str, str, list[tuple[str, str, str | None]]]] = [
    # what they do, one after the other; why the last is rejected; the records
    ("who comes first has control", "wa attaches", "", [TAKEN]),
    ("the second does not", "wa attaches, wb attaches", "", [TAKEN]),
    ("an observer never has", "oa attaches, oa takes", "an observer never has control", []),
    ("nor asks", "wa attaches, oa attaches, oa asks", "an observer never has control", [TAKEN]),
    ("a program needs none", "na attaches, na takes", "a program needs no control", []),
    ("the holder acts", "wa attaches, wa acts", "", [TAKEN]),
    ("another does not", "wa attaches, wb attaches, wb acts", "wizard:a does; ask for it, or take it", [TAKEN]),
    ("an observer does not", "oa attaches, oa acts", "an observer only watches", []),
    ("a program does", "wa attaches, na attaches, na acts", "", [TAKEN]),
    ("everybody notes", "wa attaches, wb attaches, ob attaches, wb notes, ob notes", "", [TAKEN]),
    ("every wizard reports", "wa attaches, wb attaches, wb checks, wb records, wb syncs", "", [TAKEN]),
    ("programs report", "wa attaches, nb attaches, nb checks, nb records, nb syncs", "", [TAKEN]),
    ("an observer reports no checks", "wa attaches, ob attaches, ob checks", "an observer reports nothing", [TAKEN]),
    ("nor recordings", "wa attaches, ob attaches, ob records", "an observer reports nothing", [TAKEN]),
    ("nor marks for them", "wa attaches, ob attaches, ob syncs", "an observer reports nothing", [TAKEN]),
    ("the holder judges", "wa attaches, wb attaches, wa judges", "", [TAKEN]),
    ("another does not judge", "wa attaches, wb attaches, wb judges",
     "only the wizard who holds control can say how the session counts", [TAKEN]),
    ("an observer does not", "wa attaches, ob attaches, ob judges", "an observer cannot say how the session counts",
     [TAKEN]),
    ("a program judges", "wa attaches, nb attaches, nb judges", "", [TAKEN]),
    ("anybody judges while nobody has control", "wa attaches, wa releases, wa judges", "",
     [TAKEN, ("released", A, None)]),
    ("everybody marks mistakes", "wa attaches, wb attaches, ob attaches, wa acts, wb marks, ob marks", "", [TAKEN]),
    ("a cue is for who has control", "wa attaches, wb attaches, wa cues, wb cues", "you do not hold control", [TAKEN]),
    ("or a program", "wa attaches, nb attaches, nb cues", "", [TAKEN]),
    ("an observer stops everything", "wa attaches, oa attaches, oa stops", "", [TAKEN]),
    ("a wizard without control too", "wa attaches, wb attaches, wb stops", "", [TAKEN]),
    ("but does not free", "wa attaches, wb attaches, wb stops, wb frees", "you do not hold control", [TAKEN]),
    ("anybody takes", "wa attaches, wb attaches, wb takes, wb acts", "", [TAKEN, ("taken", B, B)]),
    ("then the other cannot act", "wa attaches, wb attaches, wb takes, wa acts", "wizard:b does",
     [TAKEN, ("taken", B, B)]),
    ("taking what one has", "wa attaches, wa takes", "", [TAKEN]),
    ("asking is shown", "wa attaches, wb attaches, wb asks", "", [TAKEN, ("asked", B, A)]),
    ("and gives nothing yet", "wa attaches, wb attaches, wb asks, wb acts", "wizard:a does", [TAKEN, ("asked", B, A)]),
    ("asking twice is asking once", "wa attaches, wb attaches, wb asks, wb asks", "", [TAKEN, ("asked", B, A)]),
    ("asking oneself", "wa attaches, wa asks", "", [TAKEN]),
    ("asking nobody is taking", "wa attaches, wa releases, wa asks", "", [TAKEN, ("released", A, None), TAKEN]),
    ("giving", "wa attaches, wb attaches, wb asks, wa gives, wb acts", "", [TAKEN, ("asked", B, A), ("given", A, B)]),
    ("giving to the latest", "wa attaches, wb attaches, wc attaches, wc asks, wb asks, wa gives", "",
     [TAKEN, ("asked", C, A), ("asked", B, A), ("given", A, B)]),
    ("giving unasked", "wa attaches, wb attaches, wa gives", "nobody has asked", [TAKEN]),
    ("giving what one has not", "wa attaches, wb attaches, wb gives", "control: wizard:a does", [TAKEN]),
    ("releasing", "wa attaches, wa releases, wa acts", "no wizard holds it; take it", [TAKEN, ("released", A, None)]),
    ("releasing what one has not", "wa attaches, wb attaches, wb releases", "you do not hold control", [TAKEN]),
    ("no longer asking", "wa attaches, wb attaches, wb asks, wb releases, wa gives", "nobody has asked",
     [TAKEN, ("asked", B, A), ("released", B, A)]),
    ("free for who comes", "wa attaches, wa releases, wb attaches, wb acts", "",
     [TAKEN, ("released", A, None), ("taken", B, B)]),
    ("the holder leaves", "wa attaches, wb attaches, wa leaves, wb acts", "no wizard holds it; take it",
     [TAKEN, ("released", A, None)]),
    ("the holder leaves one who asked", "wa attaches, wb attaches, wb asks, wa leaves, wb acts", "",
     [TAKEN, ("asked", B, A), ("given", A, B)]),
    ("the asker leaves", "wa attaches, wb attaches, wb asks, wb leaves, wa gives", "nobody has asked",
     [TAKEN, ("asked", B, A), ("released", B, A)]),
    ("others leave", "wa attaches, wb attaches, oc attaches, wb leaves, oc leaves, wa acts", "", [TAKEN]),
    ("the holder comes back", "wa attaches, wa leaves, wa attaches, wa acts", "",
     [TAKEN, ("released", A, None), TAKEN]),
    ("the holder ends", "wa attaches, wa ends", "", [TAKEN]),
    ("another does not end", "wa attaches, wb attaches, wb ends", "only the wizard who holds control can end", [TAKEN]),
    ("an observer does not end", "oa attaches, oa ends", "cannot end", []),
    ("a program ends", "wa attaches, na attaches, na ends", "", [TAKEN]),
    ("anybody ends what nobody holds", "wa attaches, wb attaches, wa releases, wb ends", "",
     [TAKEN, ("released", A, None)]),
]  # fmt: skip


@pytest.mark.parametrize(("deeds", "reason", "control"), [row[1:] for row in RULES], ids=[row[0] for row in RULES])
def test_rules_of_control(deeds: str, reason: str, control: list[Any]) -> None:
    played = HubSession(end=lambda reason: None)
    *before, last = deeds.split(", ")
    for deed in before:
        assert played.does(deed) == "", deed
    rejection = played.does(last)
    assert (reason in rejection) if reason else rejection == ""
    assert played.control == control
    folded = SessionView()
    for record in played.records:
        folded.apply(record)
    assert folded == played.hub.view and folded.control == (control[-1][2] if control else None)


def test_after_a_standstill_of_the_engine_nothing_starts_that_was_asked_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """What waited in the sockets comes when the engine goes on; stops, marks and remarks of that time still count."""
    now = [100.0]
    for clock in ("monotonic", "time"):
        monkeypatch.setattr(f"rise_engine.run.server.hub.{clock}", lambda: now[0])
    played = HubSession()
    for deed in ("wa attaches", "nb attaches", "wa acts"):
        assert played.does(deed) == ""
    played.hub.note_alive()
    now[0] += 4.9
    assert played.does("wa acts") == ""
    played.hub.note_alive()
    now[0] += 12.0
    for deed in ("wa acts", "nb acts", "wa cues", "wa frees"):
        assert "the engine stood still, and this may have been asked before: ask again" in played.does(deed), deed
    for deed in ("wa stops", "wa marks", "wa notes", "wa checks"):
        assert played.does(deed) == "", deed
    played.hub.note_alive()
    now[0] += 0.9
    assert "ask again" in played.does("wa frees"), "one of several messages that waited"
    now[0] += 0.2
    assert "the robot has not answered the stop yet" in played.does("wa frees"), "the kernel was asked"
    told = [(record.text, record.stood) for record in played.records if isinstance(record, NoteRecord)]
    assert told == [("the engine stood still for 12 s: what happened then is recorded late", 12.0), ("x", None)]


def test_control_that_lets_acts_begin_is_not_taken_by_a_key_from_before_a_standstill(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In a session that waits for a wizard, it begins as much as a start does."""
    now = [100.0]
    monkeypatch.setattr("rise_engine.run.server.hub.monotonic", lambda: now[0])
    played = HubSession(start=False)
    played.engine.accept(SessionRecovered(waits_for_wizard=True))
    played.does("wa attaches")
    played.does("nb attaches")
    played.does("nb acts")
    played.hub.note_alive()
    now[0] += 60.0
    for deed in ("wa takes", "wa asks"):
        assert "the engine stood still" in played.does(deed), deed
    now[0] += 1.1
    played.engine.journal_status = JournalStatus(behind=3.0)
    assert "the disk has not recorded anything for 3 s" in played.does("wa takes")
    assert not played.hub.view.running
    played.engine.journal_status = JournalStatus()
    assert played.does("wa takes") == "" and played.hub.view.running
    played.hub.note_alive()
    now[0] += 60.0
    played.does("wc attaches")
    assert played.does("wc takes") == "", "from then on, it begins nothing"


def test_a_stop_does_not_wait_for_the_beginning_of_a_session() -> None:
    """On a full disk the first record may take long, and an earlier engine may have left something on the robot."""
    played = HubSession(start=False)
    played.does("wa attaches")
    assert played.does("wa acts") == "the session has not begun yet"
    assert played.does("wa stops") == ""


def test_nothing_starts_while_the_disk_is_behind() -> None:
    """Else people press the key again and again, and the robot does it that often."""
    played = HubSession()
    assert played.does("wa attaches") == ""
    for behind, reason in (
        (2.0, ""),
        (3.4, "the disk has not recorded anything for 3 s: ask again once it records again"),
    ):
        played.hub.engine.journal_status = JournalStatus(behind=behind)
        assert reason in played.does("wa acts")
    for deed in ("wa stops", "wa marks", "wa notes"):
        assert played.does(deed) == "", deed


def test_after_a_suspend_of_the_computer_nothing_starts_that_was_asked_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """The monotonic clock stands still then, and the time of day fits afterwards."""
    suspended = [50.0]
    monkeypatch.setattr("rise_engine.run.server.hub.suspended_seconds", lambda: suspended[0])
    monkeypatch.setattr("rise_engine.run.server.hub.monotonic", lambda: 100.0)
    monkeypatch.setattr("rise_engine.run.server.hub.time", lambda: 1000.0 + suspended[0])
    played = HubSession()
    assert played.does("wa attaches") == ""
    played.hub.note_alive()
    suspended[0] += 3600
    assert "ask again" in played.does("wa acts")
    played.hub.note_alive()
    told = [(note.text, note.stood, note.suspended) for note in played.records if isinstance(note, NoteRecord)]
    assert told == [("the computer was suspended for 3600 s: session time stood still", 3600.0, True)]


def test_a_step_of_the_computers_clock_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0, 5000.0]
    monkeypatch.setattr("rise_engine.run.server.hub.monotonic", lambda: now[0])
    monkeypatch.setattr("rise_engine.run.server.hub.time", lambda: now[1])
    played = HubSession()
    for passed, step in ((0.0, 0.0), (0.5, 0.5), (0.5, 0.4), (0.5, -3599.5), (0.5, 60.5), (0.5, 0.5)):
        now[0] += passed
        now[1] += step
        played.hub.note_alive()
    told = [record.text for record in played.records if isinstance(record, NoteRecord)]
    assert told == [
        f"the clock of this computer was set {how}: times of day do not fit from here on"
        for how in ("back by 3600 s", "forward by 60 s")
    ]


def test_reports_name_the_person_whatever_a_client_writes() -> None:
    played = HubSession()
    for deed in ("wanna attaches", "wanna checks", "wanna records", "wanna syncs", "wanna judges"):
        assert played.does(deed) == ""
    reports = [r for r in played.records if isinstance(r, CheckRecord | RecordingRecord | SyncRecord | OutcomeRecord)]
    assert len(reports) == 4 and {report.source for report in reports} == {"wizard:anna"}


def test_the_record_names_the_person_and_control_the_console() -> None:
    played = HubSession()
    first, second = played.hub.attach("anna", "wizard"), played.hub.attach("anna", "wizard")
    assert (first.name, second.name) == ("wizard:anna", "wizard:anna#2")
    answers: list[Reply] = []
    played.hub.change_control(second, "take", answers.append)
    played.hub.submit(
        second, Submit(function="startCommunicationRobotAct", behavior="Greet", source="x"), answers.append
    )
    played.hub.submit(first, Note(text="hm", source="x"), answers.append)
    assert all(reply.accepted for reply in answers) and answers[1].task == 1
    assert played.hub.view.control == "wizard:anna#2"
    assert {r.source for r in played.records if isinstance(r, TaskRecord | NoteRecord)} == {"wizard:anna"}
    assert played.hub.attach("anna", "observer").name == "observer:anna"


def test_the_name_of_the_wizard_lasts_when_their_console_has_gone() -> None:
    it = HubSession()
    assert it.hub.summary().wizard == ""
    for deed in ("wanna attaches", "oben attaches", "wanna leaves"):
        it.does(deed)
    assert (it.hub.summary().control, it.hub.summary().wizard) == (None, "anna")
    for deed in ("wanna attaches", "wbob attaches", "wbob takes", "wbob leaves"):
        it.does(deed)
    assert it.hub.summary().wizard == "bob"
    again = SessionHub(it.engine, view=it.hub.view)  # of an engine that goes on with the session
    assert again.summary().wizard == "bob"


@pytest.mark.parametrize(
    ("there", "comes", "why"),
    [
        ("anna", "\u0430nna", "mixes Cyrillic and Latin letters"),
        ("anna", "\uff41nna", "looks like 'anna'"),  # a full-width letter
        ("cope", "\u0441\u043e\u0440\u0435", "looks like 'cope'"),  # all Cyrillic
        ("max1", "maxl", "looks like 'max1'"),
        ("anna", "ann\u200da", "characters that cannot be shown"),
        ("anna", "anna\u3164", "characters that cannot be shown"),
        ("Ivo", "lvo", "looks like 'Ivo'"),
    ],
)
def test_nobody_comes_under_a_name_that_looks_like_another_one(there: str, comes: str, why: str) -> None:
    for role in ("wizard", "observer"):
        it = HubSession()
        it.hub.attach(there, "wizard")
        with pytest.raises(Rejected, match=why):
            it.hub.attach(comes, role)  # type: ignore[arg-type]


def test_a_name_stays_taken_when_its_owner_has_gone_and_after_the_engine_has() -> None:
    it = HubSession()
    it.hub.detach(it.hub.attach("cope", "wizard"))
    with pytest.raises(Rejected, match="a name in this session's record"):
        it.hub.attach("\u0441\u043e\u0440\u0435", "wizard")
    again = SessionHub(it.engine, view=it.hub.view)
    with pytest.raises(Rejected, match="looks like 'cope'"):
        again.attach("\u0441\u043e\u0440\u0435", "wizard")
    assert again.attach("cope", "wizard").name == "wizard:cope"


@pytest.mark.parametrize(
    "name",
    [
        "anna",
        "\u0410\u043d\u043d\u0430",
        "\u0386\u03bd\u03bd\u03b1",
        "José Müller",
        "Grün",
        "李雷",
        "max 1",
        "gaze-tracker_2",
    ],
)
def test_names_of_all_scripts_are_names(name: str) -> None:
    it = HubSession()
    assert it.hub.attach(name, "wizard").source == f"wizard:{normalize('NFC', name)}"
    it.hub.attach(normalize("NFD", name), "wizard")  # written on another system: the same person


def test_nothing_comes_before_the_session() -> None:
    """Consoles may attach while the engine is still to start; the session's first record is its own."""
    played = HubSession(start=False)
    played.does("wa attaches")
    played.does("wb attaches")
    assert "not begun" in played.does("wa acts") and "not begun" in played.does("wb takes")
    assert played.records == []
    played.engine.start()
    assert isinstance(played.records[0], SessionRecord)
    assert played.control == [TAKEN]
    assert played.does("wa acts") == ""


def test_who_held_control_when_the_engine_died_does_not_hold_it_for_ever() -> None:
    for comes, control in ((False, [("released", "wizard:z", None)]), (True, [TAKEN])):
        played = HubSession(start=False, view=SessionView(control="wizard:z"))
        if comes:
            played.does("wa attaches")
        played.engine.start()
        assert played.control == control


def test_who_attaches_to_a_session_that_waits_for_a_wizard_has_to_take_control() -> None:
    """Otherwise the robot would begin before anybody has seen with what."""
    played = HubSession(start=False, view=SessionView(control="wizard:z"))
    played.does("wa attaches")
    played.engine.accept(SessionRecovered(waits_for_wizard=True))
    played.does("wb attaches")
    assert played.control == [("released", "wizard:z", None)] and played.hub.view.waits_for_wizard
    assert "no wizard holds it; take it" in played.does("wb acts") and played.does("wb stops") == ""
    assert played.does("wa takes") == ""
    assert played.control[1:] == [TAKEN] and not played.hub.view.waits_for_wizard
    played.does("wa leaves")
    played.does("wc attaches")
    assert played.control[-1] == ("taken", C, C), "once it goes on, as ever"


class Recovered(_SessionProcess):
    """An engine that has found on the robot what an earlier one has left, and no more of its process."""

    def __init__(self, played: HubSession) -> None:
        self.hub, self.engine, self.looks = played.hub, played.engine, []  # type: ignore[var-annotated]
        played.engine.accept(SessionRecovered(waits_for_wizard=True))
        played.engine.post(RobotChanged(status="degraded", open=(OpenGoal("base", "1/1", "Drive", "no answer"),)))
        self.hub.on_wizards_gone = self._schedule_goal_cancel
        self._schedule_goal_cancel()

    def _schedule_goal_cancel(self) -> None:
        self.looks.append(self._cancel_earlier_goals)

    def look(self) -> None:
        self.looks.pop()()


@pytest.mark.parametrize(
    ("before", "after", "is_cancelled"),
    [
        ("", "", True),
        ("wa attaches", "", False),
        ("wa attaches", "wa leaves", True),  # undecided
        ("wa attaches", "wa takes, wa leaves", True),
        ("wa attaches, wb attaches", "wa leaves", False),
        ("wa attaches", "wa takes, wa keeps, wa leaves", False),
        ("wa attaches, wa takes, wa keeps", "wa leaves", False),
    ],
)
def test_what_an_earlier_engine_left_is_cancelled_when_nobody_is_there_who_decides(
    monkeypatch: pytest.MonkeyPatch, before: str, after: str, is_cancelled: bool
) -> None:
    played = HubSession(start=False)
    process = Recovered(played)
    asked: list[object] = []
    monkeypatch.setattr(played.engine._commands, "run", asked.append)  # this robot knows no open goals

    def does(deeds: str) -> None:
        for deed in filter(None, deeds.split(", ")):
            assert deed == "wa keeps" or played.does(deed) == ""
            if deed == "wa keeps":  # the robot says that nothing holds it any more
                played.engine.post(RobotChanged(status="connected"))

    does(before)
    process.look()
    does(after)
    if process.looks:
        process.look()
    assert (CancelOpenGoals("") in asked) is is_cancelled


def test_while_nothing_can_be_recorded_control_stays_and_who_goes_is_recorded_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    played = HubSession()
    for deed in ("wa attaches", "wb attaches"):
        played.does(deed)
    with monkeypatch.context() as patch:

        def rejects(fact: object, answer: Any) -> None:
            answer(Reply(False, "nothing can be recorded"))

        patch.setattr(played.engine, "accept", rejects)
        assert played.does("wb takes") == "nothing can be recorded"
        assert played.does("wb asks") == "nothing can be recorded"
    assert "wizard:a does" in played.does("wb acts")
    assert played.does("wb asks") == "" and played.does("wa acts") == ""


def test_after_the_end_nobody_attaches() -> None:
    played = HubSession()
    played.engine.end("done")
    with pytest.raises(Rejected, match="has ended"):
        played.does("wa attaches")
    assert played.hub.view.end_reason == "done"


def test_a_listener_that_fails_hurts_nobody(caplog: pytest.LogCaptureFixture) -> None:
    played = HubSession()

    def fails(update: object) -> None:
        raise ValueError("a mistake")

    played.hub.subscribe(fails)
    played.does("wa attaches")
    assert played.hub.view.control == A and "a listener failed" in caplog.text
