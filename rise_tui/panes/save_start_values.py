"""Saves the present memory as the scenario's start values in `memory.json`, after asking."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rise_engine.author.edit.memory import edit_memory_text, memory_file_text
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.study_folder import write_files
from rise_engine.base.json_codec import json_equal
from rise_engine.kernel.view import SessionView
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS, why_not_written
from rise_engine.scenario.model import SESSION, Scenario
from rise_engine.scenario.shipped_studies import shipped_name
from rise_tui.panes.pane import Pane
from rise_tui.rendering.text import clean, crop, format_value, plain_text
from rise_tui.screens.dialog import Dialog, DialogChoice

MAX_NAMED = 8
"""Changes that the question lists."""


def saveable_memory(scenario: Scenario, view: SessionView) -> dict[str, Any]:
    """The memory without values that sessions get elsewhere: the engine's own, and those of a condition.

    These keep their start values, if they have any.
    """
    elsewhere = {key for condition in scenario.conditions.values() for key in condition.memory}
    elsewhere |= view.condition_values.keys()
    memory = view.memory
    if scenario.reads_session:
        elsewhere.add(SESSION)
    saveable = {key: value for key, value in scenario.memory.items() if key in elsewhere or key in memory}
    return saveable | {key: entry.value for key, entry in memory.items() if key not in elsewhere}


async def ask_to_save_start_values(pane: Pane) -> None:
    """Ask over `pane` whether later sessions should begin with the present memory, then write it."""
    scenario = pane.store.scenario
    try:
        path = await asyncio.to_thread(memory_file_path, scenario)
    except EditRefused as why:
        pane.host.show_notice(f"not saved: {why}")
        return
    memory = saveable_memory(scenario, pane.store.view)
    differing = describe_changes(scenario.memory, memory)
    if not differing:
        pane.host.show_notice("the memory is as it was at the start: nothing to save")
        return
    lines = ["Later sessions of this scenario begin with:"]
    lines += [f"  {plain_text(crop(((clean(line), 'plain'),), 56))}" for line in differing[:MAX_NAMED]]
    lines += [f"  and {len(differing) - MAX_NAMED} more"] if len(differing) > MAX_NAMED else []
    lines += [
        "",
        f"Written into {path}; the rest of the file stays as it is.",
        "The running session does not change.",
    ]

    def save_if_chosen(key: str | None) -> None:
        if key == "s":
            pane.run_worker(_save(pane, path, scenario.memory, memory, len(differing)), group="keep")

    pane.app.push_screen(Dialog("Save the memory as start values?", lines, DialogChoice("s", "Save")), save_if_chosen)


async def _save(pane: Pane, path: Path, before: Mapping[str, Any], memory: Mapping[str, Any], changed: int) -> None:
    try:
        await asyncio.to_thread(save_memory, path, before, memory)
    except EditRefused as why:
        pane.host.show_notice(f"not saved: {why}")
        return
    what = "1 start value" if changed == 1 else f"{changed} start values"
    pane.host.show_notice(f"saved {what} in {path.name}; the rest is unchanged")


# --- the file; these functions block ----------------------------------------------------------------------------------


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
    """The changes for later sessions, one key a line."""
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

    The file is replaced completely or not at all. A link stays a link, and its target is written. Raises EditRefused.
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
