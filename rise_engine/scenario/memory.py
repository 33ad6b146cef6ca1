"""Reading the WorkingMemory's start values (paper, listing 3; semantics.md 7)."""

from __future__ import annotations

import re
from unicodedata import normalize

from rise_engine.json_codec import JsonArray, JsonError, JsonMember, JsonObject, plain, read_json
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.source_files import SourceFile

LIST_KEY = "WorkingMemory"
_WRITABLE = re.compile(r"[^\W\d]\w*(?:\.\w+)*\Z")
_WORDS = frozenset({"true", "false", "null", "or", "xor", "and", "not", "starts", "ends", "contains", "with"})


def read_memory(source: SourceFile, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Read a memory file, in RISE's form or as a plain object, into `draft`."""

    def duplicate(key: str, offset: int, first: int) -> None:
        line = source.location(first).line
        diagnostics.error("duplicate-key", source.location(offset), f'the key "{key}" stands in line {line} already')

    def no_number(message: str, offset: int) -> None:
        diagnostics.error("json-value", source.location(offset), message)

    if not source.text.strip():
        diagnostics.error(
            "json-syntax", source.location(0), "this file is empty; write {} for a memory without start values"
        )
        return
    try:
        value = read_json(source.text, duplicate, no_number)
    except JsonError as error:
        diagnostics.error("json-syntax", source.location(error.offset), str(error))
        draft.unreadable_parts.add("memory")
        return
    form = 'the memory is an object of keys and values, or {"WorkingMemory": [{"key": value}, ...]}'
    if not isinstance(value, JsonObject):
        diagnostics.error("memory-form", source.location(0), form)
        draft.unreadable_parts.add("memory")
        return
    members: list[JsonMember] = []
    lists = [member for member in value.members if member.key.casefold() == LIST_KEY.casefold()]
    for member in value.members:
        if member.key.casefold() != LIST_KEY.casefold():
            members.append(member)
            if lists:
                message = f'nothing stands beside "{LIST_KEY}" here; {form}'
                diagnostics.error("memory-form", source.location(member.key_at), message)
            continue
        if member.key != LIST_KEY:
            diagnostics.error("memory-form", source.location(member.key_at), f'write "{LIST_KEY}", not "{member.key}"')
        if isinstance(member.value, JsonArray):
            members += _listed(member.value, source, diagnostics)
            continue
        message = f'"{LIST_KEY}" is a list of objects; {form}'
        diagnostics.error("memory-form", source.location(member.value_at), message)
        if isinstance(member.value, JsonObject):
            members += member.value.members
    first: dict[str, int] = {}
    for member in members:
        if member.key in first:
            duplicate(member.key, member.key_at, first[member.key])
            continue
        first[member.key] = member.key_at
        if not member.key.strip():
            diagnostics.error("bad-name", source.location(member.key_at), "a memory key cannot be empty")
            continue
        if not _WRITABLE.match(member.key) or member.key in _WORDS:
            draft.memory_key_locations[member.key] = source.location(member.key_at)
            remedy = "use letters, digits, `_` and dots"
            if _WRITABLE.match(whole := normalize("NFC", member.key)):
                remedy = f'its letters with accents are two characters each; write "{whole}" with one for each'
            diagnostics.warning(
                "unwritable-key",
                source.location(member.key_at),
                f'the key "{member.key}" cannot be written in a condition; {remedy}',
            )
        draft.memory[member.key] = plain(member.value)
    draft.settable_keys.update(draft.memory)


def _listed(items: JsonArray, source: SourceFile, diagnostics: Diagnostics) -> list[JsonMember]:
    """The entries of RISE's form: a list of objects, each with one key."""
    members: list[JsonMember] = []
    for item, offset in zip(items, items.items_at, strict=True):
        if not isinstance(item, JsonObject):
            diagnostics.error(
                "memory-form", source.location(offset), 'each entry of the list is an object: {"key": value}'
            )
            continue
        if not item.members:
            diagnostics.warning("memory-form", source.location(offset), "this entry is empty")
        members += item.members
    return members
