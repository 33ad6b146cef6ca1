"""Robots' drivers are found by their entry points."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from rise_engine.run.engine.drivers import driver_names, find_driver


def test_of_two_with_one_name_python_finds_the_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("one", "two"):
        folder = tmp_path / name / f"{name}-1.0.dist-info"
        folder.mkdir(parents=True)
        (folder / "entry_points.txt").write_text(f"[rise.drivers]\nmine = {name}:Robot\n")
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (tmp_path / name / f"{name}.py").write_text("class Robot: pass\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path / "one"), str(tmp_path / "two"), *sys.path])
    assert find_driver("mine").__module__ == "one" and {"mine", "simulated", "ros2"} <= driver_names()  # type: ignore[attr-defined]
