"""Parameter texts with memory values in them: `Hello {person_name|there}!` (semantics.md 2.3).

`Thank you{", "person_name}!` has a separator, which is only spoken with a value. `{items[i].text}` is a part of one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from json import dumps
from typing import Any

from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.base.json_codec import MAX_LEVELS
from rise_engine.base.nearest_name import Correction
from rise_engine.base.text import match_end
from rise_engine.expression import Environment, EvaluationError, Expression, ExpressionError, MissingPartError, lookup
from rise_engine.expression.tokens import path_end
from rise_engine.scenario.speech.ssml import begins_as_ssml, escape_value

_SLOT = re.compile(
    r"""\{ \s*+ (?:"([^"]*+)" \s*+)? ([^\W\d][\w.]*+) \s*+ (?:"([^"]*+)" \s*+)? (?:\|([^}]*+))? \}""", re.VERBOSE
)
"""A separator, the key, a separator, a fallback."""
_SLOT_START = re.compile(r"""\{ \s*+ (?:"([^"]*+)" \s*+)? (?=[^\W\d][\w.]*+\s*+\[)""", re.VERBOSE)
"""A separator before a key with an index."""
_SLOT_END = re.compile(r"""\s*+ (?:"([^"]*+)" \s*+)? (?:\|([^}]*+))? \}""", re.VERBOSE)
"""A separator and a fallback after it."""
_SLOT_KEY = re.compile(r"[\w.]+\s*")
_TYPOGRAPHIC = re.compile("[“”„‟«»″]")


class TemplateError(RiseError, ValueError):
    """A template cannot be read. `column` counts from 1 in the text; `suggestion` is the intended text there."""

    def __init__(self, message: str, column: int, suggestion: Correction | None = None) -> None:
        super().__init__(message)
        self.column = column
        self.suggestion = suggestion


class MissingValueError(RiseError):
    """A template needs a missing value: that of a memory key, or a part of one."""

    def __init__(self, key: str, message: str = "") -> None:
        super().__init__(message or f"the memory has no value for {key!r}")
        self.key = key


class MemorySlot(Struct, frozen=True):
    """A placeholder for a memory value."""

    key: str
    """As written, with its index: `items[i].text`."""
    fallback: str | None = None
    """Replaces a missing value. With separators, the default is the empty text."""
    before: str = ""
    after: str = ""
    """The separators, which are only spoken with a value that is not empty."""
    part: Expression | None = None
    """The expression of a key with an index."""

    def read(self, memory: Mapping[str, Any]) -> Any:
        """Return the memory's current value; None: there is no value but a fallback.

        Raises MissingValueError if there is neither, or if the index cannot be computed.
        """
        problem = ""
        value: Any = None
        if self.part is None:
            value = lookup(memory, self.key)[1]
        else:
            try:
                value = self.part.compiled_value(Environment(memory))
            except MissingPartError as missing:
                problem = str(missing)
            except EvaluationError as error:
                raise MissingValueError(self.key, str(error)) from None
        if value is None and self.fallback is None:
            raise MissingValueError(self.key, problem)
        return value


class Template(Struct, frozen=True):
    """A parameter as written: literal pieces and slots."""

    text: str
    """The source, including braces."""
    parts: tuple[str | MemorySlot, ...]

    @property
    def slots(self) -> list[MemorySlot]:
        """The placeholders for memory values, in order."""
        return [part for part in self.parts if isinstance(part, MemorySlot)]

    @property
    def constant(self) -> str | None:
        """Its text if it reads no memory value, else None."""
        return None if self.slots else self.fill({})

    def fill(self, memory: Mapping[str, Any]) -> str:
        """The text with the memory's current values. In SSML, markup in values is escaped.

        Raises MissingValueError for a key without value or fallback.
        """
        write = escape_value if self._is_ssml else str
        return "".join(part if isinstance(part, str) else _slot_text(part, memory, write) for part in self.parts)

    @property
    def _is_ssml(self) -> bool:
        return len(self.parts) > 1 and isinstance(self.parts[0], str) and begins_as_ssml(self.parts[0])

    def fill_value(self, memory: Mapping[str, Any]) -> Any:
        """Like `fill`, but a single slot keeps the value's own type (for numbers and booleans)."""
        if len(self.parts) == 1 and isinstance(slot := self.parts[0], MemorySlot):
            value = slot.read(memory)
            if value is not None:
                return value
        return self.fill(memory)


def parse_template(text: str) -> Template:
    """Read a parameter text. Raises TemplateError for an unmatched brace or a slot without a key."""
    if "{" not in text and "}" not in text:
        return Template(text, (text,) if text else ())
    parts: list[str | MemorySlot] = []
    literal: list[str] = []
    at = 0
    while at < len(text):
        character = text[at]
        if character not in "{}":
            literal.append(character)
            at += 1
        elif text[at : at + 2] in ("{{", "}}"):
            literal.append(character)
            at += 2
        elif character == "}":
            raise TemplateError("a `}` without its `{`; write `}}` for the character itself", at + 1)
        else:
            if literal:
                parts.append("".join(literal))
                literal.clear()
            slot, at = _read_slot(text, at)
            parts.append(slot)
    if literal:
        parts.append("".join(literal))
    return Template(text, tuple(parts))


def _read_slot(text: str, start: int) -> tuple[MemorySlot, int]:
    """Read the slot that begins at `start`. Returns it and its end. Raises TemplateError."""
    part: Expression | None = None
    indexed = _SLOT_START.match(text, start)
    if indexed is not None:
        before = indexed[1]
        part, at = _read_part(text, indexed.end())
        key = part.text
        rest = _SLOT_END.match(text, at)
        if rest is None:
            raise _malformed_error(text, start)
        (after, fallback), end = rest.groups(), rest.end()
    else:
        found = _SLOT.match(text, start)
        if found is None or found[2].count(".") >= MAX_LEVELS:
            raise _malformed_error(text, start)
        (before, key, after, fallback), end = found.groups(), found.end()
    if fallback is None and (before is not None or after is not None):
        fallback = ""
    return MemorySlot(key, fallback, before or "", after or "", part), end


def _read_part(text: str, start: int) -> tuple[Expression, int]:
    """Read the part of a value at `start`. Returns it and its end."""
    end = path_end(text, match_end(_SLOT_KEY, text, start))
    if end < 0:
        opening = text.index("[", start)
        raise TemplateError("this `[` is not closed; write {items[i].text}", opening + 1)
    try:
        part = Expression.parse(text[start:end])
    except ExpressionError as error:
        message = f"{error.message}; {error.hint}" if error.hint else error.message
        raise TemplateError(message, start + error.column, error.suggestion) from None
    if part.draws:
        message = "chance is not allowed in braces, because a text is shown before it is said; assign the number first"
        raise TemplateError(message, start + 1)
    return part, end


def _malformed_error(text: str, at: int) -> TemplateError:
    """Return the error of the slot that begins at `at`."""
    end = text.find("}", at)
    if end < 0:
        return TemplateError("a `{` without its `}`; write `{{` for the character itself", at + 1)
    written = text[at : end + 1]
    before_fallback = written.partition("|")[0]
    typographic = _TYPOGRAPHIC.search(before_fallback)
    if typographic is not None:
        return TemplateError(
            f'`{typographic.group()}` is a typographic quotation mark; a separator needs straight ones: {{", "key}}',
            at + typographic.start() + 1,
        )
    if before_fallback.count('"') % 2:
        column = at + before_fallback.rindex('"') + 1
        return TemplateError(
            f'the separator in `{written}` has no closing quotation mark; write {{", "key}} or {{key" "}}', column
        )
    if '"' in before_fallback:
        return TemplateError(
            f"`{written}` cannot be read: between the braces write one key and, directly before or after it, a "
            'separator in quotation marks: {", "key} or {key" "}',
            at + 1,
        )
    return TemplateError(f"`{written}` does not name a memory key; write {{key}} or {{key|fallback}}", at + 1)


def key_template(key: str) -> Template:
    """The template of a parameter that is a bare memory key (allowed for numbers and booleans)."""
    return Template(key, (MemorySlot(key),))


def spoken_text(value: Any) -> str:
    """A memory value in spoken or printed form: numbers without a trailing `.0`, booleans as `true` and `false`."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    if isinstance(value, str | int | float):
        return str(value)
    return dumps(value, ensure_ascii=False)


def _slot_text(slot: MemorySlot, memory: Mapping[str, Any], write: Callable[[str], str]) -> str:
    """The text of a slot; `write` escapes the value's text."""
    value = slot.read(memory)
    if value is not None:
        text = write(spoken_text(value))
        if not (slot.before or slot.after):
            return text
        if text.strip():
            return slot.before + text + slot.after
    assert slot.fallback is not None  # separators imply one, and without a value `read` has raised
    return slot.fallback
