"""A name in what stands beside a scenario: task files, `study.toml`, translations."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any

from rise_engine.edit.edits import Rename
from rise_engine.edit.plan import EditRefused, Files, Splice
from rise_engine.edit.text_edits import EditedText, TextEdit, edits_between
from rise_engine.edit.toml_edits import TomlText, rename_key, set_value
from rise_engine.edit.written_keys import json_keys, keys_in_assignment, keys_in_slots, rename_in, renamed_key
from rise_engine.json_codec import JsonError, JsonObject, read_json
from rise_engine.scenario.model import normal_topic
from rise_engine.scenario.toml_syntax import KeyPath

_STUDY = "study.toml"
_TEXTS = "texts/"


class Renaming:
    """What a rename makes of names of every kind: an act's new name is that of the events of its end, too."""

    def __init__(self, edit: Rename, owner: str, old: str, events: dict[str, str]) -> None:
        """
        :param edit: what is asked for.
        :param owner: of a state its rule, of an action its act; otherwise empty.
        :param old: the name alone, without the owner.
        :param events: events that are called otherwise because of it: old name, new name, without slash.
        """
        self.kind, self.owner, self.old, self.new = edit.kind, owner, old, edit.new
        self.events = events

    def act(self, name: str) -> str:
        return self.new if self.kind == "act" and name == self.old else name

    def rule(self, name: str) -> str:
        return self.new if self.kind == "rule" and name == self.old else name

    def state(self, rule: str, name: str) -> str:
        return self.new if self.kind == "state" and (rule, name) == (self.owner, self.old) else name

    def event(self, written: str) -> str:
        topic = normal_topic(written)
        return written.replace(topic, self.events[topic]) if topic in self.events else written


def data_splices(files: Files, renaming: Renaming) -> Iterator[Splice]:
    """What changes in task files, study.toml and translations.

    :raises EditRefused: one of these files cannot be read, or the new name cannot stand there.
    """
    for name in sorted(files):
        if name.endswith(".jsonl"):
            yield from _task_splices(EditedText(name, files[name]), renaming)
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


# --- task files -------------------------------------------------------------------------------------------------------


def _task_splices(file: EditedText, renaming: Renaming) -> Iterator[Splice]:
    """Line by line: each is a JSON object; what is none is left to whoever reads the file."""
    at = 0
    edits: list[TextEdit] = []
    for line in file.text.splitlines(keepends=True):
        if line.lstrip().startswith("{"):
            edits += (TextEdit(at + start, at + end, text) for start, end, text in _task_edits(line, renaming))
        at += len(line)
    return iter(file.splices(edits))


def _task_edits(line: str, renaming: Renaming) -> Iterator[TextEdit]:
    try:
        task = read_json(line, lambda key, at, first: None)
    except JsonError:
        return
    if not isinstance(task, JsonObject):
        return
    function = task.get("function_type")
    member = next((each for each in task.members if each.key == "domain_task_behavior"), None)
    if member is None or not isinstance(function, str):
        return
    behavior = member.value
    if isinstance(behavior, str):
        renamed = _behavior(function, behavior, renaming)
        if renamed != behavior:
            end = json.JSONDecoder().raw_decode(line, member.value_at)[1]
            ascii_only = line[member.value_at : end].isascii() and behavior != renamed and not behavior.isascii()
            yield TextEdit(member.value_at, end, json.dumps(renamed, ensure_ascii=ascii_only))
    elif isinstance(behavior, JsonObject):
        written_end = json.JSONDecoder().raw_decode(line, member.value_at)[1]
        written = line[member.value_at : written_end]
        renamed = _json_behavior(function, written, renaming)
        yield from (
            TextEdit(member.value_at + edit.start, member.value_at + edit.end, edit.text)
            for edit in edits_between(written, renamed)
        )


def _behavior(function: str, behavior: str, renaming: Renaming) -> str:
    if behavior.lstrip().startswith("{"):
        return _json_behavior(function, behavior, renaming)
    match function:
        case "startCommunicationRobotAct" | "stopCommunicationRobotAct":
            return renaming.act(behavior)
        case "startInteractionRule" | "stopInteractionRule" | "stepBack":
            return renaming.rule(behavior)
        case "raiseEventTopic":
            return renaming.event(behavior)
        case "assignValue" if renaming.kind == "key":
            return rename_in(behavior, keys_in_assignment(behavior), renaming.old, renaming.new)
        case "deleteValue" if renaming.kind == "key":
            return renamed_key(behavior, renaming.old, renaming.new) or behavior
    return behavior


def _json_behavior(function: str, written: str, renaming: Renaming) -> str:
    """A behaviour that is a JSON object, as text: only names in it change."""
    try:
        value = read_json(written, lambda key, at, first: None)
    except JsonError:
        return written
    if not isinstance(value, JsonObject):
        return written
    if function == "assignValue":
        if renaming.kind != "key":
            return written
        return rename_in(written, json_keys(written), renaming.old, renaming.new)
    edits: list[TextEdit] = []
    rule = value.get("rule")
    for member in value.members:
        if function == "releaseStop":
            _replace(edits, written, member.key_at, member.key, renaming.rule(member.key))
        elif member.key == "rule" and isinstance(member.value, str):
            _replace(edits, written, member.value_at, member.value, renaming.rule(member.value))
        elif member.key == "state" and isinstance(member.value, str) and isinstance(rule, str):
            _replace(edits, written, member.value_at, member.value, renaming.state(rule, member.value))
        elif member.key == "event" and isinstance(member.value, str):
            _replace(edits, written, member.value_at, member.value, renaming.event(member.value))
        elif member.key == "take_back" and renaming.kind == "key" and isinstance(member.value, list):
            for item, at in zip(member.value, getattr(member.value, "items_at", ()), strict=False):
                if isinstance(item, str):
                    _replace(edits, written, at, item, renamed_key(item, renaming.old, renaming.new) or item)
    for edit in sorted(edits, reverse=True):
        written = written[: edit.start] + edit.text + written[edit.end :]
    return written


def _replace(edits: list[TextEdit], text: str, at: int, old: str, new: str) -> None:
    if old != new:
        edits.append(TextEdit(at, json.JSONDecoder().raw_decode(text, at)[1], json.dumps(new, ensure_ascii=False)))


# --- TOML files -------------------------------------------------------------------------------------------------------


def _toml_splices(file: EditedText, change: Callable[[str], str]) -> Iterator[Splice]:
    try:
        after = change(file.text)
    except EditRefused as error:
        raise EditRefused(f"{file.name}: {error}") from None
    return iter(file.splices(edits_between(file.text, after)))


def _in_study(text: str, renaming: Renaming) -> str:
    """What levels of factors set."""
    factors = TomlText(text).values.get("factors")
    for factor, values in _tables(factors):
        for level, given in _tables(values.get("levels")):
            for key in _tables_or_none(given.get("memory")):
                new = renamed_key(key, renaming.old, renaming.new)
                if new is not None:
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
    """The slots of translations, and of the texts that they were translated from."""
    toml = TomlText(text)
    changes: list[tuple[KeyPath, str]] = []
    for path in toml.entries:
        found, value = toml.find(path)
        if found and isinstance(value, str):
            renamed = rename_in(value, keys_in_slots(value), renaming.old, renaming.new)
            if renamed != value:
                changes.append((path, renamed))
    for path, value in changes:
        text = set_value(text, path, value)
    return text


def _tables(values: Any) -> list[tuple[str, dict[str, Any]]]:
    return [(key, each) for key, each in _tables_or_none(values).items() if isinstance(each, dict)]


def _tables_or_none(values: Any) -> dict[str, Any]:
    return values if isinstance(values, dict) else {}
