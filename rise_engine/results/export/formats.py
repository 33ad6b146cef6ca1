"""Every export format, by its name: ours, and those that installed packages bring as entry points.

A format of ours is a module in this package with a constant `FORMAT`, and a line in `_OWN`.
"""

from __future__ import annotations

from importlib import import_module

from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.results.export.format import ExportError, ExportFormat

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
        raise ExportError(f"the format {name!r} ({entry.value}) is no ExportFormat")
    return found
