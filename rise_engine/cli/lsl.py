"""`rise-engine lsl`: markers of a running session for the Lab Streaming Layer, from a process of its own."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import threading
from contextlib import suppress
from typing import get_args

import click

from rise_engine.client import EngineGone
from rise_engine.exit_status import FAILED, INTERRUPTED, NO_SUCH_SESSION, OK, USAGE
from rise_engine.ports.outlet import OutletError, Scope
from rise_engine.recording.marker_feed import MarkerFeed, Payload, find_outlet
from rise_engine.text import clean

OUTLET = "lsl"
"""The entry point in the group `rise.outlets`."""


@click.command()
@click.argument("session", metavar="SESSION")
@click.option(
    "--scope",
    type=click.Choice(get_args(Scope)),
    default="machine",
    show_default=True,
    help="Who can see the stream: this computer, its network segment, or the whole network.",
)
@click.option(
    "--payload",
    type=click.Choice(get_args(Payload)),
    default="short",
    show_default=True,
    help="short: names of the scenario, as act/R_Nod/robot. json: whole records, with all that is said.",
)
@click.option("--leash", is_flag=True, help="End when standard input ends, for a program that starts this one.")
def lsl(session: str, scope: Scope, payload: Payload, leash: bool) -> None:
    """Send the markers of the running SESSION to the Lab Streaming Layer, until it ends.

    SESSION is its name (rise-engine sessions), or the path of its socket. It is only watched: whatever happens here,
    the session goes on. A stamp is the time at which something happened, however late it is sent. Markers wait until
    a program receives the stream.

    Exit status: 0 when the session has ended; 1 there is no such session; 2 wrong usage, or no stream can be made; 70
    the engine went without an end; 130 interrupted.
    """
    sys.exit(asyncio.run(_send(session, scope, payload, leash)))


async def _send(session: str, scope: Scope, payload: Payload, leash: bool) -> int:
    loop = asyncio.get_running_loop()
    stop, interrupted = asyncio.Event(), asyncio.Event()
    opened = False

    def tell_opened(sentence: str) -> None:
        nonlocal opened
        opened = True
        _print(sentence, sys.stdout)

    def interrupt() -> None:
        interrupted.set()
        stop.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, interrupt)
    if leash:
        threading.Thread(target=_wait_for_end_of_input, args=(loop, stop), daemon=True).start()
    try:
        feed = MarkerFeed(
            session,
            find_outlet(OUTLET),
            scope=scope,
            payload=payload,
            on_open=tell_opened,
            warn=lambda sentence: _print(f"note: {sentence}", sys.stderr),
        )
        await feed.run(stop)
    except OutletError as error:
        _print(f"error: {error}", sys.stderr)
        return USAGE
    except EngineGone as error:
        _print(f"error: {error}", sys.stderr)
        return FAILED if opened else NO_SUCH_SESSION
    return INTERRUPTED if interrupted.is_set() else OK


def _wait_for_end_of_input(loop: asyncio.AbstractEventLoop, stop: asyncio.Event) -> None:
    """On a thread of its own: whoever started this process holds the other end, and may not say anything for hours."""
    with suppress(OSError):
        while os.read(sys.stdin.fileno(), 4096):
            pass
    with suppress(RuntimeError):  # the loop is closed: it has ended by itself
        loop.call_soon_threadsafe(stop.set)


def _print(text: str, where: object) -> None:
    with suppress(OSError, ValueError):  # nobody reads it any more
        print(clean(text), file=where, flush=True)  # type: ignore[call-overload]


COMMANDS = {"lsl": lsl}
