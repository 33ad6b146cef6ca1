"""What the values of a table are: whole numbers, numbers, true and false, or texts."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Literal, TypeAlias

from rise_engine.base.json_codec import is_64_bit
from rise_engine.scenario.model import Json

ColumnType: TypeAlias = Literal["text", "number", "bool"]
DecimalMark: TypeAlias = Literal[".", ","]

_WHOLE = re.compile(r"[-+]?(?:0|[1-9][0-9]{0,18})")
_DIGITS = re.compile(r"[-+]?[0-9]+")
_NUMBER = {
    mark: re.compile(
        rf"[-+]?(?:(?:0|[1-9][0-9]*)(?:{re.escape(mark)}[0-9]*)?|{re.escape(mark)}[0-9]+)(?:[eE][-+]?[0-9]+)?"
    )
    for mark in (".", ",")
}
"""Without zeros in front: `007` is a code, and its zeros are meant."""
_TRUTH = {"true": True, "false": False}


def guess_type(texts: Sequence[str], decimal: DecimalMark) -> ColumnType:
    """The type of a column: number or bool when all its values are, those that are empty apart; else text."""
    for kind in ("number", "bool"):
        if any(texts) and all(convert_value(text, kind, decimal) is not None for text in texts if text):
            return kind
    return "text"


def convert_value(text: str, kind: ColumnType, decimal: DecimalMark) -> Json:
    """The value that a text means in a column of this type; null for an empty one and for what is none."""
    if not text or kind == "text":
        return text or None
    if kind == "bool":
        return _TRUTH.get(text.lower())
    if _WHOLE.fullmatch(text) and is_64_bit(int(text)):
        return int(text)
    if _NUMBER[decimal].fullmatch(text) and not _DIGITS.fullmatch(text):
        number = float(text.replace(",", "."))
        return number if math.isfinite(number) else None
    return None


def has_comma_numbers(texts: Sequence[str]) -> bool:
    """Whether a column would be one of numbers, if its comma were a decimal mark."""
    return any("," in text for text in texts) and guess_type(texts, ",") == "number"
