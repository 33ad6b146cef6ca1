"""Where the result of an action says that it failed (`carrier.error`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rise_adapters.ros2.mapping.action_mapping import ResultRule
from rise_adapters.ros2.mapping.compiler import ProfileMistakes
from rise_adapters.ros2.mapping.field_types import FieldTypes, MessageFieldType

_KEYS = ("code", "ok", "text", "codes")


def parse_result_rule(
    table: Mapping[str, Any], type: str, where: str, types: FieldTypes, mistakes: ProfileMistakes
) -> ResultRule:
    """`type`: the action's; empty when it is not known. What is wrong goes into `mistakes`, and is left out."""
    mistakes.add_unknown_keys(where, table, _KEYS)
    code, code_type = _read_field_path(table, "code", type, where, types, mistakes)
    text, text_type = _read_field_path(table, "text", type, where, types, mistakes)
    if text_type is not None and (text_type.kind != "text" or text_type.is_list):
        mistakes.add(f"{where}.text", f"is the field with the robot's words, and this one is `{text_type}`")
    ok = table.get("ok", 0)
    if code_type is not None and (code_type.is_list or code_type.kind not in ("integer", "boolean")):
        mistakes.add(f"{where}.code", f"is a whole number or true or false, and this field is `{code_type}`")
    elif code_type is not None and code_type.kind == "boolean" and not isinstance(ok, bool):
        mistakes.add(where, "has a `code` that is true or false; say which one is success: `ok = true`")
    elif not isinstance(ok, int) or (code_type is not None and code_type.kind == "integer" and ok is True):
        mistakes.add(f"{where}.ok", "is the value of `code` that means success: a whole number, true or false")
        ok = 0
    codes = table.get("codes", {})
    if not isinstance(codes, dict) or not all(isinstance(each, str) for each in codes.values()):
        mistakes.add(f"{where}.codes", 'says what numbers mean: { 134 = "the robot cannot do this" }')
        codes = {}
    for key in ("ok", "codes"):
        if key in table and "code" not in table:
            mistakes.add(f"{where}.{key}", "needs `code`: the field of the result that it is about")
    return ResultRule(code, ok, text, codes)


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
        return names, types.find(f"{type}_Result", names)
    except ValueError as error:
        mistakes.add(f"{where}.{key}", str(error))
        return names, None
