"""A wizard's own errors as data: one key after the act, and the better word within four seconds."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from rise_engine.kernel.records import MistakeRecord
from rise_engine.kernel.task_view import TaskView
from rise_tui.model.failures import newest_markable
from rise_tui.rendering.text import plain_text
from rise_tui.widgets import fields as line
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo

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


@pytest.mark.slow
async def test_the_newest_act_is_wrong_at_once_and_a_letter_is_the_better_word(monkeypatch: pytest.MonkeyPatch) -> None:
    async with console() as it:
        await it.press("exclamation_mark")
        await it.until(lambda: "you have done nothing yet" in it.notice or "nothing has been started" in it.notice)
        it.client.task("raiseEventTopic", "/next", "SUCCEEDED", source="ros:camera")
        await it.press("exclamation_mark")
        await it.until(lambda: "you have done nothing yet" in it.notice)
        assert marks(it) == [] and not it.bars.mistake_line.is_open
        it.client.act("Praise", "SUCCEEDED")
        id = it.client.act("Greet")
        await it.press("exclamation_mark")
        await it.until(lambda: marks(it) == [f"{id} wrong"])
        assert it.client.sent[-1].pressed is not None
        assert it.bars.mistake_line.has_focus
        record(it, id, "wrong")
        await it.until(lambda: "! marked wrong" in it.bars.mistake_line.text and "Greet" in it.bars.mistake_line.text)
        for piece in ("w wrong", "l late", "e early", "d double", "o undo", "esc"):
            assert piece in it.bars.mistake_line.text
        await it.press("escape")
        for key, better in (("l", "late"), ("e", "early"), ("d", "double"), ("o", "none"), ("w", ""), ("escape", "")):
            it.client.sent.clear()
            await it.pilot.pause(0.6)  # beyond the time in which a second press is the same one
            await it.press("exclamation_mark", key)
            wanted = [f"{id} wrong", *([f"{id} {better}"] if better else [])]
            await it.until(lambda wanted=wanted: marks(it) == wanted, key)  # type: ignore[misc]
            await it.until(lambda: it.pane("acts").row_view.has_focus and not it.bars.mistake_line.is_open)
            await it.pilot.pause(0.1)
            assert marks(it) == wanted, "wrong it is already"
            assert it.bars.notice_line.display
        it.client.sent.clear()
        await it.pilot.pause(0.6)
        await it.press("exclamation_mark", "p")  # any other key closes it and does what it always does
        await it.sent(ACT, "Praise")
        assert marks(it) == [f"{id} wrong"] and not it.bars.mistake_line.is_open
        await it.pilot.pause(0.6)
        await it.press("exclamation_mark", "f3")
        await it.until(lambda: it.pane("rule").row_view.has_focus)
        await it.press("f2")
        monkeypatch.setattr(line, "OPEN_SECONDS", 0.2)
        await it.pilot.pause(0.6)
        await it.press("exclamation_mark")
        await it.until(lambda: not it.bars.mistake_line.is_open and it.pane("acts").row_view.has_focus)
        await it.press("g")  # closed by itself, it swallows nothing
        await it.sent(ACT, "Greet")


@pytest.mark.slow
async def test_whatever_key_was_pressed_last_is_marked_by_its_name() -> None:
    scenario = demo()
    judged = replace(scenario.keys["n"], key="k", label="k", behavior="/understood", title="understood", keep=2.0)
    keys = {**scenario.keys, "e": replace(scenario.keys["g"], key="e", label="e"), "k": judged}
    async with console(client=FakeClient(replace(scenario, keys=keys)), size=(80, 24)) as it:
        tasks = it.screen.session.store.view.tasks
        for key, function, name in (
            ("n", "raiseEventTopic", "n: raised next"),
            ("u", "assignValue", "u: understood = true"),
            ("m", "startInteractionRule", "m: rule Main"),
            ("p", ACT, "Praise"),
            ("space", "markCue", "cue"),
            ("k", "raiseEventTopic", "k: understood"),  # it may come early: what the author calls it
        ):
            it.client.sent.clear()
            await it.press(key)
            await it.until(lambda function=function: it.client.sent and it.client.sent[0].function == function)  # type: ignore[misc]
            await it.until(lambda: it.client._tasks in tasks)
            id = it.client._tasks
            it.client.act("Praise", source="rule:Main")  # what the key has led to
            await it.pilot.pause(0.6)
            await it.press("exclamation_mark")
            await it.until(lambda id=id: marks(it) == [f"{id} wrong"], name)  # type: ignore[misc]
            record(it, id, "wrong")
            await it.until(lambda name=name: f"! marked wrong {name} " in it.bars.mistake_line.text, name)  # type: ignore[misc]
            assert "d double" in it.bars.mistake_line.text
            await it.press("escape")
        it.client.sent.clear()
        await it.pilot.pause(0.6)
        await it.press("exclamation_mark")
        assert "r early" in it.bars.mistake_line.text, "no letter of the line is a key of the study"
        await it.press("e")
        await it.sent(ACT, "Greet")
        assert len(marks(it)) == 1


async def test_a_second_console_is_the_same_person_and_the_mark_stands_in_the_log() -> None:
    client = FakeClient(demo(), you="wizard:anna#2", holder="wizard:anna#2")
    id = client.act("Greet", "SUCCEEDED")
    async with console(client=client, size=(200, 50)) as it:
        await it.press("exclamation_mark")
        await it.until(lambda: marks(it) == ["1 wrong"])
        log = it.pane("log").row_view
        record(it, id, "late")
        await it.until(lambda: "late" in plain_text(log.row_at(0).line))
        record(it, id, "none")
        await it.until(lambda: "late" not in plain_text(log.row_at(0).line))
