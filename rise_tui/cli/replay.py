"""`rise-tui --replay`: a console on the record of a session."""

from __future__ import annotations

from pathlib import Path

from rise_engine.client.replay import ReplayClient
from rise_engine.exit_status import USAGE
from rise_engine.session.folder import SessionError, find_session
from rise_tui.cli.open_console import on_client
from rise_tui.cli.options import CommandLine
from rise_tui.cli.process_launcher import process_launcher
from rise_tui.config.keymap import KeyFile
from rise_tui.config.settings import NothingStarted, expand_home


def find(options: CommandLine) -> Path:
    """The folder of the recorded session. Raises NothingStarted."""
    try:
        return find_session(str(expand_home(options.replay or "")))
    except SessionError as error:
        raise NothingStarted(USAGE, str(error)) from None


def open_console(path: Path, options: CommandLine, keys: KeyFile | None) -> int:
    """Show it until somebody leaves; returns the exit status."""
    client = ReplayClient(path, options.speed)
    return on_client(client, None, process_launcher("wizard", "wizard"), "replay", options, keys)
