"""Renaming in the data of a scenario: task files and tests, `study.toml`, translations."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from rise_engine.author.edit.edits import NameKind
from rise_engine.author.edit.plan import EditedText, Files, Splice
from rise_engine.base.json_codec import JsonArray, JsonError, JsonObject, read_json
from rise_engine.expression.key_places import KeyPlace, keys_in_assignment, keys_in_slots
from rise_engine.scenario.model import normal_topic
from rise_engine.syntax.changes import TextEdit, changed_text, edits_between
from rise_engine.syntax.toml import KeyPath
from rise_engine.syntax.toml_edits import TomlText, rename_key, set_value


class Renaming:
    """The effect of a rename on names of every kind; renaming an act also renames the events of its end."""

    def __init__(self, kind: NameKind, owner: str, old: str, new: str, events: dict[str, str]) -> None:
        """:param kind: what is renamed.
        :param owner: the rule of a state or the act of an action; otherwise empty.
        :param old: the name alone, without the owner and without slash.
        :param new: the new name.
        :param events: the new names of events that change with it, by the old names, without slash.
        """
        self.kind, self.owner, self.old, self.new = kind, owner, old, new
        self.events = events

    def act(self, name: str) -> str:
        return self.new if self.kind == "act" and name == self.old else name

    def rule(self, name: str) -> str:
        return self.new if self.kind == "rule" and name == self.old else name

    def state(self, rule: str, name: str) -> str:
        return self.new if self.kind == "state" and (rule, name) == (self.owner, self.old) else name

    def event(self, written: str) -> str:
        """Rename an event, or the end of an act as in a record, `ended R_Yes succeeded`, which a test may expect."""
        topic, end = normal_topic(written), f"ended {self.old} "
        if self.kind == "act" and topic.startswith(end) and " " not in topic.removeprefix(end):
            return written.replace(end, f"ended {self.new} ", 1)
        return written.replace(topic, self.events[topic]) if topic in self.events else written

    def key(self, written: str) -> str:
        """Rename a memory key or a part of it: `person.name`, if `person` is renamed."""
        renamed = renamed_key(written, self.old, self.new) if self.kind == "key" else None
        return written if renamed is None else renamed

    def keys_in(self, text: str, places: Iterable[KeyPlace]) -> str:
        """Rename the key at these places of a text."""
        return rename_in(text, places, self.old, self.new) if self.kind == "key" else text


def renamed_key(written: str, old: str, new: str) -> str | None:
    """Return a key's new name if `old` becomes `new`, also for a part: `person.name`. None: it is another key."""
    if written == old:
        return new
    return new + written[len(old) :] if written.startswith(f"{old}.") else None


def rename_in(text: str, places: Iterable[KeyPlace], old: str, new: str) -> str:
    """Rename a key at these places of a text."""
    for place in sorted(places, key=lambda each: each.start, reverse=True):
        renamed, end = renamed_key(place.key, old, new), place.start + len(place.key)
        if renamed is not None and text[place.start : end] == place.key:
            text = text[: place.start] + renamed + text[end:]
    return text


# --- data files ------------------------------------------------------------------------------------------------------


_STUDY = "study.toml"
_TEXTS = "texts/"


def data_splices(files: Files, renaming: Renaming) -> Iterator[Splice]:
    """Yield the changes of task files, study.toml and translations.

    :raises EditRefused: one of these files cannot be read, or cannot contain the new name.
    """
    for name in sorted(files):
        if name.endswith(".jsonl"):
            yield from task_splices(EditedText(name, files[name]), renaming)
        elif name == _STUDY and renaming.kind == "key":
            yield from _toml_splices(EditedText(name, files[name]), lambda text: _in_study(text, renaming))
        elif name.startswith(_TEXTS) and name.endswith(".toml"):
            change: Callable[[str], str] | None = {
                "act": lambda text: _in_table_names(text, renaming),
                "action": lambda text: _in_text_ids(text, renaming),
                "key": lambda text: _in_texts(text, renaming),
            }.get(renaming.kind)
            if change is not None:
                yield from _toml_splices(EditedText(name, files[name]), change)


# --- TOML files -------------------------------------------------------------------------------------------------------


def _toml_splices(file: EditedText, change: Callable[[str], str]) -> Iterator[Splice]:
    with file.refusing():
        after = change(file.text)
    return iter(file.splices(edits_between(file.text, after)))


def _in_study(text: str, renaming: Renaming) -> str:
    """Rename the key in the memory values of factors' levels."""
    factors = TomlText(text).values.get("factors")
    for factor, values in _tables(factors):
        for level, given in _tables(values.get("levels")):
            for key in _tables_or_none(given.get("memory")):
                new = renaming.key(key)
                if new != key:
                    text = rename_key(text, ("factors", factor, "levels", level, "memory", key), new)
    return text


def _in_table_names(text: str, renaming: Renaming) -> str:
    return rename_key(text, (renaming.old,), renaming.new) if renaming.old in TomlText(text).values else text


def _in_text_ids(text: str, renaming: Renaming) -> str:
    for key in _tables_or_none(TomlText(text).values.get(renaming.owner)):
        if key == renaming.old or key.startswith(f"{renaming.old}/"):
            text = rename_key(text, (renaming.owner, key), renaming.new + key[len(renaming.old) :])
    return text


def _in_texts(text: str, renaming: Renaming) -> str:
    """Rename the key in the slots of translations and of their originals."""
    toml = TomlText(text)
    changes: list[tuple[KeyPath, str]] = []
    for path in toml.entries:
        value = toml.find(path)
        if isinstance(value, str):
            renamed = renaming.keys_in(value, keys_in_slots(value))
            if renamed != value:
                changes.append((path, renamed))
    for path, value in changes:
        text = set_value(text, path, value)
    return text


def _tables(values: Any) -> list[tuple[str, dict[str, Any]]]:
    return [(key, each) for key, each in _tables_or_none(values).items() if isinstance(each, dict)]


def _tables_or_none(values: Any) -> dict[str, Any]:
    return values if isinstance(values, dict) else {}


# --- task files and tests, line by line ------------------------------------------------------------------------------


def task_splices(file: EditedText, renaming: Renaming) -> tuple[Splice, ...]:
    """Find the changes of a task file. Lines that are not JSON objects stay; the file's reader reports them."""
    return _line_splices(file, lambda edits, value: _edit_task(edits, value, renaming))


def pressed_key_splices(file: EditedText, old: str, new: str) -> tuple[Splice, ...]:
    """Find the changes of a study's test for another key of the keyboard: `{"key": "n"}`."""

    def press(edits: _JsonEdits, value: JsonObject) -> None:
        for member in value.members:
            if member.key == "key" and member.value == old:
                edits.replace(member.value_at, old, new)

    return _line_splices(file, press)


def _line_splices(file: EditedText, change: Callable[[_JsonEdits, JsonObject], None]) -> tuple[Splice, ...]:
    """Change each line that is a JSON object."""
    found: list[TextEdit] = []
    at = 0
    for line in file.text.splitlines(keepends=True):
        edits = _JsonEdits(line)
        if line.lstrip().startswith("{") and (value := _read(line)) is not None:
            change(edits, value)
        found += (TextEdit(at + edit.start, at + edit.end, edit.text) for edit in edits.found)
        at += len(line)
    return file.splices(found)


def _edit_task(edits: _JsonEdits, value: JsonObject, renaming: Renaming) -> None:
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


class _JsonEdits:
    """Collects the changes of a JSON text."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.found: list[TextEdit] = []

    def replace(self, at: int, old: str, new: str) -> None:
        """Replace a text at its place, with escapes if the old one had them."""
        if old != new:
            end = json.JSONDecoder().raw_decode(self.text, at)[1]
            is_escaped = self.text[at:end].isascii() and not old.isascii()
            self.found.append(TextEdit(at, end, json.dumps(new, ensure_ascii=is_escaped)))

    def rename_keys(self, value: Any, name: Callable[[str], str]) -> None:
        """Rename the keys of an object."""
        for member in value.members if isinstance(value, JsonObject) else ():
            self.replace(member.key_at, member.key, name(member.key))

    def rename_items(self, value: Any, name: Callable[[str], str]) -> None:
        """Rename the texts of an array."""
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
    """Rename within the behavior of a task that is a text: a name, an assignment, or JSON."""
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
    """Rename within the behavior of a task that is an object (rise_engine/kernel/behaviors.py)."""
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
    """Rename within the expectations of a study's test: states of rules, values of keys, acts and events."""
    rules = value.get("rules")
    for member in rules.members if isinstance(rules, JsonObject) else ():
        edits.replace(member.key_at, member.key, renaming.rule(member.key))
        if isinstance(member.value, str):
            edits.replace(member.value_at, member.value, renaming.state(member.key, member.value))
    edits.rename_keys(value.get("memory"), renaming.key)
    edits.rename_items(value.get("starts"), renaming.act)
    edits.rename_items(value.get("events"), renaming.event)
