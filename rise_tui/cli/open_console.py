"""Opens a console on a session and shows it until somebody leaves. Textual is prepared before this is imported."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

import click

from rise_engine.run.client.replay import ReplayClient
from rise_engine.run.client.shadow import ShadowClient
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import Client
from rise_engine.run.protocol.registry import RegistryError, ask_summary
from rise_engine.run.protocol.session_options import SessionOptions
from rise_tui.cli.options import CommandLine
from rise_tui.cli.process_launcher import process_launcher
from rise_tui.cli.study_folder import open_study
from rise_tui.cli.terminal import UNNAMED, login_name
from rise_tui.config.display import choose_theme, detect_colors
from rise_tui.config.keymap import KeyFile
from rise_tui.config.paths import PREFERENCES_NAME, state_folder
from rise_tui.config.preferences import Preferences, load_saved
from rise_tui.config.study_source import StudySource
from rise_tui.console.app import ConsoleApp
from rise_tui.console.ui_state import UiState, save_all
from rise_tui.rendering.text import clean


def run_on_session(
    name: str, settings: SessionOptions | None, options: CommandLine, keys: KeyFile | None, *, notice: str = ""
) -> int:
    """A console on a running session; returns the exit status. `notice`: what there is to say about the session."""
    wizard, remark = wizard_name(options, name)
    client = SocketClient(name, wizard, options.role)
    if notice and remark:
        remark = remark.partition(",")[0]  # a line of 80 cells has no room for more
    notice = "; ".join(filter(None, (notice, remark)))
    return _run_console(client, settings, wizard, options, keys, notice)


def run_on_study(options: CommandLine, keys: KeyFile | None) -> int:
    """The screen of a study of which no session runs; returns the exit status."""
    study = open_study(options.folder or "", options.settings.ros)
    return _run_console(None, None, options.wizard or "", options, keys, study=study)


def run_on_replay(path: Path, options: CommandLine, keys: KeyFile | None) -> int:
    """A console on the record of a session; returns the exit status."""
    return _run_console(ReplayClient(path, options.speed), None, "replay", options, keys)


def run_on_shadow(client: ShadowClient, options: CommandLine, keys: KeyFile | None) -> int:
    """A console in which a second wizard answers the cues of a recorded session; returns the exit status."""
    return _run_console(client, None, options.wizard or "", options, keys)


def _run_console(
    client: Client | None,
    settings: SessionOptions | None,
    wizard: str,
    options: CommandLine,
    keys: KeyFile | None,
    notice: str = "",
    study: StudySource | None = None,
) -> int:
    """A console on what a client shows, or on a study; returns the exit status."""
    kept, unused = (Preferences(), "") if options.fresh else load_saved(state_folder() / PREFERENCES_NAME, Preferences)
    recorded = options.replay is not None or options.shadow is not None
    ui_state = UiState(kept, fresh=options.fresh, remark=unused, keeps_changes=not options.observe and not recorded)
    if options.wizard is not None:
        save_all(ui_state.keep_wizard(options.wizard))
    app = ConsoleApp(
        client,
        settings=settings,
        wizard=wizard,
        study=study,
        login=login_name(),
        participant=options.participant or "",
        theme=choose_theme(options.display, detect_colors(options.display, os.environ), kept.theme),
        launcher=process_launcher(wizard, options.role, options.settings.ros, is_named=options.wizard is not None),
        notice=notice,
        keys=keys,
        ui_state=ui_state,
    )
    app.run(mouse=options.display.mouse)
    if app.exit_message and not app.is_terminal_gone:
        with suppress(OSError):  # it may have gone just now
            click.echo(app.exit_message, err=True)
    return app.return_code or 0


def wizard_name(options: CommandLine, session: str) -> tuple[str, str]:
    """The name of whoever sits here, and what there is to say about it.

    A wizard who comes back to a session and says no name is who this user's console was before: sessions belong to one
    user of the machine, and whoever held control last is who has lost a console. Otherwise it is the login, and in a
    real session, whose record is about a participant, no name at all.
    """
    if options.wizard is not None:
        return options.wizard, ""
    try:
        found = ask_summary(session)
    except RegistryError:  # attaching says it
        found = None
    if found is not None and found.mode == "real" and (options.observe or found.wizard in ("", UNNAMED["wizard"])):
        nobody = UNNAMED[options.role]
        return nobody, f"the record calls you {nobody}; to be named in it: rise-tui --wizard NAME"
    if options.observe:
        return login_name(), ""
    login = login_name()
    if found is None or found.wizard in ("", login):
        return login, ""
    return found.wizard, f"you are {clean(found.wizard)}, as before; if you are not: rise-tui --wizard NAME"
