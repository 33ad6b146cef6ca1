"""Finds the names of acts, rules, states, events and memory keys in scenario.toml and the memory file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from msgspec.structs import replace

from rise_engine.base.json_codec import JsonError, JsonObject, read_json
from rise_engine.base.text import match_end
from rise_engine.expression.key_places import keys_in_assignment, keys_in_expression, names_in_property
from rise_engine.scenario.checking.uses import Use, UsedKind
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.toml_files import TomlFile, WrittenText
from rise_engine.scenario.model import Rule, normal_topic
from rise_engine.scenario.reading.explore_tables import PROPERTY_TABLES, states_named
from rise_engine.scenario.reading.memory import LIST_KEY
from rise_engine.syntax.toml import KeyPath

_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"')
_KINDS: dict[str, UsedKind] = {
    "act": "act",
    "stop_act": "act",
    "rule": "rule",
    "stop_rule": "rule",
    "event": "event",
}
_WILDCARD = re.compile(r"\[[^\]]*\]|[*?]")


def uses_in_settings(file: TomlFile) -> list[Use]:
    """The uses in scenario.toml, except `[trials]`."""
    return list(_SettingsUses(file).find())


def uses_in_trials(file: TomlFile, rules: Mapping[str, Rule]) -> list[Use]:
    """The uses in `[trials]` of scenario.toml.

    :param file: scenario.toml.
    :param rules: the scenario's rules. A state that only one rule has may be written without its rule.
    """
    return list(_SettingsUses(file).find_in_trials(rules))


class _SettingsUses:
    def __init__(self, file: TomlFile) -> None:
        self.file = file
        self.source = file.source

    def find(self) -> Iterator[Use]:
        for name in self.table("act"):
            if not _WILDCARD.search(name):
                yield self.key_use("act", name, f"settings of the act {name}", "act", name)
        for written, binding in self.table("keys").items():
            if isinstance(binding, dict):
                yield from self.find_in_binding(written, binding)
        yield from self.find_keys(("private",), self.file.values.get("private"), "private keys")
        for name in self.table("conditions"):
            for key in self.table("conditions", name, "memory"):
                yield self.key_use("key", key, f"condition {name}", "conditions", name, "memory", key)
        allowed = self.table("check").get("allow")
        for index, values in enumerate(allowed if isinstance(allowed, list) else []):
            if isinstance(values, dict) and isinstance(named := values.get("key"), str) and named:
                yield self.text_use("key", named, "silenced warning", ("check", "allow", str(index), "key"), named, 0)
        yield from self.find_in_explore()
        for kind in PROPERTY_TABLES:
            for name, value in self.table(kind).items():
                for part, text in value.items() if isinstance(value, dict) else [("", value)]:
                    if isinstance(text, str):
                        yield from self.find_in_property(name, (kind, name, part) if part else (kind, name), text)

    def table(self, *path: str) -> dict[str, Any]:
        value: Any = self.file.values
        for part in path:
            value = value.get(part) if isinstance(value, dict) else None
        return value if isinstance(value, dict) else {}

    def find_keys(self, path: tuple[str, ...], names: Any, where: str) -> Iterator[Use]:
        for index, name in enumerate(names if isinstance(names, list) else []):
            if isinstance(name, str) and name:
                yield self.text_use("key", name, where, (*path, str(index)), name, 0)

    def find_in_explore(self) -> Iterator[Use]:
        end = self.table("explore").get("end")
        if isinstance(end, str) and (name := end.strip()):
            yield self.text_use("rule", name, "end of exploring", ("explore", "end"), end, end.index(name))
        for key in self.table("explore", "tries"):
            yield self.key_use("key", key, "tried when exploring", "explore", "tries", key)

    def find_in_trials(self, rules: Mapping[str, Rule]) -> Iterator[Use]:
        table = self.table("trials")
        columns = table.get("columns")
        texts = [
            (("columns", str(index)), text) for index, text in enumerate(columns if isinstance(columns, list) else [])
        ]
        for path, text in (*texts, (("key",), table.get("key"))):
            for key in keys_in_expression(text) if isinstance(text, str) else ():
                yield self.text_use("key", key.key, "trials", ("trials", *path), text, key.start)
        speech = table.get("speech")
        if isinstance(speech, str) and (topic := normal_topic(speech)):
            yield self.text_use("event", topic, "trials", ("trials", "speech"), speech, speech.index(topic))
        state = table.get("state")
        if not isinstance(state, str) or "*" in state:
            return
        for rule, name in states_named(state.strip(), rules):
            path, at = ("trials", "state"), state.rindex(name)
            yield replace(self.text_use("state", name, "trials", path, state, at), name=f"{rule}/{name}")
            if state.strip() != name:
                yield self.text_use("rule", rule, "trials", path, state, state.index(rule))

    def find_in_property(self, name: str, path: KeyPath, text: str) -> Iterator[Use]:
        where = f"property {name}"
        for key in keys_in_expression(text):
            yield self.text_use("key", key.key, where, path, text, key.start)
        for asked in names_in_property(text):
            use = self.text_use(asked.kind, asked.name, where, path, text, asked.start, asked.length)
            yield replace(use, name=f"{asked.rule}/{asked.name}") if asked.kind == "state" else use

    def find_in_binding(self, written: str, binding: dict[str, Any]) -> Iterator[Use]:
        path, where = ("keys", written), f"key {written}"
        for what, kind in _KINDS.items():
            text = binding.get(what)
            if not isinstance(text, str):
                continue
            if name := normal_topic(text) if kind == "event" else text.strip():
                yield self.text_use(kind, name, where, (*path, what), text, text.index(name))
        state, rule = binding.get("state"), binding.get("rule")
        if isinstance(state, str) and isinstance(rule, str) and (name := state.strip()):
            use = self.text_use("state", name, where, (*path, "state"), state, state.index(name))
            yield replace(use, name=f"{rule.strip()}/{name}")
        assignment = binding.get("set")
        if not isinstance(assignment, str):
            return
        for place in keys_in_assignment(assignment):
            use = self.text_use("key", place.key, where, (*path, "set"), assignment, place.start)
            yield replace(use, may_be_text=place.may_be_text)

    def key_use(self, kind: UsedKind, name: str, where: str, *path: str) -> Use:
        """The use of a name that is a key of the file."""
        offset = self.source.offset(*_line_column(self.file, *path))
        if self.source.text.startswith(('"', "'"), offset):
            start, length = WrittenText(self.source, offset, name).span(0, len(name))
        else:
            start, length = offset, len(name)
        return Use(kind, name, self.source.location(start), length, False, where)

    def text_use(
        self, kind: UsedKind, name: str, where: str, path: KeyPath, value: str, start: int, length: int | None = None
    ) -> Use:
        """The use of a name at the character `start` of a text; `length` is its length there, if it differs."""
        location = self.file.value_location(*path)
        offset = self.source.offset(location.line, location.column)
        at, length = WrittenText(self.source, offset, value).span(start, len(name) if length is None else length)
        return Use(kind, name, self.source.location(at), length, False, where)


def _line_column(file: TomlFile, *path: str) -> tuple[int, int]:
    location = file.key_location(*path)
    return location.line, location.column


def uses_in_memory(source: SourceFile) -> list[Use]:
    """The start values of the memory file; each defines its key."""
    ignore: Callable[..., None] = lambda *args: None  # noqa: E731  # mistakes in the file have their diagnostics
    try:
        value = read_json(source.text, ignore, ignore)
    except JsonError:
        return []
    if not isinstance(value, JsonObject):
        return []
    entries = value.get(LIST_KEY) if len(value) == 1 else None
    objects = [each for each in entries if isinstance(each, JsonObject)] if isinstance(entries, list) else [value]
    found = []
    for member in (member for each in objects for member in each.members):
        length = match_end(_QUOTED, source.text, member.key_at) - member.key_at - 2
        location = source.location(member.key_at + 1)
        found.append(Use("key", member.key, location, length, True, "start value"))
    return found
