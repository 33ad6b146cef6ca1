"""Reads the start values of the WorkingMemory (paper, listing 3; semantics.md 7)."""

from __future__ import annotations

import re
from collections.abc import Collection
from unicodedata import normalize

from rise_engine.base.json_codec import JsonArray, JsonError, JsonMember, JsonObject, read_json, to_plain
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.source_files import SourceFile

LIST_KEY = "WorkingMemory"
_WRITABLE = re.compile(r"[^\W\d]\w*(?:\.\w+)*\Z")
_WORDS = frozenset({"true", "false", "null", "or", "xor", "and", "not", "starts", "ends", "contains", "with"})


_FORM = 'the memory is an object of keys and values, or {"WorkingMemory": [{"key": value}, ...]}'


def is_writable_key(key: str) -> bool:
    """Whether a condition can contain this key."""
    return _WRITABLE.match(key) is not None and key not in _WORDS


def read_memory(source: SourceFile, tables: Collection[str], draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Read a memory file, in RISE's form or as a plain object, into `draft`. `tables` are the names of the tables."""
    _MemoryReader(source, tables, draft, diagnostics).read()


class _MemoryReader:
    def __init__(
        self, source: SourceFile, tables: Collection[str], draft: ScenarioDraft, diagnostics: Diagnostics
    ) -> None:
        self.source = source
        self.tables = tables
        self.draft = draft
        self.diagnostics = diagnostics

    def report_error(self, code: str, offset: int, message: str) -> None:
        self.diagnostics.error(code, self.source.location(offset), message)

    def report_duplicate(self, key: str, offset: int, first: int) -> None:
        line = self.source.location(first).line
        self.report_error("duplicate-key", offset, f'the key "{key}" is already in line {line}')

    def report_no_number(self, message: str, offset: int) -> None:
        self.report_error("json-value", offset, message)

    def read(self) -> None:
        if not self.source.text.strip():
            message = "this file is empty; write {} for a memory without start values"
            self.report_error("json-syntax", 0, message)
            return
        try:
            value = read_json(self.source.text, self.report_duplicate, self.report_no_number)
        except JsonError as error:
            self.report_error("json-syntax", error.offset, str(error))
            self.draft.unreadable_parts.add("memory")
            return
        if not isinstance(value, JsonObject):
            self.report_error("memory-form", 0, _FORM)
            self.draft.unreadable_parts.add("memory")
            return
        first: dict[str, int] = {}
        for member in self.read_members(value):
            if member.key in first:
                self.report_duplicate(member.key, member.key_at, first[member.key])
                continue
            first[member.key] = member.key_at
            if not member.key.strip():
                self.report_error("bad-name", member.key_at, "a memory key cannot be empty")
                continue
            if (head := member.key.partition(".")[0]) in self.tables:
                message = f"`{head}` is a table, tables/{head}.csv; nothing else can have its name"
                self.report_error("duplicate-key", member.key_at, message)
                continue
            if not is_writable_key(member.key):
                self.warn_of_key(member)
            self.draft.memory[member.key] = to_plain(member.value)
        self.draft.settable_keys.update(self.draft.memory)

    def read_members(self, value: JsonObject) -> list[JsonMember]:
        """The keys and values of either form."""
        members: list[JsonMember] = []
        has_list = any(member.key.casefold() == LIST_KEY.casefold() for member in value.members)
        for member in value.members:
            if member.key.casefold() != LIST_KEY.casefold():
                members.append(member)
                if has_list:
                    message = f'nothing else is allowed beside "{LIST_KEY}" here; {_FORM}'
                    self.report_error("memory-form", member.key_at, message)
                continue
            if member.key != LIST_KEY:
                self.report_error("memory-form", member.key_at, f'write "{LIST_KEY}", not "{member.key}"')
            if isinstance(member.value, JsonArray):
                members += self.read_entries(member.value)
                continue
            self.report_error("memory-form", member.value_at, f'"{LIST_KEY}" is a list of objects; {_FORM}')
            if isinstance(member.value, JsonObject):
                members += member.value.members
        return members

    def read_entries(self, items: JsonArray) -> list[JsonMember]:
        """The entries of RISE's form: a list of objects with one key each."""
        members: list[JsonMember] = []
        for item, offset in zip(items, items.items_at, strict=True):
            if not isinstance(item, JsonObject):
                self.report_error("memory-form", offset, 'each entry of the list is an object: {"key": value}')
                continue
            if not item.members:
                self.diagnostics.warning("memory-form", self.source.location(offset), "this entry is empty")
            members += item.members
        return members

    def warn_of_key(self, member: JsonMember) -> None:
        location = self.source.location(member.key_at)
        self.draft.memory_key_locations[member.key] = location
        remedy = "use letters, digits, `_` and dots"
        if _WRITABLE.match(whole := normalize("NFC", member.key)):
            remedy = f'its letters with accents are two characters each; write "{whole}" with one for each'
        message = f'the key "{member.key}" cannot be written in a condition; {remedy}'
        self.diagnostics.warning("unwritable-key", location, message)
