"""Parameters with memory values in them, and how long an action takes (semantics.md 2.3, cra.md)."""

from __future__ import annotations

from typing import Any

from rise_engine.expression import Environment, EvaluationError, MissingPartError, lookup
from rise_engine.scenario.model import ActionCall, ActionSpec
from rise_engine.scenario.parameters import ParameterError, convert_parameter
from rise_engine.scenario.speech.template import MemorySlot, Template, spoken_text


class Unfit(Exception):
    """A parameter that has no value now."""


def read(slot: MemorySlot, memory: dict[str, Any]) -> tuple[bool, Any]:
    """Whether what stands in braces is there, and its value."""
    if slot.part is None:
        return lookup(memory, slot.key)
    try:
        return True, slot.part.compiled_value(Environment(memory))
    except MissingPartError:
        return False, None
    except EvaluationError as error:
        raise Unfit(str(error)) from None


def text_of(template: Template, memory: dict[str, Any]) -> str:
    """The words, with the memory's values in them."""
    words = ""
    for part in template.parts:
        if isinstance(part, str):
            words += part
            continue
        found, value = read(part, memory)
        separated = bool(part.before or part.after)
        if found and value is not None and not (separated and not spoken_text(value).strip()):
            words += part.before + spoken_text(value) + part.after
        elif part.fallback is not None:
            words += part.fallback
        else:
            raise Unfit(f"no value for {part.key}")
    return words


def filled(call: ActionCall, spec: ActionSpec, memory: dict[str, Any]) -> dict[str, Any]:
    """The parameters of an action that starts now."""
    values = {}
    for name, template in call.parameters.items():
        declared = spec.parameters[name]
        value: Any = None
        if declared.type != "text" and len(template.parts) == 1 and isinstance(template.parts[0], MemorySlot):
            value = read(template.parts[0], memory)[1]
        if value is None:
            value = text_of(template, memory)
        try:
            values[name] = value if declared.type == "text" else convert_parameter(declared, value)
        except ParameterError as error:
            raise Unfit(str(error)) from None
    return values


def expected_seconds(spec: ActionSpec, values: dict[str, Any]) -> float:
    """How long an action will probably take."""
    if "message" in values and "duration" not in values:
        return min(max(0.5, 0.3 + len(values["message"]) / (14.0 * values.get("rate", 1))), 86_400)
    times = float(values.get("repetitions", 1))
    if "duration" in values:
        unit = 1.0 if spec.parameters["duration"].unit == "s" else 0.001
        return float(min(values["duration"] * unit * times, 86_400))
    return min(spec.seconds * times, 86_400)


def limit_seconds(spec: ActionSpec, values: dict[str, Any]) -> float:
    """How long it may take."""
    return spec.limit if spec.limit is not None else 3 * expected_seconds(spec, values) + 10
