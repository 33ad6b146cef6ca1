"""Writes the present memory into the scenario's file, after asking."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rise_engine.author.edit.plan import EditRefused
from rise_engine.kernel.view import MemoryView
from rise_engine.scenario.model import SESSION, Scenario
from rise_tui.config.initial_memory import describe_changes, memory_file_path, save_memory
from rise_tui.messages import ShowNotice
from rise_tui.panes.pane import Pane
from rise_tui.rendering.text import clean, crop, plain_text
from rise_tui.screens.dialog import Dialog, DialogChoice

_SET_AT_START = ("condition", "study")
"""Sources of values that come from a condition or the study."""
MOST_NAMED = 8
"""Changes that the question lists."""


def saveable_memory(scenario: Scenario, memory: Mapping[str, MemoryView]) -> dict[str, Any]:
    """The memory without values that other sessions get elsewhere: the engine's own, and those of a condition.

    These keep their start values, if they have any.
    """
    elsewhere = {key for condition in scenario.conditions.values() for key in condition.memory}
    elsewhere |= {key for key, entry in memory.items() if entry.source in _SET_AT_START}
    if scenario.reads_session:
        elsewhere.add(SESSION)
    saveable = {key: value for key, value in scenario.memory.items() if key in elsewhere or key in memory}
    return saveable | {key: entry.value for key, entry in memory.items() if key not in elsewhere}


async def ask_to_save_start_values(pane: Pane) -> None:
    """Ask over `pane` whether later sessions should begin with the present memory; then write it."""
    scenario = pane.store.scenario
    try:
        path = await asyncio.to_thread(memory_file_path, scenario)
    except EditRefused as why:
        pane.post_message(ShowNotice(f"not saved: {why}"))
        return
    memory = saveable_memory(scenario, pane.store.view.memory)
    differing = describe_changes(scenario.memory, memory)
    if not differing:
        pane.post_message(ShowNotice("the memory is as it was at the start: nothing to save"))
        return
    lines = ["Later sessions of this scenario begin with:"]
    lines += [f"  {plain_text(crop(((clean(line), 'plain'),), 56))}" for line in differing[:MOST_NAMED]]
    lines += [f"  and {len(differing) - MOST_NAMED} more"] if len(differing) > MOST_NAMED else []
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
        pane.post_message(ShowNotice(f"not saved: {why}"))
        return
    what = "1 start value" if changed == 1 else f"{changed} start values"
    pane.post_message(ShowNotice(f"saved {what} in {path.name}; the rest is unchanged"))
