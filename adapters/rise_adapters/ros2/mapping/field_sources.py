"""Sources that fill the fields of a message from an action's parameters. A carrier is checked and compiled once per
session, so a goal's message is made by walking over a small tree."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Protocol

from msgspec import Struct

from rise_adapters.ros2.mapping.field_types import (
    DURATION,
    MessageFieldType,
    describe_field_type,
    describe_value,
    duration_message,
    fit_value,
)
from rise_adapters.ros2.mapping.templates import seconds_per_unit
from rise_adapters.ros2.transport.port import Message
from rise_engine.scenario.model import Parameter
from rise_engine.scenario.speech.template import spoken_text


class FillContext(Struct, frozen=True):
    """The inputs of one message."""

    parameters: Mapping[str, Any]
    """As given by the author, without omitted ones."""
    specials: Mapping[str, str]
    now: int = 0
    """Nanoseconds since 1970."""


class _NoValue:
    """No value from the author, a fallback or the declaration: the field stays zero."""


NO_VALUE = _NoValue()


class FieldSource(Protocol):
    def fill(self, context: FillContext) -> Any:
        """Return the value of a field, or NO_VALUE. Raises ValueError with a sentence if the field cannot hold it."""
        ...


# --- fields ---------------------------------------------------------------------------------------------------------


class FixedSource(Struct, frozen=True):
    value: Any

    def fill(self, context: FillContext) -> Any:
        return self.value


class MessageSource(Struct, frozen=True):
    """A message of several fields."""

    fields: dict[str, FieldSource]

    def fill(self, context: FillContext) -> Message:
        values = {name: source.fill(context) for name, source in self.fields.items()}
        return {name: value for name, value in values.items() if value is not NO_VALUE}


class ListSource(Struct, frozen=True):
    """A list of values."""

    items: tuple[FieldSource, ...]
    zero: Any = NO_VALUE
    """The value of an item without one; NO_VALUE: it is omitted."""
    as_bytes: bool = False

    def fill(self, context: FillContext) -> Any:
        filled = [item.fill(context) for item in self.items]
        values = [self.zero if value is NO_VALUE else value for value in filled]
        values = [value for value in values if value is not NO_VALUE]
        return bytes(values) if self.as_bytes else values


class ParameterSource(Struct, frozen=True):
    """A field that one parameter fills."""

    field: str
    """The field's path, for messages."""
    conversion: ParameterConversion
    absent: Any = NO_VALUE
    """The field's value without the author's value."""
    special: str | None = None
    """The special value for that case, if any."""

    def fill(self, context: FillContext) -> Any:
        conversion = self.conversion
        value = context.parameters.get(conversion.parameter.name)
        try:
            if value is not None:
                return conversion.to_field_value(value)
            return self.absent if self.special is None else fit_literal(context.specials[self.special], conversion.type)
        except ValueError as error:
            raise ValueError(f"`{self.field}` {error} (parameter `{conversion.parameter.name}`)") from None


class SpecialSource(Struct, frozen=True):
    field: str
    name: str
    type: MessageFieldType | None

    def fill(self, context: FillContext) -> Any:
        return _fit_text(context.specials[self.name], self.type, self.field, f" (@{self.name})")


class AllParametersSource(Struct, frozen=True):
    """All parameters as a JSON object in text form, in the order of their declaration."""

    field: str
    all: tuple[ParameterConversion, ...]
    type: MessageFieldType | None

    def fill(self, context: FillContext) -> Any:
        values = {
            each.parameter.name: each.to_named_value(
                context.parameters.get(each.parameter.name, each.parameter.default)
            )
            for each in self.all
        }
        text = json.dumps({name: value for name, value in values.items() if value is not None}, ensure_ascii=False)
        return _fit_text(text, self.type, self.field, " (@parameters)")


class JoinedTextSource(Struct, frozen=True):
    """A text joined from pieces."""

    field: str
    pieces: tuple[FieldSource, ...]
    type: MessageFieldType | None

    def fill(self, context: FillContext) -> Any:
        values = [piece.fill(context) for piece in self.pieces]
        text = "".join(spoken_text(value) for value in values if value is not NO_VALUE)
        return _fit_text(text, self.type, self.field)


def _fit_text(text: str, type: MessageFieldType | None, field: str, name: str = "") -> Any:
    try:
        return fit_literal(text, type)
    except ValueError as error:
        raise ValueError(f"`{field}` {error}{name}") from None


# --- one parameter --------------------------------------------------------------------------------------------------


class ParameterConversion(Struct, frozen=True):
    """Converts a parameter's value from the author to a field's type."""

    parameter: Parameter
    values: dict[str, Any]
    """The robot's own words for some values, by RISE's words (`carrier.values`)."""
    type: MessageFieldType | None = None
    """The field's type; None: unknown, or a piece of a text."""
    factor: float = 1.0
    divisor: float = 1.0

    def to_named_value(self, value: Any) -> Any:
        """Return the value by its name instead of its number, and in the robot's own word if it has one."""
        value = self._to_name(value)
        return self.values.get(spoken_text(value), value) if self.values and value is not None else value

    def to_field_value(self, value: Any) -> Any:
        """Return the field's value. Raises ValueError with the values that the field accepts."""
        value = self._to_name(value)
        if self.values and (word := spoken_text(value)) in self.values:
            return fit_literal(self.values[word], self.type)
        if (self.factor, self.divisor) != (1.0, 1.0):
            value = value * self.factor / self.divisor
        if self.type is None:
            return value
        if self.type.base == DURATION:
            return duration_message(value * (seconds_per_unit(self.parameter) or 1.0))
        if self.type.kind == "text":
            return fit_value(spoken_text(value), self.type)
        if self.parameter.type == "name" and isinstance(value, str):
            code = self.parameter.codes.get(value)
            if code is None:
                raise ValueError(f"takes {describe_field_type(self.type)}, and {describe_value(value)} has no number")
            value = code
        elif self.parameter.type == "boolean" and self.type.kind == "integer":
            value = int(value)
        return fit_value(value, self.type)

    def _to_name(self, value: Any) -> Any:
        if self.parameter.type == "name" and isinstance(value, int) and not isinstance(value, bool):
            return next((name for name, code in self.parameter.codes.items() if code == value), value)
        return value


def fit_literal(value: Any, type: MessageFieldType | None) -> Any:
    """Return a plain value of the profile for a field. Raises ValueError with the values that the field accepts."""
    if type is None:
        return value
    if type.base == DURATION:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"takes a time in seconds, and {describe_value(value)} is not")
        return duration_message(value)
    if type.kind == "message":
        raise ValueError(f"takes {describe_field_type(type)}, and {describe_value(value)} is not")
    return fit_value(value, type)
