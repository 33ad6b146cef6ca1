"""The texts of a carrier that contain an action's parameters: `{message}`, `{frame|@frame}`, `{duration:s}`
(docs/reference/robots.md, "What fills a field")."""

from __future__ import annotations

import math
import re
from typing import TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.model import Parameter

SPECIAL_NAMES = ("node", "goal", "frame", "parameters", "now")
"""The names for `{@...}`: the full name of the sending node, the goal's name in the session's record
(`<task>/<actionID>`), the robot's frame, all parameters as a JSON object, the time of sending."""
FUNCTIONS = ("yaw",)
"""The functions for `{@...(parameter)}`: the quaternion of a rotation about the vertical axis."""
_STANDING_IN = SPECIAL_NAMES[:3]
"""The specials that can replace a missing parameter: `{frame|@frame}`."""

_TOKEN = re.compile(r"\{\{|\}\}|\{(?P<slot>[^}]*)\}|[{}]|[^{}]+")
"""An escaped brace, a slot, a single brace, or the text between them."""
_SLOT = re.compile(
    r"\s*(?P<special>@)?(?P<name>[^\W\d]\w*)(?:\.(?P<key>[^\W\d]\w*))?\s*(?::\s*(?P<unit>[a-z%]+)\s*)?"
    r"(?:\|(?P<fallback>.*))?\Z",
    re.DOTALL,
)
_CALL = re.compile(r"\s*@(?P<function>\w+)\s*\((?P<inside>.*)\)\s*\Z", re.DOTALL)

_SIZES = {
    "time": {"ns": 1.0, "us": 1e3, "ms": 1e6, "s": 1e9},
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "length": {"mm": 1.0, "cm": 10.0, "m": 1000.0},
    "part": {"%": 1.0, "": 100.0},
}
"""Convertible units by quantity; the smallest is 1. A number without a unit is a fraction of one, so 0.8 is 80 %."""


class Placeholder(Struct, frozen=True):
    """The place of a parameter, or of a special: a text that the session knows (`@frame`, `@goal`, ...)."""

    name: str
    special: bool = False
    unit: str | None = None
    """The unit of the field."""
    fallback: str | None = None
    """The value without the author's value: in the author's form, or `@` and a special."""
    key: str = ""
    """The key of the parameter's place whose value is inserted."""
    function: str = ""
    """The function that is applied to the value (FUNCTIONS); empty: none."""


TemplatePiece: TypeAlias = str | Placeholder


def parse_template(text: str) -> tuple[TemplatePiece, ...]:
    """Split a text into pieces; `{{` and `}}` are braces. Raises ValueError with a sentence."""
    pieces: list[TemplatePiece] = []
    for token in _TOKEN.finditer(text):
        words = token[0]
        if token["slot"] is not None:
            pieces.append(_parse_slot(token["slot"]))
            continue
        if words in ("{", "}"):
            other = "}" if words == "{" else "{"
            raise ValueError(f"has a `{words}` without its `{other}`; write `{words * 2}` for the character itself")
        literal = words[0] if words in ("{{", "}}") else words
        if pieces and isinstance(before := pieces[-1], str):
            pieces[-1] = before + literal
        else:
            pieces.append(literal)
    return tuple(pieces) or ("",)


def _parse_slot(inside: str) -> Placeholder:
    call = _CALL.match(inside)
    if call is not None:
        function = call["function"]
        if function not in FUNCTIONS:
            raise ValueError(f"has `@{function}(...)`, which does not exist{did_you_mean(function, FUNCTIONS)}")
        slot = _parse_slot(call["inside"])
        if slot.special or slot.unit is not None:
            raise ValueError(
                f"has `{{{inside}}}`; write {{@{function}(parameter)}} or {{@{function}(place.{function})}}"
            )
        return replace(slot, function=function)
    found = _SLOT.match(inside)
    if found is None:
        raise ValueError(
            f"has `{{{inside}}}`, which names no parameter; write {{name}}, {{name|fallback}} or {{@node}}"
        )
    slot = Placeholder(
        found["name"], found["special"] is not None, found["unit"], found["fallback"], found["key"] or ""
    )
    if slot.special and slot.name in FUNCTIONS:
        raise ValueError(f"has `@{slot.name}` without what it is of; write {{@{slot.name}(parameter)}}")
    for special, known in (
        (slot.name if slot.special else None, SPECIAL_NAMES),
        (special_fallback(slot), _STANDING_IN),
    ):
        if special is not None and special not in known:
            raise ValueError(f"has `@{special}`, which is not allowed there{did_you_mean(special, known)}")
    if slot.special and (slot.unit is not None or slot.fallback is not None or slot.key):
        raise ValueError(f"has `{{{inside}}}`; `@{slot.name}` has a value always, and no unit")
    return slot


def special_fallback(slot: Placeholder) -> str | None:
    """The special that replaces a missing value."""
    fallback = (slot.fallback or "").strip()
    return fallback[1:] if fallback.startswith("@") else None


def unit_factors(parameter: Parameter, unit: str) -> tuple[float, float]:
    """Return a factor and a divisor, one of which is 1, from the parameter's unit to `unit`. Raises ValueError."""
    if parameter.type not in ("number", "integer"):
        raise ValueError(f"wants `{parameter.name}` in `{unit}`, and it is not a number")
    for sizes in _SIZES.values():
        if parameter.unit in sizes and unit in sizes:
            have, want = sizes[parameter.unit], sizes[unit]
            return (have / want, 1.0) if have >= want else (1.0, want / have)
    known = [each for sizes in _SIZES.values() for each in sizes if each]
    if unit not in known:
        raise ValueError(f"wants `{parameter.name}` in `{unit}`, which is not a known unit{did_you_mean(unit, known)}")
    declared = f"is declared in `{parameter.unit}`" if parameter.unit else "is declared without a unit"
    raise ValueError(f"wants `{parameter.name}` in `{unit}`, but it {declared}")


def seconds_per_unit(parameter: Parameter) -> float | None:
    """The seconds in one unit of the parameter; None: it is no time."""
    size = _SIZES["time"].get(parameter.unit) if parameter.type in ("number", "integer") else None
    return None if size is None else size / 1e9
