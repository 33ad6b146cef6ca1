"""Opens the editor of a study's files over the console, or over the screen of a study."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from textual.app import App

from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.workspace import Workspace
from rise_engine.study.review import findings_of_files
from rise_tui.editor.model.draft import StudyDraft, draft_of
from rise_tui.editor.screen import EditScreen
from rise_tui.editor.study import EditedStudy

RUNS = "the running session keeps its own copy of the files; what you save applies to the next one"


async def open_editor(app: App[object], folder: str, refuse: Callable[[str], None], *, runs: bool) -> None:
    """`refuse` is told why it does not open. `runs`: whether a session runs here, so that the stop key must work."""

    def read() -> tuple[Workspace, StudyDraft]:
        workspace = Workspace(Path(folder), also_check=findings_of_files)
        return workspace, draft_of(workspace)

    try:
        workspace, draft = await asyncio.to_thread(read)
    except EditRefused as refused:
        refuse(f"the editor cannot open: {refused}")
        return
    notice = workspace.read_only or (RUNS if runs else "")
    await app.push_screen(EditScreen(EditedStudy(workspace, draft), notice=notice, may_suspend=not runs))


def tell_editor(app: App[object]) -> None:
    """The stop key was pressed: the editor that lies over the console says so, for it hides what came of it."""
    for screen in app.screen_stack:
        if isinstance(screen, EditScreen):
            screen.say("STOP was sent: the console below shows what the robot has confirmed", "fault")
