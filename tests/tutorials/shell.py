"""A shell on a terminal, as a reader of a tutorial has one."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.console.terminals import Terminal, kill_engines

PROMPT = "$ "


@contextmanager
def shell(folder: Path, size: tuple[int, int] = (80, 24)) -> Iterator[Terminal]:
    """A shell in an empty folder, with the commands of this checkout."""
    home = folder / "home"
    home.mkdir()
    (folder / "work").mkdir()
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    own = {
        "PS1": PROMPT,
        "PATH": programs,
        "HOME": str(home),
        "EDITOR": "true",
        "BASH_SILENCE_DEPRECATION_WARNING": "1",
    }
    found = Terminal(
        home=str(home),
        size=size,
        program=("bash", "--norc", "--noprofile", "-i"),
        folder=folder / "work",
        environment=own,
    )
    try:
        found.until_screen(PROMPT.strip())
        yield found
    finally:
        found.process.kill()
        found.process.wait()
        os.close(found.master)
        kill_engines(found.home)
