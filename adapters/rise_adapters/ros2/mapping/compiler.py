"""Compiles a profile's tables for message fields into sources that fill them, and finds all errors together.

If the message's type is known, each field's value is checked against it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from msgspec.structs import replace

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
    fit_literal,
)
from rise_adapters.ros2.mapping.field_types import (
    DURATION,
    FieldTypes,
    MessageFieldType,
    describe_field_type,
    describe_value,
)
from rise_adapters.ros2.mapping.poses import (
    YawSource,
    check_quaternion,
    compile_now,
    compile_place_value,
    pose_fields,
)
from rise_adapters.ros2.mapping.templates import (
    Placeholder,
    parse_template,
    seconds_per_unit,
    special_fallback,
    unit_factors,
)
from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.ports.bridge import ProfileFinding, ProfileFindingKind
from rise_engine.scenario.model import ActionSpec, Parameter
from rise_engine.scenario.parameters import accepts_any_name, convert_parameter, listed_names


class ProfileMistakes:
    """Collects diagnostics about a profile, as sentences that begin with the place."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._found: dict[ProfileFinding, None] = {}
        self.place_keys: set[str] = set()
        """The keys of places that are used by some field."""

    @property
    def found(self) -> list[ProfileFinding]:
        """All diagnostics, each once."""
        return list(self._found)

    @property
    def refusals(self) -> list[ProfileFinding]:
        """The diagnostics that prevent a session with this robot."""
        return [each for each in self._found if each.refuses]

    def add(self, where: str, sentence: str, kind: ProfileFindingKind = "wrong") -> None:
        self._found[ProfileFinding(f"robot {self._robot}: `{where}` {sentence}", where, kind)] = None

    def add_unknown_keys(self, where: str, table: Mapping[str, Any], known: Collection[str]) -> None:
        for key in table:
            if key not in known:
                self.add(f"{where}.{key}", f"does not exist{did_you_mean(key, known)}")


class MessageCompiler:
    """Prepares the messages of one action."""

    def __init__(
        self,
        spec: ActionSpec,
        values: Mapping[str, Mapping[str, Any]],
        types: FieldTypes,
        mistakes: ProfileMistakes,
        places: Mapping[str, Mapping[str, Any]],
    ) -> None:
        self._spec = spec
        self._places = places
        self._values = values
        self._types = types
        self._mistakes = mistakes
        self.used_parameters: set[str] = set()
        """Parameters that are used by some field."""

    def compile(self, table: Mapping[str, Any], type: str, where: str) -> MessageSource:
        """Compile a message from a table of its fields; an empty `type` means any type."""
        return self._compile_message(
            nest_dotted_keys(table, where, self._mistakes), MessageFieldType(type) if type else None, where
        )

    def _compile_message(self, table: Mapping[str, Any], type: MessageFieldType | None, where: str) -> MessageSource:
        fields = self._types.fields_of(type.base) if type is not None else None
        if type is not None and fields is None and (missing := self._types.why_unknown(type.base)):
            self._mistakes.add(where, f"cannot be checked: {missing}", "missing")
        sources: dict[str, FieldSource] = {}
        for name, value in table.items():
            at = f"{where}.{name}"
            if fields is not None and name not in fields:
                assert type is not None
                self._mistakes.add(at, f"is not a field of {type.base}{did_you_mean(name, fields)}")
            elif (source := self._compile_field(value, fields[name] if fields is not None else None, at)) is not None:
                sources[name] = source
        return MessageSource(sources)

    def _compile_field(self, value: Any, type: MessageFieldType | None, where: str) -> FieldSource | None:
        try:
            if isinstance(value, dict):
                if type is not None and (type.is_list or type.kind != "message"):
                    raise ValueError(f"takes {describe_field_type(type)}, and not a table of fields")
                return self._compile_message(value, type, where)
            if isinstance(value, list):
                return self._compile_list(value, type, where)
            if type is not None and type.is_list:
                raise ValueError(f"takes {describe_field_type(type)}, and {describe_value(value)} is not")
            if isinstance(value, str):
                return self._compile_text(value, type, where)
            if type is None and not isinstance(value, bool | int | float):
                raise ValueError(
                    f"cannot be {describe_value(value)}; write a text, a number, true, false, a list or a table"
                )
            return FixedSource(fit_literal(value, type))
        except ValueError as error:
            self._mistakes.add(where, f"{error}{self._advise_fields(type)}")
        return None

    def _compile_list(self, values: list[Any], type: MessageFieldType | None, where: str) -> FieldSource | None:
        if type is not None and not type.is_list:
            raise ValueError(f"takes {describe_field_type(type)}, and not a list")
        if type is not None and (
            (type.container == "array" and len(values) != type.count)
            or (type.container == "bounded" and len(values) > type.count)
        ):
            raise ValueError(f"takes {describe_field_type(type)}, and here are {len(values)}")
        item = type.item if type is not None else None
        compiled = [self._compile_field(value, item, f"{where}.{number}") for number, value in enumerate(values)]
        sources = tuple(source for source in compiled if source is not None)
        zero = type.zero if type is not None and type.container == "array" else NO_VALUE
        return ListSource(sources, zero, type is not None and type.travels_as_bytes)

    def _compile_text(self, text: str, type: MessageFieldType | None, where: str) -> FieldSource:
        pieces = parse_template(text)
        if len(pieces) == 1 and isinstance(pieces[0], Placeholder):
            return self._compile_slot(pieces[0], type, where)
        if len(pieces) == 1:
            return FixedSource(fit_literal(pieces[0], type))
        if type is not None and type.kind != "text":
            raise ValueError(
                f"takes {describe_field_type(type)}; only a single {{parameter}} can fill it, with nothing around it"
            )
        sources = [
            FixedSource(piece) if isinstance(piece, str) else self._compile_slot(piece, None, where, in_text=True)
            for piece in pieces
        ]
        return JoinedTextSource(where, tuple(sources), type)

    def _compile_slot(
        self, slot: Placeholder, type: MessageFieldType | None, where: str, *, in_text: bool = False
    ) -> FieldSource:
        if slot.special:
            if slot.name == "now":
                return compile_now(type, in_text=in_text)
            if type is not None and type.kind != "text":
                raise ValueError(f"takes {describe_field_type(type)}, and @{slot.name} is a text")
            if slot.name == "parameters":
                self.used_parameters.update(self._spec.parameters)
                conversions = tuple(map(self._make_conversion, self._spec.parameters.values()))
                return AllParametersSource(where, conversions, type)
            return SpecialSource(where, slot.name, type)
        return self._compile_parameter(slot, type, where, in_text=in_text)

    def _compile_parameter(
        self, slot: Placeholder, type: MessageFieldType | None, where: str, *, in_text: bool
    ) -> FieldSource:
        parameter = self._spec.parameters.get(slot.name)
        if parameter is None:
            if not self._spec.parameters:
                raise ValueError(f"has `{{{slot.name}}}`, and there are no parameters here")
            known = did_you_mean(slot.name, self._spec.parameters)
            raise ValueError(f"has `{{{slot.name}}}`, which is not a parameter of {self._spec.name}{known}")
        self.used_parameters.add(parameter.name)
        if slot.function:
            check_quaternion(type, in_text=in_text)
            flat = "0" if slot.key and slot.fallback is None else slot.fallback  # a place without an angle: no rotation
            inside = replace(slot, function="", unit=None if slot.key else "rad", fallback=flat)
            return YawSource(where, self._compile_parameter(inside, MessageFieldType("float64"), where, in_text=False))
        if slot.key:
            self._mistakes.place_keys.add(slot.key)
            return compile_place_value(slot, parameter, self._places, type, where)
        if parameter.place and type is not None and not type.is_list and (pose := pose_fields(type.base, slot.name)):
            return self._compile_message(pose, type, where)
        factor, divisor = unit_factors(parameter, slot.unit) if slot.unit is not None else (1.0, 1.0)
        conversion = self._make_conversion(parameter, type, factor, divisor)
        if type is not None:
            _check_can_fill(conversion, type)
        special = special_fallback(slot)
        if special is not None and type is not None and type.kind != "text":
            raise ValueError(f"takes {describe_field_type(type)}, and @{special} is a text")
        absent = self._value_when_absent(slot, conversion, in_text=in_text)
        return ParameterSource(where, conversion, absent, special)

    def _make_conversion(
        self, parameter: Parameter, type: MessageFieldType | None = None, factor: float = 1.0, divisor: float = 1.0
    ) -> ParameterConversion:
        if type is not None and type.base == DURATION:
            factor, divisor = 1.0, 1.0  # a time in any unit
        return ParameterConversion(parameter, dict(self._values.get(parameter.name, {})), type, factor, divisor)

    def _value_when_absent(self, slot: Placeholder, conversion: ParameterConversion, *, in_text: bool) -> Any:
        """The field's value without the author's value."""
        parameter, type = conversion.parameter, conversion.type
        what, written = ("fallback", slot.fallback) if slot.fallback is not None else ("default", parameter.default)
        if special_fallback(slot) is not None or written is None:
            return NO_VALUE
        try:
            value = convert_parameter(parameter, written)
        except ValueError as error:
            if what == "default":
                raise ValueError(f"cannot take the default: {error}") from None
            if parameter.type != "name" or not (in_text or type is None or type.kind == "text"):
                raise ValueError(f"has a fallback that cannot be: {error}") from None
            value = written  # the robot's own word
        try:
            return conversion.to_field_value(value)
        except ValueError as error:
            raise ValueError(f"{error} (the {what} of `{parameter.name}`)") from None

    def _advise_fields(self, type: MessageFieldType | None) -> str:
        """The end of a sentence about a field that is itself a message."""
        if type is None or type.is_list or type.kind != "message" or type.base == DURATION:
            return ""
        fields = self._types.fields_of(type.base)
        return f"; give its fields: {in_backquotes(fields)}" if fields else ""


def _check_can_fill(conversion: ParameterConversion, type: MessageFieldType) -> None:
    """Raise ValueError if the parameter can never fill the field, or cannot with some of its names."""
    parameter = conversion.parameter
    if type.base == DURATION:
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
        conversion.to_field_value(name)


def nest_dotted_keys(table: Mapping[str, Any], where: str, mistakes: ProfileMistakes) -> dict[str, Any]:
    """Return a table of fields, with all dotted keys as nested tables."""
    result: dict[str, Any] = {}
    _nest_into(result, table, where, mistakes)
    return result


def _nest_into(result: dict[str, Any], table: Mapping[str, Any], where: str, mistakes: ProfileMistakes) -> None:
    for key, value in table.items():
        *parents, last = key.split(".")
        inside: Any = result
        for parent in parents:
            inside = inside.setdefault(parent, {}) if isinstance(inside, dict) else None
        if not isinstance(inside, dict):
            mistakes.add(f"{where}.{key}", "is given twice, once as a whole")
        elif isinstance(value, dict) and isinstance(inside.setdefault(last, {}), dict):
            _nest_into(inside[last], value, f"{where}.{key}", mistakes)
        elif last in inside:
            mistakes.add(f"{where}.{key}", "is given twice")
        else:
            inside[last] = value
