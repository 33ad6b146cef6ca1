"""The editor on a terminal of 120x40, with LabLinking and a rule of 40 states and 120 transitions: the bytes of a key,
the seconds until a letter is on the screen, and the seconds until the editor is there.

The floors in the same run: a bare Textual app with one field, and one with five panes.
"""

from __future__ import annotations

import os
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

from console_bytes import DOWN, UP, cost
from console_terminal import Pty, environment_in
from measure import Report
from start_console import BARE, until_painted

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
LETTERS, STARTS, MOVES = 60, 7, 8
ECHO_MS, ECHO_BYTES, MOVE_BYTES = 16.0, 300, 1500
TIMES_FIELD = 4.0
"""For the slowest letters, compared with the bare field's: both suffer from the machine's other work."""
TIMES_BARE = 3.0
"""The aim was 2. The bare app is Textual's import and little else (150 ms of processor time); the editor's imports of
the engine take 90 ms, its own modules 60, the study itself 30."""
GAP = 0.15
"""Seconds between two letters, after which all background work of a letter has ended."""

FIELD = """
from textual.app import App
from textual.widgets import Input

class Field(App):
    ENABLE_COMMAND_PALETTE = False

    def compose(self):
        yield Input(placeholder="READY")

Field().run()
"""


def write_long_study(folder: Path) -> None:
    """Write a study whose main path has 40 states and 120 transitions."""
    from tests.tui.editor.long_rule import long_rule_files

    for name, data in long_rule_files().items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)


def press(terminal: Pty, *keys: bytes) -> None:
    """Press one key after the other, each when the screen is painted."""
    for key in keys:
        os.write(terminal.master, key)
        while terminal.read(0.3):
            pass


def echoes(editor: Pty, bare: Pty) -> tuple[list[float], list[float], list[int]]:
    """Seconds from a letter to the first bytes, in the editor and in the bare field, and all bytes of the editor's."""
    seconds: dict[Pty, list[float]] = {editor: [], bare: []}
    sizes = []
    for number in range(LETTERS):
        for terminal in (editor, bare):
            before = terminal.count
            begin = time.perf_counter()
            os.write(terminal.master, b"abcdefgh"[number % 8 : number % 8 + 1])
            while terminal.count == before:
                terminal.read(1)
            seconds[terminal].append(time.perf_counter() - begin)
            terminal.read_for(GAP)
            if terminal is editor:
                sizes.append(terminal.count - before)
    return seconds[editor], seconds[bare], sizes


def percentile(values: list[float], part: float) -> float:
    return sorted(values)[min(len(values) - 1, int(len(values) * part))]


def main() -> bool:
    root = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    Path(root, "run").mkdir(0o700)
    environment = environment_in(root)
    study, long_study = Path(root, "study"), Path(root, "long")
    shutil.copytree(ROOT / "scenarios" / "lablinking", study)
    write_long_study(long_study)
    command = [str(Path(sys.executable).with_name("rise-tui")), "edit"]
    terminals: list[Pty] = []

    def opened(arguments: list[str], mark: bytes) -> Pty:
        terminals.append(Pty(arguments, environment))
        terminals[-1].until(mark)
        terminals[-1].read_for(1)
        return terminals[-1]

    try:
        editor = opened([*command, str(study)], b"R_Praise")
        moved = [cost(editor, key) for _ in range(MOVES // 2) for key in (DOWN, UP)]
        press(editor, DOWN, b"\r", DOWN, b"\t", DOWN, b"\r")
        editor.until(b"as it was")
        bare = opened([sys.executable, "-c", FIELD], b"READY")
        ours, floor, sizes = echoes(editor, bare)
        editor.close()
        rule = opened([*command, str(long_study)], b"R_Welcome")
        press(rule, b"/", b"Course", b"\r", b"\r")
        rule.until(b"Red cubes")
        walked = [cost(rule, DOWN) for _ in range(5 * MOVES)]
        starts: dict[str, list[float]] = {"the editor": [], "a bare app with five panes": []}
        for number in range(STARTS + 1):
            for name, arguments, mark in (
                ("the editor", [*command, str(study)], b"R_Task1_Step1"),
                ("a bare app with five panes", [sys.executable, "-c", BARE], b"LIVE"),
            ):
                seconds = until_painted(arguments, mark, dict(environment))
                if number:  # the first round fills the caches
                    starts[name].append(seconds)
    finally:
        for each in terminals:
            if each.process.poll() is None:
                each.close()
        shutil.rmtree(root, ignore_errors=True)

    report = Report("The editor on a terminal, 120x40", "wall time, bytes")
    for name, values in (("a letter in a field", ours), ("floor: in the bare field", floor)):
        report.row(
            name, f"{statistics.median(values) * 1000:.1f} ms", f"95 of 100 {percentile(values, 0.95) * 1000:.1f}"
        )
    report.target("ms, half of the letters", statistics.median(ours) * 1000, ECHO_MS, at_least=False)
    slowest = percentile(ours, 0.95) / percentile(floor, 0.95)
    report.target("times the bare field, 95 of 100 letters", slowest, TIMES_FIELD, at_least=False)
    report.target("bytes of a letter", statistics.median(sizes), ECHO_BYTES, at_least=False)
    for name, each in (("list", moved), ("graph", walked)):
        report.row(
            f"a cursor moved in the {name}", f"{statistics.median(each):,.0f} B", f"{min(each):,} to {max(each):,}"
        )
    report.target("bytes of a cursor moved in the list", statistics.median(moved), MOVE_BYTES, at_least=False)
    report.target("bytes of one moved in the graph", statistics.median(walked), MOVE_BYTES, at_least=False)
    for name, seconds in starts.items():
        report.row(f"from nothing to {name}", f"{statistics.median(seconds) * 1000:.0f} ms")
    mine, least = (statistics.median(seconds) for seconds in starts.values())
    report.target("times the bare app", mine / least, TIMES_BARE, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
