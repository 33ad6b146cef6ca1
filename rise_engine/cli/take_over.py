"""`rise-engine take-over`: let a running session go on with the files of its scenario as they are now."""

from __future__ import annotations

import asyncio
import sys

import click

from rise_engine import exit_status
from rise_engine.cli.sessions import find_session_name
from rise_engine.client.socket import SocketClient
from rise_engine.protocol.client import EngineGone, Reply
from rise_engine.protocol.registry import RegistryError, socket_path
from rise_engine.session.lock import user_name
from rise_engine.text import clean


async def _take_over(name: str) -> Reply:
    client = SocketClient(socket_path(name), user_name(), "node")
    await client.attach()
    try:
        return await client.take_over()
    finally:
        await client.close()


@click.command("take-over")
@click.argument("session", required=False, metavar="[SESSION|DIR]")
def take_over(session: str | None) -> None:
    """Let a running session go on with the files of its scenario as they are now. Without an argument, the only one.

    Only at a safe moment: no act runs or waits, nothing is stopped, and where the rules stand is there still. Otherwise
    it says why not, and the session goes on as it was. It is recorded, and the files are kept with the session.
    Exit status: 0 they are taken over; 1 they are not, or there is no such session.
    """
    try:
        name = find_session_name(session)
        reply = asyncio.run(_take_over(name))
    except (RegistryError, EngineGone) as error:
        print(clean(f"error: {error}"), file=sys.stderr)
        sys.exit(exit_status.NO_SUCH_SESSION)
    if not reply.accepted:
        print(clean(f"not taken over: {reply.reason}"), file=sys.stderr)
        sys.exit(exit_status.REFUSED)
    print(f"{name} goes on with the files as they are now")


COMMANDS = {"take-over": take_over}
