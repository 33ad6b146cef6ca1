"""What leaves the log: details to read, rows to copy, rows to save."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from rise_engine.view import TaskView
from rise_tui.export import NotSaved, TooLong, folder_for, for_clipboard, on_the_way, save, table
from rise_tui.messages import Told
from rise_tui.model.states import State
from rise_tui.model.task_text import task_rows
from rise_tui.start.paths import tilde
from rise_tui.text import Row, clock

if TYPE_CHECKING:
    from rise_tui.panes.log import LogPane

LETTERS = (("c", "copy"), ("a", "copy all"), ("s", "save"), ("t", "go to time"))
_ACTIONS = {"c": "log.copy", "a": "log.copy-all", "s": "log.save", "t": "log.time"}


class LogOut:
    """Belongs to the log's pane."""

    def __init__(self, pane: LogPane) -> None:
        self._pane = pane
        self._saving = False

    def details(self) -> None:
        """Everything about the selected task; the arrows go on to its neighbours."""
        from rise_tui.screens.reading import Reading  # not needed to begin

        pane = self._pane
        if pane.selected is None:
            pane.post_message(Told("no task is selected"))
            return

        def step(direction: int) -> None:
            pane.log_view.move_to(min(max(pane.log_view.cursor + direction, 0), pane.log_view.count - 1))

        def rows(width: int) -> list[Row]:
            task = pane.selected
            return task_rows(task, self._state(task), pane.store.now(), width) if task is not None else []

        def done(letter: str | None) -> None:
            if letter:
                pane.do(_ACTIONS[letter])

        pane.app.push_screen(Reading("Task", rows, LETTERS, step), done)

    def _state(self, task: TaskView) -> State:
        return self._pane.log_view.state_of(task)

    # --- the clipboard ------------------------------------------------------------------------------------------------

    def copy(self) -> None:
        task = self._pane.selected
        if task is not None:
            self._copy(table([task], head=False), "the row")

    def copy_all(self) -> None:
        self._copy(table(self._shown()), _rows(self._pane.log_view.count), self._without())

    def _copy(self, lines: Iterator[str], what: str, without: str = "") -> None:
        try:
            text = for_clipboard(lines)
        except TooLong as why:
            self._tell(f"not copied, {what}: {why}")
            return
        self._pane.app.copy_to_clipboard(text)
        self._tell(f"copied {what}{on_the_way(os.environ) or ' to the clipboard of your terminal'}{without}")

    # --- a file -------------------------------------------------------------------------------------------------------

    def free_name(self) -> str:
        """A name that says when; it goes into the session's folder."""
        return f"rise-log_{datetime.now():%Y-%m-%d}_{clock(self._pane.store.now()).replace(':', '-')}.tsv"

    def save(self, name: str) -> None:
        if not self._saving:
            self._saving = True
            self._pane.run_worker(self._save(name), group="save")

    async def _save(self, name: str) -> None:
        """The rows as they are shown now; the name can be bettered until it could be used."""
        pane = self._pane
        tasks = list(self._shown())
        try:
            path = await asyncio.to_thread(save, name, tasks, folder_for(pane.store.hello.folder))
        except NotSaved as why:
            self._tell(f"not saved: {why}")
        else:
            self._tell(f"saved {_rows(len(tasks))} to {tilde(str(path))}{self._without()}")
            if pane.save_bar.is_open:
                pane.save_bar.close()
                pane.screen.set_focus(pane.rows)
        finally:
            self._saving = False

    def _shown(self) -> Iterator[TaskView]:
        log, view = self._pane.store.log, self._pane.store.view
        found = (log.find(row, view) for row in list(self._pane.log_view.ids))
        return (task for task in found if task is not None)

    def _without(self) -> str:
        """What is not among the rows, and how to get it."""
        store = self._pane.store
        return f"; {store.older}: rise-engine export {Path(store.hello.folder).name}" if store.older else ""

    def _tell(self, text: str) -> None:
        self._pane.post_message(Told(text))


def _rows(count: int) -> str:
    return "1 row" if count == 1 else f"{count} rows"
