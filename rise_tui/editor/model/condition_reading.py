"""A condition while it is typed: what is wrong with it, how it is read, and what it is with the values of the start.

The same for the value on the right of an assignment. Pure, and fast enough for every key (0.02 ms a reading).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Literal, NamedTuple, TypeAlias

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.expression import Environment, EvaluationError, Expression, ExpressionError, lookup
from rise_engine.expression.errors import MISSING_PART
from rise_engine.expression.functions import SIGNATURES
from rise_engine.scenario.model import SESSION, Json
from rise_tui.editor.model.study_names import StudyNames, short_value

NoteLevel: TypeAlias = Literal["error", "warning", "info"]

MOST_CUTS = 60
"""How many words are taken away from the end of a text that cannot be read, until the rest of it can."""
_WORD = re.compile(r"""[\w.]+|"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|\S""")
_LAST_WORD = re.compile(r"[^\W\d][\w.]*\Z")
_TEXTS = re.compile(r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'""")
WORDS = ("and", "or", "not", "true", "false", "contains", "starts with", "ends with")


class FieldNote(NamedTuple):
    """What is to be said about a field while it is filled in."""

    level: NoteLevel
    text: str


class TypedCondition(NamedTuple):
    """What a text means as a condition."""

    text: str
    problem: str = ""
    """Why it cannot be read, with the remedy; empty: it can."""
    column: int = 0
    """Where, from 1."""
    so_far: str = ""
    """Of a text that cannot be read, its longest beginning that can, with all brackets."""
    explicit: str = ""
    """With all brackets written out, where that says more than the text does."""
    values: str = ""
    """The keys that it reads, with their values: `step is 0, understood is false`."""
    holds: bool | None = None
    """Whether it holds with these values; None: that cannot be said, because of `why_unknown`."""
    why_unknown: str = ""
    unknown_keys: tuple[str, ...] = ()
    """Sentences about keys that nothing in the study sets."""

    @property
    def expression(self) -> Expression | None:
        """What was read, or of an unfinished text its beginning."""
        readable = self.text if not self.problem else self.so_far
        return Expression.parse(readable) if readable else None


def read_condition(text: str, names: StudyNames, *, memory: Mapping[str, Json] | None = None) -> TypedCondition:
    """How a condition is read.

    :param memory: the values to look at; without it, those of the start.
    """
    text = text.strip()
    memory = names.memory if memory is None else memory
    try:
        expression = Expression.parse(text)
    except ExpressionError as error:
        problem = f"{error.message}; {error.hint}" if error.hint else error.message
        beginning = _readable_beginning(text) if text else None
        if beginning is None:
            return TypedCondition(text, problem, error.column)
        values, holds, why = _evaluate(beginning, memory)
        return TypedCondition(text, problem, error.column, beginning.with_all_brackets, "", values, holds, why)
    values, holds, why = _evaluate(expression, memory)
    explicit = expression.with_all_brackets
    return TypedCondition(
        text,
        explicit=explicit if _without_blanks(explicit) != _without_blanks(text) else "",
        values=values,
        holds=holds,
        why_unknown=why,
        unknown_keys=tuple(unknown_key_notes(expression, names)),
    )


def reading_notes(reading: TypedCondition, basis: str = "at the start") -> list[FieldNote]:
    """The lines below a condition's field, the most important first.

    :param basis: of when the values are, in words.
    """
    notes: list[FieldNote] = []
    if reading.problem:
        notes.append(FieldNote("error", reading.problem))
        if reading.so_far:
            notes.append(FieldNote("info", f"so far read as {reading.so_far}; {_truth_text(reading, basis)}"))
        return notes
    if reading.explicit:
        notes.append(FieldNote("info", f"read as {reading.explicit}"))
    notes.append(FieldNote("info", _truth_text(reading, basis)))
    notes += [FieldNote("warning", text) for text in reading.unknown_keys]
    return notes


def unknown_key_notes(expression: Expression, names: StudyNames) -> Iterator[str]:
    """A sentence for each key that is read and that nothing in the study sets."""
    paths = names.memory_paths
    for key in sorted(expression.keys_read):
        if not paths.is_known(key):
            remedy = did_you_mean(key, (*names.memory, *names.set_keys), limit=0)
            yield f"nothing in this study sets the memory key `{key}`{remedy}"
        elif problem := paths.reading_problem(key):
            yield problem


def suggest_ending(text: str, names: StudyNames) -> str:
    """What could be added at the end of a text: the rest of the word that is begun there; empty: nothing is sure.

    >>> from rise_tui.editor.model.study_names import StudyNames
    >>> from rise_engine.author.edit.outline import Outline
    >>> some = StudyNames(Outline(), {"step": 0, "understood": False}, frozenset(), frozenset(), {}, frozenset(), {})
    >>> suggest_ending("step < 4 and not und", some)
    'erstood'
    """
    begun = _LAST_WORD.search(text)
    if begun is None or {*_TEXTS.sub("", text)} & {"'", '"'}:
        return ""
    word = begun.group()
    functions = (f"{signature.name}(" for signature in SIGNATURES)
    for known in (*names.memory, *sorted(names.set_keys), *WORDS, *functions):
        if known.startswith(word) and known != word:
            return known[len(word) :]
    return ""


def values_text(expression: Expression, memory: Mapping[str, Json]) -> str:
    """The keys and parts that an expression reads, with their values."""
    return _evaluate(expression, memory)[0]


def _truth_text(reading: TypedCondition, basis: str) -> str:
    if reading.holds is None:
        return reading.why_unknown
    truth = "true" if reading.holds else "false"
    return f"{reading.values} {basis}: {truth}" if reading.values else f"always {truth}"


def _evaluate(expression: Expression, memory: Mapping[str, Json]) -> tuple[str, bool | None, str]:
    """The values that are read, whether it holds, and why that cannot be said."""
    parts: dict[str, Json] = {}
    holds, why = None, ""
    if expression.draws:
        why = "chance decides it, each time anew"
    else:
        try:
            holds = expression.compiled_condition(Environment(memory, parts=parts))
        except EvaluationError as error:
            why = f"with these values it cannot be worked out: {str(error).removeprefix(f'{MISSING_PART}: ')}"
    texts = {name: f"{name} is {short_value(value)}" for name, value in parts.items() if value is not None}
    for key in expression.keys - expression.keys_of_parts_only:
        found, value = lookup(memory, key)
        if not found and key.partition(".")[0] == SESSION:
            holds, why = None, f"what `{key}` is, is known when a session runs"
        texts[key] = f"{key} is {short_value(value)}" if found else f"{key} is not there"
    values = ", ".join(text for _, text in sorted(texts.items()))
    return values, holds, why


def _readable_beginning(text: str) -> Expression | None:
    ends = [found.end() for found in _WORD.finditer(text)][:-1]
    for end in reversed(ends[-MOST_CUTS:]):
        try:
            return Expression.parse(text[:end])
        except ExpressionError:
            continue
    return None


def _without_blanks(text: str) -> str:
    """A text without what brackets and blanks around it add; `=` and `==` are one."""
    return re.sub(r"\s+", "", text.replace("==", "=").replace("'", '"'))
