"""The screen of a study: who is next, what would run, checks, the session, its outcome, the next participant."""

from __future__ import annotations

from threading import Event

import pytest
from msgspec.structs import replace
from textual import events
from textual.widgets import Input, Static

from rise_engine.kernel.inputs import OutcomeReport
from rise_engine.kernel.records import OpenGoal
from rise_engine.run.protocol.client import EngineGone, Role
from rise_engine.scenario.model import KeyBinding, SourceLocation
from rise_engine.study.model import (
    AssignmentSettings,
    PlannedRun,
    RecorderSettings,
    RecordingSettings,
)
from rise_tui.config.key_file import KeyFile
from rise_tui.config.launch import SessionRequest, StudyNow
from rise_tui.console.app import ConsoleApp
from rise_tui.console.screen import ConsoleScreen
from rise_tui.console.study_dialogs import plan_lines
from rise_tui.console.study_screen import StudyScreen
from rise_tui.model.study_rows import conditions_of, find_participant
from rise_tui.rendering.text import plain_text
from rise_tui.screens.checks import ChecksScreen
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.help import HelpScreen
from rise_tui.screens.palette import Palette
from rise_tui.screens.reading import ReportScreen
from rise_tui.screens.session_forms import EndSessionDialog, OutcomeDialog, RehearsalDialog, WizardNameDialog
from tests.tui.fake import DEMO, FakeClient, FakeLauncher, demo
from tests.tui.fake_study import FakeStudy, entry, pending, person, standing, study
from tests.tui.study_days import Day, day

# --- what is shown ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_who_is_next_is_selected_and_the_lists_follow_the_study() -> None:
    async with day(size=(80, 24)) as at:
        lists = at.screen.lists
        assert lists.people.current_id == "P07" and "next: P07" in lists.people_head.text
        assert "REAL" in at.screen.head.text and "wizard anna" in at.screen.head.text
        assert "2 of 24 complete" in lists.beside_head.text and "recorded by" not in at.screen.head.text
        for focused in (lists.beside, lists.people):
            await at.press("tab")
            assert at.app.focused is focused
        await at.pilot.resize_terminal(200, 50)
        await at.select("P01")
        at.screen.draw()
        assert "A+loud" in lists.beside.text, "in a wide terminal the participant is beside the list"
        before, recorded = at.source.loads, at.source.now.study
        assert recorded is not None
        camera = RecordingSettings((RecorderSettings("camera", "obs"),))
        at.source.now = replace(at.source.now, study=replace(recorded, recording=camera))
        await at.press("ctrl+r")  # reads it again
        await at.until(lambda: at.source.loads > before and "recorded by camera (obs)" in at.screen.head.text)
        people = (person(1, "running", sessions=(entry("P01", status="running", outcome=None),)), person(2, "waiting"))
        at.source.change(standing=standing(participants=people, next=""))
        await at.until(lambda: "► running" in lists.people.text)
        await at.until(lambda: "no participant can begin now" in lists.people_head.text)
        done = standing(participants=(person(1, "complete"), person(2, "complete")), next="", complete=2, wanted=2)
        at.source.change(study=study(n=2), standing=done)
        await at.until(lambda: "the study is complete" in lists.people_head.text)


@pytest.mark.slow
async def test_participants_are_found_by_typing_and_help_and_palette_know_this_screen() -> None:
    async with day() as at:
        lists = at.screen.lists
        await at.press("slash")
        await at.type("in progress")
        assert lists.people.count == 1 and "find in progress  1 of 10" in lists.people_head.text
        await at.press("enter")
        assert lists.selected is not None and lists.selected.participant == "P07"
        await at.press("escape")
        assert lists.people.count == 10
        await at.press("slash")
        await at.type("zzz")
        assert "nothing matches" in lists.people.text
        await at.press("escape")
        assert lists.people.count == 10 and at.app.focused is lists.people
        await at.press("question_mark")
        shown = await at.shows(HelpScreen)
        assert "Rehearse" in shown.list.text and "no outcome" in shown.list.text
        await at.press("escape")
        await at.press("colon")
        await at.shows(Palette)
        await at.type("say who")
        await at.press("enter")
        await at.shows(WizardNameDialog)


@pytest.mark.slow
async def test_a_hidden_study_shows_no_condition_before_its_session() -> None:
    hidden = study(assignment=AssignmentSettings(strata=("language",), hidden=True))
    async with day(FakeStudy(StudyNow(hidden, standing(), after=pending("after")))) as at:
        assert "hidden" in at.screen.lists.beside.text
        await at.press("r")
        rehearsal = await at.shows(RehearsalDialog)
        assert "their own condition" not in rehearsal.list.text and "hesitation: A, noise: quiet" in rehearsal.list.text
        await at.press("enter")
        await at.shows(ChecksScreen)
        assert at.source.planned[0].condition == "yes+quiet"
        await at.press("escape", "enter")
        plan = await at.shows(ChecksScreen)
        assert "hidden until the session begins" in plan.list.text
        assert not any(word in plan.list.text for word in ("quiet", "loud", "A+"))
        await at.press("escape")
        await at.select("P05")
        await at.press("enter")
        question = await at.shows(Dialog)
        assert "quiet" not in f"{question._title} {question._lines}"
        await at.press("escape")
        await at.select("P07")
        await at.begin()
        assert at.app.console_screen is not None
        await at.until(lambda: "P07 run 2 · A+loud" in at.app.console_screen.bars.status_line.text)  # type: ignore[union-attr]


@pytest.mark.slow
async def test_a_study_that_does_not_load_shows_its_findings_and_starts_nothing_until_it_is_mended() -> None:
    finding = "study.toml:14:1: error: there is no key `scenerio` here; did you mean `scenario`?"
    source = FakeStudy(StudyNow(None, None, (finding,)))
    async with day(source) as at:
        people = at.screen.lists.people
        assert "nothing can be started" in people.text and "`scenerio`" in people.text
        await at.press("enter")
        assert "the study does not load" in at.notice and source.planned == []
        await at.press("r")
        assert isinstance(at.top, StudyScreen)
        running = (person(1, "running", sessions=(entry("P01", status="running", outcome=None),)), person(2, "waiting"))
        source.change(study=study(), standing=standing(participants=running, next=""), problems=())
        await at.until(lambda: people.current_id == "P01", "it was not read again")
        done = (person(1, "to-go-on", sessions=(entry("P01"),)), person(2, "waiting"))
        source.change(standing=standing(participants=done, next="P02"))
        await at.until(lambda: people.current_id == "P02", "a session has ended elsewhere")
        source.change(standing=standing(participants=done, next="P01"))
        await at.until(lambda: "next: P01" in at.screen.lists.people_head.text)
        assert people.current_id == "P02"  # nobody is moved under the wizard's hand


# --- what would run, and why not --------------------------------------------------------------------------------------

NOT_RECORDED = "nothing is recorded: P07 has not consented to it (consent_recording of participants.csv has no date)"


def plan_of(source: FakeStudy, participant: str = "P07") -> list[str]:
    """What is shown before a session."""
    plan = source.plan(SessionRequest(participant), "anna")
    each = find_participant(standing(), participant)
    return [plain_text(line).strip() for line in plan_lines(plan, each, conditions_of(study()), "anna")]


def test_what_would_run_is_said_in_full() -> None:
    shown = "\n".join(plan_of(FakeStudy()))
    for piece in (
        *(
            "P07 · run 2 of 2",
            "hesitation: A, noise: loud",
            "REAL",
            "pepper",
            "LabLinking: setting the table",
            "yes, slot 7",
        ),
        *("/home/lab/lablinking/sessions", "anna", "consent, lights, door, disk, tracker"),
        "run 1 · ✓ complete · A+quiet · 2026-11-21 14:15 · 24:10",
    ):
        assert piece in shown, piece


@pytest.mark.parametrize(
    ("recorders", "unrecorded", "lines"),
    [
        ("camera (obs), bag (rosbag2)", "", ["recorded by  camera (obs), bag (rosbag2)"]),
        (
            "markers on LSL",
            NOT_RECORDED,
            [
                "recorded by  markers on LSL",
                "nothing is recorded: P07 has not consented to it",
                "(consent_recording of participants.csv has no date)",
            ],
        ),
        ("", "", []),
    ],
)
def test_what_records_the_session_besides_and_why_not(recorders: str, unrecorded: str, lines: list[str]) -> None:
    source = FakeStudy()
    source.recorders, source.unrecorded = recorders, unrecorded
    assert [line for line in plan_of(source) if line.startswith(("recorded by", "nothing is", "(consent_"))] == lines


def test_what_the_robot_does_is_said_before_a_real_session() -> None:
    source = FakeStudy()
    assert "mode         REAL  the robot moves" in plan_of(source)
    source.simulated, source.warnings = True, ("F9 cannot stop Speech: keep a hand on the robot's own switch",)
    shown = plan_of(source)
    assert "mode         REAL  no robot moves" in shown
    assert "F9 cannot stop Speech: keep a hand on the robot's own switch" in " ".join(shown)


def test_who_is_out_of_turn_and_in_which_language() -> None:
    source = FakeStudy()
    source.language, source.warning = "de", "P07 (en) is next; you are about to open P08 (de)"
    shown = "\n".join(plan_of(source, "P08"))
    assert "out of turn  P07 (en) is next; you are about to open P08 (de)" in shown
    assert "P08 · run 2 of 2   language de" in shown


@pytest.mark.slow
async def test_enter_says_what_would_run_and_esc_leaves_it() -> None:
    async with day(participant="P10") as at:
        assert at.screen.lists.people.current_id == "P10", "who was named is selected"
        await at.select("P07")
        at.source.recorders, at.source.unrecorded = "markers on LSL", NOT_RECORDED
        for size in ((120, 40), (80, 24)):
            await at.pilot.resize_terminal(*size)
            await at.press("enter")
            plan = await at.shows(ChecksScreen)
            assert "P07 · run 2 of 2" in plan.list.text and at.source.checked == []
            box = plan.query_one("#box").region
            assert box.height <= size[1] and plan.answer_line.region.bottom < box.bottom
            await at.press("escape")
            await at.gone_back()
            assert at.source.started == [] and "nothing has been started for P07" in at.notice


@pytest.mark.slow
async def test_who_cannot_begin_is_told_why() -> None:
    keys = KeyFile(keys={"cue": ("g",)}, locations={("cue", "g"): SourceLocation("keys.toml", 2, 7)})
    async with day(keys=keys, participant="p07") as at:
        assert "there is no participant 'p07' in participants.csv; did you mean `P07`?" in at.notice
        for participant, said in (
            ("P09", "consent_recording"),
            ("P01", "P01: complete; no run is left"),
            ("P03", "fire alarm"),
            ("P04", "P04: withdrawn"),
        ):
            await at.select(participant)
            await at.press("enter")
            assert said in at.notice and at.top is at.screen and at.source.planned == []
        await at.select("P07")
        loads, at.source.refusal = at.source.loads, "study.toml was changed since the plan was made"
        await at.press("enter")
        await at.until(lambda: "study.toml was changed" in at.notice and at.source.loads > loads)
        assert at.top is at.screen
        at.source.refusal = ""
        at.source.keys = {"g": KeyBinding("g", "g", "startCommunicationRobotAct", "Greet", SourceLocation("s", 1))}
        await at.press("enter")
        await at.until(lambda: "`g` is given to `cue`" in at.notice, "keys of the user's own that the scenario has too")
        assert at.top is at.screen and at.source.started == []


# --- checks -----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_checks_run_by_themselves_and_asked_ones_wait_for_an_answer() -> None:
    async with day() as at:
        screen = await at.checks()
        await at.press("y", "escape")
        await at.gone_back()
        assert at.source.started == [], "leaving the checks starts nothing"
        at.source.checked.clear()
        at.source.noted.clear()
        screen = await at.checks()
        assert sorted(at.source.checked) == ["consent", "disk", "door", "lights", "tracker"]
        assert at.source.most_at_once == 1  # a robot that speaks and a program that listens are not one check
        assert "lights and door: answer with y or n" in at.text_of(screen) and screen.list.current_id == "lights"
        await at.press("enter")
        assert "not yet: lights and door" in at.text_of(screen) and at.source.started == []
        for _ in range(8):  # held down
            await at.pilot.press("y")
            await at.pilot.pause(0.03)
        assert [item.status for item in screen.checks.items if item.check.ask] == ["passed", "asked"]
        assert screen.list.current_id == "door"
        await at.pilot.pause(1)
        await at.press("y")
        assert "enter: begin the session of P07 in REAL" in at.text_of(screen)
        for _ in range(5):
            await at.pilot.press("enter")
        await at.shows(ConsoleScreen)
        ((request, reports, wizard),) = at.source.started
        assert (request.participant, request.purpose, wizard) == ("P07", "counted", "anna")
        assert {each.result for each in reports} == {"passed"} and len(reports) == 5
        assert ("lights", "passed") in at.source.noted and ("disk", "passed") in at.source.noted


@pytest.mark.slow
async def test_a_failed_check_blocks_is_made_again_or_skipped_with_a_reason() -> None:
    source = FakeStudy()
    source.results = {"tracker": "no answer from 10.0.0.7", "consent": "consent_recording has no date"}
    async with day(source) as at:
        screen = await at.checks()
        screen.list.select("consent")
        await at.press("s")
        assert "consent cannot be skipped" in at.text_of(screen) and not screen.reason_bar.is_open
        await at.press("y")
        assert "checked automatically" in at.text_of(screen)
        del source.results["consent"]
        await at.press("r")
        screen.list.select("lights")
        await at.press("n")
        assert ("lights", "failed") in source.noted
        await at.press("y", "y", "enter")  # an answer of no can be taken back
        assert "not yet: tracker failed" in at.text_of(screen) and screen.list.current_id == "tracker"
        await at.press("s", "enter")
        assert "give a reason for skipping a check" in at.text_of(screen) and source.started == []
        await at.type("it is broken")
        await at.press("enter")
        source.held, source.refusal = Event(), "the study changed while the session was prepared: try again"
        await at.press("enter")
        await at.until(lambda: bool(source.started))
        source.held.set()
        await at.until(lambda: "the study changed while" in at.notice, "an engine that refuses says why")
        assert at.top is at.screen and at.app.console_screen is None
        report = source.started[0][1][-1]
        assert (report.id, report.result, report.reason) == ("tracker", "skipped", "it is broken")
        source.held, source.refusal = None, ""
        source.change(study=study(checks=()))
        await at.press("enter")
        screen = await at.shows(ChecksScreen)
        assert "enter: begin the session of P07 in REAL" in screen.answer_line.text, "without checks enter begins"
        await at.press("enter")
        await at.shows(ConsoleScreen)


# --- who sits here ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_the_name_is_asked_once_and_kept() -> None:
    async with day(wizard="") as at:
        assert "no wizard named yet" in at.screen.head.text
        await at.press("enter")
        await at.shows(WizardNameDialog)
        await at.press("escape")
        await at.gone_back()
        assert at.source.planned == []
        await at.press("enter")
        question = await at.shows(WizardNameDialog)
        assert question.field.value == ""  # a login is nobody's name in a real session
        await at.press("enter")
        assert "enter a name" in str(question.query_one("#answer", Static).content)
        await at.type("bea")
        await at.press("enter")
        await at.shows(ChecksScreen)
        await at.press("escape")
        assert "wizard bea" in at.screen.head.text
        await at.press("enter")
        await at.shows(ChecksScreen)


async def test_a_real_study_offers_its_wizards_and_in_debug_mode_the_login_is_offered() -> None:
    source = FakeStudy(StudyNow(study(mode="debug"), standing()))
    async with day(source, wizard="") as at:
        await at.press("w")
        assert (await at.shows(WizardNameDialog)).field.value == "root"
        await at.press("escape")
        source.change(study=study(wizards={"anna": "W1", "ben": "W2"}))
        await at.until(lambda: "REAL" in at.screen.head.text)
        await at.press("w")
        question = await at.shows(WizardNameDialog)
        await at.press("up", "right")
        assert question.field.value == "anna"
        await at.press("enter", "enter")
        await at.gone_back()
        assert "wizard anna" in at.screen.head.text


# --- rehearsals -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_a_rehearsal_takes_no_slot_asks_no_outcome_and_comes_back() -> None:
    source = FakeStudy()
    source.results = {"tracker": "not set"}
    async with day(source) as at:
        await at.press("r")
        await at.shows(RehearsalDialog)
        await at.press("right", "right", "down", "enter")
        plan = await at.shows(ChecksScreen)
        assert "no: pilot" in plan.list.text and source.planned[0].condition == "yes+quiet"
        await at.press("enter")
        await at.until(lambda: "answer with y or n" in at.text_of(plan))
        await at.press("y", "n")
        assert "enter: begin the pilot session" in at.text_of(plan), "no check is in its way"
        await at.press("escape", "r")
        await at.shows(RehearsalDialog)
        await at.press("enter")
        plan = await at.shows(ChecksScreen)
        assert "no: debug" in plan.list.text and "DEBUG" in plan.list.text
        assert "enter: begin the debug session of P07 in DEBUG" in plan.answer_line.text
        await at.press("enter")
        await at.shows(ConsoleScreen)
        assert at.source.started[0][0].purpose == "debug"
        await at.ask_to_end()
        await at.shows(EndSessionDialog)
        await at.says_end()
        await at.leave_report()
        assert at.client.closed == [True] and at.client.reports == []
        assert "it does not count" in at.notice


# --- the end of a session, and the next participant -------------------------------------------------------------------


@pytest.mark.slow
async def test_a_session_ends_with_its_outcome_and_the_next_participant_is_selected() -> None:
    client = FakeClient(demo(), folder="/home/lab/lablinking/sessions/2026_P07")
    client.rule("Main", "entered", "waiting")
    client.act("Greet")
    async with day(FakeStudy(client=client)) as at:
        await at.press("slash")
        await at.type("in progress")
        await at.press("enter")
        await at.begin()
        await at.ask_to_end()
        question = await at.answer_debrief()
        said = "\n".join([str(question.query_one("#box").border_title), *question._lines])
        for piece in ("End the session of P07 run 2 · A+loud?", "rule Main: in waiting", "act Greet"):
            assert piece in said
        for size in ((120, 40), (80, 24)):
            await at.pilot.resize_terminal(*size)
            box = question.query_one("#box").region
            assert box.height <= size[1] and question.word.region.y < box.bottom - 2
        await at.press("right", "enter", "enter")
        at.source.now = replace(at.source.now, standing=standing(next="P10"))
        assert at.app._session is not None
        at.app._session.store.view.left_open = (OpenGoal("pepper/speech", "3/1", "Speech", "it refused to stop"),)
        await at.says_end()
        await at.leave_report()
        outcome = at.client.reports[-1]
        assert isinstance(outcome, OutcomeReport)
        assert (outcome.status, outcome.reason, outcome.source) == ("complete", "", "wizard:anna")
        assert [each.id for each in at.client.reports[:-1]] == ["debrief"]  # type: ignore[union-attr]
        assert at.client.closed == [True]
        await at.until(lambda: at.screen.lists.people.count == 10, "only those who were searched for are shown")
        await at.until(lambda: at.screen.lists.people.current_id == "P10")
        assert "P07, run 2: complete" in at.notice and at.app.console_screen is None
        assert "LOOK AT THE ROBOT: pepper/speech may still be doing Speech" in at.notice


@pytest.mark.slow
async def test_every_step_to_the_end_can_be_left_stopped_and_refused_and_needs_what_it_asks_for() -> None:
    async with day() as at:
        await at.begin()
        console = at.app.console_screen
        assert console is not None
        console.action_do("settings")
        await at.until(lambda: "the study decides what runs" in console.bars.notice_line.text)
        await at.ask_to_end()
        checks = await at.shows(ChecksScreen)
        for key in "abcdefghijklmopqtuvwxyz0123456789":
            await at.pilot.press(key)
        await at.press("f9")
        await at.until(lambda: at.client.asked() == [("stopAll", "")])
        assert at.top is checks
        await at.press("escape")
        await at.shows(ConsoleScreen)
        await at.ask_to_end()
        await at.answer_debrief()
        for key in "abcefghijklmnopqrstuvwxyz":
            await at.pilot.press(key)
        await at.press("escape")
        await at.shows(ConsoleScreen)
        assert at.client.closed == [] and at.client.reports == [], "no key of any study ends its session"
        at.client.reject = "only the wizard who holds control can say how it is to count"
        await at.ask_to_end()
        await at.answer_debrief()
        await at.press("right", "enter", "enter")
        await at.says_end()
        await at.shows(ConsoleScreen)
        await at.until(lambda: "this was not recorded" in console.bars.notice_line.text)
        assert at.client.closed == []
        at.client.reject = ""
        await at.ask_to_end()
        question = await at.answer_debrief()

        def answer() -> str:
            return str(question.query_one("#answer", Static).content)

        await at.press("enter", "enter")
        assert "choose the outcome" in answer(), "nothing is chosen to begin with"
        await at.press("right")
        assert question.choice.value == "complete"
        await at.press("right")
        assert question.choice.value == "aborted" and "may repeat" in str(question.query_one("#meaning").content)
        await at.press("enter", "enter")
        assert "aborted needs a reason" in answer()
        await at.type("the robot fell")
        await at.press("enter")
        await at.type("no")
        await at.press("enter")
        assert "that is not the word" in answer() and at.client.closed == []
        question.query_one("#word", Input).value = ""
        await at.says_end()
        await at.leave_report()
        outcome = at.client.reports[-1]
        assert isinstance(outcome, OutcomeReport) and (outcome.status, outcome.reason) == ("aborted", "the robot fell")


@pytest.mark.slow
async def test_a_session_whose_engine_has_gone_is_recovered_left_or_ended_by_somebody_else() -> None:
    async with day() as at:
        await at.begin()

        async def gone() -> Dialog:
            at.client.end("the engine was killed")
            await at.until(lambda: bool(at.app.console_screen.store.gone_reason))  # type: ignore[union-attr]
            await at.press("ctrl+c")
            found = await at.shows(Dialog)
            assert isinstance(found, Dialog)
            return found

        assert "Back to the study" in [answer.title for answer in (await gone())._answers]
        await at.press("r")
        await at.until(lambda: len(at.source.recovered) == 1)
        assert at.source.recovered[0].participant == "P07"
        await at.until(lambda: len(at.source.clients) == 2 and not at.app.console_screen.store.gone_reason)  # type: ignore[union-attr]
        await gone()
        await at.press("b")
        await at.gone_back()
        await at.select("P07")
        await at.begin()
        at.source.change(standing=standing(next="P10"))
        await at.over()
        assert "P07, run 2: ended by SIGTERM; press enter to record its outcome" in at.notice
        await at.pilot.pause(0.2)
        assert at.screen.lists.people.current_id == "P07"
        await at.begin()
        await at.press("ctrl+c")
        await at.shows(Dialog)
        await at.press("d")
        await at.until(lambda: at.client.closed == [False])
        assert at.client.reports == [] and "goes on; come back with: " in at.app.exit_message


def attached(role: Role = "wizard") -> FakeClient:
    """A session of a study that runs, for a console that was started without naming the study."""
    you = "wizard:anna" if role == "wizard" else "observer:ben"
    folder = "/home/lab/lablinking/sessions/2026_P07"
    source = FakeStudy(client=FakeClient(demo(), you=you, role=role, folder=folder))
    return source.session("P07", PlannedRun(7, 2, {}, "yes+loud", {}, DEMO, 1), "counted")


@pytest.mark.slow
async def test_a_console_that_was_not_told_the_study_finds_it_by_the_session() -> None:
    source, launcher = FakeStudy(), FakeLauncher(attached(), find_study=lambda reply: source)
    app = ConsoleApp(launcher.clients[0], launcher=launcher, wizard="anna")
    async with app.run_test(size=(80, 24)) as pilot:
        at = Day(pilot, source)
        source.clients.append(launcher.clients[0])
        console = await at.shows(ConsoleScreen)
        await at.until(lambda: "P07 run 2 · A+loud" in console.bars.status_line.text)
        assert "yes" not in console.bars.status_line.text
        await at.ask_to_end()
        await at.answer_debrief()
        await at.press("right", "enter", "enter")
        await at.says_end()
        await at.shows(ReportScreen)
        await at.press("escape")
        await at.until(lambda: isinstance(at.top, StudyScreen) and at.top.wizard == "anna")


async def test_who_only_watches_sees_the_label_and_can_only_detach() -> None:
    launcher = FakeLauncher(attached("observer"), find_study=lambda reply: FakeStudy())
    app = ConsoleApp(launcher.clients[0], launcher=launcher, wizard="ben")
    async with app.run_test(size=(120, 40)) as pilot:
        at = Day(pilot, FakeStudy())
        console = await at.shows(ConsoleScreen)
        await at.until(lambda: "P07 run 2 · A+loud" in console.bars.status_line.text)
        await at.press("ctrl+c")
        question = await at.shows(Dialog)
        assert [answer.title for answer in question._answers] == ["Detach"]


# --- sessions that run, did not end, or were never judged -------------------------------------------------------------


@pytest.mark.slow
async def test_a_session_that_runs_without_a_console_here_is_reached_and_stopped() -> None:
    running = entry("P01", status="running", outcome=None)
    rehearsal = entry("P10", purpose="debug", status="running", outcome=None)
    source = FakeStudy()
    async with day(source, size=(120, 40)) as at:
        await at.press("f9")
        assert "nothing to stop" in at.notice
        screen = await at.checks()
        await at.press("ctrl+g")
        assert "nothing to stop" in at.text_of(screen)
        await at.press("escape")
        people = (person(1, "running", sessions=(running,)),)
        source.change(standing=standing(participants=people, next=""))
        await at.until(lambda: "► running" in at.screen.lists.people.text)
        await at.press("question_mark")
        await at.shows(HelpScreen)
        await at.press("f9")
        await at.until(lambda: bool(source.clients) and ("stopAll", "") in at.client.asked())
        await at.over()
        await at.select("P01")
        await at.press("enter")
        await at.shows(ConsoleScreen)
        assert source.attached[-1] == running
        await at.over()
        source.change(standing=standing(rehearsals=(rehearsal,)))
        await at.until(lambda: "a debug session with P10 is running" in at.screen.lists.beside.text)
        await at.select("P10")
        before = len(source.planned)
        await at.press("enter")
        await at.shows(ConsoleScreen)
        assert source.attached[-1] == rehearsal and len(source.planned) == before
        await at.over()
        await at.press("f9")
        await at.shows(ConsoleScreen)
        await at.until(lambda: ("stopAll", "") in at.client.asked())


@pytest.mark.slow
async def test_stop_while_a_session_is_starting_stops_it_as_soon_as_it_is_reached() -> None:
    source = FakeStudy()
    source.held = Event()
    async with day(source) as at:
        await at.checks()
        await at.press("y", "y", "enter")
        await at.until(lambda: "is starting" in at.notice)
        await at.press("enter")
        assert "not now: the session of P07 is starting" in at.notice
        await at.press("f9")
        assert "STOP will be sent" in at.notice
        source.held.set()
        await at.shows(ConsoleScreen)
        await at.until(lambda: ("stopAll", "") in at.client.asked())


@pytest.mark.slow
async def test_sessions_are_judged_given_up_corrected_and_recovered() -> None:
    async with day() as at:

        async def asked_about(participant: str) -> Dialog:
            await at.select(participant)
            await at.press("enter")
            found = await at.shows(Dialog)
            assert isinstance(found, Dialog)
            return found

        async def judged() -> tuple[str, str, str, str]:
            await at.until(lambda: bool(at.source.judged))
            found, status, reason, wizard = at.source.judged.pop()
            return found.participant, status, reason, wizard

        question = await asked_about("P05")
        said = "\n".join((question._title, *question._lines))
        for piece in ("P05 · run 1 · A+quiet did not end", "Started 2026-11-21 14:15", "its record ends at 00:14:32"):
            assert piece in said
        assert 'unless its\n         profile has unattended = "go on".' in said
        await at.press("escape")
        await at.gone_back()
        assert at.source.judged == [] and at.source.recovered == []
        await at.select("P06")
        await at.press("enter")
        outcome = await at.answer_debrief()
        assert at.source.noted == [("debrief", "passed")]
        assert "ended without an outcome" in "\n".join(outcome._lines) and not outcome.query("#word")
        at.source.refusal = "study.jsonl cannot be written: no space left"
        await at.press("right", "enter", "enter")
        await at.until(lambda: "no space left" in at.notice)
        at.source.refusal = ""
        await at.select("P06")
        await at.press("enter")
        await at.answer_debrief()
        await at.press("right", "enter", "enter")
        assert await judged() == ("P06", "complete", "", "anna")
        await at.select("P08")
        await at.press("o")
        outcome = await at.shows(OutcomeDialog)
        assert "It counts as aborted" in str(outcome.query_one("#lines", Static).render())
        await at.press("right", "enter", "enter")
        assert "needs a reason" in str(outcome.query_one("#answer", Static).render()) and at.source.judged == []
        await at.type("heard all of it")
        await at.press("enter")
        assert await judged() == ("P08", "complete", "heard all of it", "anna")
        await at.select("P10")
        await at.press("o")
        assert "P10 has no session yet" in at.notice
        await asked_about("P05")
        await at.press("g")
        await at.shows(OutcomeDialog)
        await at.press("right", "right", "enter")
        await at.type("power cut")
        await at.press("enter")
        assert await judged() == ("P05", "aborted", "power cut", "anna")
        await at.until(lambda: "P05, run 1: aborted" in at.notice)
        assert at.screen.lists.people.current_id == "P07"
        await asked_about("P05")
        await at.press("r")
        await at.shows(ConsoleScreen)
        assert [each.participant for each in at.source.recovered] == ["P05"]


# --- no accidents -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_keys_that_come_together_start_nothing_and_leaving_the_checks_asks_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async with day() as at:
        at.app._keys_together = True
        assert not at.app.admits(events.Key("enter", None)) and at.app.admits(events.Key("f9", None))
        at.app._keys_together = False
        assert at.app.admits(events.Key("enter", None))
        with monkeypatch.context() as unreachable:
            client = FakeClient(demo())
            client.gone = "it has just ended"
            unreachable.setattr(at.source, "session", lambda *_: client)
            await at.checks()
            await at.press("y", "y", "enter")
            await at.until(lambda: "could not be reached: it has just ended" in at.notice)
            with pytest.raises(EngineGone):
                await client.attach()
        at.source.started.clear()
        await at.checks()
        await at.press("ctrl+c")
        await at.shows(Dialog)
        await at.press("escape")
        await at.shows(ChecksScreen)
        await at.press("ctrl+c")
        await at.shows(Dialog)
        await at.press("l")
        await at.until(lambda: bool(at.app.exit_message))
        assert at.source.started == []


async def test_leaving_the_study_ends_nothing_and_says_how_to_come_back() -> None:
    async with day(size=(40, 12)) as at:
        await at.until(lambda: type(at.top).__name__ == "TooSmallScreen")
        await at.pilot.resize_terminal(80, 24)
        await at.gone_back()
        await at.press("ctrl+c")
        await at.pilot.pause(0.2)
        assert " --config /home/lab/lablinking" in at.app.exit_message and at.app.return_code == 0


@pytest.mark.slow
async def test_leaving_while_a_session_is_starting_does_not_say_that_none_runs() -> None:
    source = FakeStudy()
    source.held = Event()
    async with day(source) as at:
        await at.checks()
        await at.press("y", "y", "enter")
        await at.until(lambda: "is starting" in at.notice)
        await at.press("ctrl+c")
        await at.until(lambda: bool(at.app.exit_message))
        source.held.set()
        said = "the session of P07 is starting, and goes on without this console; to come back to the study: "
        assert at.app.exit_message.startswith(said)


# --- the report of a session -----------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_the_report_of_any_session_that_has_ended_is_read_by_keys_alone() -> None:
    source = FakeStudy()
    async with day(source) as at:
        await at.select("P10")
        await at.press("v")
        assert at.top is at.screen and "P10: no session has ended" in at.notice
        await at.select("P01")
        source.report_held = Event()
        try:
            await at.press("v")
            report = await at.shows(ReportScreen)
            assert "reading the record" in report.text
            await at.press("escape")
            assert at.top is at.screen
            await at.press("down")
            assert at.screen.lists.people.current_id == "P02", "nobody waits for a report"
            source.report_held.set()
            await at.until(lambda: source.reported != [])
            assert at.top is at.screen
        finally:
            source.report_held.set()
        await at.select("P01")
        source.report_refusal = "the journal cannot be read"
        await at.press("v")
        report = await at.shows(ReportScreen)
        await at.until(lambda: "there is no report: the journal cannot be read" in report.text)
        await at.press("enter")
        assert at.top is at.screen
        source.report_refusal = ""
        for size in ((120, 40), (80, 24)):
            await at.pilot.resize_terminal(*size)
            source.reported.clear()
            await at.press("v")
            report = await at.shows(ReportScreen)
            await at.until(lambda report=report: "line 0 of" in report.text)  # type: ignore[misc]
            assert "(2 of 2)" in str(report.query_one("#box").border_title)  # the last one first
            assert report.query_one("#box").region.bottom <= size[1]
            widest = max(len(line) for line in report.text.split("\n"))
            assert widest <= report.list.row_width
            await at.press("pagedown")
            assert report.list.scroll_y > 0
            await at.press("home", "right", "right")
            assert report.text.split("\n")[round(report.list.scroll_y)].strip() == "Acts"
            await at.press("left")
            assert report.text.split("\n")[round(report.list.scroll_y)].strip() == "Checks"
            await at.press("left_square_bracket")
            await at.until(lambda: len(source.reported) == 2)
            assert "(1 of 2)" in str(report.query_one("#box").border_title)
            assert source.reported == [each.folder for each in reversed(standing().participants[0].sessions)]
            await at.press("escape")
            assert at.top is at.screen
        await at.press("v")
        await at.shows(ReportScreen)
        await at.press("ctrl+c")  # the console can be left from a report
        await at.until(lambda: at.app.return_code == 0)
        assert "to come back to the study" in at.app.exit_message
