"""An act that fails is unmistakable: which, why, what was not said, and two keys that stay until one is pressed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rise_engine.kernel.records import FailureRecord, FailureStatus, MemoryRecord
from rise_engine.run.protocol.messages import with_tasks, without_tasks
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_tui.actions import BY_ID
from rise_tui.key_labels import key_name, why_unavailable
from rise_tui.model.failures import UnspokenText, failure_lines, unanswered_failures, unspoken_texts
from rise_tui.model.store import Store
from rise_tui.rendering.text import line_width, plain_text
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

ACT = "startCommunicationRobotAct"
ACTS = """<Dialogs>
  <Dialog name="Instruct">
    <Speech><actionID>1</actionID><message>Hello {name}.</message></Speech>
    <LookAt><actionID>2</actionID><waitForActions>1</waitForActions>
      <pointx>1</pointx><pointy>0</pointy><pointz>1</pointz></LookAt>
    <Speech><actionID>3</actionID><waitForActions>2</waitForActions>
      <message>Put the fork to the {side}.</message></Speech>
    <Variants><actionID>4</actionID><waitForActions>3</waitForActions>
      <Speech><message>Was that clear?</message></Speech><Speech><message>Did you get it?</message></Speech>
    </Variants>
  </Dialog>
</Dialogs>"""


@pytest.fixture
def study(tmp_path: Path) -> Scenario:
    (tmp_path / "acts").mkdir()
    (tmp_path / "acts" / "all.xml").write_text(ACTS, encoding="utf-8")
    (tmp_path / "memory.json").write_text('{"name": "Ada"}', encoding="utf-8")
    scenario = load(str(tmp_path)).scenario
    assert scenario is not None
    return scenario


def action(client: FakeClient, task: int, id: str, kind: str, *statuses: str, **parameters: str) -> None:
    for status in statuses:
        client.action(task, "Instruct", id, kind, status, **parameters)
        client.time += 1


def what_was_not_said(scenario: Scenario, *happenings: Callable[[FakeClient, int], None]) -> list[UnspokenText]:
    client = FakeClient(scenario)
    task = client.act("Instruct")
    for happening in happenings:
        happening(client, task)
    client.end_task(task, "Instruct", "ABORTED", "it went wrong")
    store = Store(client.attach_reply(), "anna", client.now)
    return unspoken_texts(store.scenario, store.view.tasks[task], store.memory)


def said_hello(client: FakeClient, task: int) -> None:
    action(client, task, "1", "Speech", "started", "accepted", "succeeded", message="Hello Ada.")


def looks_in_vain(client: FakeClient, task: int) -> None:
    action(client, task, "2", "LookAt", "started", "failed")
    for id in ("3", "4"):  # the engine records these as they are written
        client.action(task, "Instruct", id, "Speech", "skipped", message="as written: {side}")


def test_all_that_was_not_said_word_for_word_with_the_memory_s_values(study: Scenario) -> None:
    def left(client: FakeClient, task: int) -> None:
        client.emit(MemoryRecord(0, 0.0, "", "side", "left", None, "wizard:anna", created=True))

    assert what_was_not_said(study, said_hello, looks_in_vain, left) == [
        UnspokenText("Put the fork to the left.", begun=False),
        UnspokenText("Was that clear?", begun=False, variants=2),
    ]


def test_a_value_that_is_missing_stays_as_it_is_written(study: Scenario) -> None:
    def missing(client: FakeClient, task: int) -> None:
        client.action(task, "Instruct", "3", "Speech", "failed", message="Put the fork to the {side}.")

    assert what_was_not_said(study, said_hello, missing)[0] == UnspokenText("Put the fork to the {side}.", begun=False)


def test_what_the_robot_was_given_is_perhaps_begun(study: Scenario) -> None:
    def lost(client: FakeClient, task: int) -> None:
        action(client, task, "1", "Speech", "started", "lost", message="Hello Ada.")

    first, *others = what_was_not_said(study, lost)
    assert first == UnspokenText("Hello Ada.", begun=True)
    assert [each.begun for each in others] == [False, False]


# --- which failures wait ----------------------------------------------------------------------------------------------


def test_they_are_told_to_whoever_attaches_later() -> None:
    client = FakeClient(demo())
    client.act("Greet", "ABORTED", reason="no voice")
    client.act("Praise", "ABORTED", reason="no voice")
    view = client.attach_reply().view
    again = with_tasks(without_tasks(view), view.tasks.values())
    assert again.failed == view.failed == [1, 2]


def store_after(*acts: tuple[str, str], **options: object) -> Store:
    client = FakeClient(demo(), **options)  # type: ignore[arg-type]
    for name, status in acts:
        client.act(name, status, reason="action 1 (Speech) failed: no voice")
    return Store(client.attach_reply(), "anna", client.now)


def bar(store: Store, width: int = 80, most: int = 8) -> list[str]:
    return [plain_text(line) for line in failure_lines(store, width, most, key_name)]


def test_of_several_the_first_is_shown_and_the_others_are_counted() -> None:
    store = store_after(("Greet", "ABORTED"), ("Praise", "ABORTED"), ("Greet", "ABORTED"))
    assert [task.behavior for task in unanswered_failures(store)] == ["Greet", "Praise"]
    head, reason, *_, keys = bar(store)
    assert "✗ ACT FAILED   Greet" in head and head.endswith("1 more ")
    assert "no voice" in reason and "ctrl+e repeat" in keys and "ctrl+k go on without it" in keys


@pytest.mark.parametrize(
    ("status", "seconds", "said"),
    [
        ("asked", None, "the study waits for your answer"),
        ("waiting", 2.0, "repeated in 2 s"),
        ("waiting", None, "repeated when the robot is back"),
    ],
)
def test_it_says_whether_it_is_repeated_by_itself(status: FailureStatus, seconds: float | None, said: str) -> None:
    client = FakeClient(demo())
    task = client.act("Greet", "ABORTED", reason="no voice")
    client.emit(FailureRecord(0, 0.0, "", task, "Greet", status, "engine", seconds=seconds))
    store = Store(client.attach_reply(), "anna", client.now)
    head, *_, keys = bar(store)
    assert said in head and "ctrl+e repeat" in keys


def test_an_act_that_was_done_after_all_is_forgotten() -> None:
    assert bar(store_after(("Greet", "ABORTED"), ("Greet", "SUCCEEDED"))) == []
    assert bar(store_after(("Greet", "SUCCEEDED"), ("Greet", "CANCELED"))) == []


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"you": "observer:ben", "role": "observer"}, "anna has control and decides"),
        ({"you": "wizard:ben"}, "anna has control and decides"),
        ({"you": "wizard:ben", "holder": None}, "nobody has control"),
        ({"you": "observer:replay", "role": "observer", "replay": True}, "this is a replay"),
    ],
)
def test_who_cannot_act_sees_it_without_the_keys(options: dict[str, object], said: str) -> None:
    *_, keys = bar(store_after(("Greet", "ABORTED"), **options))
    assert said in keys and "ctrl+e" not in keys and "ctrl+k" not in keys


def test_while_nothing_may_start_only_going_on_is_offered() -> None:
    store = store_after(("Greet", "ABORTED"))
    store.input_mode = "SAFE"
    *_, keys = bar(store)
    assert "not now: SAFE" in keys and "ctrl+e" not in keys and "ctrl+k go on" in keys
    assert why_unavailable(BY_ID["repeat"], store) and not why_unavailable(BY_ID["go-on"], store)


@pytest.mark.parametrize("width", [40, 80, 120, 200])
@pytest.mark.parametrize("most", [5, 8, 13])
def test_it_never_takes_more_room_than_it_has_and_says_what_it_leaves_out(width: int, most: int) -> None:
    client = FakeClient(demo())
    text = " ".join(f"word{number}" for number in range(300))
    client.task("say", text, "ABORTED", reason="a reason of some length " * 20)
    found = failure_lines(Store(client.attach_reply(), "anna", client.now), width, most, key_name)
    assert len(found) <= most and all(line_width(line) <= width for line in found)
    assert "word0" in plain_text(found[-2]) + plain_text(found[3])
    assert plain_text(found[-2]).endswith("in full: act pane" if width > 40 else "…")


# --- on the screen ----------------------------------------------------------------------------------------------------


async def shown(it: Console) -> None:
    await it.until(lambda: it.bars.failure_bar.display and it.bars.failure_bar.region.height >= 4)


def bar_of(it: Console) -> str:
    return it.bars.failure_bar.text


@pytest.mark.slow
async def test_it_stays_on_every_pane_until_it_is_answered() -> None:
    async with console(size=(80, 24)) as it:
        for key, title in (("ctrl+e", "Repeat the failed act"), ("ctrl+k", "Go on without the failed act")):
            await it.press(key)
            await it.until(lambda title=title: f"{title}: not now, no act has failed" in it.notice)  # type: ignore[misc]
        id = it.client.act("Greet", "ABORTED", reason="no voice")
        await shown(it)
        for size in ((120, 40), (80, 24)):
            await it.pilot.resize_terminal(*size)
            await shown(it)
            for _ in range(6):
                await it.press("f3")
                assert it.bars.failure_bar.display and "Greet" in bar_of(it)
        await it.press("f4", "escape", "g")  # zoomed, left, and another act started
        assert "ctrl+e repeat" in bar_of(it) or "runs again" in bar_of(it)
        await it.press("ctrl+k")
        await it.sent("goOn", str(id))
        await it.until(lambda: not it.bars.failure_bar.display)


@pytest.mark.slow
async def test_its_keys_repeat_what_was_asked_for_go_on_and_can_be_clicked() -> None:
    async with console(size=(80, 24)) as it:
        failed = it.client.act("Greet", "ABORTED", reason="no voice")
        await shown(it)
        *others, keys = bar_of(it).splitlines()
        await it.pilot.click(it.bars.failure_bar, offset=(keys.index("repeat"), 0))
        await it.pilot.click(it.bars.failure_bar, offset=(0, len(others)))
        assert it.client.asked() == []
        await it.press("ctrl+x", "ctrl+e")  # SAFE: the same care as for every start
        await it.until(lambda: "not now, SAFE" in it.notice)
        await it.press("ctrl+x", "ctrl+e")
        await it.sent(ACT, "Greet")
        assert it.client.sent[-1].calling_type == "Blocking"
        await it.until(lambda: "it runs again" in bar_of(it))
        it.client.end_task(failed + 1, "Greet")
        await it.until(lambda: not it.bars.failure_bar.display, "its success puts the bar away")
        it.client.sent.clear()
        id = it.client.act("Praise", "ABORTED", reason="no voice")
        await it.until(lambda: "Praise" in bar_of(it) and it.bars.failure_bar.display)
        *others, keys = bar_of(it).splitlines()
        await it.pilot.click(it.bars.failure_bar, offset=(keys.index("without"), len(others)))
        await it.until(lambda: it.client.asked() == [("goOn", str(id))])
        it.client.sent.clear()
        it.client.act("Filler", "ABORTED", reason="no voice")
        await it.until(lambda: "Filler" in bar_of(it) and it.bars.failure_bar.display)
        *others, keys = bar_of(it).splitlines()
        await it.pilot.click(it.bars.failure_bar, offset=(keys.index("repeat"), len(others)))
        await it.sent(ACT, "Filler")


@pytest.mark.slow
async def test_what_was_said_freely_is_said_again_and_beside_an_alarm_the_panes_can_still_be_seen() -> None:
    async with console(size=(80, 24)) as it:
        failed = it.client.task("say", "One moment please", "ABORTED", reason="no voice")
        await shown(it)
        assert "“One moment please”" in bar_of(it)
        await it.press("ctrl+e")
        await it.sent("say", "One moment please")
        it.client.task_record(failed + 1, "say", "One moment please", "SUCCEEDED")
        await it.until(lambda: not it.bars.failure_bar.display)
        it.client.sent.clear()
        it.client.task("say", " ".join(["word"] * 200), "ABORTED", reason="a reason of some length " * 9)
        await shown(it)
        it.client.stop("latched", ("pepper/speech",))
        await it.until(lambda: it.bars.alarm_bar.display and it.bars.alarm_bar.region.height == 3)
        await it.until(lambda: "ctrl+k go on" in bar_of(it) and "not now: STOPPED" in bar_of(it))
        assert it.screen.pane_layout.region.height >= 4 and it.bars.failure_bar.region.height >= 5
        await it.press("ctrl+e")
        await it.until(lambda: "Repeat the failed act: not now, STOPPED" in it.notice)
        assert it.client.asked() == []


# --- the study waits for an answer ------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_a_question_shows_its_three_answers() -> None:
    """An act of a rule has failed, and somebody is asked."""
    async with console(size=(80, 24)) as it:
        it.client.rule("Main", "entered", "greeting", trigger="start")
        for size in ((120, 40), (80, 24)):
            await it.pilot.resize_terminal(*size)
            for answer, function, status in (
                (("ctrl+e",), "repeatAct", "repeated"),
                (("ctrl+k",), "goOn", "gone-on"),
                ((":", *"failed act's", "enter", "enter"), "stopRuleOfAct", "dropped"),
            ):
                it.client.sent.clear()
                id = it.client.task(ACT, "Greet", "ABORTED", reason="no voice", source="rule:Main")
                it.client.emit(FailureRecord(0, 0.0, "", id, "Greet", "asked", "engine"))
                await shown(it)
                await it.until(lambda: "the study waits for your answer" in bar_of(it))
                assert all(
                    words in bar_of(it) for words in ("ctrl+e repeat", "ctrl+k go on", ": Stop the failed act's rule")
                )
                await it.press("ctrl+x", "ctrl+e", "ctrl+k")  # SAFE: no answer makes anything happen
                assert it.client.asked() == [] and "SAFE" in it.notice
                await it.press("ctrl+x")
                await it.pilot.pause(0.6)
                await it.press(*answer)
                await it.sent(function, str(id))
                it.client.emit(FailureRecord(0, 0.0, "", id, "Greet", status, "wizard:anna", id + 1))  # type: ignore[arg-type]
                await it.until(lambda: not it.bars.failure_bar.display)
