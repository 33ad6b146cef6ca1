"""Edits of start values. They change only the values of a memory file; its layout, order and form stay."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from rise_engine.author.edit.edits import Edit, RemoveStartValue, SetStartValue
from rise_engine.author.edit.plan import EditRefused, Files, Plan, StudyState, file_of
from rise_engine.author.edit.study_folder import sets_key
from rise_engine.base.json_codec import (
    JsonArray,
    JsonError,
    JsonMember,
    JsonObject,
    decode,
    json_equal,
    read_json,
    to_plain,
)
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.scenario.reading.memory import LIST_KEY, is_writable_key
from rise_engine.syntax.changes import TextEdit, changed_text

_BLANK_LINES = re.compile(r"(?:(?:\r\n|\r(?!\n)|\n)[ \t]*)*(\r\n|\r(?!\n)|\n)")


class _Span(NamedTuple):
    start: int
    end: int


def edit_memory_text(text: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return the file's text after the changes of `memory_text_edits`."""
    return changed_text(text, memory_text_edits(text, before, now))


def memory_text_edits(text: str, before: Mapping[str, Any], now: Mapping[str, Any]) -> list[TextEdit]:
    """Find the changes of a memory file that set, add and delete keys as from `before` to `now`.

    :param text: the file's text, without byte order mark.
    :param before: values by key, as the author of the change knows them.
    :param now: the new values. Keys that do not differ stay unchanged in the file.
    :raises EditRefused: it is not JSON, or not a scenario's memory.
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
    elif not document.members and wanted:  # with the first key, every key gets a line of its own
        line_end = next((end for end in ("\r\n", "\n", "\r") if end in text), "\n")
        rows = f",{line_end}  ".join(f"{_dumps(key)}: {_dumps(value)}" for key, value in wanted.items())
        edits = [TextEdit(document.at + 1, text.index("}", document.at), f"{line_end}  {rows}{line_end}")]
    else:
        edits = _object_edits(text, document, wanted)
    after = _memory_members(_read_document(changed_text(text, edits)))
    if not json_equal({member.key: to_plain(member.value) for member in after}, wanted):
        raise EditRefused("it is written in a way that cannot be changed here; change it with an editor")
    return edits


def memory_file_text(memory: Mapping[str, Any]) -> str:
    """Write the text of a new memory file in RISE's form."""
    entries = [f"  {json.dumps({key: value}, ensure_ascii=False)}" for key, value in memory.items()]
    return f'{{"{LIST_KEY}":\n[\n' + ",\n".join(entries) + "\n]\n}\n"


def memory_values(text: str) -> dict[str, Any]:
    """Read the start values of a memory file. :raises EditRefused: it is not one."""
    return {member.key: to_plain(member.value) for member in _memory_members(_read_document(text))}


def _read_document(text: str) -> JsonObject:
    def refuse_duplicate(key: str, offset: int, first: int) -> None:
        raise EditRefused(f'the key "{key}" is in it twice')

    try:
        found = read_json(text, refuse_duplicate)
    except JsonError as error:
        line = text.count("\n", 0, error.offset) + 1
        raise EditRefused(f"line {line}: {error}") from None
    if not isinstance(found, JsonObject):
        raise EditRefused("it is not an object of keys and values")
    return found


def _memory_members(document: JsonObject) -> list[JsonMember]:
    """Return the memory's keys, in either form. Raises EditRefused."""
    listed = document.get(LIST_KEY)
    if not isinstance(listed, JsonArray):
        return list(document.members)
    items = [item for item in listed if isinstance(item, JsonObject)]
    members = [member for item in items for member in item.members]
    if len(document) > 1 or len(items) < len(listed) or len({member.key for member in members}) < len(members):
        raise EditRefused(f'"{LIST_KEY}" is a list of objects, each key in one of them, and nothing beside it')
    return members


def _list_edits(text: str, items: JsonArray, wanted: Mapping[str, Any]) -> list[TextEdit]:
    """Find the changes in RISE's form, which has an object for each key."""
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


def _object_edits(text: str, object: JsonObject, wanted: Mapping[str, Any]) -> list[TextEdit]:
    edits: list[TextEdit] = []
    gone = set()
    for index, member in enumerate(object.members):
        if member.key in wanted:
            edits += _value_edits(text, member.value_at, member.value, wanted[member.key])
        else:
            gone.add(index)
    new = [f"{_dumps(key)}: {_dumps(value)}" for key, value in wanted.items() if key not in object]
    spans = [_Span(member.key_at, _find_end(text, member.value_at)) for member in object.members]
    return [*edits, *_entry_edits(text, object.at, spans, gone, new)]


def _value_edits(text: str, offset: int, old: Any, new: Any) -> list[TextEdit]:
    if json_equal(to_plain(old), new, in_order=True):
        return []
    if isinstance(old, JsonObject) and isinstance(new, dict):
        return _object_edits(text, old, new)
    if isinstance(old, JsonArray) and isinstance(new, list | tuple) and len(old) == len(new):
        pairs = zip(old.items_at, old, new, strict=True)
        return [edit for offset, one, other in pairs for edit in _value_edits(text, offset, one, other)]
    return [TextEdit(offset, _find_end(text, offset), _dumps(new))]


def _entry_edits(text: str, opening: int, spans: Sequence[_Span], gone: set[int], new: Sequence[str]) -> list[TextEdit]:
    """Remove and add entries of an object or a list, with their commas; new ones are laid out like the last ones.

    Blank lines between groups stay: of the two gaps beside a removed entry, the larger one remains.
    """
    if not gone and not new:
        return []
    if not spans:
        return [TextEdit(opening + 1, opening + 1, ", ".join(new))]
    indent = text[opening + 1 : spans[0].start]
    between = text[spans[-2].end : spans[-1].start] if len(spans) > 1 else "," + (indent if "\n" in indent else " ")
    between = _BLANK_LINES.sub(r"\1", between)
    kept = [index for index in range(len(spans)) if index not in gone]
    if not kept:
        return [TextEdit(spans[0].start, spans[-1].end, between.join(new))]
    edits = []
    for one, other in pairwise([-1, *kept]):
        if other == one + 1:
            continue
        first, last = spans[one + 1].start, spans[other].start
        if one < 0:
            edits.append(TextEdit(first, last, ""))
            continue
        gaps = [text[spans[at].end : spans[at + 1].start] for at in range(one, other)]
        widest = max(gaps, key=_count_lines)
        edits.append(TextEdit(spans[one].end, last, widest))
    tail = TextEdit(spans[kept[-1]].end, spans[-1].end, "".join(between + entry for entry in new))
    return [*edits, tail] if tail.start < tail.end or tail.text else edits


def _count_lines(gap: str) -> int:
    return gap.count("\n") or gap.count("\r")


def _find_end(text: str, offset: int) -> int:
    """Find the end of the value that begins here."""
    return json.JSONDecoder().raw_decode(text, offset)[1]


def _dumps(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


# --- start values of a study ------------------------------------------------------------------------------------------


_SHOWN = 60
"""Maximum characters of a value in a sentence."""


def memory_file(files: Files) -> str:
    """Return the file of start values, which may not exist: the one in scenario.toml, or the usual one."""
    try:
        named = tomllib.loads(files.get(SCENARIO_FILE, b"").decode("utf-8-sig")).get("memory")
    except (ValueError, RecursionError):
        named = None
    return named if isinstance(named, str) and named else DEFAULT_PATHS["memory"]


def plan_set_start_value(edit: SetStartValue, study: StudyState) -> Plan:
    """Plan a key's start value; a new key goes at the end.

    :raises EditRefused: the key is empty, a memory cannot hold the value, or the file is not a memory.
    """
    if not edit.key.strip():
        raise EditRefused("a memory key cannot be empty; give it a name")
    table = edit.key.partition(".")[0]
    if any(name.startswith("tables/") and name[7:].lower() == f"{table}.csv".lower() for name in study.files):
        raise EditRefused(f"`{table}` is a table of this study, and nothing else can have its name; choose another one")
    _check_value(edit.key, edit.value)
    name = memory_file(study.files)
    noticed = () if is_writable_key(edit.key) else (_unwritable(edit.key),)
    if name not in study.files:
        says = f"{edit.key} begins as {value_text(edit.value)} (new key, in the new file {name})"
        return Plan(written={name: memory_file_text({edit.key: edit.value}).encode()}, says=(says,), noticed=noticed)
    file = file_of(study.files, name)
    if not file.text.strip():
        return Plan(
            written={name: memory_file_text({edit.key: edit.value}).encode()},
            says=(f"{edit.key} begins as {value_text(edit.value)} (new key)",),
            noticed=noticed,
        )
    with file.refusing():
        before = memory_values(file.text)
    was = f"was {value_text(before[edit.key])}" if edit.key in before else "new key"
    return Plan(
        splices=file.splices(memory_text_edits(file.text, {}, {edit.key: edit.value})),
        says=(f"{edit.key} begins as {value_text(edit.value)} ({was})",),
        noticed=noticed if edit.key not in before else (),
    )


def plan_remove_start_value(edit: RemoveStartValue, study: StudyState) -> Plan:
    """Plan the removal of a start value. :raises EditRefused: there is none, or the file is not a memory."""
    name = memory_file(study.files)
    before: dict[str, Any] = {}
    if name in study.files:
        file = file_of(study.files, name)
        with file.refusing():
            before = memory_values(file.text)
    if edit.key not in before:
        near = did_you_mean(edit.key, before)
        raise EditRefused(f"the memory key `{edit.key}` has no start value in {name}{near}")
    return Plan(
        splices=file.splices(memory_text_edits(file.text, {edit.key: None}, {})),
        says=(f"{edit.key} has no start value any more (was {value_text(before[edit.key])})",),
        noticed=(above,) if (above := sets_key(study.above, edit.key)) else (),
    )


def value_text(value: Any) -> str:
    """Format a value for a sentence."""
    text = json.dumps(value, ensure_ascii=False, default=str)  # TOML has dates and times
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


def _check_value(key: str, value: Any) -> None:
    """:raises EditRefused: a memory cannot hold the value."""
    try:
        decode(json.dumps(value))
    except (JsonError, RecursionError, TypeError, ValueError) as error:
        raise EditRefused(f"this cannot be the start value of `{key}`: {error}") from None


def _unwritable(key: str) -> str:
    return f"the key `{key}` cannot be written in a condition: use letters, digits, `_` and dots"


PLANNERS: dict[type[Edit], Callable[[Any, StudyState], Plan]] = {
    SetStartValue: plan_set_start_value,
    RemoveStartValue: plan_remove_start_value,
}
