"""The quality of service of what an action publishes, or listens to (`carrier.qos`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rise_adapters.ros2.mapping.compiler import ProfileMistakes
from rise_adapters.ros2.transport.port import FEEDBACK, RELIABLE, STATUS, STATUS_TOPIC, QoS
from rise_engine.base.nearest_name import did_you_mean, nearest_name

_KEYS = ("reliability", "durability", "depth")
_RELIABILITY = {"reliable": True, "best_effort": False}
_DURABILITY = {"volatile": False, "transient_local": True}
_DEEPEST = 10_000
"""Messages that may be kept for one topic."""


def parse_qos(table: Mapping[str, Any], kind: str, where: str, mistakes: ProfileMistakes) -> dict[str, QoS]:
    """By the field of `ActionMapping`: `topic_qos`, or `feedback_qos` and `status_qos` of an action (`kind`). What is
    wrong goes into `mistakes`."""
    if kind == "topic":
        return {"topic_qos": _parse_quality(table, RELIABLE, where, mistakes)}
    usual = {FEEDBACK: RELIABLE, STATUS_TOPIC: STATUS}
    for key in table:
        if key in _KEYS:
            mistakes.add(f"{where}.{key}", f"stands in `qos.{FEEDBACK}` or `qos.{STATUS_TOPIC}`: goals have no other")
        elif key not in usual:
            mistakes.add(f"{where}.{key}", f"does not exist{did_you_mean(key, usual)}")
    return {
        f"{key}_qos": _parse_quality(table.get(key, {}), before, f"{where}.{key}", mistakes)
        for key, before in usual.items()
    }


def _parse_quality(table: Any, before: QoS, where: str, mistakes: ProfileMistakes) -> QoS:
    if not isinstance(table, dict):
        mistakes.add(where, 'is a table: { reliability = "best_effort" }')
        return before
    mistakes.add_unknown_keys(where, table, _KEYS)
    depth = table.get("depth", before.depth)
    if isinstance(depth, bool) or not isinstance(depth, int) or not 1 <= depth <= _DEEPEST:
        mistakes.add(f"{where}.depth", f"is a whole number of messages from 1 to {_DEEPEST}")
        depth = before.depth
    reliable = _parse_choice(table.get("reliability"), _RELIABILITY, before.reliable, f"{where}.reliability", mistakes)
    latched = _parse_choice(table.get("durability"), _DURABILITY, before.latched, f"{where}.durability", mistakes)
    return QoS(depth, reliable, latched)


def _parse_choice(word: Any, words: Mapping[str, bool], before: bool, where: str, mistakes: ProfileMistakes) -> bool:
    if word is None:
        return before
    if isinstance(word, str) and word in words:
        return words[word]
    near = nearest_name(word, words) if isinstance(word, str) else None
    meant = f"; did you mean `{near}`?" if near is not None else ""
    mistakes.add(where, f"is {' or '.join(f'`{each}`' for each in words)}{meant}")
    return before
