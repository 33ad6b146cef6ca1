"""`rise-tui edit DIR`: opens the editor on a study's files."""

from __future__ import annotations

import asyncio
import os
import shlex
import sys
from pathlib import Path

import click

from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.study_folder import scenarios_below
from rise_engine.author.edit.workspace import Workspace
from rise_engine.base.exit_status import REFUSED
from rise_engine.cli.options import ROBOT
from rise_engine.run.protocol.registry import RegistryError, ask_summary
from rise_engine.scenario.files.study_paths import PARTICIPANTS_FILE, SCENARIO_FILE, STUDY_FILE
from rise_engine.session.folder import running_sessions
from rise_engine.study.review import findings_of_files
from rise_tui.cli.command_line import KEYS, MOUSE, THEME, PlainTerminal, not_started, read_key_file
from rise_tui.cli.stop_session import stop_session
from rise_tui.config.display import (
    DEFAULT_FRAMES,
    DisplayOptions,
    choose_theme,
    detect_colors,
    prepare_textual,
    with_detected_colors,
)
from rise_tui.config.preferences import PREFERENCES_NAME, Preferences, expand_home, load_saved, state_folder
from rise_tui.editor.model.draft import draft_of
from rise_tui.editor.study import EditedStudy, RunningHere, explore_saved


@click.command()
@click.argument("folder", metavar="DIR")
@ROBOT
@THEME
@MOUSE
@KEYS
def edit(folder: str, robot: str | None, theme: str | None, mouse: str, keys: str | None) -> None:
    """Change the study in DIR: acts, memory, keys, settings, tables. Nothing starts on a robot.

    DIR/study.toml opens the design of a study and its participants.
    """
    display = DisplayOptions(theme or "", "auto", mouse == "on", DEFAULT_FRAMES)
    sys.exit(_edit(folder, robot=robot, keys=keys, display=display))


def _participant(socket: str) -> str:
    """The participant's name; empty: unknown."""
    try:
        summary = ask_summary(socket)
    except RegistryError:
        return ""
    return (summary.participant or "") if summary is not None else ""


class SessionsHere:
    """Implements `rise_tui.editor.study.SessionWatch` for the sessions of this computer."""

    def find(self, folder: Path) -> RunningHere | None:
        """The latest running session of this scenario."""
        try:
            found = running_sessions(str(folder))
        except OSError:
            return None
        for holder in found.values():
            if holder is not None and holder.is_this_computer:
                return RunningHere(holder.socket, _participant(holder.socket))
        return None

    def stop(self, session: RunningHere) -> str:
        """Stop everything in that session, attached as an observer."""
        if why := stop_session(session.socket, "editor"):
            return f"THE STOP DID NOT REACH THE SESSION ({why}): use its console"
        return "STOPPED: the session of this study was told to stop everything; its console releases it"


def _edit(folder: str, *, robot: str | None, keys: str | None, display: DisplayOptions) -> int:
    """Show the editor until the user leaves it; returns the exit status."""
    if not PlainTerminal().interactive:
        raise not_started("the editor needs a terminal; `rise-engine edit` needs none")
    path = expand_home(folder)
    of_study = path.name in (STUDY_FILE, PARTICIPANTS_FILE)
    path = path.parent if of_study or path.name == SCENARIO_FILE else path
    below = scenarios_below(path) if not of_study else []
    if len(below) > 1:
        raise not_started(
            f"{folder} is a study of several scenarios. Which one? Type one of:",
            *(f"  rise-tui edit {shlex.quote(os.path.normpath(each))}" for each in below),
            f"  rise-tui edit {shlex.quote(os.path.normpath(path / STUDY_FILE))}  for its design",
        )
    path = Path(os.path.normpath(below[0])) if below else path
    try:
        workspace = Workspace(path, robot=robot, also_check=findings_of_files)
    except EditRefused as refused:
        raise not_started(str(refused), status=REFUSED) from None
    display = with_detected_colors(display, os.environ)
    prepare_textual(display)  # before anything imports Textual
    key_file = read_key_file(keys)
    from rise_tui.editor.screen import EditApp

    kept, _ = load_saved(state_folder() / PREFERENCES_NAME, Preferences)
    theme = choose_theme(display, detect_colors(display, os.environ), kept.theme)
    study = EditedStudy(workspace, draft_of(workspace))
    app = EditApp(
        study,
        sessions=SessionsHere(),
        theme=theme,
        keys=key_file,
        notice=workspace.read_only,
        explorer=explore_saved,
    )
    app.run(mouse=display.mouse)
    asyncio.run(study.close())
    return app.return_code or 0
