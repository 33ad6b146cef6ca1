"""`rise-engine lsl`: sends markers of a running session to the Lab Streaming Layer, in its own process."""

from __future__ import annotations

import asyncio
import logging
import signal
from pathlib import Path
from typing import Literal

import click

from rise_engine.base.errors import AdapterError
from rise_engine.base.exit_status import FAILED, INTERRUPTED, OK, USAGE
from rise_engine.cli.terminal import refusing
from rise_engine.ports.outlet import OutletPlan
from rise_engine.run.client import EngineGone
from rise_engine.run.protocol.registry import RegistryError, find_running, socket_path
from rise_engine.run.recording.companion_main import find_outlet

OUTLET = "lsl"
"""The entry point in the group `rise.outlets`."""


@click.command()
@click.argument("session", metavar="SESSION")
@click.option(
    "--scope",
    type=click.Choice(["machine", "link", "site"]),
    default="machine",
    show_default=True,
    help="Choose who can see the stream: this computer, its network segment, or the whole network.",
)
@click.option(
    "--payload",
    type=click.Choice(["short", "json"]),
    default="short",
    show_default=True,
    help="Choose what a marker has. short: names of the scenario, as act/R_Nod/robot. json: whole "
    "records, with everything that is said.",
)
def lsl(session: str, scope: Literal["machine", "link", "site"], payload: Literal["short", "json"]) -> int:
    """Send the markers of the running SESSION to the Lab Streaming Layer, until it ends.

    SESSION is its name (rise-engine sessions), or the path of its socket. This command only watches, so the session
    goes on whatever happens here. A stamp is the time at which something happened, however late it is sent. Markers
    wait until a program receives the stream.

    Exit status: 0 the session has ended; 1 there is no such session; 2 wrong usage, or no stream can be made; 70 the
    engine went without an end; 130 interrupted.
    """
    socket = session if "/" in session else str(socket_path(find_running(session)))
    if not Path(socket).exists():
        raise RegistryError(f"no session runs at {socket}")
    _log_to_standard_error()
    return asyncio.run(_send(OutletPlan(socket, scope=scope, payload=payload)))


async def _send(plan: OutletPlan) -> int:
    finish = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, finish.set)
    with refusing(USAGE, of=AdapterError), refusing(FAILED, of=EngineGone):
        await find_outlet(OUTLET)(plan, finish)
    return INTERRUPTED if finish.is_set() else OK


def _log_to_standard_error() -> None:
    """Show the stream's messages to the user."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    log = logging.getLogger("rise_engine.run.recording")
    log.addHandler(handler)
    log.setLevel(logging.INFO)
