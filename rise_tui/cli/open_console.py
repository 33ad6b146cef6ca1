"""Opens a console on a session and shows it until it is left. Prepare Textual before importing this module."""

from __future__ import annotations

import os
from pathlib import Path
from time import monotonic, sleep

from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import ALREADY_RUNNING, UNFINISHED
from rise_engine.ports.bridge import RosConnection
from rise_engine.run.client.shadow import ShadowClient, start_time
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import AttachReply, Client, EngineGone, Role
from rise_engine.run.protocol.registry import RegistryError, ask_summary, running_names, session_name
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineRefused, EngineStarted, start_engine
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import find_session
from rise_engine.session.shadow import unfinished_shadow
from rise_engine.study.traces import study_of_session
from rise_tui.cli.command_line import UNNAMED, CommandLine, Prompter, login_name, not_started
from rise_tui.cli.study_folder import find_study
from rise_tui.config.display import choose_theme, detect_colors
from rise_tui.config.key_file import KeyFile
from rise_tui.config.launch import Launcher, RecoveredClient, ReportProgress, StudySource, startup_notice
from rise_tui.config.preferences import (
    PREFERENCES_NAME,
    Preferences,
    abbreviate_home,
    expand_home,
    load_saved,
    state_folder,
)
from rise_tui.config.settings import engine_options, scenario_folder, scenario_path
from rise_tui.console.app import ConsoleApp
from rise_tui.console.layout import UiState, save_all
from rise_tui.rendering.text import clean, format_clock


def run_on_session(
    name: str, settings: SessionOptions | None, options: CommandLine, keys: KeyFile | None, *, notice: str = ""
) -> int:
    """Show a console on a running session; returns the exit status. `notice`: remarks about the session."""
    wizard, remark = wizard_name(options, name)
    client = SocketClient(name, wizard, options.role)
    if notice and remark:
        remark = remark.partition(",")[0]  # a line of 80 cells has no room for more
    notice = "; ".join(filter(None, (notice, remark)))
    return run_console(client, settings, wizard, options, keys, notice)


def run_console(
    client: Client | None,
    settings: SessionOptions | None,
    wizard: str,
    options: CommandLine,
    keys: KeyFile | None,
    notice: str = "",
    study: StudySource | None = None,
) -> int:
    """Show a console on a client's session, or on a study; returns the exit status."""
    kept, unused = (Preferences(), "") if options.fresh else load_saved(state_folder() / PREFERENCES_NAME, Preferences)
    recorded = options.replay is not None or options.shadow is not None
    ui_state = UiState(kept, fresh=options.fresh, remark=unused, keeps_changes=not options.observe and not recorded)
    if options.wizard is not None:
        save_all(ui_state.save_wizard_name(options.wizard))
    if options.folder is not None:
        used = scenario_folder(options.folder) if study is None else Path(study.folder)
        save_all(ui_state.save_folder(str(used.absolute())))
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
    if app.exit_message and app.terminal_writer is not None:  # it gives up a stalled terminal
        app.terminal_writer.write(f"{app.exit_message}\n")
    return app.return_code or 0


def wizard_name(options: CommandLine, session: str) -> tuple[str, str]:
    """The name of the person at this console, and a remark about it.

    A wizard who returns to a session without a name gets the name of the last holder of control. Sessions belong to one
    user of the machine, so that is the wizard who lost a console. Otherwise the name is the login. A real session,
    whose record is about a participant, gets no name at all.
    """
    if options.wizard is not None:
        return options.wizard, ""
    try:
        found = ask_summary(session)
    except RegistryError:  # attaching reports it
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


# --- sessions with their own engine process ---------------------------------------------------------------------------

_USUAL_ROS = RosConnection()
ENGINE_EXIT_SECONDS = 10.0
"""Seconds for an ended engine to close its record and release its name."""


def process_launcher(who: str, role: Role, ros: RosConnection = _USUAL_ROS, *, is_named: bool = True) -> Launcher:
    """A launcher for the next session, for the recovery of this one, and for the study that this session belongs to.

    `ros`: the connection of that study's sessions to ROS 2. `is_named`: whether the name was given. A login is not
    written into the record of a real session.
    """

    def start(scenario: Scenario, settings: SessionOptions) -> Client:
        until = monotonic() + ENGINE_EXIT_SECONDS
        name = who if is_named or scenario.mode != "real" else UNNAMED[role]
        while True:
            found = start_engine(replace(engine_options(settings, settings.seed, "ask"), wizard=name))
            if not isinstance(found, EngineRefused):
                return SocketClient(found.name, name, role, scenario=scenario)
            if found.code != ALREADY_RUNNING or monotonic() > until:
                break
            sleep(0.1)
        if found.unfinished or found.others:
            raise EngineGone(
                "an earlier session of that scenario did not end; "
                f"to recover it or begin a new one: rise-tui --config {scenario_path(settings)}"
            )
        raise EngineGone("; ".join(found.lines))

    def recover(attach_reply: AttachReply, report: ReportProgress) -> RecoveredClient:
        folder = attach_reply.scenario.folder
        study = study_of_session(Path(attach_reply.folder))
        name = session_name(study or folder)
        wanted = SessionOptions(folder, unfinished=attach_reply.folder)
        found = start_engine(wanted, report) if role == "wizard" else None
        if isinstance(found, EngineStarted):
            return RecoveredClient(SocketClient(found.name, who, role), startup_notice(found))
        if found is not None and found.code != ALREADY_RUNNING:
            raise EngineGone("; ".join(found.lines))
        if found is not None and found.socket:
            return RecoveredClient(SocketClient(found.socket, who, role))
        if name not in running_names():
            raise EngineGone("nobody has recovered it yet")
        return RecoveredClient(SocketClient(name, who, role))  # another console has recovered it

    return Launcher(start=start, recover=recover, find_study=lambda attach_reply: find_study(attach_reply, ros))


# --- a second wizard --------------------------------------------------------------------------------------------------

QUESTION = "Your name in the comparison of wizards?"


def make_shadow(options: CommandLine, terminal: Prompter) -> tuple[ShadowClient, str]:
    """Make the client that plays the session's cues, and find the name of the person at this console. Writes nothing
    yet.

    :raises Refused: there is no such session, the judge's name is missing, or an earlier shadow needs a decision.
    """
    try:
        folder = find_session(str(expand_home(options.shadow or "")))
        wizard = _name_judge(options, terminal)
        unfinished = unfinished_shadow(folder, wizard)
        if options.recover:
            if unfinished is None:
                raise not_started(f"{clean(wizard)} has left no shadow of {folder.name} unfinished")
            return ShadowClient(folder, wizard, resume=unfinished), wizard
        if unfinished is not None and not options.new:
            raise not_started(
                f"{clean(wizard)} has begun a shadow of {folder.name}, which goes as far as "
                f"{format_clock(unfinished.resume_at[0])}: {abbreviate_home(str(unfinished.path))}",
                "--recover goes on with it; --new begins another one, and leaves it as it is",
                status=UNFINISHED,
            )
        at = start_time(folder, options.at) if options.at is not None else 0.0
    except SessionError as error:
        raise not_started(*error.lines) from None
    return ShadowClient(folder, wizard, at=at, speed=options.speed), wizard


def _name_judge(options: CommandLine, terminal: Prompter) -> str:
    """Ask for the name. The last session's name is never used: its wizard may be the one to compare with."""
    name = options.wizard
    if name is None and terminal.interactive:
        name = (terminal.read_answer(QUESTION) or "").strip()
    if not name:
        raise not_started("name the second wizard: --wizard NAME; the comparison tells wizards apart by their names")
    return name
