"""Where the result of an action says that it failed (`carrier.error`)."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite
from typing import Any

from rise_adapters.ros2.mapping.action_mapping import ResultRule
from rise_adapters.ros2.mapping.compiler import ProfileMistakes
from rise_adapters.ros2.mapping.field_types import FieldTypes, MessageFieldType
from rise_adapters.ros2.transport.port import PortError

_KEYS = ("code", "ok", "minimum", "maximum", "text", "codes")
_LIMITS = ("minimum", "maximum")
_KINDS: dict[str, type | tuple[type, ...]] = {"integer": int, "boolean": bool, "text": str}
"""What `ok` has for a `code` of each kind."""


def parse_result_rule(
    table: Mapping[str, Any], type: str, where: str, types: FieldTypes, mistakes: ProfileMistakes
) -> ResultRule:
    """`type`: of the result, or a service's response; empty: not known. What is wrong goes into `mistakes`, and is left
    out."""
    mistakes.add_unknown_keys(where, table, _KEYS)
    code, code_type = _read_field_path(table, "code", type, where, types, mistakes)
    text, text_type = _read_field_path(table, "text", type, where, types, mistakes)
    if text_type is not None and (text_type.kind != "text" or text_type.is_list):
        mistakes.add(f"{where}.text", f"is the field with the robot's words, and this one is `{text_type}`")
    minimum, maximum = _read_limits(table, where, mistakes)
    has_limits = any(key in table for key in _LIMITS)
    if has_limits and "ok" in table:
        mistakes.add(
            f"{where}.ok", "stands beside a `minimum` or `maximum`; a rule has values that mean success, or limits"
        )
    if code_type is not None and (code_type.is_list or code_type.kind == "message"):
        mistakes.add(f"{where}.code", f"is a number, a text, or true or false, and this field is `{code_type}`")
        code_type = None
    ok = () if has_limits else _read_ok(table, code_type, where, mistakes)
    if has_limits and code_type is not None and code_type.kind not in ("integer", "float"):
        mistakes.add(f"{where}.code", f"is a number where it has limits, and this field is `{code_type}`")
    codes = table.get("codes", {})
    if not isinstance(codes, dict) or not all(isinstance(each, str) for each in codes.values()):
        mistakes.add(f"{where}.codes", 'says what numbers mean: { 134 = "the robot cannot do this" }')
        codes = {}
    for key in ("ok", "codes", *_LIMITS):
        if key in table and "code" not in table:
            mistakes.add(f"{where}.{key}", "needs `code`: the field of the result that it is about")
    return ResultRule(code, ok, minimum, maximum, text, codes)


def _read_limits(table: Mapping[str, Any], where: str, mistakes: ProfileMistakes) -> tuple[float, float]:
    limits = {"minimum": -inf, "maximum": inf}
    for key in _LIMITS:
        value = table.get(key, limits[key])
        if isinstance(value, bool) or not isinstance(value, int | float) or (key in table and not isfinite(value)):
            mistakes.add(f"{where}.{key}", "is a number")
        else:
            limits[key] = value
    if limits["minimum"] > limits["maximum"]:
        mistakes.add(f"{where}.minimum", "is above `maximum`, so nothing would be a success")
    return limits["minimum"], limits["maximum"]


def _read_ok(
    table: Mapping[str, Any], type: MessageFieldType | None, where: str, mistakes: ProfileMistakes
) -> tuple[int | bool | str, ...]:
    """The values of `code` that mean success."""
    written = table.get("ok", 0)
    values = tuple(written) if isinstance(written, list) else (written,)
    kind = type.kind if type is not None else ""
    if kind == "float":
        mistakes.add(where, "has a `code` with decimals; say from where it is a success: `minimum = 0.5`, or `maximum`")
    elif kind in ("boolean", "text") and "ok" not in table:
        which = "is true or false; say which one is success: `ok = true`"
        mistakes.add(where, f"has a `code` that {which if kind == 'boolean' else 'is a text; say which: `ok = [...]`'}")
    elif not values or not all(_is_ok(value, kind) for value in values):
        what = {"integer": "whole numbers", "boolean": "true or false", "text": "texts"}.get(
            kind, "whole numbers, texts, true or false"
        )
        mistakes.add(f"{where}.ok", f"has the values of `code` that mean success: {what}")
    else:
        return values
    return (0,)


def _is_ok(value: Any, kind: str) -> bool:
    if kind == "integer" and isinstance(value, bool):
        return False
    return isinstance(value, _KINDS.get(kind, (int, str)))


def _read_field_path(
    table: Mapping[str, Any], key: str, type: str, where: str, types: FieldTypes, mistakes: ProfileMistakes
) -> tuple[tuple[str, ...], MessageFieldType | None]:
    """The path of a field of the result, and its type where that is known."""
    path = table.get(key)
    if path is None:
        return (), None
    if not isinstance(path, str) or not all(path.split(".")):
        mistakes.add(f"{where}.{key}", "is a field of the result, such as `result.error_code`")
        return (), None
    names = tuple(path.split("."))
    if not type:
        return names, None
    try:
        return names, types.find(type, names)
    except (ValueError, PortError) as error:
        mistakes.add(f"{where}.{key}", str(error), "missing" if isinstance(error, PortError) else "wrong")
        return names, None
