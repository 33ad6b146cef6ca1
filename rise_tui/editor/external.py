"""A file of the study in the author's own editor, at a line, and what came of it."""

from __future__ import annotations

import asyncio
import os
import shlex
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from textual.app import App

from rise_engine.author.edit.edits import ReplaceFile
from rise_tui.editor.model.draft import FilePlace
from rise_tui.editor.page import EditFrame
from rise_tui.rendering.terminal_app import TerminalApp

USUAL_EDITORS = ("nano", "vim", "vi")


def editor_command() -> list[str]:
    """The program that `$VISUAL` or `$EDITOR` names, else the first usual one."""
    named = os.environ.get("VISUAL") or os.environ.get("EDITOR")
    if named:
        return shlex.split(named)
    folders = os.environ.get("PATH", os.defpath).split(os.pathsep)
    return [next((each for each in USUAL_EDITORS if any(Path(at, each).is_file() for at in folders)), "vi")]


def arguments_at(command: list[str], path: str, line: int) -> list[str]:
    """The command line that opens a file at a line, as this editor wants it.

    >>> arguments_at(["vim"], "a.xml", 3), arguments_at(["hx"], "a.xml", 3)
    (['vim', '+3', 'a.xml'], ['hx', 'a.xml:3'])
    >>> arguments_at(["code"], "a.xml", 3)
    ['code', '--wait', '--goto', 'a.xml:3']
    """
    name = Path(command[0]).name
    if name in ("code", "codium", "code-insiders"):
        waits = [] if "--wait" in command or "-w" in command else ["--wait"]
        return [*command, *waits, "--goto", f"{path}:{line}"]
    if name in ("hx", "helix", "subl", "zed"):
        return [*command, f"{path}:{line}"]
    return [*command, f"+{line}", path]


async def edit_file(app: App[Any], frame: EditFrame, place: FilePlace) -> None:
    """Give the terminal to the editor until it ends; then the caller looks what has changed on the disk.

    A file without unsaved changes is edited where it lies, and read again; else a copy of the draft is, and what came
    of it is one more change of the draft. :raises EditRefused: the draft cannot take it.
    """
    draft = frame.study.draft
    content = draft.files.get(place.file)
    if place.file in draft.above:  # of the study that this scenario is of: it lies outside, and is no part of the draft
        await _run(app, frame, place.file, place.line)
        return
    if content is None:
        frame.say(f"{place.file} no longer exists", "wait")
        return
    if content == draft.saved.get(place.file):
        await _run(app, frame, str(Path(draft.folder, place.file)), place.line)
        return
    written = await _edit_copy(app, frame, place, content)
    if written != content:
        try:
            text = written.decode("utf-8")
        except UnicodeDecodeError:
            frame.say(f"{place.file} was not read: it is not UTF-8", "fault")
            return
        frame.make(ReplaceFile(place.file, text))


async def _edit_copy(app: App[Any], frame: EditFrame, place: FilePlace, content: bytes) -> bytes:
    """What came of a copy of the draft."""
    with tempfile.TemporaryDirectory(prefix="rise-draft-") as folder:
        copy = Path(folder, Path(place.file).name)
        await asyncio.to_thread(copy.write_bytes, content)
        await _run(app, frame, str(copy), place.line)
        return await asyncio.to_thread(copy.read_bytes)


async def _run(app: App[Any], frame: EditFrame, path: str, line: int) -> None:
    arguments = arguments_at(editor_command(), path, line)
    try:
        with app.suspend():
            await asyncio.to_thread(subprocess.run, arguments, check=False)
    except OSError as error:
        frame.say(f"{arguments[0]} could not be started ({error.strerror}): name your editor in $EDITOR", "fault")
    if isinstance(app, TerminalApp):
        app.repaint_everything()
