"""Converts values of action parameters from the author's text to the robot's value (docs/reference/cra.md)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from rise_engine.base.errors import RiseError
from rise_engine.base.json_codec import is_64_bit
from rise_engine.base.nearest_name import Correction, suggest
from rise_engine.scenario.durations import MAX_SECONDS
from rise_engine.scenario.model import ActionCall, ActionSpec, Parameter
from rise_engine.scenario.speech.template import Template, spoken_text

SPEECH_CHANNEL = "speech"
"""Actions on this channel speak."""
MESSAGE = "message"
"""The parameter with the spoken text."""
LANGUAGE = "language"
"""The parameter with its language."""


def says_message(spec: ActionSpec) -> bool:
    """Whether an action speaks its `message`, so that the lexicon and SSML apply to it."""
    message = spec.parameters.get(MESSAGE)
    return message is not None and message.type == "text" and SPEECH_CHANNEL in spec.channels


def spoken_parameters(spec: ActionSpec) -> tuple[str, ...]:
    """The parameters with texts to translate: those declared `spoken`, and a spoken `message`."""
    return tuple(
        name
        for name, parameter in spec.parameters.items()
        if parameter.spoken or (name == MESSAGE and says_message(spec))
    )


_NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?\Z", re.ASCII)
_WHOLE = re.compile(r"[-+]?\d{1,300}\Z", re.ASCII)
_KEY = re.compile(r"[^\W\d][\w.]*\Z")
_NO_PART = re.compile(r"[^-+0-9.eE\s]|\d\s+\d")
"""Characters that no text around a memory value can contain if the whole is a number."""
_LONGEST = {"ms": 1000 * MAX_SECONDS, "s": MAX_SECONDS}
"""The maximum of a parameter that is a time, by unit: 24 hours."""
ANY_NAME = "*"
"""In the names of a `name` parameter: any other name is accepted, too."""


class ParameterError(RiseError, ValueError):
    """A value is invalid for an action's parameter: a sentence that begins with the parameter's name."""

    code = "wrong-type"
    """Or `out-of-range`: a number outside the parameter's limits."""

    def __init__(self, message: str, suggestion: Correction | None = None) -> None:
        """`suggestion`: the intended value; its words are added to the message."""
        super().__init__(message + (suggestion.words if suggestion else ""))
        self.suggestion = suggestion and replace(suggestion, words="")


def convert_parameter(parameter: Parameter, value: Any, origin: str = "") -> Any:
    """The value for the robot: of the declared type, within the range, or a known name.

    Arguments:
        parameter: its declaration. `parameter.unit` is the unit of the given and of the returned number.
        value: the author's text, or a memory value of any JSON type.
        origin: the end of the message, with the source of the value.

    Returns a str, int, float or bool. Integers stay integers; a `name` that is given as its code stays a number. Raises
    only ParameterError, for any value.

    >>> convert_parameter(Parameter("duration", "integer", unit="ms", maximum=5000), "1500")
    1500
    >>> convert_parameter(Parameter("duration", "integer", unit="ms", maximum=5000), "6000")
    Traceback (most recent call last):
    ...
    rise_engine.scenario.parameters.ParameterError: duration is at most 5000 (ms); 6000 is outside
    """
    try:
        match parameter.type:
            case "text":
                return spoken_text(value)
            case "number":
                return _check_range(parameter, _convert_to_number(parameter, value, origin), origin)
            case "integer":
                number = _convert_to_number(parameter, value, origin)
                if isinstance(number, float):
                    if not number.is_integer():
                        raise ParameterError(f"{parameter.name} is a whole number; {_show(value)}{origin} is not")
                    number = _check_64_bit(parameter, int(number), origin)
                return _check_range(parameter, number, origin)
            case "boolean":
                return _convert_to_boolean(parameter, value, origin)
            case "name":
                return _convert_to_name(parameter, value, origin)
    except (OverflowError, RecursionError):  # endlessly nested lists, as a text
        raise ParameterError(f"a value of this size cannot be used for {parameter.name}{origin}") from None


def is_bare_key(parameter: Parameter, text: str) -> bool:
    """Whether a text that is not a valid value of the parameter is a memory key without braces."""
    if parameter.type in ("text", "name") or not _KEY.match(text):
        return False
    try:
        convert_parameter(parameter, text)
    except ParameterError:
        return True
    return False


def fill_parameters(call: ActionCall, spec: ActionSpec, memory: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of an action that starts now: filled from memory, converted, without omitted ones.

    Arguments:
        call: the action as written in its act.
        spec: its declaration (`scenario.robot.actions[call.type]`), with the unit of each parameter.
        memory: the current values, by key.

    Returns the values by parameter. For any memory, raises only MissingValueError (a key without value or fallback) and
    ParameterError (an invalid value, with its memory keys).

    >>> from rise_engine.scenario.loader import load
    >>> scenario = load("scenarios/greeting").scenario
    >>> call = scenario.acts["R_FollowGaze"].actions[0].calls[0]
    >>> fill_parameters(call, scenario.robot.actions["LookAt"], {"person_x": 1.2, "person_y": 0, "person_z": 0.4})
    {'pointx': 1.2, 'pointy': 0, 'pointz': 0.4, 'duration': 500}
    """
    result: dict[str, Any] = {}
    for name, template in call.parameters.items():
        parameter = spec.parameters[name]
        try:
            if parameter.type == "text":
                result[name] = template.fill(memory)
            else:
                result[name] = convert_parameter(parameter, template.fill_value(memory), _describe_origin(template))
        except (OverflowError, RecursionError):
            raise ParameterError(
                f"a value of this size cannot be used for {name}{_describe_origin(template)}"
            ) from None
    return result


def check_template(parameter: Parameter, template: Template) -> None:
    """Raise ParameterError if no memory value can make a template with slots a valid value of the parameter."""
    if parameter.type == "text":
        return
    slots = template.slots
    if any(slot.before or slot.after for slot in slots):
        raise ParameterError(
            f"{parameter.name} is not a text, and a separator as in `{template.text}` is only for texts"
        )
    if all(slot.fallback is not None for slot in slots):
        convert_parameter(parameter, template.fill({}), " (without a memory value)")
    if len(template.parts) == 1 or (parameter.type == "name" and accepts_any_name(parameter)):
        return
    if parameter.type in ("number", "integer"):
        for part in template.parts:
            if isinstance(part, str) and _NO_PART.search(part):
                raise ParameterError(
                    f"{parameter.name} is a number{_unit(parameter)}; `{template.text}` can never be one"
                )
        return
    known = ["true", "false"]
    if parameter.type == "name":
        known = [*listed_names(parameter), *map(str, parameter.codes.values())]
    if not any(_could_spell(template, name) for name in known):
        what = "true or false" if parameter.type == "boolean" else "a name"
        raise ParameterError(f"{parameter.name} is {what}; `{template.text}` can never be a valid one")


def _could_spell(template: Template, name: str) -> bool:
    """Whether some memory values could make a template this name: its literal parts occur in the name in order."""
    parts = template.parts
    first, last = parts[0] if isinstance(parts[0], str) else "", parts[-1] if isinstance(parts[-1], str) else ""
    first, last = first.lstrip(), last.rstrip()
    if len(name) < len(first) + len(last) or not name.startswith(first) or not name.endswith(last):
        return False
    at, end = len(first), len(name) - len(last)
    for part in parts[1:-1]:
        if isinstance(part, str):
            found = name.find(part, at, end)
            if found < 0:
                return False
            at = found + len(part)
    return True


def listed_names(parameter: Parameter) -> list[str]:
    """All names that a `name` parameter lists, those with codes first."""
    return [*parameter.codes, *(name for name in parameter.names if name != ANY_NAME)]


def accepts_any_name(parameter: Parameter) -> bool:
    return ANY_NAME in parameter.names or not (parameter.codes or parameter.names)


def _convert_to_number(parameter: Parameter, value: Any, origin: str) -> int | float:
    if isinstance(value, str):
        text = value.strip()
        if _WHOLE.match(text):
            value = int(text)
        elif _NUMBER.match(text):
            value = float(text)
        elif re.fullmatch(r"[-+]?\d+,\d+", text):
            point = _show(text.replace(",", ".")).strip("`")
            raise ParameterError(f"{parameter.name} is a number; write {point} with a point{origin}")
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ParameterError(f"{parameter.name} is a number{_unit(parameter)}; {_show(value)}{origin} is not")
    if isinstance(value, int):
        return _check_64_bit(parameter, value, origin)
    if not math.isfinite(value):
        raise ParameterError(
            f"{parameter.name} is a number{_unit(parameter)}; `{value}`{origin} cannot be sent to a robot"
        )
    return value


def _check_64_bit(parameter: Parameter, value: int, origin: str) -> int:
    if is_64_bit(value):
        return value
    raise ParameterError(
        f"{parameter.name} is a number{_unit(parameter)}; a whole number of more than 64 bits{origin} cannot be sent "
        "to a robot"
    )


def _check_range(parameter: Parameter, number: int | float, origin: str) -> int | float:
    low, high = parameter.minimum, parameter.maximum
    longest = _LONGEST.get(parameter.unit)
    if longest is not None and (high is None or high > longest):
        high = longest
    if (low is not None and number < low) or (high is not None and number > high):
        if low is not None and high is not None:
            allowed = f"from {low:.15g} to {high:.15g}"
        else:
            allowed = f"at least {low:.15g}" if low is not None else f"at most {high:.15g}"
        error = ParameterError(f"{parameter.name} is {allowed}{_unit(parameter)}; {number}{origin} is outside")
        error.code = "out-of-range"
        raise error
    return number


def _convert_to_boolean(parameter: Parameter, value: Any, origin: str) -> bool:
    if isinstance(value, bool):
        return value
    if isinstance(value, str) and value.strip() in ("true", "false"):
        return value.strip() == "true"
    if isinstance(value, int | float) and value in (0, 1):
        return bool(value)
    raise ParameterError(f"{parameter.name} is true or false; {_show(value)}{origin} is neither")


def _convert_to_name(parameter: Parameter, value: Any, origin: str) -> str | int:
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if isinstance(value, str) and _WHOLE.match(value.strip()):
        value = int(value)
    if isinstance(value, int) and not isinstance(value, bool):
        if value in parameter.codes.values():
            return value
        if not parameter.codes and accepts_any_name(parameter):
            return _check_64_bit(parameter, value, origin)
        codes = ", ".join(f"{code} {name}" for name, code in parameter.codes.items())
        number = value if is_64_bit(value) else "of that size"
        raise ParameterError(
            f"{parameter.name} has no number {number}{origin}" + (f"; known: {codes}" if codes else "")
        )
    if not isinstance(value, str):
        raise ParameterError(f"{parameter.name} is a name; {_show(value)}{origin} is not")
    name = value.strip()
    if name in parameter.codes or name in parameter.names or (accepts_any_name(parameter) and name):
        return name
    near = suggest(name[:80], listed_names(parameter), limit=20)
    raise ParameterError(f"{parameter.name} has no name {_show(name)}{origin}", near)


def _describe_origin(template: Template) -> str:
    """The memory keys that a template reads, as a part of an error message."""
    keys = list(dict.fromkeys(slot.key for slot in template.slots))
    if not keys:
        return ""
    return f" (memory key{'s' if len(keys) > 1 else ''} {', '.join(f'`{key}`' for key in keys)})"


def _unit(parameter: Parameter) -> str:
    return f" ({parameter.unit})" if parameter.unit else ""


def _show(value: Any) -> str:
    """A value in a message, always short."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, str):
        return f"`{value}`" if len(value) <= 60 else f"`{value[:59]}…`"
    if isinstance(value, int) and not is_64_bit(value):
        return "a whole number of more than 64 bits"
    if isinstance(value, int | float):
        return f"`{value}`"
    return "an array" if isinstance(value, list) else "an object"
