"""A name in task files and in tests of a study, `*.jsonl`: line by line, as the file has them."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from rise_engine.author.edit.plan import Splice
from rise_engine.author.edit.renaming import Renaming
from rise_engine.author.edit.text_edits import EditedText
from rise_engine.base.json_codec import JsonArray, JsonError, JsonObject, read_json
from rise_engine.expression.key_places import keys_in_assignment
from rise_engine.syntax.changes import TextEdit, changed_text


def task_splices(file: EditedText, renaming: Renaming) -> tuple[Splice, ...]:
    """What changes in a task file. A line that is no JSON object is left to whoever reads the file."""
    edits: list[TextEdit] = []
    at = 0
    for line in file.text.splitlines(keepends=True):
        if line.lstrip().startswith("{"):
            edits += (TextEdit(at + edit.start, at + edit.end, edit.text) for edit in _line_edits(line, renaming))
        at += len(line)
    return file.splices(edits)


def pressed_key_splices(file: EditedText, old: str, new: str) -> tuple[Splice, ...]:
    """What changes in a test of the study when another key of the keyboard is pressed: `{"key": "n"}`."""
    edits: list[TextEdit] = []
    at = 0
    for line in file.text.splitlines(keepends=True):
        found, value = _JsonEdits(line), _read(line) if line.lstrip().startswith("{") else None
        for member in value.members if value is not None else ():
            if member.key == "key" and member.value == old:
                found.replace(member.value_at, old, new)
        edits += (TextEdit(at + edit.start, at + edit.end, edit.text) for edit in found.found)
        at += len(line)
    return file.splices(edits)


def _line_edits(line: str, renaming: Renaming) -> list[TextEdit]:
    value = _read(line)
    if value is None:
        return []
    edits = _JsonEdits(line)
    function = value.get("function_type")
    for member in value.members:
        if member.key == "domain_task_behavior" and isinstance(function, str):
            if isinstance(member.value, str):
                edits.replace(member.value_at, member.value, _behavior(function, member.value, renaming))
            elif isinstance(member.value, JsonObject):
                _edit_behavior(edits, function, member.value, renaming)
        elif member.key == "expect" and isinstance(member.value, JsonObject):
            _edit_expectation(edits, member.value, renaming)
        elif member.key == "memory":
            edits.rename_keys(member.value, renaming.key)
    return edits.found


class _JsonEdits:
    """Collects what changes in a JSON text."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.found: list[TextEdit] = []

    def replace(self, at: int, old: str, new: str) -> None:
        """Another text for the one that stands there, written with escapes if that one was."""
        if old != new:
            end = json.JSONDecoder().raw_decode(self.text, at)[1]
            is_escaped = self.text[at:end].isascii() and not old.isascii()
            self.found.append(TextEdit(at, end, json.dumps(new, ensure_ascii=is_escaped)))

    def rename_keys(self, value: Any, name: Callable[[str], str]) -> None:
        """The keys of an object."""
        for member in value.members if isinstance(value, JsonObject) else ():
            self.replace(member.key_at, member.key, name(member.key))

    def rename_items(self, value: Any, name: Callable[[str], str]) -> None:
        """The texts of an array."""
        if isinstance(value, JsonArray):
            for item, at in zip(value, value.items_at, strict=True):
                if isinstance(item, str):
                    self.replace(at, item, name(item))


def _read(text: str) -> JsonObject | None:
    try:
        value = read_json(text, lambda key, at, first: None)
    except JsonError:
        return None
    return value if isinstance(value, JsonObject) else None


def _behavior(function: str, behavior: str, renaming: Renaming) -> str:
    """The behaviour of a task that is a text: a name, an assignment, or JSON."""
    if function == "assignValue":
        return renaming.keys_in(behavior, keys_in_assignment(behavior))
    if behavior.lstrip().startswith("{"):
        value = _read(behavior)
        if value is None:
            return behavior
        edits = _JsonEdits(behavior)
        _edit_behavior(edits, function, value, renaming)
        return changed_text(behavior, edits.found)
    match function:
        case "startCommunicationRobotAct" | "stopCommunicationRobotAct":
            return renaming.act(behavior)
        case "startInteractionRule" | "stopInteractionRule" | "stepBack":
            return renaming.rule(behavior)
        case "raiseEventTopic":
            return renaming.event(behavior)
        case "deleteValue":
            return renaming.key(behavior)
    return behavior


def _edit_behavior(edits: _JsonEdits, function: str, value: JsonObject, renaming: Renaming) -> None:
    """The behaviour of a task that is an object (rise_engine/kernel/behaviors.py)."""
    if function == "assignValue":
        edits.rename_keys(value, renaming.key)
        return
    if function == "releaseStop":
        edits.rename_keys(value, renaming.rule)
        return
    rule = value.get("rule")
    for member in value.members:
        if member.key == "take_back":
            edits.rename_items(member.value, renaming.key)
        elif isinstance(member.value, str):
            new = member.value
            if member.key == "rule":
                new = renaming.rule(new)
            elif member.key == "state" and isinstance(rule, str):
                new = renaming.state(rule, new)
            elif member.key == "event":
                new = renaming.event(new)
            edits.replace(member.value_at, member.value, new)


def _edit_expectation(edits: _JsonEdits, value: JsonObject, renaming: Renaming) -> None:
    """What a test of the study expects: states of rules, values of keys, acts and events."""
    rules = value.get("rules")
    for member in rules.members if isinstance(rules, JsonObject) else ():
        edits.replace(member.key_at, member.key, renaming.rule(member.key))
        if isinstance(member.value, str):
            edits.replace(member.value_at, member.value, renaming.state(member.key, member.value))
    edits.rename_keys(value.get("memory"), renaming.key)
    edits.rename_items(value.get("starts"), renaming.act)
    edits.rename_items(value.get("events"), renaming.event)
