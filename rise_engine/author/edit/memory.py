"""Edits of the memory's start values, `memory.json` in either of its forms."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from typing import Any

from rise_engine.author.edit.edits import Edit, RemoveStartValue, SetStartValue
from rise_engine.author.edit.json_edits import memory_file_text, memory_text_edits, memory_values
from rise_engine.author.edit.plan import EditRefused, Files, Plan
from rise_engine.author.edit.study_above import sets_key
from rise_engine.author.edit.study_state import StudyState
from rise_engine.author.edit.text_edits import file_of
from rise_engine.base.json_codec import JsonError, decode
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.file_names import DEFAULT_PATHS, SCENARIO_FILE
from rise_engine.scenario.memory import is_writable_key

_SHOWN = 60
"""Characters of a value that a sentence shows."""


def memory_file(files: Files) -> str:
    """The file of start values, which need not be there: what scenario.toml names, or the usual one."""
    try:
        named = tomllib.loads(files.get(SCENARIO_FILE, b"").decode("utf-8-sig")).get("memory")
    except (ValueError, RecursionError):
        named = None
    return named if isinstance(named, str) and named else DEFAULT_PATHS["memory"]


def plan_set_start_value(edit: SetStartValue, study: StudyState) -> Plan:
    """What a key's start value is to be; a new key stands at the end.

    :raises EditRefused: the key is empty, the value is none that a memory can hold, or the file is no memory.
    """
    if not edit.key.strip():
        raise EditRefused("a memory key cannot be empty; give it a name")
    table = edit.key.partition(".")[0]
    if any(name.startswith("tables/") and name[7:].lower() == f"{table}.csv".lower() for name in study.files):
        raise EditRefused(f"`{table}` is a table of this study, and nothing else can have its name; choose another one")
    _check_value(edit.key, edit.value)
    name = memory_file(study.files)
    noticed = () if is_writable_key(edit.key) else (_unwritable(edit.key),)
    if name not in study.files:
        says = f"{edit.key} begins as {value_text(edit.value)} (new key, in the new file {name})"
        return Plan(written={name: memory_file_text({edit.key: edit.value}).encode()}, says=(says,), noticed=noticed)
    file = file_of(study.files, name)
    if not file.text.strip():
        return Plan(
            written={name: memory_file_text({edit.key: edit.value}).encode()},
            says=(f"{edit.key} begins as {value_text(edit.value)} (new key)",),
            noticed=noticed,
        )
    before = _values(name, file.text)
    was = f"was {value_text(before[edit.key])}" if edit.key in before else "new key"
    return Plan(
        splices=file.splices(memory_text_edits(file.text, {}, {edit.key: edit.value})),
        says=(f"{edit.key} begins as {value_text(edit.value)} ({was})",),
        noticed=noticed if edit.key not in before else (),
    )


def plan_remove_start_value(edit: RemoveStartValue, study: StudyState) -> Plan:
    """A key without start value any more. :raises EditRefused: it has none, or the file is no memory."""
    name = memory_file(study.files)
    before: dict[str, Any] = {}
    if name in study.files:
        file = file_of(study.files, name)
        before = _values(name, file.text)
    if edit.key not in before:
        near = did_you_mean(edit.key, before)
        raise EditRefused(f"the memory key `{edit.key}` has no start value in {name}{near}")
    return Plan(
        splices=file.splices(memory_text_edits(file.text, {edit.key: None}, {})),
        says=(f"{edit.key} has no start value any more (was {value_text(before[edit.key])})",),
        noticed=(above,) if (above := sets_key(study.above, edit.key)) else (),
    )


def value_text(value: Any) -> str:
    """A value in a sentence."""
    text = json.dumps(value, ensure_ascii=False, default=str)  # TOML has dates and times
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


def _values(name: str, text: str) -> dict[str, Any]:
    try:
        return memory_values(text)
    except EditRefused as error:
        raise EditRefused(f"{name}: {error}") from None


def _check_value(key: str, value: Any) -> None:
    """:raises EditRefused: a memory cannot hold the value."""
    try:
        decode(json.dumps(value))
    except (JsonError, RecursionError, TypeError, ValueError) as error:
        raise EditRefused(f"this cannot be the start value of `{key}`: {error}") from None


def _unwritable(key: str) -> str:
    return f"the key `{key}` cannot be written in a condition: use letters, digits, `_` and dots"


PLANNERS: dict[type[Edit], Callable[[Any, StudyState], Plan]] = {
    SetStartValue: plan_set_start_value,
    RemoveStartValue: plan_remove_start_value,
}
