"""Two real processes and one study: an editor at a terminal, and somebody who writes the same file meanwhile."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tui.terminals import Terminal, press_keys, terminal

pytestmark = pytest.mark.pty

STUDY = Path(__file__).parents[3] / "scenarios" / "greeting"
ESCAPE, ENTER, TAB = b"\x1b", b"\r", b"\t"
OLD, THEIRS = "My name is Floka, and I am a robot. Well, the head of one.", "Call me Floka."
REWRITE = """import sys
from pathlib import Path
path = Path(sys.argv[1])
new = path.parents[2] / "new"
new.write_text(path.read_text("utf-8").replace(*sys.argv[2:]), "utf-8")
new.replace(path)  # in one step: a half written file would be another change
"""


def test_one_changes_what_the_other_has_changed_and_chooses(tmp_path: Path) -> None:
    folder = tmp_path / "study"
    shutil.copytree(STUDY, folder)
    file = folder / "acts" / "greeting.xml"
    before = file.read_text("utf-8")

    def change(it: Terminal, choice: bytes) -> None:
        """Here and there; then what is to stay is chosen."""
        press_keys(it, ENTER)
        it.until_screen("as it was")
        press_keys(it, b"\x15", b"I am Floka.")
        press_keys(it, ENTER)
        it.until_screen("1 change unsaved")
        subprocess.run([sys.executable, "-c", REWRITE, str(file), OLD, THEIRS], check=True)
        it.until_screen("Changed here and on the disk")
        press_keys(it, choice)
        it.until_screen("Changed here and on the disk", gone=True)

    with terminal("edit", str(folder), size=(80, 24)) as it:
        it.until_screen("ACTS")
        press_keys(it, b"/", b"R_Introduction", ENTER, b"\x1b[H", ENTER)
        it.until_screen("waits for")
        press_keys(it, TAB)
        it.until_screen("What is said")
        change(it, b"o")
        it.until_screen(THEIRS)
        assert file.read_text("utf-8") == before.replace(OLD, THEIRS)
        file.write_text(before, "utf-8")
        it.until_screen("My name is Floka")
        change(it, ESCAPE)
        it.until_screen("1 change unsaved")
        press_keys(it, b"\x0f")
        it.until_screen("enter saves")
        press_keys(it, ENTER)
        it.until_screen("saved: acts/greeting.xml")
        press_keys(it, ESCAPE, ESCAPE, ESCAPE)
        assert it.ended() == 0
    assert file.read_text("utf-8") == before.replace(OLD, "I am Floka.")
