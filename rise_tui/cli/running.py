"""Which of the running sessions is meant."""

from __future__ import annotations

from pathlib import Path

from rise_engine.link.elsewhere import everywhere
from rise_engine.link.leftover import as_lines, left_over
from rise_engine.link.places import PlaceError, find, running, session_name
from rise_engine.session.folder import running_folders
from rise_tui.cli.options import USAGE, CommandLine
from rise_tui.cli.terminal import PlainTerminal
from rise_tui.start import choose
from rise_tui.start.settings import NothingChosenError, Settings, scenario_place


def running_session(asked: CommandLine) -> str:
    """The name, or the socket, of the running session that is meant. Raises NothingChosenError."""
    try:
        if asked.session is not None:
            return find(asked.session)
        if asked.folder is None:
            return choose.session(everywhere(), PlainTerminal(), lambda: as_lines(left_over({})))
        name = session_name(scenario_place(asked.settings))
        if name in running():
            return name
        if elsewhere := reached_elsewhere(asked.settings):
            return elsewhere
    except PlaceError as error:
        raise NothingChosenError(USAGE, str(error)) from None
    raise NothingChosenError(USAGE, f"no session of {asked.folder} is running")


def reached_elsewhere(settings: Settings) -> str:
    """The socket of the scenario's session when it runs with another runtime folder; empty when none does."""
    holders = running_folders(str(Path(scenario_place(settings)).absolute())).values()
    return next((holder.socket for holder in holders if holder is not None and holder.is_here), "")
