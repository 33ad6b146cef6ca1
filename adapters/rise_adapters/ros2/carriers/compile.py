"""From what a profile says about the fields of a message to what fills them: every mistake found, all at once.

Where the type of the message is known, so is what each of its fields takes; otherwise everything else is checked.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rise_adapters.ros2.carriers.fields import DURATION, FieldType, Types, shown, what_it_takes
from rise_adapters.ros2.carriers.fill import (
    NOTHING,
    Constant,
    Conversion,
    FromParameter,
    FromSpecial,
    Group,
    Joined,
    Maker,
    Parameters,
    Row,
    literal,
)
from rise_adapters.ros2.carriers.texts import Slot, conversion, parse_text, seconds, special_fallback
from rise_engine.nearest_name import listed, suggestion
from rise_engine.scenario.model import ActionSpec, Parameter
from rise_engine.scenario.parameters import accepts_any_name, convert, known_names


class Notes:
    """Collects what is wrong, as sentences that begin with the place."""

    def __init__(self) -> None:
        self.sentences: list[str] = []

    def add(self, where: str, sentence: str) -> None:
        self.sentences.append(f"`{where}` {sentence}")


class Compiler:
    """Prepares the messages of one action."""

    def __init__(self, spec: ActionSpec, values: Mapping[str, Mapping[str, Any]], types: Types, notes: Notes) -> None:
        self._spec = spec
        self._values = values
        self._types = types
        self._notes = notes
        self.used: set[str] = set()
        """Parameters that some field takes."""

    def message(self, table: Mapping[str, Any], type: str, where: str) -> Group:
        """A message out of a table of its fields; of any type when `type` is empty."""
        return self._message(nested(table, where, self._notes), FieldType(type) if type else None, where)

    def _message(self, table: Mapping[str, Any], type: FieldType | None, where: str) -> Group:
        fields = self._types.of(type.name) if type is not None else None
        if type is not None and fields is None and (missing := self._types.missing(type.name)):
            self._notes.add(where, f"cannot be checked: {missing}")
        makers: dict[str, Maker] = {}
        for name, value in table.items():
            at = f"{where}.{name}"
            if fields is not None and name not in fields:
                assert type is not None
                self._notes.add(at, f"is no field of {type.name}{suggestion(name, fields)}")
            elif (maker := self._source(value, fields[name] if fields is not None else None, at)) is not None:
                makers[name] = maker
        return Group(makers)

    def _source(self, value: Any, type: FieldType | None, where: str) -> Maker | None:
        try:
            if isinstance(value, dict):
                if type is not None and (type.many or type.kind != "message"):
                    raise ValueError(f"takes {what_it_takes(type)}, and not a table of fields")
                return self._message(value, type, where)
            if isinstance(value, list):
                return self._list(value, type, where)
            if type is not None and type.many:
                raise ValueError(f"takes {what_it_takes(type)}, and {shown(value)} is not")
            if isinstance(value, str):
                return self._text(value, type, where)
            if type is None and not isinstance(value, bool | int | float):
                raise ValueError(f"cannot be {shown(value)}; write a text, a number, true, false, a list or a table")
            return Constant(literal(value, type))
        except ValueError as error:
            self._notes.add(where, f"{error}{self._fields_of(type)}")
        return None

    def _list(self, values: list[Any], type: FieldType | None, where: str) -> Maker | None:
        if type is not None and not type.many:
            raise ValueError(f"takes {what_it_takes(type)}, and not a list")
        if type is not None and not type.least <= len(values) <= (type.most if type.most is not None else len(values)):
            raise ValueError(f"takes {what_it_takes(type)}, and here are {len(values)}")
        item = type.item if type is not None else None
        made = [self._source(value, item, f"{where}.{number}") for number, value in enumerate(values)]
        makers = tuple(maker for maker in made if maker is not None)
        zero = type.zero if type is not None and type.least else NOTHING
        return Row(makers, zero, type is not None and type.as_bytes)

    def _text(self, text: str, type: FieldType | None, where: str) -> Maker:
        pieces = parse_text(text)
        if len(pieces) == 1 and isinstance(pieces[0], Slot):
            return self._slot(pieces[0], type, where)
        if len(pieces) == 1:
            return Constant(literal(pieces[0], type))
        if type is not None and type.kind != "text":
            raise ValueError(
                f"takes {what_it_takes(type)}; only a single {{parameter}} can fill it, with nothing around it"
            )
        made = [
            Constant(piece) if isinstance(piece, str) else self._slot(piece, None, where, in_text=True)
            for piece in pieces
        ]
        return Joined(where, tuple(made), type)

    def _slot(self, slot: Slot, type: FieldType | None, where: str, *, in_text: bool = False) -> Maker:
        if slot.special:
            if type is not None and type.kind != "text":
                raise ValueError(f"takes {what_it_takes(type)}, and @{slot.name} is a text")
            if slot.name == "parameters":
                self.used.update(self._spec.parameters)
                return Parameters(where, tuple(map(self._conversion, self._spec.parameters.values())), type)
            return FromSpecial(where, slot.name, type)
        parameter = self._spec.parameters.get(slot.name)
        if parameter is None:
            if not self._spec.parameters:
                raise ValueError(f"has `{{{slot.name}}}`, and there are no parameters here")
            known = suggestion(slot.name, self._spec.parameters)
            raise ValueError(f"has `{{{slot.name}}}`, which is no parameter of {self._spec.name}{known}")
        self.used.add(parameter.name)
        factor, divisor = conversion(parameter, slot.unit) if slot.unit is not None else (1.0, 1.0)
        made = self._conversion(parameter, type, factor, divisor)
        if type is not None:
            _check_possible(made, type)
        special = special_fallback(slot)
        if special is not None and type is not None and type.kind != "text":
            raise ValueError(f"takes {what_it_takes(type)}, and @{special} is a text")
        return FromParameter(where, made, self._value_when_absent(slot, made, in_text=in_text), special)

    def _conversion(
        self, parameter: Parameter, type: FieldType | None = None, factor: float = 1.0, divisor: float = 1.0
    ) -> Conversion:
        if type is not None and type.name == DURATION:
            factor, divisor = 1.0, 1.0  # it is a time in any unit
        return Conversion(parameter, dict(self._values.get(parameter.name, {})), type, factor, divisor)

    def _value_when_absent(self, slot: Slot, made: Conversion, *, in_text: bool) -> Any:
        """What the field gets when the author gives nothing."""
        parameter = made.parameter
        if special_fallback(slot) is not None:
            return NOTHING
        if slot.fallback is not None:
            try:
                value = convert(parameter, slot.fallback)
            except ValueError as error:
                if parameter.type != "name" or not (in_text or made.type is None or made.type.kind == "text"):
                    raise ValueError(f"has a fallback that cannot be: {error}") from None
                value = slot.fallback  # a word of the robot's
            return self._converted(made, value, "fallback")
        if parameter.default is None:
            return NOTHING
        try:
            value = convert(parameter, parameter.default)
        except ValueError as error:
            raise ValueError(f"cannot take the default: {error}") from None
        return self._converted(made, value, "default")

    def _converted(self, made: Conversion, value: Any, what: str) -> Any:
        try:
            return made.of(value)
        except ValueError as error:
            raise ValueError(f"{error} (the {what} of `{made.parameter.name}`)") from None

    def _fields_of(self, type: FieldType | None) -> str:
        """The end of a message about a field that is a message itself."""
        if type is None or type.many or type.kind != "message" or type.name == DURATION:
            return ""
        fields = self._types.of(type.name)
        return f"; give its fields: {listed(fields)}" if fields else ""


def _check_possible(made: Conversion, type: FieldType) -> None:
    """Raises ValueError when the parameter can never, or not with each of its known names, fill the field."""
    parameter = made.parameter
    if type.name == DURATION:
        if seconds(parameter) is None:
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
        raise ValueError(f"takes {what_it_takes(type)}, and `{parameter.name}` is {what}")
    if parameter.type != "name":
        return
    if type.kind != "text" and accepts_any_name(parameter):
        raise ValueError(
            f"takes {what_it_takes(type)}, and `{parameter.name}` may be any name, also one without a number"
        )
    for name in known_names(parameter):
        made.of(name)


def nested(table: Mapping[str, Any], where: str, notes: Notes) -> dict[str, Any]:
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
        value = nested(value, f"{where}.{key}", notes) if isinstance(value, dict) else value
        before = into.get(last)
        if isinstance(before, dict) and isinstance(value, dict):
            _merge(before, value, f"{where}.{key}", notes)
        elif last in into:
            notes.add(f"{where}.{key}", "is given twice")
        else:
            into[last] = value
    return result


def _merge(into: dict[str, Any], more: dict[str, Any], where: str, notes: Notes) -> None:
    for key, value in more.items():
        before = into.get(key)
        if isinstance(before, dict) and isinstance(value, dict):
            _merge(before, value, f"{where}.{key}", notes)
        elif key in into:
            notes.add(f"{where}.{key}", "is given twice")
        else:
            into[key] = value
