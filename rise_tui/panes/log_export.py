"""Exports from the log: rows to the clipboard of the wizard's terminal, or to a file. No widgets."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from textual.app import App

from rise_engine.base.errors import RiseError
from rise_engine.kernel.task_view import TaskView
from rise_tui.config.preferences import abbreviate_home
from rise_tui.model.store import Store
from rise_tui.rendering.text import format_clock

CLIPBOARD_BYTES = 75_000
"""Bytes. Many terminals silently drop more than this."""
COLUMNS = (
    *("task", "submitted", "started", "ended", "waited", "took", "source", "function", "calling_type", "behavior"),
    *("status", "reason", "mistake", "cue", "key", "robot", "voice", "filler"),
)
"""Times are seconds of the session; `waited` and `took` are durations in seconds. Missing values are `n/a`."""
TABLE_SUFFIXES, JSON_LINES_SUFFIXES = (".tsv", ".txt"), (".jsonl", ".ndjson")


class ExportFailed(RiseError):
    """Nothing was written. The message gives the reason, for a person."""


def task_columns(task: TaskView) -> dict[str, Any]:
    """A task's values for COLUMNS; None: missing."""
    waited = task.started - task.submitted if task.started is not None else None
    took = task.ended - task.started if task.ended is not None and task.started is not None else None
    times = (task.submitted, task.started, task.ended, waited, took)
    values = (
        *(task.id or None, *map(_round, times), task.source, task.function, task.calling_type, task.behavior),
        *(task.status, task.reason, task.mark, *map(_round, (task.cue_at, task.key_at, task.robot_at))),
        *(_round(task.voice_at), task.filler),
    )
    return dict(zip(COLUMNS, values, strict=True))


def table_lines(tasks: Iterable[TaskView], *, head: bool = True) -> Iterator[str]:
    """Lines of tab-separated values."""
    if head:
        yield "\t".join(COLUMNS)
    for task in tasks:
        yield "\t".join(map(_cell_text, task_columns(task).values()))


def json_lines(tasks: Iterable[TaskView]) -> Iterator[str]:
    """One JSON object for each task, with the actions of acts."""
    for task in tasks:
        actions = [
            {
                "action": action.action,
                "type": action.type,
                "status": action.status,
                "parameters": action.parameters,
                "started": _round(action.since),
                "ended": _round(action.ended),
                "reason": action.reason,
            }
            for action in list(task.actions.values())
        ]
        yield json.dumps({**task_columns(task), "actions": actions}, ensure_ascii=False)


def clipboard_text(lines: Iterable[str]) -> str:
    """The lines as one text. Raises ExportFailed at the size limit, before it makes the rest."""
    taken, size = [], 0
    for line in lines:
        size += len(line.encode("utf-8", "replace")) + 1
        if size > CLIPBOARD_BYTES:
            least = f"more than {CLIPBOARD_BYTES // 1000} kB"
            raise ExportFailed(f"{least}, which many terminals drop: filter the log, or save it to a file")
        taken.append(line)
    return "\n".join(taken)


def clipboard_remark(environment: Mapping[str, str]) -> str:
    """What may prevent a copied text from arriving, with the remedy; empty: nothing is known."""
    if environment.get("TMUX") or environment.get("TERM", "").startswith("tmux"):
        return "; if nothing arrives: tmux set -g set-clipboard on"
    if environment.get("STY") or environment.get("TERM", "").startswith("screen"):
        return "; GNU screen does not pass it on: save to a file instead"
    if environment.get("TERM_PROGRAM") == "Apple_Terminal":
        return "; Apple's Terminal does not take it: save to a file instead"
    return ""


def export_folder(session: str) -> Path:
    """The folder for a name without one: the session's own, or else the current folder."""
    folder = Path(session)
    return folder if session and folder.is_dir() and os.access(folder, os.W_OK) else Path()


def save_tasks(name: str, tasks: Iterable[TaskView], folder: Path) -> Path:
    """Write the tasks to a new file that only its owner can read, and return its full path.

    `folder`: for names without one. Blocks, so call it off the loop. Raises ExportFailed.
    """
    path = folder / Path(name.strip()).expanduser() if name.strip() else Path()
    ending = path.suffix.casefold()
    if ending not in (*TABLE_SUFFIXES, *JSON_LINES_SUFFIXES):
        raise ExportFailed("end the name in .tsv (a table) or .jsonl (JSON lines)")
    path = path.absolute()
    lines = table_lines(tasks) if ending in TABLE_SUFFIXES else json_lines(tasks)
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        file = os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace", newline="\n")
    except FileExistsError:
        raise ExportFailed(f"{path} exists already; nothing is overwritten: take another name") from None
    except OSError as error:
        raise ExportFailed(f"{path}: {error.strerror or error}") from error
    try:
        with file:
            file.writelines(f"{line}\n" for line in lines)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise ExportFailed(f"{path}: {error.strerror or error}") from error
    return path


def _round(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


def _cell_text(value: Any) -> str:
    """A value that stays in its cell, whatever it contains."""
    if value is None or value == "":
        return "n/a"
    return str(value).replace("\\", "\\\\").replace("\t", "\\t").replace("\n", "\\n").replace("\r", "\\r")


class Saved(NamedTuple):
    """The result of saving a file."""

    written: bool
    notice: str


def rows_of(store: Store, ids: Iterable[int]) -> Iterator[TaskView]:
    """The tasks of these rows, except those that are only in the record."""
    tasks = (store.log.task_at(row, store.view) for row in ids)
    return (task for task in tasks if task is not None)


def copy_row(app: App[Any], task: TaskView) -> str:
    """Put one row on the terminal's clipboard, without a table's head."""
    return _copy_lines(app, table_lines([task], head=False), "the row")


def copy_rows(app: App[Any], store: Store, ids: Sequence[int]) -> str:
    """Put these rows on the terminal's clipboard, as a table."""
    return _copy_lines(app, table_lines(rows_of(store, ids)), _rows_text(len(ids)), _missing_text(store))


def _copy_lines(app: App[Any], lines: Iterator[str], what: str, missing: str = "") -> str:
    try:
        text = clipboard_text(lines)
    except ExportFailed as why:
        return f"not copied, {what}: {why}"
    app.copy_to_clipboard(text)
    return f"copied {what}{clipboard_remark(os.environ) or ' to the clipboard of your terminal'}{missing}"


def suggested_file_name(now: float) -> str:
    """A file name with the date and the session time `now`. The file goes into the session's folder."""
    return f"rise-log_{datetime.now():%Y-%m-%d}_{format_clock(now).replace(':', '-')}.tsv"


async def save_rows(store: Store, name: str, ids: Sequence[int]) -> Saved:
    """Write these rows as they are now to a file with this name."""
    tasks = list(rows_of(store, ids))
    try:
        path = await asyncio.to_thread(save_tasks, name, tasks, export_folder(store.attach_reply.folder))
    except ExportFailed as why:
        return Saved(False, f"not saved: {why}")
    return Saved(True, f"saved {_rows_text(len(tasks))} to {abbreviate_home(str(path))}{_missing_text(store)}")


def _missing_text(store: Store) -> str:
    """The missing part of the rows, and how to get it."""
    return (
        f"; {store.forgotten_text}: rise-engine export {Path(store.attach_reply.folder).name}"
        if store.forgotten_text
        else ""
    )


def _rows_text(rows: int) -> str:
    return "1 row" if rows == 1 else f"{rows} rows"
