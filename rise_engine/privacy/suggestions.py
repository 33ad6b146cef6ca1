"""Suggests words of a session that could be names, for a person to check before redaction.

It uses no list of names and no model, but compares typed texts with the scenario's. It lists German nouns, which begin
with a capital, unless the scenario has them; this is better than missing a name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msgspec import Struct

from rise_engine.kernel.inputs import AnyInput, SessionStarted, Submit
from rise_engine.kernel.records import ENGINE, AnyRecord, MemoryRecord
from rise_engine.session.folder import JOURNAL, SCENARIO_COPY, read_info
from rise_engine.session.journal_format import InputLine, JournalHeader
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.scenario_copies import load_session_scenario

_WORD = re.compile(r"[^\W\d_][^\W_]*(?:[-'’][^\W\d_][^\W_]*)*")
_ADDRESS = re.compile(r"[\w.+-]+@[\w-]+(?:\.[\w-]+)+|\+?\d[\d /-]{6,}\d")
_FREE_TEXT = ("text", "reason", "value")
"""Fields of inputs into which people type."""


class NameSuggestion(Struct, frozen=True):
    """A word that could be a name."""

    word: str
    why: str
    count: int
    """How often it occurs in typed texts."""


def suggest_words(folder: Path) -> list[NameSuggestion]:
    """Return words in the session in `folder` that could be names, the likeliest first. Raises SessionError."""
    info = read_info(folder)
    contents = read_journal(folder / JOURNAL)
    scenario = load_session_scenario(folder, info, [])
    found: dict[str, tuple[int, str]] = {}
    counts: dict[str, int] = {}

    def add(word: str, why: str, rank: int) -> None:
        word = " ".join(word.split())
        if len(word) < 2 or not any(map(str.isalnum, word)):
            return
        counts[word] = counts.get(word, 0) + 1
        if word not in found or found[word][0] > rank:
            found[word] = (rank, why)

    known = _scenario_words(folder / SCENARIO_COPY)
    for _, _, line in contents.lines():
        if isinstance(line, InputLine):
            for text in _typed_texts(line.input):
                for address in _ADDRESS.findall(text):
                    add(address.strip(), "looks like an address or a number of somebody", 1)
                for word in _WORD.findall(text):
                    if word[0].isupper() and word.casefold() not in known:
                        add(word, "begins with a capital, and the scenario has no such word", 3)
        elif not isinstance(line, JournalHeader):
            for value, why, rank in _memory_texts(line, scenario.private):
                add(value, why, rank)
    if info.participant and not (info.participant.isascii() and info.participant.isalnum()):
        add(info.participant, "the participant, and no pseudonym", 0)
    ordered = sorted(found, key=lambda word: (found[word][0], -counts[word], word))
    return [NameSuggestion(word, found[word][1], counts[word]) for word in ordered]


def _typed_texts(input: AnyInput) -> Iterator[str]:
    if isinstance(input, Submit):
        if input.function in ("say", "markCue") or not input.source.startswith(("rule:", "engine")):
            yield input.behavior
    elif not isinstance(input, SessionStarted) and getattr(input, "source", "") != ENGINE:
        for name in _FREE_TEXT:
            if isinstance(text := getattr(input, name, ""), str):
                yield text


def _memory_texts(record: AnyRecord, private: frozenset[str]) -> Iterator[tuple[str, str, int]]:
    if not isinstance(record, MemoryRecord):
        return
    head = record.key.partition(".")[0]
    is_private = any(record.key == key or head == key.partition(".")[0] for key in private)
    if is_private:
        for text in _texts_of(record.value):
            yield text, f"the value of the private key {record.key}", 0
    elif record.source.startswith(("wizard:", "study")):
        for text in _texts_of(record.value):
            yield text, f"typed into the memory as {record.key}", 2


def _texts_of(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | dict):
        for each in value.values() if isinstance(value, dict) else value:
            yield from _texts_of(each)


def _scenario_words(copy: Path) -> frozenset[str]:
    texts = (path.read_bytes().decode("utf-8", "replace") for path in copy.rglob("*") if path.is_file())
    return frozenset(word.casefold() for text in texts for word in _WORD.findall(text))
