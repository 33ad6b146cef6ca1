"""Proof that a rename changed names and nothing else: but for them, the study means what it meant."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from rise_engine.edit.edits import Rename
from rise_engine.edit.plan import EditRefused
from rise_engine.expression import Assignment, Expression
from rise_engine.expression.tokens import escape_text
from rise_engine.scenario.model import normal_topic

_NAME = "\0"
"""Stands for the name, whichever it is."""


def check_rename(edit: Rename, before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
    """Compare the models of a study before and after (`guard.model_of`), the old and the new name taken for the same.

    What acts do, what they say above all, may differ only where a memory key or an actionID stands in it; so may what
    they say in other languages.

    :raises EditRefused: something else differs.
    """
    owner, _, _ = edit.old.rpartition("/")
    old = edit.old[len(owner) + 1 :] if edit.kind in ("state", "action") else normal_topic(edit.old)
    new = normal_topic(edit.new) if edit.kind == "event" else edit.new
    written = {escape_text(name, quote) for name in (old, new) for quote in ("", "'", '"')}
    longest_first = sorted(written, key=len, reverse=True)

    def either(text: str) -> str:
        for name in longest_first:
            text = text.replace(name, _NAME)
        return text

    for part in before:
        inner = either if part not in ("acts", "translations") or edit.kind in ("key", "action") else _as_it_is
        one, other = before[part], after.get(part)
        if not (isinstance(other, dict) and _is_same_dict(one, other, either, inner)):
            what = {"acts": "what acts do", "rules": "what rules do"}.get(part, part)
            raise EditRefused(
                f"`{old}` cannot be renamed from here: {what} would change, perhaps because a parameter of a template "
                "is the name and something else, too; nothing was changed"
            )


def _as_it_is(text: str) -> str:
    return text


def _is_same_dict(
    one: Mapping[str, Any], other: Mapping[str, Any], outer: Callable[[str], str], inner: Callable[[str], str]
) -> bool:
    """Whether two tables are the same: their keys with the names taken for the same as `outer` does, what is in them as
    `inner` does."""
    if len(one) != len(other):
        return False
    found = {outer(str(key)): value for key, value in other.items()}
    keys = {outer(str(key)): value for key, value in one.items()}
    return keys.keys() == found.keys() and all(_is_same(value, found[key], inner) for key, value in keys.items())


def _is_same(one: Any, other: Any, either: Callable[[str], str]) -> bool:
    """Whether two parts of models are the same; places in files do not matter."""
    if one is other:
        return True
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return _is_same_dict(one, other, either, either)
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(
            _is_same(left, right, either) for left, right in zip(one, other, strict=True)
        )
    if type(one) is not type(other):
        return False
    if isinstance(one, Expression | Assignment):
        return either(one.text) == either(other.text)
    if isinstance(one, msgspec.Struct):
        names = (name for name in one.__struct_fields__ if name != "location")
        return all(_is_same(getattr(one, name), getattr(other, name), either) for name in names)
    if isinstance(one, set | frozenset):
        return set(map(either, map(str, one))) == set(map(either, map(str, other)))
    return bool(either(one) == either(other) if isinstance(one, str) else one == other)
