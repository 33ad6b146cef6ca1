"""Reading the WorkingMemory's start values (paper, listing 3; semantics.md 7)."""

from __future__ import annotations

import re
from unicodedata import normalize

from rise_engine.json_codec import JsonArray, JsonError, JsonMember, JsonObject, plain, read_json
from rise_engine.scenario.draft import Draft
from rise_engine.scenario.findings import Findings
from rise_engine.scenario.source import Source

LIST_KEY = "WorkingMemory"
_WRITABLE = re.compile(r"[^\W\d]\w*(?:\.\w+)*\Z")
_WORDS = frozenset({"true", "false", "null", "or", "xor", "and", "not", "starts", "ends", "contains", "with"})


def read_memory(source: Source, draft: Draft, findings: Findings) -> None:
    """Read a memory file, in RISE's form or as a plain object, into `draft`."""

    def duplicate(key: str, offset: int, first: int) -> None:
        line = source.place(first).line
        findings.error("duplicate-key", source.place(offset), f'the key "{key}" stands in line {line} already')

    def no_number(message: str, offset: int) -> None:
        findings.error("json-value", source.place(offset), message)

    if not source.text.strip():
        findings.error("json-syntax", source.place(0), "this file is empty; write {} for a memory without start values")
        return
    try:
        value = read_json(source.text, duplicate, no_number)
    except JsonError as error:
        findings.error("json-syntax", source.place(error.offset), str(error))
        draft.unread.add("memory")
        return
    form = 'the memory is an object of keys and values, or {"WorkingMemory": [{"key": value}, ...]}'
    if not isinstance(value, JsonObject):
        findings.error("memory-form", source.place(0), form)
        draft.unread.add("memory")
        return
    members: list[JsonMember] = []
    lists = [member for member in value.members if member.key.casefold() == LIST_KEY.casefold()]
    for member in value.members:
        if member.key.casefold() != LIST_KEY.casefold():
            members.append(member)
            if lists:
                message = f'nothing stands beside "{LIST_KEY}" here; {form}'
                findings.error("memory-form", source.place(member.key_at), message)
            continue
        if member.key != LIST_KEY:
            findings.error("memory-form", source.place(member.key_at), f'write "{LIST_KEY}", not "{member.key}"')
        if isinstance(member.value, JsonArray):
            members += _listed(member.value, source, findings)
            continue
        message = f'"{LIST_KEY}" is a list of objects; {form}'
        findings.error("memory-form", source.place(member.value_at), message)
        if isinstance(member.value, JsonObject):
            members += member.value.members
    first: dict[str, int] = {}
    for member in members:
        if member.key in first:
            duplicate(member.key, member.key_at, first[member.key])
            continue
        first[member.key] = member.key_at
        if not member.key.strip():
            findings.error("bad-name", source.place(member.key_at), "a memory key cannot be empty")
            continue
        if not _WRITABLE.match(member.key) or member.key in _WORDS:
            draft.memory_places[member.key] = source.place(member.key_at)
            remedy = "use letters, digits, `_` and dots"
            if _WRITABLE.match(whole := normalize("NFC", member.key)):
                remedy = f'its letters with accents are two characters each; write "{whole}" with one for each'
            findings.warning(
                "unwritable-key",
                source.place(member.key_at),
                f'the key "{member.key}" cannot be written in a condition; {remedy}',
            )
        draft.memory[member.key] = plain(member.value)
    draft.key_sets.update(draft.memory)


def _listed(items: JsonArray, source: Source, findings: Findings) -> list[JsonMember]:
    """The entries of RISE's form: a list of objects, each with one key."""
    members: list[JsonMember] = []
    for item, offset in zip(items, items.items_at, strict=True):
        if not isinstance(item, JsonObject):
            findings.error("memory-form", source.place(offset), 'each entry of the list is an object: {"key": value}')
            continue
        if not item.members:
            findings.warning("memory-form", source.place(offset), "this entry is empty")
        members += item.members
    return members
