"""Reading times in rules: `8s`, `{pause}`, `{patience}ms` (semantics.md 5.5)."""

from __future__ import annotations

import re
from functools import partial

from rise_engine.expression import EvaluationError, Expression, ExpressionError
from rise_engine.scenario.durations import MAX_SECONDS, UNITS, parse_time, seconds_from
from rise_engine.scenario.element_reader import ElementReader
from rise_engine.scenario.expression_checks import expression_message, note_expression
from rise_engine.scenario.model import Delay, SourceLocation
from rise_engine.syntax.xml import Element

_COMPUTED = re.compile(r"(\s*\{)(.*)\}\s*(ms|s|min)?\s*\Z", re.DOTALL)
_NUMBER = re.compile(r"\s*\d+(?:\.\d+)?\s*\Z", re.ASCII)
MIN_SECONDS = 0.001
"""A transition that takes no time is no transition after a time."""


def read_delay(reader: ElementReader, element: Element, attribute: str) -> Delay:
    """The time in an attribute. One that cannot be read is a finding, and a delay without seconds and expression."""
    text = element.attributes[attribute]
    computed = _COMPUTED.match(text)
    if computed is None:
        return Delay(text.strip(), read_seconds(reader, element, attribute))
    try:
        expression = Expression.parse(computed.group(2))
    except ExpressionError as error:
        location = reader.file.value_location(element, attribute, len(computed.group(1)) + error.column - 1)
        reader.diagnostics.error("time", location, expression_message(error), error.suggestion)
        return Delay(text.strip())
    locate = partial(_locate, reader, element, attribute, len(computed.group(1)))
    note_expression(expression, locate, reader.draft, reader.diagnostics)
    unit = UNITS[computed.group(3)] if computed.group(3) else None
    if not expression.keys:
        _check_constant(reader, element, attribute, expression, unit)
    return Delay(text.strip(), None, expression, unit)


def computed_part(text: str) -> tuple[str, int] | None:
    """The expression of a time that is worked out, and where it begins: of `{pause}ms`, `pause` and 1."""
    computed = _COMPUTED.match(text)
    return (computed.group(2), computed.start(2)) if computed is not None else None


def _check_constant(
    reader: ElementReader, element: Element, attribute: str, expression: Expression, unit: float | None
) -> None:
    """What needs no memory can be worked out now, unless chance is in it."""
    try:
        seconds = seconds_from(expression.value({}), unit)
    except EvaluationError:
        return
    if seconds is None or seconds > MAX_SECONDS:
        text = element.attributes[attribute].strip()
        message = f"`{text}` is never a time of at most 24 hours; write {{2}}, {{'2s'}} or {{1500}}ms"
        reader.report_value("wrong-type", element, attribute, message)


def read_seconds(reader: ElementReader, element: Element, attribute: str) -> float | None:
    """A time that is written out; None, after a finding, when it is none."""
    text = element.attributes[attribute]
    seconds = parse_time(text)
    if seconds is None:
        remedy = "write 500ms, 2s, 1.5s or 3min"
        if _NUMBER.match(text):
            remedy = f"write {text.strip()}ms or {text.strip()}s"
        reader.report_value("time", element, attribute, f"`{text}` is not a time; {remedy}")
        return None
    if MIN_SECONDS <= seconds <= MAX_SECONDS:
        return seconds
    at_once = seconds == 0 and attribute == "after"
    remedy = "; without `after` and with a condition, a transition is taken at once" if at_once else ""
    message = f"`{attribute}` is from 1ms to 24 hours (1440min); `{text.strip()[:40]}` is outside{remedy}"
    reader.report_value("out-of-range", element, attribute, message)
    return None


def _locate(reader: ElementReader, element: Element, attribute: str, start: int, index: int = 0) -> SourceLocation:
    return reader.file.value_location(element, attribute, start + index)
