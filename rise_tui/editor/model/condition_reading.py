"""A condition while it is typed: its reading, and whether it holds at the start. Pure; one reading takes 0.02 ms."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from rise_engine.author.drawing.rule_text import truth_of
from rise_engine.expression import Expression, ExpressionError, lookup
from rise_engine.expression.errors import MISSING_PART
from rise_engine.expression.functions import SIGNATURES
from rise_engine.scenario.model import SESSION, Json
from rise_tui.editor.model.fields import NOT_GIVEN, EditField, FieldNote, Form, info
from rise_tui.editor.model.study_names import StudyNames, short_value

MOST_CUTS = 60
"""The most words that are cut from the end of an unreadable text to find a readable beginning."""
_WORD = re.compile(r"""[\w.]+|"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|\S""")
_LAST_WORD = re.compile(r"[^\W\d][\w.]*\Z")
_TEXTS = re.compile(r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'""")
WORDS = ("and", "or", "not", "true", "false", "contains", "starts with", "ends with")


def condition_notes(text: str, names: StudyNames) -> list[FieldNote]:
    """How a condition is read, with the start values; of an unreadable one, its longest readable beginning.

    What makes it unreadable, the check of the study says.
    """
    text = text.strip()
    try:
        expression = Expression.parse(text)
    except ExpressionError:
        beginning = _readable_beginning(text)
        if beginning is None:
            return []
        return info(f"so far read as {beginning.with_all_brackets}; {_truth_text(beginning, names.memory)}")
    explicit = expression.with_all_brackets
    differs = _without_blanks(explicit) != _without_blanks(text)
    return [*info(f"read as {explicit}" if differs else ""), *info(_truth_text(expression, names.memory))]


def condition_field(
    form: Form, names: StudyNames, id: str, label: str, empty: str = NOT_GIVEN, *, note: str = ""
) -> EditField:
    """The field of a condition in a form."""
    remarks = condition_notes(form.value(id), names)
    field = form.text(id, label, empty, note=note, choices=names.key_choices(), remarks=remarks)
    return field._replace(is_expression=True)


def suggest_ending(text: str, keys: Sequence[str]) -> str:
    """The rest of the unfinished word at the end of a text; empty if it is not certain.

    >>> suggest_ending("step < 4 and not und", ["step", "understood"])
    'erstood'
    """
    begun = _LAST_WORD.search(text)
    if begun is None or {*_TEXTS.sub("", text)} & {"'", '"'}:
        return ""
    word = begun.group()
    functions = (f"{signature.name}(" for signature in SIGNATURES)
    for known in (*keys, *WORDS, *functions):
        if known.startswith(word) and known != word:
            return known[len(word) :]
    return ""


def _truth_text(expression: Expression, memory: Mapping[str, Json]) -> str:
    """Whether the expression holds with these values, or why that is unknown."""
    if expression.draws:
        return "chance decides each time"
    for key in sorted(expression.keys - expression.keys_of_parts_only):
        if key.partition(".")[0] == SESSION and not lookup(memory, key)[0]:
            return f"`{key}` is known when a session runs"
    _, values, holds, error = truth_of(expression, memory, short_value)
    if error:
        return f"these values give no result: {error.removeprefix(f'{MISSING_PART}: ')}"
    truth = "true" if holds else "false"
    return f"{values} at the start: {truth}" if values else f"always {truth}"


def _readable_beginning(text: str) -> Expression | None:
    ends = [found.end() for found in _WORD.finditer(text)][:-1]
    for end in reversed(ends[-MOST_CUTS:]):
        try:
            return Expression.parse(text[:end])
        except ExpressionError:
            continue
    return None


def _without_blanks(text: str) -> str:
    """A text for comparison, without blanks; `=` and `==` are the same."""
    return re.sub(r"\s+", "", text.replace("==", "=").replace("'", '"'))
