"""Runs the editor on an open workspace. Textual is prepared before this is imported."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import click

from rise_engine.author.edit.workspace import Workspace
from rise_engine.base.exit_status import USAGE
from rise_tui.config.display import DisplayOptions, choose_theme, detect_colors
from rise_tui.config.key_file import read_keys
from rise_tui.config.keymap import how_to_fix
from rise_tui.config.paths import PREFERENCES_NAME, state_folder
from rise_tui.config.preferences import Preferences, load_saved
from rise_tui.editor.app import EditApp
from rise_tui.editor.exploring import explore_saved
from rise_tui.editor.model.draft import draft_of
from rise_tui.editor.study import EditedStudy, SessionWatch


def run_editor(workspace: Workspace, sessions: SessionWatch, key_file: Path | None, display: DisplayOptions) -> int:
    """Until it is left; returns the exit status."""
    keys = read_keys(key_file) if key_file is not None else None
    if keys is not None and keys.problems:
        click.echo("\n".join((*map(str, keys.problems), how_to_fix(key_file))), err=True)
        return USAGE
    kept, _ = load_saved(state_folder() / PREFERENCES_NAME, Preferences)
    theme = choose_theme(display, detect_colors(display, os.environ), kept.theme)
    study = EditedStudy(workspace, draft_of(workspace))
    app = EditApp(study, sessions=sessions, theme=theme, keys=keys, notice=workspace.read_only, explorer=explore_saved)
    app.run(mouse=display.mouse)
    asyncio.run(study.close())
    return app.return_code or 0
