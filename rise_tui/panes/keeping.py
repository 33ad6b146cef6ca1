"""Writing the memory as it is into the scenario's file, after asking."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rise_tui.messages import Told
from rise_tui.start_values import NotWritable, changes, file_of, write
from rise_tui.text import clean, crop, plain

if TYPE_CHECKING:
    from rise_tui.panes.memory import MemoryPane

MOST_SAID = 8
"""Changes that the question names."""


class Keeping:
    """Belongs to the memory's pane."""

    def __init__(self, pane: MemoryPane) -> None:
        self._pane = pane

    def ask(self) -> None:
        self._pane.run_worker(self._ask(), group="keep", exclusive=True)

    async def _ask(self) -> None:
        from rise_tui.screens.dialog import Answer, Dialog  # not needed to begin

        pane, scenario = self._pane, self._pane.store.scenario
        try:
            path = await asyncio.to_thread(file_of, scenario)
        except NotWritable as why:
            self._tell(f"not saved: {why}")
            return
        memory = {key: entry.value for key, entry in pane.store.view.memory.items()}
        differing = changes(scenario.memory, memory)
        if not differing:
            self._tell("the memory is as it was at the start: nothing to save")
            return
        said = ["Later sessions of this scenario begin with:"]
        said += [f"  {plain(crop(((clean(line), 'plain'),), 56))}" for line in differing[:MOST_SAID]]
        said += [f"  and {len(differing) - MOST_SAID} more"] if len(differing) > MOST_SAID else []
        said += [
            "",
            f"Written into {path}; the rest of the file stays as it is.",
            "The session that runs now does not change.",
        ]
        dialog = Dialog("Save the memory as start values?", said, Answer("s", "Save"))

        def answered(key: str | None) -> None:
            if key == "s":
                pane.run_worker(self._write(path, scenario.memory, memory, len(differing)), group="keep")

        pane.app.push_screen(dialog, answered)

    async def _write(self, path: Path, before: Mapping[str, Any], memory: dict[str, Any], changed: int) -> None:
        try:
            await asyncio.to_thread(write, path, before, memory)
        except NotWritable as why:
            self._tell(f"not saved: {why}")
        else:
            what = "1 start value" if changed == 1 else f"{changed} start values"
            self._tell(f"saved {what} in {path.name}; the rest of it is as it was")

    def _tell(self, text: str) -> None:
        self._pane.post_message(Told(text))
