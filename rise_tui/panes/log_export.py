"""What leaves the log: rows to copy, rows to save. Each function says what became of it, in a sentence."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from textual.app import App

from rise_engine.kernel.task_view import TaskView
from rise_tui.config.paths import abbreviate_home
from rise_tui.model.store import Store
from rise_tui.panes.task_export import (
    ExportFailed,
    clipboard_remark,
    clipboard_text,
    export_folder,
    save_tasks,
    table_lines,
)
from rise_tui.rendering.text import format_clock


class Saved(NamedTuple):
    """What became of a file."""

    written: bool
    notice: str


def rows_of(store: Store, ids: Iterable[int]) -> Iterator[TaskView]:
    """What these rows of the log show, but for what is only in the record."""
    tasks = (store.log.task_at(row, store.view) for row in ids)
    return (task for task in tasks if task is not None)


def copy_row(app: App[Any], task: TaskView) -> str:
    """Put one row on the clipboard of the terminal, without a table's head."""
    return _copy_lines(app, table_lines([task], head=False), "the row")


def copy_rows(app: App[Any], store: Store, ids: Sequence[int]) -> str:
    """Put these rows on the clipboard of the terminal, as a table."""
    return _copy_lines(app, table_lines(rows_of(store, ids)), _rows_text(len(ids)), _missing_text(store))


def _copy_lines(app: App[Any], lines: Iterator[str], what: str, missing: str = "") -> str:
    try:
        text = clipboard_text(lines)
    except ExportFailed as why:
        return f"not copied, {what}: {why}"
    app.copy_to_clipboard(text)
    return f"copied {what}{clipboard_remark(os.environ) or ' to the clipboard of your terminal'}{missing}"


def suggested_file_name(now: float) -> str:
    """A name that says when (`now`: session time); it goes into the session's folder."""
    return f"rise-log_{datetime.now():%Y-%m-%d}_{format_clock(now).replace(':', '-')}.tsv"


async def save_rows(store: Store, name: str, ids: Sequence[int]) -> Saved:
    """Write these rows as they are now to a file of this name."""
    tasks = list(rows_of(store, ids))
    try:
        path = await asyncio.to_thread(save_tasks, name, tasks, export_folder(store.attach_reply.folder))
    except ExportFailed as why:
        return Saved(False, f"not saved: {why}")
    return Saved(True, f"saved {_rows_text(len(tasks))} to {abbreviate_home(str(path))}{_missing_text(store)}")


def _missing_text(store: Store) -> str:
    """What is not among the rows, and how to get it."""
    return (
        f"; {store.forgotten_text}: rise-engine export {Path(store.attach_reply.folder).name}"
        if store.forgotten_text
        else ""
    )


def _rows_text(rows: int) -> str:
    return "1 row" if rows == 1 else f"{rows} rows"
