"""A shell on a terminal, as a reader of a tutorial has one."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyte

from tests.tui.terminals import Terminal, kill_engines

PROMPT = "$ "
SHELL = ("bash", "--norc", "--noprofile", "-i")
SSH = f"""#!/bin/sh
# Stands for a login on the computer $1, which is this one: a test has no server to log in to.
PS1="$1$ " exec {" ".join(SHELL)}
"""
ALTERNATE = 1049
"""The screen that a full-screen program has for itself
(https://invisible-island.net/xterm/ctlseqs/ctlseqs.html#h3-The-Alternate-Screen-Buffer)."""


class TwoScreens(pyte.Screen):
    """A screen that shows what stood there before, when a full-screen program has ended, as terminals do; pyte's does
    not."""

    _before: tuple[dict[int, dict[int, Any]], int, int] | None = None

    def set_mode(self, *modes: int, **options: Any) -> None:
        super().set_mode(*modes, **options)
        if ALTERNATE in modes and self._before is None:
            rows = {row: dict(cells) for row, cells in self.buffer.items()}
            self._before = rows, self.cursor.y, self.cursor.x
            self.erase_in_display(2)

    def reset_mode(self, *modes: int, **options: Any) -> None:
        super().reset_mode(*modes, **options)
        if ALTERNATE in modes and self._before is not None:
            rows, line, column = self._before
            self._before = None
            self.erase_in_display(2)
            for row, cells in rows.items():
                self.buffer[row].update(cells)
            self.cursor_position(line + 1, column + 1)


@contextmanager
def shell(folder: Path, size: tuple[int, int] = (80, 24)) -> Iterator[Terminal]:
    """A shell in an empty folder, with the commands of this checkout, and an `ssh` that leads to the same computer."""
    home, programs = folder / "home", folder / "bin"
    for new in (home, programs, folder / "lab"):
        new.mkdir()
    ssh = programs / "ssh"
    ssh.write_text(SSH, encoding="utf-8")
    ssh.chmod(0o700)
    own = {
        "PS1": PROMPT,
        "PATH": os.pathsep.join((str(programs), str(Path(sys.executable).parent), os.environ["PATH"])),
        "HOME": str(home),
        "RISE_SESSIONS": str(home / "rise-sessions"),  # where they are when nobody says otherwise
        "EDITOR": "true",
        "PYTHON_BASIC_REPL": "1",
        "BASH_SILENCE_DEPRECATION_WARNING": "1",
    }
    found = Terminal(
        home=str(home),
        size=size,
        program=SHELL,
        folder=folder / "lab",
        environment=own,
        screen=TwoScreens,
    )
    try:
        found.until_screen(PROMPT.strip())
        yield found
    finally:
        found.process.kill()
        found.process.wait()
        os.close(found.master)
        kill_engines(found.home)
