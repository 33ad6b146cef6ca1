"""`rise-tui edit DIR`: opens the editor on a study's files."""

from __future__ import annotations

import asyncio
import os
import shlex
from pathlib import Path

import click

from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.study_folder import scenarios_below
from rise_engine.author.edit.workspace import Workspace
from rise_engine.base.errors import RiseError
from rise_engine.base.exit_status import REFUSED, USAGE
from rise_engine.run.client import connect
from rise_engine.run.protocol.registry import RegistryError, ask_summary
from rise_engine.scenario.file_names import PARTICIPANTS_FILE, SCENARIO_FILE, STUDY_FILE
from rise_engine.session.folder import running_sessions
from rise_engine.study.review import findings_of_files
from rise_tui.cli.terminal import PlainTerminal
from rise_tui.config.display import DisplayOptions, prepare_textual, with_detected_colors
from rise_tui.config.paths import expand_home, key_file_path
from rise_tui.editor.study import RunningHere

STOP_SECONDS = 5.0


def _participant(socket: str) -> str:
    """Who takes part; empty while the session does not say it."""
    try:
        summary = ask_summary(socket)
    except RegistryError:
        return ""
    return (summary.participant or "") if summary is not None else ""


class SessionsHere:
    """Implements `rise_tui.editor.study.SessionWatch` over the sessions of this computer."""

    def find(self, folder: Path) -> RunningHere | None:
        """The latest session that runs on this scenario."""
        try:
            found = running_sessions(str(folder))
        except OSError:
            return None
        for holder in found.values():
            if holder is not None and holder.is_this_computer:
                return RunningHere(holder.socket, _participant(holder.socket))
        return None

    def stop(self, session: RunningHere) -> str:
        """Stop everything there, as somebody who only watches."""

        async def stop() -> None:
            async with connect(session.socket, "editor", role="observer") as attached:
                await attached.stop_all()

        try:
            asyncio.run(asyncio.wait_for(stop(), STOP_SECONDS))
        except (RiseError, OSError, TimeoutError) as error:
            return f"THE STOP DID NOT REACH THE SESSION ({error or 'no answer'}): use its console"
        return "STOPPED: the session of this study was told to stop everything; its console releases it"


def edit(folder: str, *, robot: str | None, keys: str | None, display: DisplayOptions) -> int:
    """Show the editor until it is left; returns the exit status."""
    if not PlainTerminal().interactive:
        click.echo("the editor needs a terminal; `rise-engine edit` needs none", err=True)
        return USAGE
    path = expand_home(folder)
    of_study = path.name in (STUDY_FILE, PARTICIPANTS_FILE)
    path = path.parent if of_study or path.name == SCENARIO_FILE else path
    below = scenarios_below(path) if not of_study else []
    if len(below) > 1:
        click.echo(f"{folder} is a study of several scenarios. Which one? Type one of:", err=True)
        for each in below:
            click.echo(f"  rise-tui edit {shlex.quote(os.path.normpath(each))}", err=True)
        return USAGE
    path = Path(os.path.normpath(below[0])) if below else path
    try:
        workspace = Workspace(path, robot=robot, also_check=findings_of_files)
    except EditRefused as refused:
        click.echo(str(refused), err=True)
        return REFUSED
    display = with_detected_colors(display, os.environ)
    prepare_textual(display)  # before anything imports Textual
    from rise_tui.cli.edit_console import run_editor

    return run_editor(workspace, SessionsHere(), key_file_path(keys), display)
