"""Values of action parameters: from the author's text to what a robot gets (docs/reference/cra.md)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from rise_engine.scenario.model import ActionSpec, Call, Parameter

_NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\Z", re.ASCII)
_WHOLE = re.compile(r"[-+]?\d{1,300}\Z", re.ASCII)
ANY_NAME = "*"
"""Among the names of a `name` parameter: any other name is accepted too."""


def convert(parameter: Parameter, value: Any) -> Any:
    """The value that a robot gets: of the declared type, within the range, a known name.

    `value` is the author's text or a memory value. A number stays an integer when it is written as one; a `name` stays
    a number when its code was written. Raises ValueError with a sentence that begins with the parameter's name.
    """
    match parameter.type:
        case "text":
            from rise_engine.scenario.template import as_text

            return as_text(value)
        case "number":
            return _in_range(parameter, _number(parameter, value))
        case "integer":
            number = _number(parameter, value)
            if isinstance(number, float):
                if not number.is_integer():
                    raise ValueError(f"{parameter.name} is a whole number; `{value}` is not")
                number = int(number)
            return _in_range(parameter, number)
        case "boolean":
            return _boolean(parameter, value)
        case "name":
            return _name(parameter, value)


def call_parameters(call: Call, spec: ActionSpec, memory: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of an action that starts now: memory filled in, converted, those left out absent.

    Raises MissingValue for a memory key without value or fallback, ValueError for a value that the action cannot take.
    """
    result: dict[str, Any] = {}
    for name, template in call.parameters.items():
        parameter = spec.parameters[name]
        if parameter.type == "text":
            result[name] = template.fill(memory)
        else:
            result[name] = convert(parameter, template.fill_value(memory))
    return result


def known_names(parameter: Parameter) -> list[str]:
    """All names that a `name` parameter lists, those with codes first."""
    return [*parameter.codes, *(name for name in parameter.names if name != ANY_NAME)]


def accepts_any_name(parameter: Parameter) -> bool:
    return ANY_NAME in parameter.names or not (parameter.codes or parameter.names)


def _number(parameter: Parameter, value: Any) -> int | float:
    if isinstance(value, str):
        text = value.strip()
        if _WHOLE.match(text):
            return int(text)
        if _NUMBER.match(text):
            value = float(text)
        elif re.fullmatch(r"[-+]?\d+,\d+", text):
            raise ValueError(f"{parameter.name} is a number; write {text.replace(',', '.')} with a point")
        else:
            raise ValueError(f"{parameter.name} is a number{_unit(parameter)}; `{value}` is not")
    if isinstance(value, bool):
        return int(value)
    if not isinstance(value, int | float):
        raise ValueError(f"{parameter.name} is a number{_unit(parameter)}; {_kind(value)} is not")
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{parameter.name} is a number{_unit(parameter)}; `{value}` cannot be sent to a robot")
    return value


def _in_range(parameter: Parameter, number: int | float) -> int | float:
    low, high = parameter.minimum, parameter.maximum
    if (low is not None and number < low) or (high is not None and number > high):
        if low is not None and high is not None:
            allowed = f"from {low:g} to {high:g}"
        else:
            allowed = f"at least {low:g}" if low is not None else f"at most {high:g}"
        raise ValueError(f"{parameter.name} is {allowed}{_unit(parameter)}; {number} is outside")
    return number


def _boolean(parameter: Parameter, value: Any) -> bool:
    if isinstance(value, bool):
        return value
    if isinstance(value, str) and value.strip() in ("true", "false"):
        return value.strip() == "true"
    if isinstance(value, int | float) and value in (0, 1):
        return bool(value)
    raise ValueError(f"{parameter.name} is true or false; `{value}` is neither")


def _name(parameter: Parameter, value: Any) -> str | int:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, str) and _WHOLE.match(value.strip()):
        value = int(value)
    if isinstance(value, int) and not isinstance(value, bool):
        if value in parameter.codes.values():
            return value
        if not parameter.codes and accepts_any_name(parameter):
            return value
        codes = ", ".join(f"{code} {name}" for name, code in parameter.codes.items())
        raise ValueError(f"{parameter.name} has no number {value}" + (f"; known: {codes}" if codes else ""))
    if not isinstance(value, str):
        raise ValueError(f"{parameter.name} is a name; {_kind(value)} is not")
    name = value.strip()
    if name in parameter.codes or name in parameter.names or accepts_any_name(parameter):
        return name
    from rise_engine.scenario.findings import suggestion

    raise ValueError(f"{parameter.name} has no name `{name}`{suggestion(name, known_names(parameter), limit=20)}")


def _unit(parameter: Parameter) -> str:
    return f" ({parameter.unit})" if parameter.unit else ""


def _kind(value: Any) -> str:
    if value is None:
        return "null"
    return {bool: "true or false", list: "an array", dict: "an object", str: "a text"}.get(type(value), f"`{value}`")
