"""From the participant's cue until the robot is heard, by the records alone."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from rise_engine.kernel.records import ActionRecord, CueRecord, SessionRecord, TimingRecord
from rise_engine.kernel.task_view import TaskView
from rise_engine.run.protocol.messages import TasksMessage as Tasks
from rise_engine.run.protocol.messages import decode_server_message, encode_line, with_tasks, without_tasks
from rise_tui.model.cue import CueClock, speaks, voice_at
from rise_tui.panes.log_export import task_columns
from tests.tui.fake import demo
from tests.tui.model.test_speech_band import Played

T = 100.0
"""When the cue is marked."""


class Cued(Played):
    """A participant has just finished; half a second later something starts and answers that."""

    def __init__(self) -> None:
        super().__init__()
        self.mark("marked")
        self.client.time += 0.5

    def mark(self, status: str, task: int | None = None) -> None:
        self.client.emit(CueRecord(0, 0.0, "", status, "wizard:anna", task=task))  # type: ignore[arg-type]

    def answer(self, function: str = "startCommunicationRobotAct", behavior: str = "Greet") -> int:
        task = self.client.task(function, behavior)
        self.mark("answered", task)
        return task

    def robot(self, task: int, action: str, kind: str, *has_spoken: str, after: float = 0.5) -> None:
        for status in has_spoken:
            self.client.time += after
            self.client.action(task, "Greet", action, kind, status, message="Hello Ada!")

    @property
    def clock(self) -> CueClock:
        found = self.store.cue_clock
        assert found is not None
        return found


def test_a_cue_that_nothing_answers() -> None:
    it = Cued()
    assert it.clock == CueClock(T)
    it.mark("filled", it.client.act("Filler"))
    assert it.clock == CueClock(T, filled=T + 0.5)
    it.mark("undone")
    assert it.store.cue_clock is None


def test_a_nod_that_comes_first_is_no_answer() -> None:
    it = Cued()
    task = it.answer()
    it.robot(task, "2", "Animation", "started", "accepted")
    assert it.clock == CueClock(T), "the participant has heard nothing yet"
    it.robot(task, "1", "Speech", "started")
    assert it.clock == CueClock(T), "nor when the sentence is only sent"
    it.robot(task, "1", "Speech", "accepted")
    assert it.clock == CueClock(T, T + 2.5)
    it.robot(task, "1", "Speech", "succeeded")
    assert it.clock == CueClock(T, T + 2.5), "the first word counts"


def test_a_robot_that_never_says_accepted() -> None:
    it = Cued()
    task = it.answer()
    it.robot(task, "1", "Speech", "started", "succeeded")
    assert it.clock == CueClock(T, T + 1.5)


def test_free_speech_is_heard_when_the_robot_takes_it() -> None:
    it = Cued()
    task = it.answer("say", "Well")
    assert it.clock == CueClock(T)
    it.robot(task, "say", "Speech", "started", "accepted")
    assert it.clock == CueClock(T, T + 1.5)


def test_an_act_that_says_nothing_answers_with_its_start() -> None:
    it = Cued()
    acts = it.store.scenario.acts
    nod = replace(acts["Greet"], name="Nod", actions=(acts["Greet"].actions[1],))
    it.store.attach_reply = replace(
        it.store.attach_reply, scenario=replace(it.store.scenario, acts={**acts, "Nod": nod})
    )
    it.answer(behavior="Nod")
    assert it.clock == CueClock(T, T + 0.5)


@pytest.mark.parametrize("ending", ["ABORTED", "CANCELED"])
def test_an_answer_that_ends_before_it_is_heard_was_not_said(ending: str) -> None:
    it = Cued()
    task = it.answer()
    it.robot(task, "2", "Animation", "started", "accepted")
    it.robot(task, "1", "Speech", "failed")
    assert it.clock == CueClock(T), "it may still say the other sentence"
    it.client.end_task(task, "Greet", ending)
    assert it.clock == CueClock(T, T + 2.0, has_spoken=False)


def test_a_substitute_that_takes_no_voice_is_not_heard() -> None:
    scenario = demo()
    specs = scenario.robot.actions
    blinks = {**specs, "Speech": replace(specs["Speech"], substitute="Animation")}
    scenario = replace(scenario, robot=replace(scenario.robot, actions=blinks))
    action = ActionRecord(0, 1.0, "", 1, "Praise", "1", "Speech", {}, "accepted", sent_as="Animation")
    it = Played(scenario)
    it.client.act("Praise")
    it.client.emit(action)
    assert voice_at(scenario, it.store.view.tasks[1]) is None
    assert not speaks(scenario, it.store.view.tasks[1])
    assert voice_at(demo(), it.store.view.tasks[1]) is None, "what it does instead counts"


def test_the_timing_record_has_the_last_word_and_tables_have_it() -> None:
    it = Cued()
    task = it.answer()
    it.robot(task, "1", "Speech", "started", "accepted")
    it.client.end_task(task, "Greet")
    times = (T, T, T, T + 0.5, T + 0.6, T + 3)
    it.client.emit(TimingRecord(0, 0.0, "", task, "Greet", "SUCCEEDED", *times, "wizard:anna", False, T + 1.25))
    assert it.clock == CueClock(T, T + 1.25)
    columns = task_columns(it.store.view.tasks[task])
    assert (columns["cue"], columns["robot"], columns["voice"], columns["filler"]) == (T, T + 0.6, T + 1.25, False)


def test_a_console_that_attaches_in_between_knows_it_too() -> None:
    it = Cued()
    task = it.answer()
    it.robot(task, "1", "Speech", "started", "accepted")
    it.client.emit(SessionRecord(0, 0.0, "", status="started", participant="P07", slot=3, factors={"noise": "loud"}))
    view = it.store.view
    message = decode_server_message(encode_line(Tasks([*view.tasks.values()])))
    assert isinstance(message, Tasks)
    attached = with_tasks(without_tasks(view), message.tasks)
    assert attached == view
    assert voice_at(it.store.scenario, attached.tasks[task]) == T + 1.5


def test_a_task_that_is_no_act_is_not_to_be_heard() -> None:
    task = TaskView(1, "raiseEventTopic", "/next", "None", "wizard:anna", "SUCCEEDED", "", 1.0)
    assert not speaks(demo(), task) and voice_at(demo(), task) is None
