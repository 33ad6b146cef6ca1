"""Sessions whose engine is a process of its own: how consoles start them and attach to them."""

from __future__ import annotations

from time import monotonic, sleep

from msgspec.structs import replace

from rise_engine.exit_status import ALREADY_RUNNING
from rise_engine.link.client import Client, EngineGone, Hello, Role
from rise_engine.link.places import running, session_name
from rise_engine.link.socket_client import SocketClient
from rise_engine.link.spawn import Refused, Started, start_engine
from rise_engine.scenario.model import Scenario
from rise_engine.session_options import SessionOptions
from rise_tui.start.launch import Launcher, Recovered, Tell, told_of
from rise_tui.start.settings import Settings, options, scenario_place

LET_GO = 10.0
"""Seconds that an engine which has just ended may take to put its record away and let go of its name."""


def process_launcher(who: str, role: Role) -> Launcher:
    """For the next session, after the running one has ended; and for this one, after its engine has gone."""

    def start(scenario: Scenario, settings: Settings) -> Client:
        until = monotonic() + LET_GO
        while True:
            found = start_engine(replace(options(settings, settings.seed, "ask"), wizard=who))
            if not isinstance(found, Refused):
                return SocketClient(found.name, who, role, scenario=scenario, resync=True)
            if found.code != ALREADY_RUNNING or monotonic() > until:
                break
            sleep(0.1)
        if found.unfinished or found.others:
            raise EngineGone(
                "an earlier session of that scenario did not end; "
                f"to recover it or begin a new one: rise-tui --config {scenario_place(settings)}"
            )
        raise EngineGone("; ".join(found.lines))

    def recover(hello: Hello, tell: Tell) -> Recovered:
        folder = hello.scenario.folder
        name = session_name(folder)
        wanted = SessionOptions(folder, unfinished=hello.folder)
        found = start_engine(wanted, tell) if role == "wizard" else None
        if isinstance(found, Started):
            return Recovered(SocketClient(found.name, who, role, resync=True), told_of(found))
        if found is not None and found.code != ALREADY_RUNNING:
            raise EngineGone("; ".join(found.lines))
        if found is not None and found.socket:
            return Recovered(SocketClient(found.socket, who, role, resync=True))
        if name not in running():
            raise EngineGone("nobody has recovered it yet")
        return Recovered(SocketClient(name, who, role, resync=True))  # somebody else has

    return Launcher(start=start, recover=recover)
