"""Parameter texts with memory values in them: `Hello {person_name|there}!` (semantics, section 2)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from rise_engine.expression import lookup
from rise_engine.expression.values import MAX_LEVELS

_SLOT_KEY = re.compile(r"[^\W\d][\w.]*\Z")


class TemplateError(ValueError):
    """A template that cannot be read. `column` counts from 1 within the text."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.column = column


class MissingValue(Exception):
    """A memory key without value was needed to fill a template."""

    def __init__(self, key: str) -> None:
        super().__init__(f"the memory has no value for {key!r}")
        self.key = key


class Slot(Struct, frozen=True):
    """A place where a memory value goes."""

    key: str
    fallback: str | None = None


class Template(Struct, frozen=True):
    """A parameter as written: literal pieces and slots."""

    text: str
    """The source, braces and all."""
    parts: tuple[str | Slot, ...]

    @property
    def keys(self) -> frozenset[str]:
        """The memory keys that it reads."""
        return frozenset(part.key for part in self.parts if isinstance(part, Slot))

    @property
    def constant(self) -> str | None:
        """Its text when no memory value is involved."""
        if any(isinstance(part, Slot) for part in self.parts):
            return None
        return "".join(part for part in self.parts if isinstance(part, str))

    def fill(self, memory: Mapping[str, Any]) -> str:
        """The text with the memory's values of this moment. Raises MissingValue for a key without value or fallback."""
        return "".join(part if isinstance(part, str) else _slot_text(part, memory) for part in self.parts)

    def fill_value(self, memory: Mapping[str, Any]) -> Any:
        """As `fill`, but a template that is one single slot keeps the value's own type (for numbers and booleans)."""
        if len(self.parts) == 1 and isinstance(slot := self.parts[0], Slot):
            found, value = lookup(memory, slot.key)
            if found and value is not None:
                return value
        return self.fill(memory)


def parse_template(text: str) -> Template:
    """Read a parameter text. Raises TemplateError for a brace without partner or a slot that names no key."""
    if "{" not in text and "}" not in text:
        return Template(text, (text,) if text else ())
    parts: list[str | Slot] = []
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
            end = text.find("}", at)
            if end < 0:
                raise TemplateError("a `{` without its `}`; write `{{` for the character itself", at + 1)
            key, bar, fallback = text[at + 1 : end].partition("|")
            if not _SLOT_KEY.match(key.strip()) or key.count(".") >= MAX_LEVELS:
                raise TemplateError(
                    f"`{text[at : end + 1]}` does not name a memory key; write {{key}} or {{key|fallback}}", at + 1
                )
            if literal:
                parts.append("".join(literal))
                literal.clear()
            parts.append(Slot(key.strip(), fallback if bar else None))
            at = end + 1
    if literal:
        parts.append("".join(literal))
    return Template(text, tuple(parts))


def key_template(key: str) -> Template:
    """The template of a parameter that is a bare memory key (allowed for numbers and booleans)."""
    return Template(key, (Slot(key),))


def as_text(value: Any) -> str:
    """A memory value as it is spoken or printed: numbers without a trailing `.0`, booleans as `true` and `false`."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    if isinstance(value, str | int | float):
        return str(value)
    from json import dumps  # only for arrays and objects, which are rare in a parameter

    return dumps(value, ensure_ascii=False)


def _slot_text(slot: Slot, memory: Mapping[str, Any]) -> str:
    found, value = lookup(memory, slot.key)
    if found and value is not None:
        return as_text(value)
    if slot.fallback is not None:
        return slot.fallback
    raise MissingValue(slot.key)
