"""How an action's parameters fill the fields of a message: what a carrier says, checked and prepared once per session,
so that making the message of a goal is a walk over a small tree.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Protocol

from msgspec import Struct

from rise_adapters.ros2.carriers.fields import DURATION, FieldType, duration, fit, shown, what_it_takes
from rise_adapters.ros2.carriers.texts import seconds
from rise_engine.scenario.model import Parameter
from rise_engine.scenario.template import as_text


class Filling(Struct, frozen=True):
    """What one message is made of."""

    parameters: Mapping[str, Any]
    """As the author gave them; those left out are absent."""
    specials: Mapping[str, str]


class _NoValue:
    """Neither author, fallback nor declaration give a value: the field keeps its zero."""


NOTHING = _NoValue()


class Maker(Protocol):
    def make(self, filling: Filling) -> Any:
        """The value of a field, or NOTHING. Raises ValueError with a sentence when the field cannot take it."""
        ...


# --- makers ---------------------------------------------------------------------------------------------------------


class Constant(Struct, frozen=True):
    value: Any

    def make(self, filling: Filling) -> Any:
        return self.value


class Group(Struct, frozen=True):
    """A message of several fields."""

    fields: dict[str, Maker]

    def make(self, filling: Filling) -> Any:
        made = {name: maker.make(filling) for name, maker in self.fields.items()}
        return {name: value for name, value in made.items() if value is not NOTHING}


class Row(Struct, frozen=True):
    """A list of values."""

    items: tuple[Maker, ...]
    zero: Any = NOTHING
    """What stands for an item without a value; NOTHING: it is left out."""
    as_bytes: bool = False

    def make(self, filling: Filling) -> Any:
        made = [item.make(filling) for item in self.items]
        values = [self.zero if value is NOTHING else value for value in made]
        values = [value for value in values if value is not NOTHING]
        return bytes(values) if self.as_bytes else values


class FromParameter(Struct, frozen=True):
    """A field that one parameter fills."""

    field: str
    """Its path, for messages."""
    conversion: Conversion
    absent: Any = NOTHING
    """What the field gets when the author gives nothing."""
    special: str | None = None
    """The special that the field gets then, if one."""

    def make(self, filling: Filling) -> Any:
        conversion = self.conversion
        value = filling.parameters.get(conversion.parameter.name)
        try:
            if value is not None:
                return conversion.of(value)
            return self.absent if self.special is None else literal(filling.specials[self.special], conversion.type)
        except ValueError as error:
            raise ValueError(f"`{self.field}` {error} (parameter `{conversion.parameter.name}`)") from None


class FromSpecial(Struct, frozen=True):
    field: str
    name: str
    type: FieldType | None

    def make(self, filling: Filling) -> Any:
        value = filling.specials[self.name]
        try:
            return value if self.type is None else fit(value, self.type)
        except ValueError as error:
            raise ValueError(f"`{self.field}` {error} (@{self.name})") from None


class Parameters(Struct, frozen=True):
    """All parameters as the text of a JSON object, in the order of their declaration."""

    field: str
    all: tuple[Conversion, ...]
    type: FieldType | None

    def make(self, filling: Filling) -> Any:
        values = {
            each.parameter.name: each.plain(filling.parameters.get(each.parameter.name, each.parameter.default))
            for each in self.all
        }
        text = json.dumps({name: value for name, value in values.items() if value is not None}, ensure_ascii=False)
        try:
            return text if self.type is None else fit(text, self.type)
        except ValueError as error:
            raise ValueError(f"`{self.field}` {error} (@parameters)") from None


class Joined(Struct, frozen=True):
    """A text put together from pieces."""

    field: str
    pieces: tuple[Maker, ...]
    type: FieldType | None

    def make(self, filling: Filling) -> Any:
        made = [piece.make(filling) for piece in self.pieces]
        text = "".join(as_text(value) for value in made if value is not NOTHING)
        try:
            return text if self.type is None else fit(text, self.type)
        except ValueError as error:
            raise ValueError(f"`{self.field}` {error}") from None


# --- one parameter --------------------------------------------------------------------------------------------------


class Conversion(Struct, frozen=True):
    """From a parameter's value, as the author gives it, to what a field of a type takes."""

    parameter: Parameter
    values: dict[str, Any]
    """The robot's own words for some values, by RISE's (`carrier.values`)."""
    type: FieldType | None = None
    """Of the field; None: not known, or a piece of a text."""
    factor: float = 1.0
    divisor: float = 1.0

    def plain(self, value: Any) -> Any:
        """The value by its name, not by its number, and by the robot's own word if it has one."""
        value = self._by_name(value)
        return self.values.get(as_text(value), value) if self.values and value is not None else value

    def of(self, value: Any) -> Any:
        """The field's value. Raises ValueError: what the field takes instead."""
        value = self._by_name(value)
        if self.values and (word := as_text(value)) in self.values:
            return literal(self.values[word], self.type)
        if (self.factor, self.divisor) != (1.0, 1.0):
            value = value * self.factor / self.divisor
        if self.type is None:
            return value
        if self.type.name == DURATION:
            return duration(value * (seconds(self.parameter) or 1.0))
        if self.type.kind == "text":
            return fit(as_text(value), self.type)
        if self.parameter.type == "name" and isinstance(value, str):
            code = self.parameter.codes.get(value)
            if code is None:
                raise ValueError(f"takes {what_it_takes(self.type)}, and {shown(value)} has no number")
            value = code
        elif self.parameter.type == "boolean" and self.type.kind == "integer":
            value = int(value)
        return fit(value, self.type)

    def _by_name(self, value: Any) -> Any:
        if self.parameter.type == "name" and isinstance(value, int) and not isinstance(value, bool):
            return next((name for name, code in self.parameter.codes.items() if code == value), value)
        return value


def literal(value: Any, type: FieldType | None) -> Any:
    """A plain value of the profile in a field. Raises ValueError: what the field takes."""
    if type is None:
        return value
    if type.name == DURATION:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"takes a time in seconds, and {shown(value)} is not")
        return duration(value)
    if type.kind == "message":
        raise ValueError(f"takes {what_it_takes(type)}, and {shown(value)} is not")
    return fit(value, type)
