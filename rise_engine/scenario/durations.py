"""The expected duration of an action, and its time limit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from rise_engine.scenario.model import ActionSpec
from rise_engine.scenario.speech.ssml import pause_seconds, plain_words

_TIME = re.compile(r"\s*(\d+(?:\.\d+)?)\s*(ms|s|min)\s*\Z", re.ASCII)
UNITS = {"ms": 0.001, "s": 1.0, "min": 60.0}

CHARACTERS_PER_SECOND = 14.0
"""Speech of an unhurried voice at rate 1 (about 160 words a minute)."""
_LARGE = 10**30
SPEECH_START = 0.3
"""Seconds before synthesized speech is heard."""
SPEECH_MINIMUM = 0.5
"""The shortest utterance, in seconds."""


MAX_SECONDS = 86_400.0
"""24 hours: the maximum time in a scenario, and the maximum expected duration of an action."""


def parse_time(text: str) -> float | None:
    """The seconds of a written time, or None if it is not a time.

    >>> parse_time("500ms"), parse_time("1.5min"), parse_time("soon")
    (0.5, 90.0, None)
    """
    found = _TIME.match(text)
    return float(found.group(1)) * UNITS[found.group(2)] if found is not None else None


def seconds_from(value: Any, unit: float | None) -> float | None:
    """The seconds of a computed value, or None if it is not a time.

    A number counts in `unit`. Without one, it counts in seconds, and a text such as `2s` is also a time. Negative and
    very large values are accepted; the largest become infinity.

    >>> seconds_from(250, 0.001), seconds_from("2s", None), seconds_from(True, None)
    (0.25, 2.0, None)
    """
    if isinstance(value, bool):
        return None
    if isinstance(value, int | float):
        return value * (unit or 1.0) if abs(value) < 1e15 else float("inf") if value > 0 else 0.0
    return parse_time(value) if isinstance(value, str) and unit is None else None


def expected_seconds(spec: ActionSpec, parameters: Mapping[str, Any]) -> float:
    """The expected seconds of an action with these parameters, at most MAX_SECONDS. Never raises.

    Speech depends on the length of its `message` and its `rate` (for SSML, on its words and, if the robot makes them,
    its breaks). Other actions depend on `duration` (ms) times `repetitions`, or else on their declaration. `parameters`
    come from `fill_parameters`.

    >>> expected_seconds(ActionSpec("Wait", {}), {"duration": 1500})
    1.5
    """
    seconds = _estimate_seconds(spec, parameters)
    return seconds if 0 <= seconds <= MAX_SECONDS else MAX_SECONDS if seconds > 0 else 0.0


def _estimate_seconds(spec: ActionSpec, parameters: Mapping[str, Any]) -> float:
    message = parameters.get("message")
    if isinstance(message, str) and "duration" not in parameters:
        rate = _number(parameters.get("rate"), 1.0) or 1.0
        length, pauses = len(plain_words(message)), pause_seconds(message) if spec.ssml else 0.0
        return max(SPEECH_MINIMUM, SPEECH_START + length / (CHARACTERS_PER_SECOND * rate)) + pauses
    given = {name: each.default for name, each in spec.parameters.items() if each.default is not None} | {**parameters}
    repetitions = max(_number(given.get("repetitions"), 1.0), 0.0)
    if "duration" in given:
        duration = spec.parameters.get("duration")
        factor = 1.0 if duration is not None and duration.unit == "s" else 0.001
        return max(_number(given["duration"], 0.0), 0.0) * factor * repetitions
    return spec.seconds * repetitions


def limit_seconds(spec: ActionSpec, parameters: Mapping[str, Any]) -> float:
    """The seconds after which a running action counts as timed out; never raises.

    >>> limit_seconds(ActionSpec("Wait", {}), {"duration": 1500})  # three times as long as expected, and 10 s
    14.5
    """
    return spec.limit if spec.limit is not None else 3 * expected_seconds(spec, parameters) + 10


def _number(value: Any, otherwise: float) -> float:
    if isinstance(value, float):
        return value if value == value else otherwise
    return float(max(min(value, _LARGE), -_LARGE)) if isinstance(value, int) else otherwise
