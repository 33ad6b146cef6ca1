from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from textual.widgets import Input, Static

from rise_engine.kernel.records import MemoryRecord
from rise_engine.scenario.model import Condition, Table
from rise_tui.actions import BY_ID
from rise_tui.key_labels import why_unavailable
from rise_tui.model.memory_changes import CHANGED
from rise_tui.model.store import Store
from rise_tui.panes.memory import MAX_PARTS, MemoryPane
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.reading import DetailScreen
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, demo


def pane_of(it: Console) -> MemoryPane:
    pane = it.pane("memory")
    assert isinstance(pane, MemoryPane)
    return pane


def remember(it: Console, key: str, value: Any, source: str = "rule:Main") -> None:
    """As an engine records a change."""
    old = it.client._view.memory.get(key)
    before = old.value if old is not None else None
    it.client.emit(MemoryRecord(0, 0.0, "", key, value, before, source, created=old is None))


async def at(it: Console, key: str) -> MemoryPane:
    pane = pane_of(it)
    await it.focus("memory")
    await it.until(lambda: it.row("memory", key))
    pane.row_list.select(key)
    return pane


async def typed(it: Console, text: str) -> None:
    await it.until(lambda: isinstance(it.app.focused, Input))
    assert isinstance(it.app.focused, Input)
    it.app.focused.value = text
    await it.pilot.pause()


def changed(it: Console, key: str, value: Any, source: str) -> None:
    """A change with which nothing was there before."""
    it.client.emit(MemoryRecord(0, 0.0, "", key, value, None, source, created=True))


# --- undo ------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_undo_brings_the_old_value_back_and_overwrites_nobody_silently() -> None:
    client = FakeClient(demo())
    async with console(client=client) as it:
        stack = it.screen.session.store.undo_stack
        await at(it, "side")
        remember(it, "side", "right", "wizard:anna#2")  # of another console
        await it.until(lambda: "right" in it.text("memory"))
        await it.press("ctrl+u")
        await it.until(lambda: "nothing to undo" in it.notice)
        remember(it, "side", "left")
        remember(it, "side", "right", "wizard:anna")
        await it.until(lambda: stack)
        client.answers = False
        await it.press("ctrl+u")
        await it.sent("assignValue", '{"side": "left"}')
        await it.press("ctrl+u")
        await it.until(lambda: "still on its way" in it.notice)
        assert len(client.sent) == 1, "an undo on its way is not sent twice"
        client.answer()
        remember(it, "side", "left", "wizard:anna")
        await it.until(lambda: not stack)
        await it.press("ctrl+u")
        assert len(it.client.sent) == 1 and "nothing to undo" in it.notice
        remember(it, "cups", 4, "wizard:anna")
        it.client.emit(MemoryRecord(0, 0.0, "", "side", None, "left", "wizard:anna", deleted=True))
        await it.until(lambda: len(stack) == 2)
        await it.press("ctrl+u")
        await it.until(lambda: it.client.asked()[1:] == [("assignValue", '{"side": "left"}')])
        remember(it, "side", "left", "wizard:anna")
        await it.until(lambda: len(stack) == 1)
        await it.press("ctrl+u")
        await it.sent("deleteValue", "cups")
        it.client.emit(MemoryRecord(0, 0.0, "", "cups", None, 4, "wizard:anna", deleted=True))
        await it.until(lambda: not stack)
        it.client.sent.clear()
        remember(it, "side", "right", "wizard:anna")
        remember(it, "side", "middle")
        await it.until(lambda: "middle" in it.text("memory"))
        await it.press("ctrl+u")
        await it.until(lambda: "side has changed since, to middle, by rule:Main" in it.notice)
        assert it.client.sent == []
        await it.press("ctrl+u")
        await it.sent("assignValue", '{"side": "left"}')


# --- values of the condition ------------------------------------------------------------------------------------------


async def test_a_value_of_the_condition_changes_after_a_question_and_the_title_tells() -> None:
    async with console() as it:
        remember(it, "quiet", True, "condition")
        await at(it, "quiet")
        remember(it, "quiet", False, "rule:Main")
        remember(it, "quiet", True, "wizard:bob")
        await it.until(lambda: "wizard:bob" in it.row("memory", "quiet"))
        assert CHANGED not in it.bars.status_line.text, "a rule may change it, and anybody may restore it"
        for keys, answer in ((("delete",), "escape"), (("enter", "false", "enter"), "escape")):
            await change(it, keys)
            await it.shows(Dialog)
            await it.press(answer)
        assert it.client.sent == []
        await change(it, ("enter", "false", "enter"))
        await it.shows(Dialog)
        remember(it, "quiet", True, "rule:Main")
        await it.press("c")
        await it.until(lambda: "quiet has changed meanwhile: nothing was sent" in it.notice)
        assert it.client.sent == []
        await change(it, ("enter", "false", "enter"))
        await it.shows(Dialog)
        assert "The condition set quiet to true at the start." in str(it.app.screen.query_one("#lines", Static).content)
        await it.press("c")
        await it.sent("assignValue", '{"quiet": false}')
        remember(it, "quiet", False, "wizard:anna")
        await it.until(lambda: CHANGED in it.bars.status_line.text)
        it.client.sent.clear()
        await change(it, ("enter", "maybe", "enter"))
        await it.sent("assignValue", '{"quiet": "maybe"}')
        remember(it, "quiet", True, "wizard:anna")
        await it.until(lambda: CHANGED not in it.bars.status_line.text)


async def change(it: Console, keys: tuple[str, ...]) -> None:
    """Press these keys; what is no key is typed."""
    for key in keys:
        if key in ("enter", "delete"):
            await it.press(key)
        else:
            await typed(it, key)


# --- conflicts -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_a_change_while_typing_must_be_confirmed() -> None:
    async with console(size=(80, 24)) as it:
        pane = await at(it, "task")
        line = pane.editor.conflict_line
        await it.press("enter")
        await typed(it, "5")
        remember(it, "task", 3)
        await it.until(lambda: line.text)
        remember(it, "task", 2)
        await it.until(lambda: not line.text, "a value that is as before again is no conflict")
        await it.press("enter")
        await it.sent("assignValue", '{"task": 5}')
        for size in ((80, 24), (120, 40)):
            it.client.sent.clear()
            await it.pilot.resize_terminal(*size)
            await it.press("enter")
            await typed(it, "5")
            remember(it, "task", 3)
            await it.until(lambda: "was 2, is now 3" in line.text)
            await it.press("enter")
            assert it.client.sent == [] and "enter again" in line.text
            remember(it, "task", 4)
            await it.until(lambda: "is now 4" in line.text)
            await it.press("enter")
            assert it.client.sent == []  # it has changed once more
            await it.press("enter")
            await it.sent("assignValue", '{"task": 5}')
            remember(it, "task", 2)
            await it.until(lambda: it.row("memory", "task").split()[1] == "2")
        it.client.sent.clear()
        await it.press("insert")
        await typed(it, "side")
        await it.until(lambda: "there is one already: left" in line.text)
        await it.press("enter")
        await typed(it, "up")
        await it.press("enter")
        assert it.client.sent == []
        await it.press("enter")
        await it.sent("assignValue", '{"side": "up"}')
        it.client.sent.clear()
        pane.row_list.select("task")
        await it.press("enter")
        it.client.emit(MemoryRecord(0, 0.0, "", "task", None, 2, "rule:Main", deleted=True))
        await it.until(lambda: "was 2, is deleted now" in line.text)
        await it.press("escape")
        assert it.client.sent == []


# --- nested values ---------------------------------------------------------------------------------------------------


PERSON = {"name": "Ada", "seen": [1, {"deep": True}]}


@pytest.mark.slow
async def test_values_unfold_fold_and_are_edited_in_parts() -> None:
    async with console(size=(120, 40)) as it:
        remember(it, "who", PERSON)
        pane = await at(it, "who")
        assert "▸" in it.row("memory", "who")
        await it.press("right")
        await it.until(lambda: ".name" in it.text("memory") and ".seen" in it.text("memory"))
        assert "▾" in it.row("memory", "who") and "Ada" in it.row("memory", ".name")
        await it.press("down", "down", "right", "down")
        await it.until(lambda: ".0" in it.text("memory"))
        await it.press("left")
        assert ".0" not in it.text("memory") and ".seen" in it.row("memory", ".seen")
        assert pane.row_list.current_id == "who\0seen"
        await it.press("left")
        await it.until(lambda: ".name" not in it.text("memory"))
        assert pane.row_list.current_id == "who"
        await it.press("right", "down", "delete")
        await it.sent("assignValue", json.dumps({"who": {"seen": PERSON["seen"]}}))
        await it.press("enter")
        await it.until(lambda: isinstance(it.app.focused, Input))
        assert isinstance(it.app.focused, Input) and it.app.focused.value == "Ada"
        await typed(it, "Grace")
        remember(it, "who", {**PERSON, "seen": [9]})  # another part: no conflict, and not overwritten
        await it.until(lambda: "[9]" in it.text("memory"))
        assert pane.editor.conflict_line.text == ""
        await it.press("enter")
        await it.sent("assignValue", json.dumps({"who": {"name": "Grace", "seen": [9]}}))
        it.client.sent.clear()
        await it.press("enter")
        await typed(it, "Grace")
        remember(it, "who", {**PERSON, "name": "Alan"})
        await it.until(lambda: "was Ada, is now Alan by rule:Main" in pane.editor.conflict_line.text)
        await it.press("enter")
        assert it.client.sent == []
        remember(it, "who", 7)
        await it.until(lambda: "is deleted now" in pane.editor.conflict_line.text)
        await it.press("enter", "enter")
        await it.until(lambda: "nothing was sent" in it.notice)
        assert it.client.sent == []
        remember(it, "who", PERSON)
        remember(it, "who.name", "flat")  # a flat key with a dot is itself
        await it.press("escape")
        await at(it, "who.name")
        await it.press("enter")
        await typed(it, "x")
        await it.press("enter")
        await it.sent("assignValue", '{"who.name": "x"}')
        remember(it, "list", list(range(5000)))
        await at(it, "list")
        await it.press("right")
        await it.until(lambda: f"and {5000 - MAX_PARTS} more" in it.text("memory"))
        assert it.text("memory").count("\n") < MAX_PARTS + 20


@pytest.mark.slow
async def test_a_table_shows_its_size_and_can_be_opened() -> None:
    rows: list[list[Any]] = [[number, f"Sentence {number}"] for number in range(1, 13)]
    scenario = replace(demo(), tables={"items": Table("items", ("id", "text"), rows)})
    async with console(size=(200, 50), client=FakeClient(scenario)) as it:
        pane = await at(it, "items")
        row = it.row("memory", "items")
        assert "12 rows x 2 columns" in row and "table" in row and "start" in row and "Sentence" not in row
        await it.press("right")
        await it.until(lambda: ".11 " in it.text("memory"))
        pane.row_list.select("items\0" + "2")
        await it.press("right")
        await it.until(lambda: "Sentence 3 " in it.text("memory"))
        for where in ("items", "items\0" + "2", "items\0" + "2\0text"):
            for key in ("enter", "delete"):
                it.screen.session.store.notice = None
                pane.row_list.select(where)
                await it.press(key)
                await it.until(lambda: "items is a table and cannot be changed here" in it.notice)
        assert not it.client.sent and not pane.editor.is_open


@pytest.mark.slow
async def test_a_long_value_can_be_read_in_full_filtered_and_told_from_others() -> None:
    words = " ".join(f"word{number}" for number in range(120))
    async with console(size=(80, 24)) as it:
        remember(it, "long", f"{words} needle")
        await at(it, "long")
        assert "…" in it.row("memory", "long")
        await it.press("right")
        screen = await it.shows(DetailScreen)
        await it.until(lambda: all(word in screen.list.text.split() for word in words.split()))
        assert "rule:Main" in screen.list.text
        await it.press("escape")
        assert it.app.screen is it.screen
        await it.press("slash", *"needle")  # a filter sees what the row has no room for
        await it.until(lambda: it.text("memory").strip().startswith("long"))
        await it.press("escape")
        for key in ("participant_name", "participant_number", "participant_name_of_the_second_person"):
            changed(it, key, 1, "wizard:anna")
        for size in ((200, 50), (120, 40), (80, 24)):  # at 80x24 `participan…` stood there twice
            await it.pilot.resize_terminal(*size)
            await it.until(lambda: it.text("memory").count("parti") == 3)
            shown = [line[1:].split()[0] for line in it.text("memory").splitlines() if "parti" in line]
            assert len(set(shown)) == 3, shown


# --- start values ----------------------------------------------------------------------------------------------------


def own_client(tmp_path: Path) -> tuple[FakeClient, Path]:
    folder = tmp_path / "study"
    shutil.copytree(demo().folder, folder)
    return FakeClient(replace(demo(), folder=str(folder))), folder / "memory.json"


async def test_the_memory_is_saved_as_start_values_after_asking(tmp_path: Path) -> None:
    client, path = own_client(tmp_path)
    before = path.read_text("utf-8")
    async with console(client=client, size=(120, 40)) as it:
        it.screen.action_do("memory.save")
        await it.until(lambda: "nothing to save" in it.notice)
        await at(it, "task")
        remember(it, "task", 9)
        await it.until(lambda: "9" in it.row("memory", "task"))
        it.screen.action_do("memory.save")
        await it.shows(Dialog)
        await it.press("escape")
        assert path.read_text("utf-8") == before
        it.screen.action_do("memory.save")
        await it.shows(Dialog)
        await it.press("s")
        await it.until(lambda: "saved 1 start value in memory.json; the rest is unchanged" in it.notice)
        assert path.read_text("utf-8") == before.replace('"task": 2', '"task": 9') and client.sent == []
        shutil.rmtree(path.parent)
        it.screen.action_do("memory.save")
        await it.until(lambda: "not on this computer" in it.notice)
        assert it.app.screen is it.screen


async def test_what_makes_a_condition_and_what_the_engine_keeps_are_no_start_values(tmp_path: Path) -> None:
    client, path = own_client(tmp_path)
    conditions = {"A": Condition({"task": 7}), "B": Condition({"task": 8, "voice": "low"})}
    client.scenario = replace(client.scenario, conditions=conditions, reads_session=True)
    before = path.read_text("utf-8")
    async with console(client=client, size=(120, 40)) as it:
        await at(it, "task")
        for key, value, source in (
            ("task", 8, "condition"),
            ("voice", "low", "condition"),
            ("task", 9, "wizard:anna"),
            ("pace", "slow", "study"),
            ("session", {"cue": False}, "engine"),
        ):
            changed(it, key, value, source)
        it.screen.action_do("memory.save")
        await it.until(lambda: "nothing to save" in it.notice)
        remember(it, "other", 3)
        it.screen.action_do("memory.save")
        await it.shows(Dialog)
        await it.press("s")
        await it.until(lambda: "saved 1 start value" in it.notice)
    assert path.read_text("utf-8") == before.replace('"Ada"}', '"Ada"}, {"other": 3}')


def test_who_only_watches_cannot_save() -> None:
    for options in ({"replay": True}, {"role": "observer", "holder": None, "you": "observer:bob"}):
        client = FakeClient(demo(), **options)  # type: ignore[arg-type]
        assert why_unavailable(BY_ID["memory.save"], Store(client.attach_reply(), "anna", client.now))
