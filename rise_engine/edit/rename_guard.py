"""Proof that a rename changed names and nothing else: but for them, the study means what it meant."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rise_engine.edit.edits import Rename
from rise_engine.edit.plan import EditRefused
from rise_engine.scenario.model import normal_topic

_NAME = "\0"
"""Stands for the name, whichever it is."""


def check_rename(edit: Rename, before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
    """Compare the models of a study before and after (`guard.model_of`), the old and the new name taken for the same.

    What acts do, what they say above all, may differ only where a memory key or an actionID stands in it.

    :raises EditRefused: something else differs.
    """
    owner, _, _ = edit.old.rpartition("/")
    old = edit.old[len(owner) + 1 :] if edit.kind in ("state", "action") else normal_topic(edit.old)
    new = normal_topic(edit.new) if edit.kind == "event" else edit.new
    longer, shorter = sorted((old, new), key=len, reverse=True)

    def either(text: str) -> str:
        return text.replace(longer, _NAME).replace(shorter, _NAME)

    for part in before:
        in_content = part != "acts" or edit.kind in ("key", "action")
        if _mapped(before[part], either, in_content) != _mapped(after.get(part), either, in_content):
            what = {"acts": "what acts do", "rules": "what rules do"}.get(part, part)
            raise EditRefused(
                f"`{old}` cannot be renamed from here: {what} would change, perhaps because a parameter of a template "
                "is the name and something else, too; nothing was changed"
            )


def _mapped(value: Any, either: Callable[[str], str], in_content: bool) -> Any:
    """A model with the names taken for the same: in all of it, or only in the keys of its outermost level."""
    if isinstance(value, dict):
        inner = {either(key): _mapped(each, either, True) if in_content else each for key, each in value.items()}
        return len(value), inner
    if isinstance(value, list | tuple):
        return [_mapped(each, either, in_content) for each in value]
    return either(value) if isinstance(value, str) else value
