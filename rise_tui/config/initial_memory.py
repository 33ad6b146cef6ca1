"""Saves the present memory as the scenario's start values in `memory.json`. No widgets. It blocks: not for a loop."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rise_engine.author.edit.memory import edit_memory_text, memory_file_text
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.saving import write_files
from rise_engine.base.json_codec import json_equal
from rise_engine.scenario.files.file_names import DEFAULT_PATHS
from rise_engine.scenario.files.study_paths import why_not_written
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.shipped_studies import shipped_name
from rise_tui.rendering.text import format_value


def memory_file_path(scenario: Scenario) -> Path:
    """The file of the start values. Raises EditRefused."""
    folder = Path(scenario.folder)
    if not scenario.folder or not folder.is_dir():
        raise EditRefused(f"the scenario's folder is not on this computer: {scenario.folder or 'none'}")
    if name := shipped_name(folder):
        raise EditRefused(
            f"this study comes with the program and stays as it is; copy it: rise-engine new DIR --from {name}"
        )
    name = scenario.paths.get("memory") or DEFAULT_PATHS["memory"]
    path = folder / name
    if problem := why_not_written(folder, name):
        raise EditRefused(problem)
    if path.exists() and not path.is_file():
        raise EditRefused(f"{path} is not a file")
    real = Path(os.path.realpath(path))
    if not os.access(real.parent, os.W_OK) or (real.exists() and not os.access(real, os.W_OK)):
        raise EditRefused(f"{real} cannot be written by you; work on a copy of the study's folder")
    return path


def describe_changes(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What changes for later sessions, one key a line."""
    changes = []
    for key in {**before, **now}:
        if key not in now:
            changes.append(f"{key}: {format_value(before[key])} → (no such key)")
        elif key not in before:
            changes.append(f"{key}: (new) → {format_value(now[key])}")
        elif not json_equal(before[key], now[key], in_order=True):
            changes.append(f"{key}: {format_value(before[key])} → {format_value(now[key])}")
    return changes


def save_memory(path: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    """Write the changes from `before` to `now` into the file, and leave the rest of it unchanged.

    The file is replaced as a whole or not at all. A link stays a link, and the file that it leads to is written. Raises
    EditRefused.
    """
    try:
        there = {path.name: path.read_bytes()} if path.exists() else {}
        data = _changed_text(path, before, now).encode()
    except EditRefused as error:
        raise EditRefused(f"{path}: {error}") from error
    except (OSError, UnicodeError) as error:
        raise EditRefused(f"{path}: {getattr(error, 'strerror', None) or error}") from error
    write_files(path.parent, there, {path.name: data})


def _changed_text(path: Path, before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """The new contents of the file. Raises OSError, UnicodeError and EditRefused."""
    if not path.exists():
        return memory_file_text(now)
    text = path.read_bytes().decode("utf-8")
    mark = text[:1] if text.startswith("\ufeff") else ""
    return mark + edit_memory_text(text.removeprefix(mark), before, now)
