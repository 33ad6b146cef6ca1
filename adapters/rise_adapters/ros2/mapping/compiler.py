"""From what a profile says about the fields of a message to what fills them: every mistake found, all at once.

Where the type of the message is known, so is what each of its fields takes; otherwise everything else is checked.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rise_adapters.ros2.mapping.field_sources import (
    NO_VALUE,
    AllParametersSource,
    FieldSource,
    FixedSource,
    JoinedTextSource,
    ListSource,
    MessageSource,
    ParameterConversion,
    ParameterSource,
    SpecialSource,
    literal_value,
)
from rise_adapters.ros2.mapping.field_types import (
    DURATION,
    FieldTypes,
    MessageFieldType,
    describe_field_type,
    describe_value,
)
from rise_adapters.ros2.mapping.templates import (
    Placeholder,
    parse_template,
    seconds_per_unit,
    special_fallback,
    unit_factors,
)
from rise_engine.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.model import ActionSpec, Parameter
from rise_engine.scenario.parameters import accepts_any_name, convert_parameter, listed_names


class ProfileMistakes:
    """Collects what is wrong, as sentences that begin with the place."""

    def __init__(self) -> None:
        self.sentences: list[str] = []

    def add(self, where: str, sentence: str) -> None:
        self.sentences.append(f"`{where}` {sentence}")


class MessageCompiler:
    """Prepares the messages of one action."""

    def __init__(
        self, spec: ActionSpec, values: Mapping[str, Mapping[str, Any]], types: FieldTypes, notes: ProfileMistakes
    ) -> None:
        self._spec = spec
        self._values = values
        self._types = types
        self._notes = notes
        self.used_parameters: set[str] = set()
        """Parameters that some field takes."""

    def compile(self, table: Mapping[str, Any], type: str, where: str) -> MessageSource:
        """A message out of a table of its fields; of any type when `type` is empty."""
        return self._message(
            nest_dotted_keys(table, where, self._notes), MessageFieldType(type) if type else None, where
        )

    def _message(self, table: Mapping[str, Any], type: MessageFieldType | None, where: str) -> MessageSource:
        fields = self._types.fields_of(type.name) if type is not None else None
        if type is not None and fields is None and (missing := self._types.why_unknown(type.name)):
            self._notes.add(where, f"cannot be checked: {missing}")
        makers: dict[str, FieldSource] = {}
        for name, value in table.items():
            at = f"{where}.{name}"
            if fields is not None and name not in fields:
                assert type is not None
                self._notes.add(at, f"is no field of {type.name}{did_you_mean(name, fields)}")
            elif (maker := self._source(value, fields[name] if fields is not None else None, at)) is not None:
                makers[name] = maker
        return MessageSource(makers)

    def _source(self, value: Any, type: MessageFieldType | None, where: str) -> FieldSource | None:
        try:
            if isinstance(value, dict):
                if type is not None and (type.is_list or type.kind != "message"):
                    raise ValueError(f"takes {describe_field_type(type)}, and not a table of fields")
                return self._message(value, type, where)
            if isinstance(value, list):
                return self._list(value, type, where)
            if type is not None and type.is_list:
                raise ValueError(f"takes {describe_field_type(type)}, and {describe_value(value)} is not")
            if isinstance(value, str):
                return self._text(value, type, where)
            if type is None and not isinstance(value, bool | int | float):
                raise ValueError(
                    f"cannot be {describe_value(value)}; write a text, a number, true, false, a list or a table"
                )
            return FixedSource(literal_value(value, type))
        except ValueError as error:
            self._notes.add(where, f"{error}{self._fields_of(type)}")
        return None

    def _list(self, values: list[Any], type: MessageFieldType | None, where: str) -> FieldSource | None:
        if type is not None and not type.is_list:
            raise ValueError(f"takes {describe_field_type(type)}, and not a list")
        if type is not None and not type.min_items <= len(values) <= (
            type.max_items if type.max_items is not None else len(values)
        ):
            raise ValueError(f"takes {describe_field_type(type)}, and here are {len(values)}")
        item = type.item if type is not None else None
        made = [self._source(value, item, f"{where}.{number}") for number, value in enumerate(values)]
        makers = tuple(maker for maker in made if maker is not None)
        zero = type.zero if type is not None and type.min_items else NO_VALUE
        return ListSource(makers, zero, type is not None and type.travels_as_bytes)

    def _text(self, text: str, type: MessageFieldType | None, where: str) -> FieldSource:
        pieces = parse_template(text)
        if len(pieces) == 1 and isinstance(pieces[0], Placeholder):
            return self._slot(pieces[0], type, where)
        if len(pieces) == 1:
            return FixedSource(literal_value(pieces[0], type))
        if type is not None and type.kind != "text":
            raise ValueError(
                f"takes {describe_field_type(type)}; only a single {{parameter}} can fill it, with nothing around it"
            )
        made = [
            FixedSource(piece) if isinstance(piece, str) else self._slot(piece, None, where, in_text=True)
            for piece in pieces
        ]
        return JoinedTextSource(where, tuple(made), type)

    def _slot(
        self, slot: Placeholder, type: MessageFieldType | None, where: str, *, in_text: bool = False
    ) -> FieldSource:
        if slot.special:
            if type is not None and type.kind != "text":
                raise ValueError(f"takes {describe_field_type(type)}, and @{slot.name} is a text")
            if slot.name == "parameters":
                self.used_parameters.update(self._spec.parameters)
                return AllParametersSource(where, tuple(map(self._conversion, self._spec.parameters.values())), type)
            return SpecialSource(where, slot.name, type)
        parameter = self._spec.parameters.get(slot.name)
        if parameter is None:
            if not self._spec.parameters:
                raise ValueError(f"has `{{{slot.name}}}`, and there are no parameters here")
            known = did_you_mean(slot.name, self._spec.parameters)
            raise ValueError(f"has `{{{slot.name}}}`, which is no parameter of {self._spec.name}{known}")
        self.used_parameters.add(parameter.name)
        factor, divisor = unit_factors(parameter, slot.unit) if slot.unit is not None else (1.0, 1.0)
        made = self._conversion(parameter, type, factor, divisor)
        if type is not None:
            _check_possible(made, type)
        special = special_fallback(slot)
        if special is not None and type is not None and type.kind != "text":
            raise ValueError(f"takes {describe_field_type(type)}, and @{special} is a text")
        return ParameterSource(where, made, self._value_when_absent(slot, made, in_text=in_text), special)

    def _conversion(
        self, parameter: Parameter, type: MessageFieldType | None = None, factor: float = 1.0, divisor: float = 1.0
    ) -> ParameterConversion:
        if type is not None and type.name == DURATION:
            factor, divisor = 1.0, 1.0  # it is a time in any unit
        return ParameterConversion(parameter, dict(self._values.get(parameter.name, {})), type, factor, divisor)

    def _value_when_absent(self, slot: Placeholder, made: ParameterConversion, *, in_text: bool) -> Any:
        """What the field gets when the author gives nothing."""
        parameter = made.parameter
        if special_fallback(slot) is not None:
            return NO_VALUE
        if slot.fallback is not None:
            try:
                value = convert_parameter(parameter, slot.fallback)
            except ValueError as error:
                if parameter.type != "name" or not (in_text or made.type is None or made.type.kind == "text"):
                    raise ValueError(f"has a fallback that cannot be: {error}") from None
                value = slot.fallback  # a word of the robot's
            return self._converted(made, value, "fallback")
        if parameter.default is None:
            return NO_VALUE
        try:
            value = convert_parameter(parameter, parameter.default)
        except ValueError as error:
            raise ValueError(f"cannot take the default: {error}") from None
        return self._converted(made, value, "default")

    def _converted(self, made: ParameterConversion, value: Any, what: str) -> Any:
        try:
            return made.field_value(value)
        except ValueError as error:
            raise ValueError(f"{error} (the {what} of `{made.parameter.name}`)") from None

    def _fields_of(self, type: MessageFieldType | None) -> str:
        """The end of a message about a field that is a message itself."""
        if type is None or type.is_list or type.kind != "message" or type.name == DURATION:
            return ""
        fields = self._types.fields_of(type.name)
        return f"; give its fields: {in_backquotes(fields)}" if fields else ""


def _check_possible(made: ParameterConversion, type: MessageFieldType) -> None:
    """Raises ValueError when the parameter can never, or not with each of its known names, fill the field."""
    parameter = made.parameter
    if type.name == DURATION:
        if seconds_per_unit(parameter) is None:
            raise ValueError(f"takes a time, and `{parameter.name}` is declared neither in `s` nor in `ms`")
        return
    able = {
        "text": ("text",),
        "number": ("text", "integer", "float"),
        "integer": ("text", "integer", "float"),
        "boolean": ("text", "integer", "boolean"),
        "name": ("text", "integer", "float"),
    }[parameter.type]
    what = {"text": "a text", "boolean": "true or false", "name": "a name"}.get(parameter.type, "a number")
    if type.kind not in able:
        raise ValueError(f"takes {describe_field_type(type)}, and `{parameter.name}` is {what}")
    if parameter.type != "name":
        return
    if type.kind != "text" and accepts_any_name(parameter):
        raise ValueError(
            f"takes {describe_field_type(type)}, and `{parameter.name}` may be any name, also one without a number"
        )
    for name in listed_names(parameter):
        made.field_value(name)


def nest_dotted_keys(table: Mapping[str, Any], where: str, notes: ProfileMistakes) -> dict[str, Any]:
    """A table of fields with all its dotted keys as tables within tables."""
    result: dict[str, Any] = {}
    for key, value in table.items():
        *parents, last = key.split(".")
        into: Any = result
        for parent in parents:
            into = into.setdefault(parent, {}) if isinstance(into, dict) else None
        if not isinstance(into, dict):
            notes.add(f"{where}.{key}", "is given twice, once as a whole")
            continue
        value = nest_dotted_keys(value, f"{where}.{key}", notes) if isinstance(value, dict) else value
        before = into.get(last)
        if isinstance(before, dict) and isinstance(value, dict):
            _merge(before, value, f"{where}.{key}", notes)
        elif last in into:
            notes.add(f"{where}.{key}", "is given twice")
        else:
            into[last] = value
    return result


def _merge(into: dict[str, Any], more: dict[str, Any], where: str, notes: ProfileMistakes) -> None:
    for key, value in more.items():
        before = into.get(key)
        if isinstance(before, dict) and isinstance(value, dict):
            _merge(before, value, f"{where}.{key}", notes)
        elif key in into:
            notes.add(f"{where}.{key}", "is given twice")
        else:
            into[key] = value
