"""The interface of export formats to the export command, and the list of installed formats."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import BinaryIO, Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.base.errors import RiseError
from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import SessionData
from rise_engine.study.model import Study, StudyStanding

Shape: TypeAlias = Literal["file", "file-per-session", "folder"]
"""The output of an export. file: one for all sessions; file-per-session: one for each; folder: a new folder."""


class ExportContext(Struct):
    """Settings shared by all sessions of an export."""

    level: ExportLevel
    study: Study | None = None
    standing: StudyStanding | None = None
    """The study's progress, if the whole study is exported."""
    folder: Path | None = None
    """The folder in which the finished files will be. None: where they are written."""
    factors: tuple[str, ...] = ()
    """The factors of all sessions of the export, in their order; tables have a column for each."""
    spreadsheet_safe: bool = False
    """Whether cells that a spreadsheet would execute get an apostrophe. Table formats use this."""
    trial_columns: tuple[str, ...] | None = None
    """The columns that the scenarios of all sessions declare in `[trials]`, in their order. None: no trials."""
    wide: bool = False
    """Whether to add a table with a row for each participant."""
    warnings: list[str] = field(default_factory=list)
    """Sentences for the person who exports; formats append to it."""


class OmittedSession(Struct, frozen=True):
    """A session's folder that is omitted from an export or a bundle."""

    name: str
    why: str
    """The reason as a sentence, without names of folders, paths and dates."""
    detail: str = ""
    """The same with these, for the people of the study. Empty: there are none."""
    unread: bool = False
    """Whether it was unreadable."""

    def __str__(self) -> str:
        return f"{self.name} is not in the export: {self.detail or self.why}"


HAS_WITHDRAWN = "its participant has withdrawn"
"""The reason why a session is not named to others, whatever the level."""


class ExportError(RiseError):
    """An export or a bundle cannot be made or read; a sentence, or several lines."""


def new_file(path: Path) -> BinaryIO:
    """Open a new file for its owner alone. Raises OSError."""
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600), "wb")


def started_text(started: str, write: Callable[[datetime], str]) -> str:
    """Write when a session began, in the form of a format. Empty: the level hides dates."""
    try:
        return write(datetime.fromisoformat(started))
    except ValueError:
        return ""


class ExportFormat(Struct, frozen=True):
    """One export format.

    `write` gets the path of a new file or folder, the sessions one after the other, and the context. It must not keep
    sessions, because a study may have hundreds. With `file-per-session`, it is called once for each session. It raises
    ExportError or OSError.
    """

    name: str
    about: str
    """One line of help."""
    shape: Shape
    suffix: str
    """With its dot. Empty for a folder."""
    write: Callable[[Path, Iterable[SessionData], ExportContext], None]
    spreadsheet_safe: bool = False
    """Whether it supports `ExportContext.spreadsheet_safe`."""
    extra: str = ""
    """The package extra that it needs."""


_OWN = {
    "tables": "rise_engine.results.export.tables:FORMAT",
    "csv": "rise_engine.results.export.records:CSV",
    "jsonl": "rise_engine.results.export.records:JSONL",
    "eaf": "rise_engine.results.export.eaf:EAF",
    "textgrid": "rise_engine.results.export.eaf:TEXTGRID",
    "boris": "rise_engine.results.export.boris:FORMAT",
    "xdf": "rise_engine.results.export.xdf:FORMAT",
    "bids": "rise_engine.results.export.bids:FORMAT",
}
"""The module of each format, in the order of the help. They are loaded on demand, because some load slowly."""
ENTRY_POINTS = "rise.exports"
"""The group of entry points for ExportFormat objects."""


def format_names() -> list[str]:
    """Return the names of all available formats without loading any."""
    others = sorted(installed_plugins(ENTRY_POINTS).names - _OWN.keys())
    return [*_OWN, *others]


def load_format(name: str) -> ExportFormat:
    """Load a format by its name, one of `format_names`. Raises ExportError if it cannot be loaded."""
    if name in _OWN:
        module, _, constant = _OWN[name].partition(":")
        found: ExportFormat = getattr(import_module(module), constant)
        return found
    entry = find_plugin(ENTRY_POINTS, name)
    if entry is None:
        raise ExportError(f"there is no format {name!r} here: {', '.join(format_names())}")
    try:
        found = entry.load()
    except Exception as error:  # a plugin's code runs on import
        raise ExportError(f"the format {name!r} ({entry.value}) cannot be loaded: {error}") from error
    if not isinstance(found, ExportFormat):
        raise ExportError(f"the format {name!r} ({entry.value}) is not an ExportFormat")
    return found
