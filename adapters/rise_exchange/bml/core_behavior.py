"""An action in BML 1.0's core, as far as the core can express it (see docs/reference/bml.md), with its times."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from decimal import Decimal
from typing import TypeAlias

from msgspec import Struct

from rise_engine.scenario.model import ActionCall
from rise_engine.scenario.speech.ssml import begins_as_ssml, plain_words
from rise_engine.scenario.speech.template import Template
from rise_exchange.bml.names import BmlNames, TargetPoint

_NUMBER = re.compile(r"\d+(?:\.\d*)?|\.\d+", re.ASCII)
_REFERENCE = re.compile(
    r"(?:(?P<block>[^\s:]+):)?(?P<behavior>[^\s:]+?):(?P<point>[^\s:+]+?)"
    r"\s*(?:(?P<sign>[+-])\s*(?P<offset>\d+(?:\.\d*)?|\.\d+))?",
    re.ASCII,
)
_MILLISECONDS = 1000


class SyncTime(Struct, frozen=True):
    """A time: seconds after a sync point of a behaviour, or after the block's start."""

    offset: Decimal
    """Seconds; negative for an earlier time."""
    behavior: str = ""
    """Its id; empty: the block's start."""
    point: str = ""
    block: str = ""
    """The id of the block, if it is written."""


def parse_sync(text: str) -> SyncTime | None:
    """Read a time; None: it is none.

    >>> parse_sync("greet:end + 0.5")
    SyncTime(offset=Decimal('0.5'), behavior='greet', point='end', block='')
    """
    text = text.strip()
    if _NUMBER.fullmatch(text):
        return SyncTime(Decimal(text))
    found = _REFERENCE.fullmatch(text)
    if found is None:
        return None
    offset = Decimal(f"{found['sign'] or ''}{found['offset'] or 0}")
    return SyncTime(offset, found["behavior"], found["point"], found["block"] or "")


def milliseconds(seconds: Decimal) -> str:
    """Convert seconds to an action's milliseconds.

    >>> milliseconds(Decimal("0.4"))
    '400'
    """
    return _plain(seconds * _MILLISECONDS)


def seconds_text(milliseconds: str) -> str | None:
    """Convert an action's milliseconds to BML's seconds; None: no number that can be written exactly.

    >>> seconds_text("400")
    '0.4'
    """
    if not _NUMBER.fullmatch(milliseconds):
        return None
    return _plain(Decimal(milliseconds) / _MILLISECONDS)


def read_seconds(text: str) -> Decimal | None:
    """Read a length of time; None: it is none."""
    return Decimal(text.strip()) if _NUMBER.fullmatch(text.strip()) else None


def _plain(number: Decimal) -> str:
    written = f"{number:f}"
    return written.rstrip("0").rstrip(".") if "." in written else written


FillTemplate: TypeAlias = Callable[[Template], str]
"""Returns the text for a parameter that contains memory values."""
MODES = {"left": "LEFT_HAND", "right": "RIGHT_HAND"}
"""The modes of `<pointing>`, for the `hand` of `PointAt`."""


class CoreBehavior(Struct, frozen=True):
    """A behaviour of BML's core."""

    tag: str
    attributes: dict[str, str]
    text: str | None = None
    """The spoken text."""
    ssml: str | None = None
    """The spoken text with its markup."""
    seconds: str | None = None
    """Its duration, if the action gives one."""


def core_behavior(call: ActionCall, names: BmlNames, fill: FillTemplate) -> CoreBehavior | None:
    """The core's behaviour for an action; None: there is none."""
    written = {name: fill(template) for name, template in call.parameters.items()}
    match call.type:
        case "Speech":
            message = written.get("message", "")
            if begins_as_ssml(message):
                return CoreBehavior("speech", {}, plain_words(message), message)
            return CoreBehavior("speech", {}, message)
        case "LookAt":
            target = {"target": target_name(written, names)}
            return CoreBehavior("gazeShift", target, seconds=seconds_text(written.get("duration", "")))
        case "PointAt":
            mode = MODES.get(written.get("hand", ""))
            target = {"target": target_name(written, names)}
            return CoreBehavior("pointing", target | ({"mode": mode} if mode else {}))
        case "Wait":
            seconds = seconds_text(written.get("duration", ""))
            return CoreBehavior("wait", {"duration": seconds if seconds is not None else written.get("duration", "")})
        case "Animation" | "Emotion" | "SocialExpression":
            return _by_lexeme(call.type, written, names)
    return None


def target_name(written: Mapping[str, str], names: BmlNames) -> str:
    """The name of a point: its own, or one made from its coordinates."""
    point = point_of(written)
    known = names.target_of(point)
    return known if known is not None else "_".join(("at", point.x, point.y, point.z, *filter(None, (point.frame,))))


def point_of(written: Mapping[str, str]) -> TargetPoint:
    """The point in an action's parameters."""
    x, y, z = (written.get(f"point{axis}", "") for axis in "xyz")
    return TargetPoint(x, y, z, written.get("frame", ""))


def _by_lexeme(type: str, written: Mapping[str, str], names: BmlNames) -> CoreBehavior:
    value = written.get("value", "")
    spec = names.robot.actions[type]
    codes = {str(code): name for name, code in spec.parameters["value"].codes.items()}
    kind, lexeme = names.lexeme_of(type, codes.get(value, value))
    seconds = seconds_text(written.get("duration", ""))
    attributes = {"lexeme": lexeme}
    repetitions = written.get("repetitions", "1")
    if seconds is not None and type == "Animation":  # the duration of one repetition
        times = read_seconds(repetitions)
        each = read_seconds(seconds)
        seconds = None if times is None or each is None else f"{(times * each).normalize():f}"
    if kind == "head" and repetitions != "1":
        attributes["repetition"] = repetitions
    tag = {"head": "head", "gesture": "gesture", "posture": "posture", "face": "faceLexeme"}[kind]
    return CoreBehavior(tag, attributes, seconds=seconds)


def length_of(seconds: Decimal, repetitions: str) -> Decimal | None:
    """The seconds of each of several repetitions; None: no finite decimal."""
    times = read_seconds(repetitions)
    if not times:
        return None
    each = seconds / times
    return each if each * times == seconds else None
