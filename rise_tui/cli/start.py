"""Finds or starts the requested session, and opens a console on it.

The modules for the console are imported after the engine's process has started, so that both start side by side (saves
150 ms). The terminal's colours must be settled first, because Textual reads them at import.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import ALREADY_RUNNING, OK, REFUSED
from rise_engine.cli.arguments import parse_assignments
from rise_engine.cli.session.sessions import running_lines, unfinished_lines, unfinished_sessions
from rise_engine.kernel.inputs import Submit
from rise_engine.run.client.running_sessions import all_running_sessions
from rise_engine.run.protocol.messages import SessionSummary
from rise_engine.run.protocol.registry import RegistryError, ask_summary, find_running, running_names, session_name
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineProcess, EngineRefused, start_engine
from rise_engine.session.folder import find_session, find_unfinished, participant_text, running_sessions
from rise_tui.cli.command_line import (
    WITHOUT_TERMINAL,
    CommandLine,
    PlainTerminal,
    ProgressLine,
    Prompter,
    check_matches,
    choose_recovery,
    login_name,
    not_started,
    read_key_file,
)
from rise_tui.config import launch
from rise_tui.config.display import prepare_textual, with_detected_colors
from rise_tui.config.preferences import PREFERENCES_NAME, Preferences, expand_home, load_saved, state_folder
from rise_tui.config.settings import engine_options, scenario_path, why_no_scenario
from rise_tui.rendering.text import clean

if TYPE_CHECKING:
    from rise_tui.config.key_file import KeyFile


def start(options: CommandLine) -> NoReturn:
    """Do what the command line requests. Ends the process with its exit status."""
    options = replace(options, display=with_detected_colors(options.display, os.environ))
    prepare_textual(options.display)  # before anything imports Textual
    _open(options, read_key_file(options.keys))


def _open(options: CommandLine, keys: KeyFile | None) -> NoReturn:
    if options.replay is not None:
        _open_replay(options, keys)
    elif options.shadow is not None:
        _open_shadow(options, keys)
    elif options.folder is None:
        _attach(options, keys)
    elif is_study(options.folder):
        _open_study(options, keys)
    else:
        _run(options, options.settings, keys)


def _refuse_start(reason: str) -> NoReturn:
    raise not_started(reason)


def _need_terminal(*also: str) -> None:
    if not PlainTerminal().interactive:
        needs = "the console needs a terminal; `rise-engine run` and `rise-engine serve` need none"
        raise not_started(needs, *also)


# --- sessions that run ------------------------------------------------------------------------------------------------


def _attach(options: CommandLine, keys: KeyFile | None) -> NoReturn:
    """Attach to the named session, or to the only one. Otherwise the person chooses what to open."""
    try:
        if options.session is not None:
            _open_console(find_running(options.session), options, keys)
        running = all_running_sessions()
    except RegistryError as error:
        _refuse_start(str(error))
    if len(running) == 1:
        _open_console(next(iter(running)), options, keys)
    if not PlainTerminal().interactive or (options.observe and not running):
        _refuse_to_choose(running)
    from rise_tui.cli import launcher  # after the preparation of Textual

    chosen = launcher.choose_item(options, keys)
    if chosen is None:
        raise not_started(status=OK)
    if chosen.state == "running":
        _open_console(chosen.target, options, keys)
    participant = chosen.participant or options.participant
    _open(replace(options, folder=chosen.target, resume=chosen.session, participant=participant), keys)


def _refuse_to_choose(running: Mapping[str, SessionSummary | None]) -> NoReturn:
    """Refuse to choose without a person, or among nothing."""
    if running:
        why = "several sessions run, and without a terminal you cannot choose: name one with --session NAME"
        raise not_started(why, *running_lines(running))
    raise not_started(
        "no session is running; start one with: rise-tui --config DIR",
        "DIR is the folder of a scenario or a study",
        *unfinished_lines(unfinished_sessions(running)),
    )


def _join(name: str, options: CommandLine, keys: KeyFile | None) -> NoReturn:
    """Attach to the scenario's running session, if it is the requested one."""
    check_matches(name, ask_summary(name), options)
    _open_console(name, options, keys)


# --- new sessions -----------------------------------------------------------------------------------------------------


def _run(options: CommandLine, settings: SessionOptions, keys: KeyFile | None) -> NoReturn:
    """Open a session of a scenario: the running one, an earlier one recovered, or a new one."""
    if problem := why_no_scenario(settings):
        _print_refusal([problem], settings.folder)
    name = session_name(scenario_path(settings))
    try:
        if name in running_names():
            _join(name, options, keys)
    except RegistryError as error:
        _refuse_start(str(error))
    if options.observe:  # starts none, but one may run with another runtime folder
        if elsewhere := find_elsewhere(settings):
            _join(elsewhere, options, keys)
        _refuse_start(f"no session of {settings.folder} is running, and --observe starts none")
    _need_terminal_to_choose(options, settings)
    if keys is not None:
        _check_clashes(settings, keys)
    with_name, remark = name_wizard(options, lambda: launch.is_real(settings), PlainTerminal())
    wanted = engine_options(settings, options.seed, options.unfinished)
    wanted = replace(
        wanted,
        wizard=with_name.wizard or "",
        login=login_name(),
        from_other_computer=options.here,
        first_tasks=_first_inputs(options),
    )
    engine = EngineProcess(wanted)
    # The engine's process takes as long to start as the import of the console, so both run together.
    from rise_tui.cli import open_console

    progress = ProgressLine()
    found = engine.wait(progress.overwrite)
    progress.clear()
    if isinstance(found, EngineRefused) and (found.unfinished or found.others):
        named = participant_text(settings.participant, settings.condition)
        chosen = choose_recovery(found.unfinished, PlainTerminal(), found.others, named)
        found = start_engine(replace(wanted, unfinished=chosen), progress.overwrite)
        progress.clear()
    if isinstance(found, EngineRefused) and found.code == ALREADY_RUNNING and (found.socket or name in running_names()):
        _join(found.socket or name, options, keys)  # another console has just started it
    if isinstance(found, EngineRefused):
        _print_refusal(found.lines, settings.folder, found.code)
    unused = options.only_for_new if found.recovered else []
    notice = launch.startup_notice(found) + (
        f"; {' and '.join(unused)}: not used, it goes on as it was" if unused else ""
    )
    if not found.recovered:  # a recovered session already has a name
        options, notice = with_name, "; ".join(filter(None, (notice, remark)))
    sys.exit(open_console.run_on_session(found.name, settings, options, keys, notice=notice))


def _need_terminal_to_choose(options: CommandLine, settings: SessionOptions) -> None:
    """Refuse to continue without a terminal, which the choice of a session that did not end also needs."""
    if PlainTerminal().interactive:
        return
    asks = options.unfinished == "ask" and find_unfinished(str(Path(scenario_path(settings)).absolute()))
    _need_terminal(*[WITHOUT_TERMINAL] * bool(asks))


def _first_inputs(options: CommandLine) -> tuple[Submit, ...]:
    """Return the first inputs of a new session. Ends the command if they cannot be used."""
    return tuple(parse_assignments(options.sets))


def _check_clashes(settings: SessionOptions, keys: KeyFile) -> None:
    """Check the keys before an engine starts for a console that then refuses to open."""
    from rise_tui.config.key_file import how_to_fix

    prepared = launch.load_scenario(settings)
    if not isinstance(prepared, launch.ScenarioProblems) and (clashes := keys.clashes(prepared.keys)):
        raise not_started(*map(str, clashes), how_to_fix(keys.path))


def _print_refusal(lines: list[str], folder: str, code: int = REFUSED) -> NoReturn:
    for line in lines:
        click.echo(line)
    click.echo(f"{folder} was refused: nothing was started", err=True)
    sys.exit(code)


# --- studies ----------------------------------------------------------------------------------------------------------


def _open_study(options: CommandLine, keys: KeyFile | None) -> NoReturn:
    """Open the study's running session, or else the screen of the study."""
    if given := options.only_for_scenarios:
        _refuse_start(f"{', '.join(given)}: a study says this itself, in its study.toml and plan.csv")
    if socket := find_study_session(options.folder or ""):
        _join(socket, options, keys)
    if options.observe:
        _refuse_start(f"no session of {options.folder} is running, and --observe starts none")
    _need_terminal()
    from rise_tui.cli import open_console, study_folder  # see above

    study = study_folder.open_study(options.folder or "", options.settings.ros)
    sys.exit(open_console.run_console(None, None, options.wizard or "", options, keys, study=study))


# --- consoles ---------------------------------------------------------------------------------------------------------


def _open_console(name: str, options: CommandLine, keys: KeyFile | None) -> NoReturn:
    """Open a console on a running session."""
    _need_terminal()
    from rise_tui.cli import open_console  # see above

    sys.exit(open_console.run_on_session(name, None, options, keys))


def _open_replay(options: CommandLine, keys: KeyFile | None) -> NoReturn:
    """Open the record of a session."""
    try:
        path = find_session(str(expand_home(options.replay or "")))
    except SessionError as error:
        _refuse_start(str(error))
    _need_terminal()
    from rise_engine.run.client.replay import ReplayClient
    from rise_tui.cli import open_console  # see above

    sys.exit(open_console.run_console(ReplayClient(path, options.speed), None, "replay", options, keys))


def _open_shadow(options: CommandLine, keys: KeyFile | None) -> NoReturn:
    """Open the cues of a recorded session for a second wizard."""
    from rise_tui.cli import open_console  # see above

    client, wizard = open_console.make_shadow(options, PlainTerminal())
    _need_terminal()
    sys.exit(open_console.run_console(client, None, wizard, replace(options, wizard=wizard), keys))


# --- finding a running session ----------------------------------------------------------------------------------------

STUDY_FILE, SESSIONS = "study.toml", "sessions"
"""As in `rise_engine.study`, which is imported only for a study."""


def find_elsewhere(settings: SessionOptions) -> str:
    """The socket of the scenario's session that runs with another runtime folder; empty without one."""
    holders = running_sessions(str(Path(scenario_path(settings)).absolute())).values()
    return next((holder.socket for holder in holders if holder is not None and holder.is_this_computer), "")


def is_study(named: str) -> bool:
    """Whether the named folder or file is a study. Light: reads nothing of the study."""
    path = expand_home(named)
    return bool(named.strip()) and (path if path.name == STUDY_FILE else path / STUDY_FILE).is_file()


def find_study_session(named: str) -> str:
    """The name, or the socket, of the study's session that runs on this computer; empty without one."""
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


# --- the wizard's name ------------------------------------------------------------------------------------------------

QUESTION = "Your name in the record (a short one; enter: none)?"


def last_wizard(options: CommandLine) -> str:
    """The last wizard's name; empty: none, or `--fresh` forgets it."""
    return "" if options.fresh else load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0].wizard


def name_wizard(options: CommandLine, is_real: Callable[[], bool], terminal: Prompter) -> tuple[CommandLine, str]:
    """Return the command line with the wizard's name for a new session, and a remark about it.

    Without `--wizard` it is the last wizard's name. If there is none, a real session asks for it. A session in debug
    mode uses the login.
    """
    if options.wizard is not None:
        return options, ""
    if last := last_wizard(options):
        remark = f"you are {clean(last)}, as last time; if you are not: rise-tui --wizard NAME"
        return replace(options, wizard=last), remark
    if terminal.interactive and is_real() and (answer := (terminal.read_answer(QUESTION) or "").strip()):
        return replace(options, wizard=answer), ""
    return options, ""
