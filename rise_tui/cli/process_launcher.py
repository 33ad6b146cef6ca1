"""Sessions whose engine is a process of its own: how consoles start them and attach to them."""

from __future__ import annotations

from pathlib import Path
from time import monotonic, sleep

from msgspec.structs import replace

from rise_engine.base.exit_status import ALREADY_RUNNING
from rise_engine.ports.bridge import RosConnection
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import AttachReply, Client, EngineGone, Role
from rise_engine.run.protocol.registry import running_names, session_name
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineRefused, EngineStarted, start_engine
from rise_engine.scenario.model import Scenario
from rise_engine.study.traces import study_of_session
from rise_tui.cli.study_folder import find_study
from rise_tui.cli.terminal import UNNAMED
from rise_tui.config.launch import Launcher, RecoveredClient, ReportProgress, startup_notice
from rise_tui.config.settings import engine_options, scenario_path

_USUAL_ROS = RosConnection()
ENGINE_EXIT_SECONDS = 10.0
"""Seconds that an engine which has just ended may take to put its record away and let go of its name."""


def process_launcher(who: str, role: Role, ros: RosConnection = _USUAL_ROS, *, is_named: bool = True) -> Launcher:
    """For the next session, after the running one has ended; for this one, after its engine has gone; and for the study
    that it is of, in whose sessions ROS 2 is spoken as `ros` says.

    `is_named`: whether somebody has said that name; a login is not written into the record of a real session.
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
        return RecoveredClient(SocketClient(name, who, role))  # somebody else has

    return Launcher(start=start, recover=recover, find_study=lambda attach_reply: find_study(attach_reply, ros))
