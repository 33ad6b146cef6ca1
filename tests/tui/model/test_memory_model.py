"""What the memory's pane thinks with: parts of values, undo, start values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.author.edit.memory import memory_file_text
from rise_engine.author.edit.plan import EditRefused
from rise_engine.expression import lookup
from rise_engine.kernel.records import MemoryRecord
from rise_engine.kernel.view import MemoryView
from rise_engine.scenario.loader import load
from rise_tui.model.memory_changes import (
    MAX_CHANGES,
    NoSuchPath,
    UndoStack,
    children,
    path_text,
    value_at,
    with_removed,
    with_replaced,
)
from rise_tui.panes.save_start_values import (
    describe_changes,
    memory_file_path,
    save_memory,
)
from tests.tui.fake import demo

json_values = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.text("ab", max_size=3),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text("abc", min_size=1, max_size=2), inner, max_size=3)
    ),
    max_leaves=12,
)


def paths(value: Any, lead: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    return [found for step, inner in children(value) for found in [(*lead, step), *paths(inner, (*lead, step))]]


@given(json_values, st.data())
def test_a_part_is_replaced_and_nothing_else(value: Any, data: st.DataObject) -> None:
    found = paths(value)
    before = json.dumps(value)
    if found:
        path = data.draw(st.sampled_from(found))
        changed = with_replaced(value, path, "NEW")
        assert value_at(changed, path) == "NEW" and json.dumps(value) == before
        assert with_replaced(changed, path, value_at(value, path)) == value
        assert lookup({"k": value}, path_text(("k", *path))) == (True, value_at(value, path))
        gone = with_removed(value, path)
        assert json.dumps(value) == before and len(paths(gone)) < len(found)


@pytest.mark.parametrize("path", [("b",), ("a", 5), ("a", "x"), (0,), ("a", 0, "deep")])
def test_what_is_not_there_says_so(path: tuple[str | int, ...]) -> None:
    value = {"a": [1, 2]}
    with pytest.raises(NoSuchPath):
        value_at(value, path)
    with pytest.raises(NoSuchPath):
        with_replaced(value, path, 1)
    with pytest.raises(NoSuchPath):
        with_removed(value, path)


# --- undo ------------------------------------------------------------------------------------------------------------


class Memory:
    """A memory, as the engine keeps it, and the undo of one of its consoles."""

    def __init__(self, **values: Any) -> None:
        self.view = {key: MemoryView(value, None, "file", 0.0) for key, value in values.items()}
        self.stack = UndoStack()

    @property
    def values(self) -> dict[str, Any]:
        return {key: entry.value for key, entry in self.view.items()}

    def set(self, key: str, value: Any, source: str = "me") -> None:
        old = self.view.get(key)
        record = MemoryRecord(0, 0.0, "", key, value, old.value if old else None, source, created=old is None)
        self.view[key] = MemoryView(value, record.old, source, 0.0)
        if source == "me":
            self.stack.record_change(record)

    def delete(self, key: str, source: str = "me") -> None:
        old = self.view.pop(key).value
        if source == "me":
            self.stack.record_change(MemoryRecord(0, 0.0, "", key, None, old, source, deleted=True))

    def undo(self) -> str:
        """Press undo once; what it asks for is done as an engine would."""
        step = self.stack.next_step(self.view)
        if step.function == "deleteValue":
            self.delete(step.behavior)
        elif step.function == "assignValue":
            for key, value in json.loads(step.behavior).items():
                self.set(key, value)
        return f"{step.kind}: {step.notice}"


def test_set_add_and_delete_are_taken_back_newest_first() -> None:
    memory = Memory(side="left", task=1)
    memory.set("side", "right")
    memory.set("cups", 4)
    memory.delete("task")
    assert memory.undo() == "do: undoing: task is 1 again, was deleted" and memory.values["task"] == 1
    assert memory.undo() == "do: undoing: cups is deleted again" and "cups" not in memory.values
    assert memory.undo() == "do: undoing: side is left again, was right"
    assert memory.values == {"side": "left", "task": 1}
    assert memory.undo() == "nothing: nothing to undo"


def test_what_somebody_else_changed_since_is_asked_about() -> None:
    memory = Memory(side="left")
    memory.set("side", "right")
    memory.set("side", "middle", "rule:Main")
    assert memory.undo() == ("ask: side has changed since, to middle, by rule:Main: undo again makes it left again")
    assert memory.values["side"] == "middle"
    memory.set("side", "up", "rule:Main")
    assert memory.undo().startswith("ask") and memory.values["side"] == "up"  # it has changed once more
    assert memory.undo().startswith("do") and memory.values["side"] == "left"


def test_one_is_not_true() -> None:
    memory = Memory(flag=False)
    memory.set("flag", 1)
    memory.set("flag", True, "rule:Main")
    assert memory.undo().startswith("ask")


def test_what_was_added_and_is_gone_already_needs_no_undo() -> None:
    memory = Memory()
    memory.set("cups", 4)
    memory.delete("cups", "rule:Main")
    assert memory.undo().startswith("ask")
    assert memory.undo() == "nothing: cups is already gone" and len(memory.stack) == 0


def test_an_own_change_between_the_undo_and_its_record_stays() -> None:
    memory = Memory(a=1, b=1)
    memory.set("a", 2)
    memory.stack.next_step(memory.view)  # asked for; its record comes after the next one
    memory.set("b", 2)
    memory.set("a", 1)
    assert len(memory.stack) == 1 and "b is 1 again" in memory.undo()


def test_the_stack_is_bounded() -> None:
    memory = Memory(a=0)
    for number in range(MAX_CHANGES + 50):
        memory.set("a", number)
    assert len(memory.stack) == MAX_CHANGES
    memory.stack.clear()
    assert memory.undo().startswith("nothing")


@given(st.lists(st.tuples(st.sampled_from("abc"), st.none() | st.integers(0, 3)), max_size=20))
def test_undoing_everything_gives_the_beginning(changes: list[tuple[str, int | None]]) -> None:
    memory = Memory(a=7, b=8)
    for key, value in changes:
        if value is not None:
            memory.set(key, value)
        elif key in memory.view:
            memory.delete(key)
    for _ in range(len(changes)):
        memory.undo()
    assert memory.values == {"a": 7, "b": 8} and len(memory.stack) == 0


# --- start values ----------------------------------------------------------------------------------------------------


def scenario_in(tmp_path: Path) -> Path:
    import shutil

    folder = tmp_path / "study"
    shutil.copytree(demo().folder, folder)
    return folder


@pytest.mark.parametrize("text", ["", "[]", '{"a": 1, "a": 2}', '{"WorkingMemory": [1]}', '{"a": 1', '{"a": NaN}'])
def test_a_file_that_is_no_memory_is_left_alone(text: str, tmp_path: Path) -> None:
    path = tmp_path / "memory.json"
    path.write_text(text)
    with pytest.raises(EditRefused, match=r"memory\.json: "):
        save_memory(path, {"a": 1}, {"a": 2})
    assert path.read_text() == text and [each.name for each in tmp_path.iterdir()] == ["memory.json"]


def test_start_values_are_written_and_read_back(tmp_path: Path) -> None:
    folder = scenario_in(tmp_path)
    scenario = load(str(folder)).scenario
    assert scenario is not None
    path = memory_file_path(scenario)
    path.chmod(0o640)
    memory = {"task": 5, "name": 'Ada "A"', "list": [1, {"x": None}], "é": True}
    save_memory(path, scenario.memory, memory)
    assert path == folder / "memory.json" and path.stat().st_mode & 0o777 == 0o640
    again = load(str(folder)).scenario
    assert again is not None and again.memory == memory
    assert [each.name for each in folder.iterdir() if each.name.startswith(".")] == []
    path.unlink()
    save_memory(path, scenario.memory, memory)
    assert path.read_text("utf-8") == memory_file_text(memory)


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    folder = scenario_in(tmp_path)
    shared = folder / "shared"
    shared.mkdir()
    (folder / "memory.json").rename(shared / "memory.json")
    (folder / "memory.json").symlink_to("shared/memory.json")
    scenario = load(str(folder)).scenario
    assert scenario is not None
    before = (shared / "memory.json").read_text("utf-8")
    save_memory(memory_file_path(scenario), scenario.memory, {**scenario.memory, "task": 3})
    assert (folder / "memory.json").is_symlink()
    assert (shared / "memory.json").read_text("utf-8") == before.replace('"task": 2', '"task": 3')
    assert [each.name for each in shared.iterdir()] == ["memory.json"]


def test_a_folder_that_cannot_be_written_is_said_before_anything_is_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = scenario_in(tmp_path)
    scenario = load(str(folder)).scenario
    assert scenario is not None
    monkeypatch.setattr("os.access", lambda path, mode: False)  # root may write everywhere
    with pytest.raises(EditRefused, match="cannot be written by you; work on a copy of the study's folder"):
        memory_file_path(scenario)


def test_a_file_that_cannot_be_written_stays_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = scenario_in(tmp_path)
    path = folder / "memory.json"
    before = path.read_text("utf-8")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(EditRefused, match="No space left"):
        save_memory(path, {}, {"a": 1})
    assert path.read_text("utf-8") == before and sorted(each.name for each in folder.iterdir()) == sorted(
        each.name for each in Path(demo().folder).iterdir()
    )


def test_no_folder_is_said(tmp_path: Path) -> None:
    folder = scenario_in(tmp_path)
    scenario = load(str(folder)).scenario
    assert scenario is not None
    folder.rename(tmp_path / "elsewhere")
    with pytest.raises(EditRefused, match="not on this computer"):
        memory_file_path(scenario)


def test_changes_are_named() -> None:
    assert describe_changes({"a": 1, "b": 2, "c": True}, {"a": 1, "b": 3, "d": "x", "c": 1}) == [
        "b: 2 → 3",
        "c: true → 1",
        "d: (new) → x",
    ]
    assert describe_changes({"a": 1}, {}) == ["a: 1 → (no such key)"]
