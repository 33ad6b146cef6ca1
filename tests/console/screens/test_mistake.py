"""A wizard's own errors as data: one key after the act, and the better word within four seconds."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from rise_engine.kernel.records import MistakeRecord
from rise_engine.kernel.task_view import TaskView
from rise_tui.model.mistakes import newest_markable
from rise_tui.rendering.text import plain_text
from rise_tui.widgets import mistake_line as line
from tests.console.conftest import Console, console
from tests.console.fake import FakeClient, demo

ACT = "startCommunicationRobotAct"

# --- pure -----------------------------------------------------------------------------------------------------------


def task(id: int, function: str = ACT, source: str = "wizard:anna", status: str = "ACTIVE") -> TaskView:
    return TaskView(id, function, "Greet", "Blocking", source, status, "", 0.0)


@pytest.mark.parametrize(
    ("tasks", "meant"),
    [
        ([], None),
        ([task(1)], 1),
        ([task(1), task(2, "say")], 2),
        ([task(1), task(2, "raiseEventTopic")], 2),
        ([task(1), task(2, "assignValue", status="SUCCEEDED")], 2),
        ([task(1), task(2, "startInteractionRule")], 2),
        ([task(1), task(2, "markMistake", status="SUCCEEDED"), task(3, "goOn", status="SUCCEEDED")], 1),
        ([task(1, "raiseEventTopic"), task(2, source="rule:Main")], 1),  # which the wizard's key has led to
        ([task(1, source="rule:Main"), task(2, "raiseEventTopic", source="rule:Main")], 1),  # who has done nothing
        ([task(1), task(2, source="wizard:ben"), task(3, source="ros:node")], 1),
        ([task(1), task(2, status="REJECTED")], 1),
        ([task(1, status="SUCCEEDED"), task(2, status="PENDING")], 2),
        ([task(1, "raiseEventTopic", source="rule:Main")], None),
    ],
)
def test_which_deed_is_meant(tasks: list[TaskView], meant: int | None) -> None:
    found = newest_markable({each.id: each for each in tasks}, "wizard:anna")
    assert (found.id if found is not None else None) == meant


# --- on the screen --------------------------------------------------------------------------------------------------


def marks(it: Console) -> list[str]:
    return [message.behavior for message in it.client.sent if message.function == "markMistake"]


def record(it: Console, id: int, mark: str) -> None:
    it.client.emit(MistakeRecord(0, 0.0, "", id, "Greet", mark, "wizard:anna"))  # type: ignore[arg-type]


async def test_the_newest_act_is_wrong_at_once() -> None:
    async with console() as it:
        it.client.act("Praise", "SUCCEEDED")
        id = it.client.act("Greet")
        await it.press("exclamation_mark")
        await it.until(lambda: marks(it) == [f"{id} wrong"])
        assert it.client.sent[-1].pressed is not None
        assert it.bars.mistake_line.has_focus
        record(it, id, "wrong")
        await it.until(lambda: "! marked wrong" in it.bars.mistake_line.text and "Greet" in it.bars.mistake_line.text)
        for piece in ("w wrong", "l late", "e early", "d double", "u undo", "esc"):
            assert piece in it.bars.mistake_line.text


@pytest.mark.slow
@pytest.mark.parametrize(("key", "mark"), [("l", "late"), ("e", "early"), ("d", "double"), ("u", "none")])
async def test_a_letter_is_the_better_word(key: str, mark: str) -> None:
    async with console() as it:
        id = it.client.act("Greet")
        await it.press("exclamation_mark", key)
        await it.until(lambda: marks(it) == [f"{id} wrong", f"{id} {mark}"])
        await it.until(lambda: it.pane("acts").row_view.has_focus and not it.bars.mistake_line.is_open)
        assert it.bars.notice_line.display


@pytest.mark.parametrize("key", ["w", "escape"])
async def test_wrong_it_is_already(key: str) -> None:
    async with console() as it:
        id = it.client.act("Greet")
        await it.press("exclamation_mark", key)
        await it.until(lambda: not it.bars.mistake_line.is_open)
        await it.pilot.pause(0.1)
        assert marks(it) == [f"{id} wrong"]


async def test_its_letters_are_not_the_scenarios_keys_while_it_is_open(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = demo()
    keys = {**scenario.keys, "e": replace(scenario.keys["g"], key="e", label="e")}
    async with console(client=FakeClient(replace(scenario, keys=keys))) as it:
        it.client.act("Praise")
        await it.press("exclamation_mark", "e")
        await it.until(lambda: len(marks(it)) == 2)
        await it.pilot.pause(0.1)
        assert (ACT, "Greet") not in it.client.asked()
        await it.press("e")  # and now it is
        await it.sent(ACT, "Greet")


async def test_any_other_key_closes_it_and_does_what_it_always_does() -> None:
    async with console() as it:
        id = it.client.act("Greet")
        await it.press("exclamation_mark", "p")
        await it.sent(ACT, "Praise")
        assert marks(it) == [f"{id} wrong"] and not it.bars.mistake_line.is_open
        await it.press("exclamation_mark", "f3")
        await it.until(lambda: it.pane("rule").row_view.has_focus)


async def test_it_closes_by_itself_and_then_swallows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(line, "OPEN_SECONDS", 0.2)
    async with console() as it:
        it.client.act("Greet")
        await it.press("exclamation_mark")
        await it.until(lambda: not it.bars.mistake_line.is_open and it.pane("acts").row_view.has_focus)
        await it.press("g")
        await it.sent(ACT, "Greet")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "function", "behavior", "name"),
    [
        ("n", "raiseEventTopic", "/next", "n: raised next"),
        ("u", "assignValue", "understood = true", "u: understood = true"),
        ("m", "startInteractionRule", "Main", "m: rule Main"),
        ("p", ACT, "Praise", "Praise"),
        ("space", "markCue", "", "cue"),
    ],
)
async def test_whatever_key_was_pressed_last_is_marked_by_its_name(
    key: str, function: str, behavior: str, name: str
) -> None:
    async with console(size=(80, 24)) as it:
        await it.press("g", key)
        await it.sent(function, behavior)
        await it.until(lambda: len(it.screen.session.store.view.tasks) == 2)
        await it.press("exclamation_mark")
        await it.until(lambda: marks(it) == ["2 wrong"])
        record(it, 2, "wrong")
        await it.until(lambda: "! marked wrong" in it.bars.mistake_line.text)
        assert f" {name} " in it.bars.mistake_line.text and "d double" in it.bars.mistake_line.text


async def test_a_feedback_key_that_may_come_early_is_marked_by_what_the_author_calls_it() -> None:
    scenario = demo()
    judged = replace(scenario.keys["n"], key="k", label="k", behavior="/understood", title="understood", keep=2.0)
    async with console(client=FakeClient(replace(scenario, keys={**scenario.keys, "k": judged}))) as it:
        it.client.act("Greet")
        await it.press("k")
        await it.until(lambda: len(it.screen.session.store.view.tasks) == 2)
        it.client.act("Praise", source="rule:Main")  # what the key has led to
        await it.press("exclamation_mark")
        await it.until(lambda: marks(it) == ["2 wrong"])
        record(it, 2, "wrong")
        await it.until(lambda: "! marked wrong k: understood " in it.bars.mistake_line.text)


async def test_a_second_console_is_the_same_person() -> None:
    client = FakeClient(demo(), you="wizard:anna#2", holder="wizard:anna#2")
    client.task("raiseEventTopic", "/next", "SUCCEEDED")
    async with console(client=client) as it:
        await it.press("exclamation_mark")
        await it.until(lambda: marks(it) == ["1 wrong"])


async def test_without_a_deed_there_is_nothing_to_mark() -> None:
    async with console() as it:
        await it.press("exclamation_mark")
        await it.until(lambda: "you have done nothing yet" in it.notice or "nothing has been started" in it.notice)
        it.client.task("raiseEventTopic", "/next", "SUCCEEDED", source="ros:camera")
        await it.press("exclamation_mark")
        await it.until(lambda: "you have done nothing yet" in it.notice)
        assert marks(it) == [] and not it.bars.mistake_line.is_open


async def test_the_mark_stands_in_the_log() -> None:
    async with console(size=(200, 50)) as it:
        id = it.client.act("Greet", "SUCCEEDED")
        log = it.pane("log").row_view
        await it.until(lambda: log.count == 1)
        record(it, id, "late")
        await it.until(lambda: "late" in plain_text(log.row_at(0).line))
        record(it, id, "none")
        await it.until(lambda: "late" not in plain_text(log.row_at(0).line))
