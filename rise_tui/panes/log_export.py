"""What leaves the log: rows to copy, rows to save. Each function says what became of it, in a sentence."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from textual.app import App

from rise_engine.view import TaskView
from rise_tui.export import NotSaved, TooLong, folder_for, for_clipboard, on_the_way, save, table
from rise_tui.model.store import Store
from rise_tui.start.paths import tilde
from rise_tui.text import clock


class Saved(NamedTuple):
    """What became of a file."""

    written: bool
    said: str


def rows_of(store: Store, ids: Iterable[int]) -> Iterator[TaskView]:
    """What these rows of the log show, but for what is in the record only."""
    found = (store.log.find(row, store.view) for row in list(ids))
    return (task for task in found if task is not None)


def copy_row(app: App[Any], task: TaskView) -> str:
    """Put one row on the clipboard of the terminal, without a table's head."""
    return _copy(app, table([task], head=False), "the row")


def copy_rows(app: App[Any], store: Store, ids: Sequence[int]) -> str:
    """Put these rows on the clipboard of the terminal, as a table."""
    return _copy(app, table(rows_of(store, ids)), _counted(len(ids)), _missing(store))


def _copy(app: App[Any], lines: Iterator[str], what: str, missing: str = "") -> str:
    try:
        text = for_clipboard(lines)
    except TooLong as why:
        return f"not copied, {what}: {why}"
    app.copy_to_clipboard(text)
    return f"copied {what}{on_the_way(os.environ) or ' to the clipboard of your terminal'}{missing}"


def suggested_file_name(now: float) -> str:
    """A name that says when (`now`: session time); it goes into the session's folder."""
    return f"rise-log_{datetime.now():%Y-%m-%d}_{clock(now).replace(':', '-')}.tsv"


async def save_rows(store: Store, name: str, ids: Sequence[int]) -> Saved:
    """Write these rows as they are now to a file of this name."""
    tasks = list(rows_of(store, ids))
    try:
        path = await asyncio.to_thread(save, name, tasks, folder_for(store.hello.folder))
    except NotSaved as why:
        return Saved(False, f"not saved: {why}")
    return Saved(True, f"saved {_counted(len(tasks))} to {tilde(str(path))}{_missing(store)}")


def _missing(store: Store) -> str:
    """What is not among the rows, and how to get it."""
    return f"; {store.older}: rise-engine export {Path(store.hello.folder).name}" if store.older else ""


def _counted(rows: int) -> str:
    return "1 row" if rows == 1 else f"{rows} rows"
