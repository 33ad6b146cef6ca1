"""Plays a page on a terminal: every key, every typed text and everything that is to be seen is read from the page.

What a page says, in a numbered step or in a line that begins with "Press" or "Type":

- ``**a**``, ``**enter**``, ``**ctrl+o**`` is a key that is pressed;
- ``type `Hello!` `` is a text that is typed;
- ``you see `Hello!` `` is what must be on the screen then, and ``you see no `x` `` what must not;
- a line of an indented block is a command that is typed into the shell;
- ``**close the window**`` closes the terminal with all that runs in it, and opens another one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

from tests.tui.terminals import Terminal

STEP = re.compile(r"^(?:\d+\. |(?:Press|Type|You see) )")
MARK = re.compile(
    r"\*\*(?P<key>[^*`]+)\*\*|[Tt]ype\s+`(?P<typed>[^`]+)`|[Yy]ou\s+see\s+no\s+`(?P<gone>[^`]+)`|"
    r"[Yy]ou\s+see\s+`(?P<seen>[^`]+)`"
)
COMMAND = re.compile(r"^ {4}(?P<command>\S.*)$")
KEYS = {
    "enter": b"\r",
    "esc": b"\x1b",
    "tab": b"\t",
    "shift+tab": b"\x1b[Z",
    "space": b" ",
    "backspace": b"\x7f",
    "up": b"\x1b[A",
    "down": b"\x1b[B",
    "right": b"\x1b[C",
    "left": b"\x1b[D",
    "ins": b"\x1b[2~",
    "del": b"\x1b[3~",
    "home": b"\x1b[H",
    "end": b"\x1b[F",
    "F2": b"\x1bOQ",
    "F3": b"\x1bOR",
    "F4": b"\x1bOS",
    "F9": b"\x1b[20~",
}
"""Keys that are more than their character, as xterm sends them."""
CLOSE = "close the window"
QUIET = 0.15
"""Seconds without a byte after which the next key is pressed: longer than a console waits for the rest of an escape
sequence, so that `esc` and the next key stay two."""


@dataclass(frozen=True)
class Step:
    kind: Literal["key", "typed", "seen", "gone", "command"]
    text: str
    line: int
    """Of the page."""


def key_bytes(name: str) -> bytes:
    """What a terminal sends for a key. Raises ValueError for one that is none."""
    if name in KEYS:
        return KEYS[name]
    if name.startswith("ctrl+") and len(name) == 6:
        return bytes([ord(name[5].upper()) - 64])
    if len(name) == 1:
        return name.encode()
    raise ValueError(f"`{name}` is no key")


def steps_of(page: str) -> Iterator[Step]:
    """What a page says to do, in order. A step goes on in the lines that are indented below it."""
    block, begin = "", 0
    fenced = False
    for number, line in enumerate([*page.splitlines(), ""], 1):
        fenced ^= line.startswith("```")
        if block and line.startswith("  ") and not fenced:
            block += f"\n{line}"
            continue
        for mark in MARK.finditer(block):
            kind = mark.lastgroup
            assert kind is not None
            yield Step(kind, mark[kind], begin + block.count("\n", 0, mark.start()))  # type: ignore[arg-type]
        block, begin = (line, number) if STEP.match(line) and not fenced else ("", 0)
        command = COMMAND.match(line)
        if command is not None and not fenced:
            yield Step("command", command["command"].partition("  #")[0].rstrip(), number)


def play(page: str, terminal: Terminal, show: Callable[[Step], None] | None = None, *, between: float = QUIET) -> None:
    """Do what a page says, step by step.

    :param show: called after each step, with the screen still.
    :param between: seconds without a byte that are waited for between two keys. 0: many come in one piece, as over a
        slow line, which the editor takes in their order; a console that starts something would take them for a paste.
    :raises AssertionError: what should be seen is not there, with the page's line and the screen.
    """
    for step in steps_of(page):
        if step.kind in ("seen", "gone"):
            if step.kind == "gone":
                terminal.still()
            try:
                terminal.until_screen(step.text, gone=step.kind == "gone")
            except AssertionError as error:
                raise AssertionError(f"line {step.line} of the page: {error}") from None
        elif step.text == CLOSE:
            terminal.close_and_open()
        elif step.kind == "key":
            terminal.press(key_bytes(step.text))
        else:
            terminal.press(step.text.encode())
            if step.kind == "command":
                terminal.still(QUIET)
                terminal.press(b"\r")
        if show is not None:
            terminal.still()
        elif step.text == "esc":  # what came at once behind an Esc would be one key with it
            terminal.still(QUIET)
        elif between and step.kind not in ("seen", "gone"):
            terminal.still(between)
        if show is not None:
            show(step)
