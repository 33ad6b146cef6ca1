"""What a text with memory values says in each condition, in each language and for each row of a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice, product
from pathlib import Path
from typing import Any, NamedTuple

from rise_engine.base.text import pluralize
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.reading.conditions import conditions_in
from rise_engine.scenario.speech.spoken_texts import SpokenText
from rise_engine.scenario.speech.ssml import plain_words
from rise_engine.scenario.speech.template import MissingValueError, Template, parse_template
from rise_engine.study.plan import condition_name
from rise_engine.study.study_toml import load_study
from rise_tui.editor.model.draft import StudyDraft
from rise_tui.editor.model.text_rows import languages_of, own_language, text_entries

MAX_PLACES = 500
"""Combinations of condition, language and row that are looked at."""


class SaidText(NamedTuple):
    """What a text says somewhere."""

    text: str
    where: str
    """`no+quiet, de, items 2`; empty: always."""


def said_texts(draft: StudyDraft, spoken: SpokenText) -> list[SaidText]:
    """The different texts with the values of the start, and where each is said. Empty: it has no memory values."""
    if not spoken.template.slots:
        return []
    found: dict[str, list[str]] = {}
    for where, text in islice(_everywhere(draft, spoken), MAX_PLACES):
        found.setdefault(text, []).append(where)
    if len(found) == 1:
        return [SaidText(text, "") for text in found]
    return [
        SaidText(text, places[0] + (f" and {pluralize(len(places) - 1, 'other')}" if len(places) > 1 else ""))
        for text, places in found.items()
    ]


def _everywhere(draft: StudyDraft, spoken: SpokenText) -> Iterator[tuple[str, str]]:
    """Each place with what is said there."""
    for condition, values in conditions_of(draft):
        for language, template in _wordings(draft, spoken):
            tables = {name: table.in_language(language).records for name, table in draft.checked.draft.tables.items()}
            memory = {**tables, **draft.checked.draft.memory, **values}
            for row, text in _rows(template, memory):
                yield ", ".join(filter(None, (condition, language, row))), text


def conditions_of(draft: StudyDraft) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The conditions of the study, or else of the scenario, each with its memory values; without any, one empty one."""
    folder, files = Path(draft.folder), draft.files
    for path, data in draft.above.items():
        folder, files = Path(path).parent, {STUDY_FILE: data}
    if STUDY_FILE in files:
        study = load_study(folder, check_scenarios=False, held=files).study
        for levels in product(*(factor.levels for factor in study.factors)) if study is not None else ():
            names = {factor.name: level.name for factor, level in zip(study.factors, levels, strict=True)}  # type: ignore[union-attr]
            yield condition_name(names), {key: value for level in levels for key, value in level.memory.items()}
        if study is not None:
            return
    conditions = conditions_in(dict(draft.values_in(SCENARIO_FILE)))  # also while there are errors elsewhere
    for name, condition in conditions.items():
        yield name, condition.memory
    if not conditions:
        yield "", {}


def _wordings(draft: StudyDraft, spoken: SpokenText) -> Iterator[tuple[str, Template]]:
    """The text in each language."""
    languages = languages_of(draft)
    yield own_language(draft) if languages else "", spoken.template
    for language in languages:
        entry = next((each for each in text_entries(draft, language) if each.text.id == spoken.id), None)
        if entry is not None and entry.translation is not None:
            yield language, entry.translation.template
        elif not spoken.is_needed:
            yield language, spoken.template


def _rows(template: Template, memory: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The text for each row of the first table or list that it reads by a number, as `{items[order[i]].text}` does."""
    parts = [_split_index(slot.key) for slot in template.slots]
    name = next((name for name, _ in parts if isinstance(memory.get(name), list)), "")
    if not name:
        yield "", _fill(template, memory)
        return
    for number in range(len(memory[name])):
        text = template.text
        for slot, (read, rest) in zip(template.slots, parts, strict=True):
            if read == name:
                text = text.replace(slot.key, f"{name}[{number}]{rest}")
        yield f"{name} {number + 1}", _fill(parse_template(text), memory)


def _split_index(key: str) -> tuple[str, str]:
    """The name before the first index of a slot, and what follows that index: `items` and `.text` of
    `items[order[i]].text`.

    >>> _split_index("items[order[i]].text"), _split_index("name")
    (('items', '.text'), ('', ''))
    """
    name, _, inside = key.partition("[")
    depth = 1
    for at, character in enumerate(inside):
        depth += {"[": 1, "]": -1}.get(character, 0)
        if not depth:
            return name.strip(), inside[at + 1 :]
    return "", ""


def _fill(template: Template, memory: Mapping[str, Any]) -> str:
    try:
        return plain_words(template.fill(memory).strip())
    except MissingValueError as missing:
        return f"{{{missing.key}}} has no value yet"
    except (OverflowError, RecursionError):
        return "too long"
