"""What an author waits for: a step back and forward, a save of five files, a rule's drawing. It uses LabLinking, and a
rule of 40 states and 120 transitions. Each step includes the check of all files, as in the editor.

The floors in the same run: parse the changed files and read the bytes of all; write the same bytes as safely, one file
after the other; parse the file of the rule.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

from lxml import etree
from measure import Report, interleave

from rise_engine.author.edit.edits import Rename, SetParameter, SetSetting, SetStartValue
from rise_engine.author.edit.read_outline import read_outline
from rise_engine.author.edit.workspace import Workspace
from rise_engine.scenario.loader import load
from rise_tui.editor.model.draft import draft_of
from rise_tui.editor.model.rule_graph import GraphSpot, draw_rule, lay_out_rule

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
from tests.tui.editor.long_rule import long_rule_files  # noqa: E402

UNDO_MS, SAVE_MS, GRAPH_MS = 20.0, 150.0, 10.0
EVERYWHERE = Rename("event", "next", "go_on")
"""A step that changes several files."""


def steps(workspace: Workspace) -> tuple[Callable[[], None], Callable[[], None]]:
    """Seconds of a step back and forward again; and the floor of both."""
    before = workspace.files
    workspace.apply(EVERYWHERE)
    after = workspace.files
    changed = [name for name in after if after[name] != before[name] and name.endswith(".xml")]

    def ours() -> None:
        assert workspace.undo() is not None
        assert draft_of(workspace).files == before
        assert workspace.redo() is not None
        assert draft_of(workspace).files == after

    def least() -> None:
        for files in (before, after):
            for name in changed:
                etree.fromstring(files[name])
            for data in files.values():
                sha256(data)

    return ours, least


def saves(workspace: Workspace, folder: Path) -> tuple[Callable[[], float], Callable[[], float]]:
    """Seconds of a save of five files, each time with other contents; and the floor."""
    count = 0

    def change() -> None:
        nonlocal count
        count += 1
        workspace.apply(
            SetParameter("R_Apology", "2", "message", f"I am sorry, {count}."),
            SetParameter("R_Welcome", "2", "message", f"Welcome, {count}."),
            SetParameter("R_Filler_Hm", "1", "message", f"Hm, {count}."),
            SetStartValue("pause_ms", 600 + count),
            SetSetting(("title",), f"LabLinking {count}"),
        )

    def ours() -> float:
        change()
        begin = time.perf_counter()
        written = workspace.save().files
        seconds = time.perf_counter() - begin
        assert len(written) == 5, written
        return seconds

    def least() -> float:
        names = sorted(workspace.files)[:5]
        begin = time.perf_counter()
        for name in names:
            beside = folder / "floor.tmp"
            with beside.open("wb") as file:
                file.write(workspace.files[name])
                file.flush()
                os.fsync(file.fileno())
            beside.replace(folder / "floor.xml")
        return time.perf_counter() - begin

    return ours, least


def drawings() -> tuple[Callable[[], None], Callable[[], None]]:
    """Seconds of the drawing of 40 states and 120 transitions; and the floor."""
    files = long_rule_files()
    rule = read_outline(load("/nowhere", held=files).parts).rule("Course")
    assert rule is not None
    assert (len(rule.states), sum(len(state.transitions) for state in rule.states)) == (40, 120)

    def ours() -> None:
        layout = lay_out_rule(rule, 76)
        assert layout is not None
        draw_rule(layout, GraphSpot(rule.initial), {})

    def least() -> None:
        etree.fromstring(files[rule.file])

    return ours, least


def main() -> bool:
    root = Path(tempfile.mkdtemp(prefix=".bench-", dir=ROOT))  # /tmp may not be a disk
    os.environ["XDG_STATE_HOME"] = str(root / "state")
    report = Report("What an author waits for")
    try:
        shutil.copytree(ROOT / "scenarios" / "lablinking", root / "study")
        workspace = Workspace(root / "study")
        ours, least = steps(workspace)
        figures = interleave({"ours": (ours, 2), "floor": (least, 2)}, rounds=9)
        report.row("undo, redo: floor", f"{figures['floor'].median * 1000:.2f} ms")
        report.target("undo, redo, ms", figures["ours"].median * 1000, UNDO_MS, at_least=False)
        workspace.undo()
        save, write = saves(workspace, root)
        saved = interleave({"ours": (save, 0), "floor": (write, 0)}, rounds=9)
        report.row("save of five files: floor", f"{saved['floor'].median * 1000:.2f} ms", "on the clock, with fsync")
        report.target("save of five files, ms", saved["ours"].median * 1000, SAVE_MS, at_least=False)
        workspace.close()
        ours, least = drawings()
        drawn = interleave({"ours": (ours, 1), "floor": (least, 1)}, rounds=15)
        report.row("40 states and 120 ways drawn: floor", f"{drawn['floor'].median * 1000:.2f} ms")
        report.target("40 states and 120 ways drawn, ms", drawn["ours"].median * 1000, GRAPH_MS, at_least=False)
    finally:
        shutil.rmtree(root, ignore_errors=True)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
