"""Entry points, read as Python reads them, only quicker."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from rise_engine.entries import Entry, entries
from rise_engine.robots import drivers

GROUPS = ("rise.robots", "rise.drivers", "rise.bridges", "rise.checks", "rise.doctors", "console_scripts", "pytest11")


@pytest.mark.parametrize("group", GROUPS)
def test_they_are_those_that_python_finds(group: str) -> None:
    ours = {(each.name, each.value) for each in entries(group)}
    assert ours == {(each.name, each.value) for each in entry_points(group=group)} and ours


def test_one_is_loaded_as_python_loads_it() -> None:
    (theirs,) = [each for each in entry_points(group="rise.drivers") if each.name == "simulated"]
    (ours,) = [each for each in entries("rise.drivers") if each.name == "simulated"]
    assert ours.load() is theirs.load() and ours.module == "rise_adapters.simulated"


def test_what_is_written_oddly_is_read_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "odd-1.0.dist-info"
    folder.mkdir()
    text = "; x\n[other]\na = b\n[my.group]\n# four = x\n two=os.path : join [extra]\n\nthree = json\n[last]\nc = d\n"
    (folder / "entry_points.txt").write_text(text)
    monkeypatch.setattr(sys, "path", [str(tmp_path / "nothing"), str(tmp_path)])
    found = list(entries("my.group"))
    assert found == [Entry("two", "os.path : join [extra]"), Entry("three", "json")]
    import json
    import os

    assert [each.load() for each in found] == [os.path.join, json]


def test_of_two_with_one_name_python_finds_the_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one", "two"):
        folder = tmp_path / name / f"{name}-1.0.dist-info"
        folder.mkdir(parents=True)
        (folder / "entry_points.txt").write_text(f"[rise.drivers]\nmine = {name}:Robot\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path / "one"), str(tmp_path / "two"), *sys.path])
    assert drivers()["mine"].value == "one:Robot" and "simulated" in drivers()


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("rise_engine.serve", {"importlib.metadata", "textual", "click"}),
        ("rise_tui.app", {"importlib.metadata", "lxml", "tomllib", "rise_engine.scenario.loader", "secrets"}),
        ("rise_engine.link.socket_client", {"importlib.metadata", "lxml", "tomllib", "rise_engine.scenario.loader"}),
    ],
)
def test_what_takes_long_to_import_is_not_imported_before_it_is_needed(module: str, absent: set[str]) -> None:
    code = f"import sys, {module}; print(sorted({absent!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
