"""Formats that others bring."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints

import pytest

from rise_engine.base import plugins
from rise_engine.results.export import format
from rise_engine.results.export.format import ExportError, ExportFormat, format_names, load_format


def test_every_format_of_ours_is_called_as_it_is_listed() -> None:
    assert {"tables", "csv", "jsonl"} <= set(format_names())
    for name in format_names():
        found = load_format(name)
        assert isinstance(found, ExportFormat)
        assert (found.name, bool(found.about)) == (name, True)
        assert (found.suffix == "") == (found.shape == "folder") or found.shape == "file-per-session"


def test_formats_of_other_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    brought = [
        EntryPoint("again", "rise_engine.results.export.records:CSV", format.ENTRY_POINTS),
        EntryPoint("broken", "rise_engine.results.export.nothing:FORMAT", format.ENTRY_POINTS),
        EntryPoint("other", "rise_engine.results.export.records:COLUMNS", format.ENTRY_POINTS),
        EntryPoint("csv", "rise_engine.results.export.nothing:FORMAT", format.ENTRY_POINTS),
    ]
    monkeypatch.setattr(plugins, "_installed_on", lambda path, group: EntryPoints(brought).select(group=group))
    assert format_names()[-3:] == ["again", "broken", "other"]
    assert load_format("again").name == "csv" and load_format("csv").name == "csv"
    with pytest.raises(ExportError, match=r"the format 'broken' .* cannot be loaded: No module named"):
        load_format("broken")
    with pytest.raises(ExportError, match="is not an ExportFormat"):
        load_format("other")
    with pytest.raises(ExportError, match=r"there is no format 'none' here: .*csv.*, again, broken, other"):
        load_format("none")
