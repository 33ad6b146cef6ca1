"""What every export format is to the command that writes it, and which formats are installed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.base.errors import RiseError
from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.model import SessionData
from rise_engine.study.model import Study, StudyStanding

Shape: TypeAlias = Literal["file", "file-per-session", "folder"]
"""What an export becomes. file: one, whatever the number of sessions; file-per-session: one of each, in a new folder
when there are several; folder: always a new one."""


class ExportContext(Struct):
    """What is the same for all sessions of one export."""

    level: ExportLevel
    study: Study | None = None
    standing: StudyStanding | None = None
    """Of the study, when all of it is exported."""
    folder: Path | None = None
    """The folder in which the files of the export will lie when it is whole; None: where they are written."""
    factors: tuple[str, ...] = ()
    """The factors of all sessions of the export, in their order: columns of tables."""
    spreadsheet_safe: bool = False
    """Whether cells that a spreadsheet would carry out get an apostrophe; formats of tables ask for it."""
    trial_columns: tuple[str, ...] | None = None
    """What the scenarios of all sessions declare as columns of trials (`[trials]`), in their order; None: no scenario
    says what a trial is."""
    wide: bool = False
    """Whether the tables have a row for each participant besides."""
    warnings: list[str] = field(default_factory=list)
    """Sentences for whoever exports; a format appends to it."""


class ExportError(RiseError):
    """An export or a bundle cannot be made or read; a sentence, or several lines."""


class ExportFormat(Struct, frozen=True):
    """One format.

    `write` gets a path that does not exist yet (a file's, or that of a folder that it makes), the sessions one after
    the other, and the context. It must take one session at a time and keep none of them: a study may have hundreds.
    With `file-per-session` it is called once for each, with that one alone. It raises ExportError, or OSError.
    """

    name: str
    about: str
    """In a line of help."""
    shape: Shape
    suffix: str
    """With its dot; empty for a folder."""
    write: Callable[[Path, Iterable[SessionData], ExportContext], None]
    spreadsheet_safe: bool = False
    """Whether it does what `ExportContext.spreadsheet_safe` asks for."""
    extra: str = ""
    """The extra of the package that it needs."""


_OWN = {
    "tables": "rise_engine.results.export.tables:FORMAT",
    "csv": "rise_engine.results.export.records:CSV",
    "jsonl": "rise_engine.results.export.records:JSONL",
    "eaf": "rise_engine.results.export.eaf:FORMAT",
    "textgrid": "rise_engine.results.export.textgrid:FORMAT",
    "boris": "rise_engine.results.export.boris:FORMAT",
    "xdf": "rise_engine.results.export.xdf:FORMAT",
    "bids": "rise_engine.results.export.bids:FORMAT",
}
"""Where each is, in the order in which help lists them. Loaded when it is asked for: some take a while."""
ENTRY_POINTS = "rise.exports"
"""The group of entry points that name an ExportFormat each."""


def format_names() -> list[str]:
    """What can be asked for here. Nothing is loaded."""
    others = sorted(installed_plugins(ENTRY_POINTS).names - _OWN.keys())
    return [*_OWN, *others]


def load_format(name: str) -> ExportFormat:
    """A format by its name, one of `format_names`. Raises ExportError when what brings it cannot be loaded."""
    if name in _OWN:
        module, _, constant = _OWN[name].partition(":")
        found: ExportFormat = getattr(import_module(module), constant)
        return found
    entry = find_plugin(ENTRY_POINTS, name)
    if entry is None:
        raise ExportError(f"there is no format {name!r} here: {', '.join(format_names())}")
    try:
        found = entry.load()
    except Exception as error:  # code of others runs as it is imported
        raise ExportError(f"the format {name!r} ({entry.value}) cannot be loaded: {error}") from error
    if not isinstance(found, ExportFormat):
        raise ExportError(f"the format {name!r} ({entry.value}) is not an ExportFormat")
    return found
