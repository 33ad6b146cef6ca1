"""Encodes a checked scenario as one JSON object, and decodes it, so that clients need not read and check its files."""

from __future__ import annotations

from functools import cache
from typing import Any

import msgspec
from msgspec.structs import replace

from rise_engine.base.errors import RiseError
from rise_engine.base.text import escape_surrogates, restore_surrogates
from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.model import Scenario


class ScenarioDecodeError(RiseError, ValueError):
    """A received text is not a scenario of this version."""


def encode_scenario(scenario: Scenario) -> bytes:
    """Encode the fields of `Scenario`, with conditions and assignments as their texts.

    Raises UnicodeEncodeError if a text contains half a character, which JSON does not allow.
    """
    if escape_surrogates(scenario.folder) != scenario.folder:  # a folder name that is not UTF-8
        scenario = replace(scenario, folder=escape_surrogates(scenario.folder))
    return _ENCODER.encode(scenario)


def decode_scenario(data: bytes | msgspec.Raw) -> Scenario:
    """Undo `encode_scenario`. Raises ScenarioDecodeError."""
    try:
        scenario = _decoder().decode(data)
    except (ValueError, RecursionError) as error:  # an invalid condition raises ValueError, too
        raise ScenarioDecodeError(f"this is not a scenario of this version: {error}") from None
    folder = restore_surrogates(scenario.folder)
    return scenario if folder == scenario.folder else replace(scenario, folder=folder)


@cache
def _decoder() -> msgspec.json.Decoder[Scenario]:
    """The decoder, built on demand because that takes a few milliseconds."""
    return msgspec.json.Decoder(Scenario, dec_hook=_decode_text)


def _encode_text(value: Any) -> Any:
    if isinstance(value, Expression | Assignment):
        return value.text
    raise TypeError(f"a scenario holds no {type(value).__name__}")


def _decode_text(kind: type, value: Any) -> Any:
    if kind is Expression:
        return Expression.parse_property(value)  # accepts all other conditions, too
    if kind is Assignment:
        return Assignment.parse(value)
    raise TypeError(f"a scenario holds no {kind.__name__}")


_ENCODER = msgspec.json.Encoder(enc_hook=_encode_text)
