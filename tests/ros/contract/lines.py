"""What a test and its peers say to each other: a line of JSON each, with bytes, NaN and infinities in it."""

from __future__ import annotations

import json
from typing import Any

_BYTES = "$bytes"


def encode(value: dict[str, Any]) -> str:
    return json.dumps(value, default=_unusual)


def decode(line: str) -> dict[str, Any]:
    value: dict[str, Any] = json.loads(line, object_hook=_usual)
    return value


def _unusual(value: object) -> dict[str, str]:
    if isinstance(value, bytes | bytearray | memoryview):
        return {_BYTES: bytes(value).hex()}
    raise TypeError(f"{type(value).__name__} cannot be sent")


def _usual(value: dict[str, Any]) -> Any:
    return bytes.fromhex(value[_BYTES]) if _BYTES in value else value
