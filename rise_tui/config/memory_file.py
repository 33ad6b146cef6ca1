"""Changing values in a memory file and nothing else: layout, order and form stay as the author has them. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from rise_engine.errors import RiseError
from rise_engine.json_codec import JsonArray, JsonError, JsonMember, JsonObject, read_json, to_plain
from rise_engine.scenario.memory import LIST_KEY
from rise_tui.model.json_path import json_equal


class MemoryFileNotEditable(RiseError):
    """The file is not what a scenario's memory is; the message says why, for a person."""


class _Edit(NamedTuple):
    """From here to there, this instead."""

    start: int
    end: int
    text: str


class _Span(NamedTuple):
    start: int
    end: int


def edit_memory_text(text: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """The file's text after the changes that lead from `before` to `now`: keys set, added and deleted.

    Keys that do not differ between the two stay in the file as they are there. Raises MemoryFileNotEditable.
    """
    document = _read_document(text)
    members = _memory_members(document)
    wanted = {member.key: to_plain(member.value) for member in members}
    for key in (*before, *now):
        if key not in now:
            wanted.pop(key, None)
        elif key not in before or not json_equal(before[key], now[key], in_order=True):
            wanted[key] = now[key]
    listed = document.get(LIST_KEY)
    if isinstance(listed, JsonArray):
        edits = _list_edits(text, listed, wanted)
    else:
        edits = _object_edits(text, document, wanted)
    for edit in sorted(edits, reverse=True):
        text = text[: edit.start] + edit.text + text[edit.end :]
    if not json_equal({member.key: to_plain(member.value) for member in _memory_members(_read_document(text))}, wanted):
        raise MemoryFileNotEditable("it is written in a way that cannot be changed here; change it with an editor")
    return text


def _read_document(text: str) -> JsonObject:
    def refuse_duplicate(key: str, offset: int, first: int) -> None:
        raise MemoryFileNotEditable(f'the key "{key}" stands in it twice')

    try:
        found = read_json(text, refuse_duplicate)
    except JsonError as error:
        line = text.count("\n", 0, error.offset) + 1
        raise MemoryFileNotEditable(f"line {line}: {error}") from None
    if not isinstance(found, JsonObject):
        raise MemoryFileNotEditable("it is no object of keys and values")
    return found


def _memory_members(document: JsonObject) -> list[JsonMember]:
    """The memory's keys, in either form. Raises MemoryFileNotEditable."""
    listed = document.get(LIST_KEY)
    if not isinstance(listed, JsonArray):
        return list(document.members)
    items = [item for item in listed if isinstance(item, JsonObject)]
    members = [member for item in items for member in item.members]
    if len(document) > 1 or len(items) < len(listed) or len({member.key for member in members}) < len(members):
        raise MemoryFileNotEditable(
            f'"{LIST_KEY}" is a list of objects, each key in one of them, and nothing stands beside it'
        )
    return members


def _list_edits(text: str, items: JsonArray, wanted: Mapping[str, Any]) -> list[_Edit]:
    """RISE's form: an object for each key."""
    edits, gone = [], set()
    for index, item in enumerate(items):
        keys = {member.key for member in item.members}
        if keys and not keys & wanted.keys():
            gone.add(index)
        else:
            edits += _object_edits(text, item, {key: wanted[key] for key in item if key in wanted})
    there = {key for item in items for key in item}
    new = [_dumps({key: value}) for key, value in wanted.items() if key not in there]
    spans = [_Span(offset, _find_end(text, offset)) for offset in items.items_at]
    return [*edits, *_entry_edits(text, items.at, spans, gone, new)]


def _object_edits(text: str, object: JsonObject, wanted: Mapping[str, Any]) -> list[_Edit]:
    edits: list[_Edit] = []
    gone = set()
    for index, member in enumerate(object.members):
        if member.key in wanted:
            edits += _value_edits(text, member.value_at, member.value, wanted[member.key])
        else:
            gone.add(index)
    new = [f"{_dumps(key)}: {_dumps(value)}" for key, value in wanted.items() if key not in object]
    spans = [_Span(member.key_at, _find_end(text, member.value_at)) for member in object.members]
    return [*edits, *_entry_edits(text, object.at, spans, gone, new)]


def _value_edits(text: str, offset: int, old: Any, new: Any) -> list[_Edit]:
    if json_equal(to_plain(old), new, in_order=True):
        return []
    if isinstance(old, JsonObject) and isinstance(new, dict):
        return _object_edits(text, old, new)
    if isinstance(old, JsonArray) and isinstance(new, list | tuple) and len(old) == len(new):
        pairs = zip(old.items_at, old, new, strict=True)
        return [edit for offset, one, other in pairs for edit in _value_edits(text, offset, one, other)]
    return [_Edit(offset, _find_end(text, offset), _dumps(new))]


def _entry_edits(text: str, opening: int, spans: Sequence[_Span], gone: set[int], new: Sequence[str]) -> list[_Edit]:
    """Entries of an object or a list that go and that come, with their commas; new ones stand as the last ones do."""
    if not gone and not new:
        return []
    if not spans:
        return [_Edit(opening + 1, opening + 1, ", ".join(new))]
    indent = text[opening + 1 : spans[0].start]
    between = text[spans[-2].end : spans[-1].start] if len(spans) > 1 else "," + (indent if "\n" in indent else " ")
    kept = [index for index in range(len(spans)) if index not in gone]
    if not kept:
        return [_Edit(spans[0].start, spans[-1].end, between.join(new))]
    edits = [_Edit(spans[index].start, spans[index + 1].start, "") for index in sorted(gone) if index < kept[-1]]
    tail = _Edit(spans[kept[-1]].end, spans[-1].end, "".join(between + entry for entry in new))
    return [*edits, tail] if tail.start < tail.end or tail.text else edits


def _find_end(text: str, offset: int) -> int:
    """Where the value ends that begins here."""
    return json.JSONDecoder().raw_decode(text, offset)[1]


def _dumps(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)
