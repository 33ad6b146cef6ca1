"""A simulated robot's answers: results and feedback of any type, as far as a profile defines their meaning."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.transport.port import Message, Transport

CANCELED, FAILED = 125, 255
"""Error codes for results with a code, as in std_skills/msg/Result."""


class ResultMaker:
    """Makes results of an action, or responses of a service, with any fields: a reason, an error code and its text."""

    def __init__(self, transport: Transport, mapping: ActionMapping) -> None:
        self._rule = rule = mapping.result_rule
        fields = transport.fields(f"{mapping.type}_{'Response' if mapping.kind == 'service' else 'Result'}")
        self._text = rule.text or (("reason",) if fields.get("reason") == "string" else ())

    def make_result(self, reason: str, code: int) -> Message:
        """Make a result. `code` 0 is success."""
        result: Message = {}
        if self._text:
            _put(result, self._text, reason)
        if self._rule.code:
            _put(result, self._rule.code, self._choose_code(code))
        return result

    def _choose_code(self, code: int) -> Any:
        """Choose a value that the profile counts as a success, or as a failure."""
        rule = self._rule
        if not rule.ok:
            finite = [each for each in (rule.minimum, rule.maximum) if math.isfinite(each)]
            if not code:
                return finite[0]
            return rule.minimum - 1 if math.isfinite(rule.minimum) else rule.maximum + 1
        if not code:
            return rule.ok[0]
        if isinstance(rule.ok[0], bool):
            return not rule.ok[0]
        return "failed" if isinstance(rule.ok[0], str) else code


def make_feedback(transport: Transport, type: str) -> Callable[[float], Message]:
    """Return a function that makes feedback for the finished part, from 0 to 1; empty without a field for it."""
    fields = transport.fields(f"{type}_Feedback")
    if fields.get("progress") in ("float32", "float64"):
        return lambda done: {"progress": done}
    if fields.get("feedback") == "std_skills/msg/Feedback":
        return lambda done: {"feedback": {"data_float": done}}
    return lambda done: {}


def is_same(received: Any, sent: Any) -> bool:
    """Whether a received message equals a sent one, in which missing fields are zero. Stamps may differ."""
    if isinstance(received, dict):
        return all(is_same(value, (sent or {}).get(key)) for key, value in received.items() if key != "stamp")
    if sent is None:
        return not received
    if isinstance(received, list):
        return len(received) == len(sent) and all(map(is_same, received, sent))
    if isinstance(received, float):
        return math.isclose(received, sent, rel_tol=1e-6, abs_tol=1e-9)
    return bool(received == sent)


def _put(result: Message, path: tuple[str, ...], value: Any) -> None:
    for name in path[:-1]:
        result = result.setdefault(name, {})
    result[path[-1]] = value
