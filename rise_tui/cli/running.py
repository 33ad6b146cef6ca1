"""Which of the running sessions is meant."""

from __future__ import annotations

from pathlib import Path

from rise_engine.cli.session.unfinished import unfinished_lines, unfinished_sessions
from rise_engine.run.client.running_sessions import all_running_sessions
from rise_engine.run.protocol.registry import RegistryError, find_running, running_names, session_name
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.session.folder import running_sessions
from rise_tui.cli import choose_session
from rise_tui.cli.options import CommandLine
from rise_tui.cli.terminal import PlainTerminal, not_started
from rise_tui.config.paths import expand_home
from rise_tui.config.settings import scenario_path

STUDY_FILE, SESSIONS = "study.toml", "sessions"
"""As `rise_engine.study` has them, which is read only when there is a study."""


def find_running_session(options: CommandLine) -> str:
    """The name, or the socket, of the running session that is meant. Raises Refused."""
    try:
        if options.session is not None:
            return find_running(options.session)
        if options.folder is None:
            return choose_session.choose_session(
                all_running_sessions(), PlainTerminal(), lambda: unfinished_lines(unfinished_sessions({}))
            )
        if is_study(options.folder):
            if socket := find_study_session(options.folder):
                return socket
            raise not_started(f"no session of {options.folder} is running")
        name = session_name(scenario_path(options.settings))
        if name in running_names():
            return name
        if elsewhere := find_elsewhere(options.settings):
            return elsewhere
    except RegistryError as error:
        raise not_started(str(error)) from None
    raise not_started(f"no session of {options.folder} is running")


def find_elsewhere(settings: SessionOptions) -> str:
    """The socket of the scenario's session when it runs with another runtime folder; empty when none does."""
    holders = running_sessions(str(Path(scenario_path(settings)).absolute())).values()
    return next((holder.socket for holder in holders if holder is not None and holder.is_this_computer), "")


def is_study(named: str) -> bool:
    """Whether a folder, or a file, that somebody names is a study. Light: nothing of a study is read."""
    path = expand_home(named)
    return bool(named.strip()) and (path if path.name == STUDY_FILE else path / STUDY_FILE).is_file()


def find_study_session(named: str) -> str:
    """The name, or the socket, of the study's session that runs on this computer; empty: none does."""
    path = expand_home(named)
    folder = (path.parent if path.name == STUDY_FILE else path).absolute()
    name = session_name(folder)
    try:
        if name in running_names():
            return name
    except RegistryError as error:
        raise not_started(str(error)) from None
    holders = running_sessions(root=folder / SESSIONS).values()
    return next((each.socket for each in holders if each is not None and each.is_this_computer), "")
