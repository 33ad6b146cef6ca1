"""A companion's process (`companion`): it reads its request and works until its input or the session ends."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from contextlib import suppress

import msgspec

from rise_engine.base.errors import AdapterError, RiseError
from rise_engine.base.plugins import find_plugin
from rise_engine.ports.outlet import OutletPlan, OutletRunner
from rise_engine.run.protocol.client import EngineGone
from rise_engine.run.recording.companion import LIFE_SIGN_SECONDS, OUTLET_NAME, CompanionRequest, decode_request
from rise_engine.run.recording.supervisor import supervise

# --- outlets ----------------------------------------------------------------------------------------------------------

OUTLETS = "rise.outlets"


def find_outlet(name: str) -> OutletRunner:
    """Load the outlet of that name. Raises AdapterError if it is not installed or cannot be loaded."""
    entry = find_plugin(OUTLETS, name)
    if entry is None:
        raise AdapterError(f"there is no outlet {name!r}: no entry point of that name in the group {OUTLETS!r}")
    try:
        runner: OutletRunner = entry.load()
    except Exception as error:  # importing it runs code of other authors
        raise AdapterError(f"the outlet {name!r} ({entry.value}) cannot be loaded: {error}") from error
    return runner


def main() -> None:
    """Run a companion, and exit."""
    signs = os.dup(1)
    os.dup2(2, 1)  # output of libraries is not a sign of life
    try:
        asyncio.run(_run_session_work(signs))
    except (RiseError, msgspec.MsgspecError) as error:
        print(" ".join(str(error).split()), file=sys.stderr, flush=True)
        os._exit(1)
    except Exception as error:
        sys.excepthook(type(error), error, error.__traceback__)
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)  # without waiting for threads of libraries


async def _run_session_work(signs: int) -> None:
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGHUP):  # from a terminal: the engine decides when to finish
        loop.add_signal_handler(number, lambda: None)
    leash = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(leash), sys.stdin.buffer)
    signing = asyncio.create_task(_give_signs(signs))
    line = await leash.readline()
    if not line:
        return
    finish = asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, finish.set)
    holding = asyncio.create_task(_hold_leash(leash, finish))
    try:
        await _run(decode_request(line), finish)
    except EngineGone:
        pass  # the session is over
    finally:
        holding.cancel()
        signing.cancel()


async def _run(request: CompanionRequest, finish: asyncio.Event) -> None:
    if request.kind == "recorders":
        await supervise(request, finish)
        return
    markers = request.settings.markers
    assert markers is not None
    plan = OutletPlan(request.socket, request.session, request.task, markers.scope, markers.payload)
    await find_outlet(OUTLET_NAME)(plan, finish)


async def _hold_leash(leash: asyncio.StreamReader, finish: asyncio.Event) -> None:
    while await leash.read(4096):
        pass
    finish.set()


async def _give_signs(signs: int) -> None:
    with suppress(OSError):  # the engine has gone; the end of the input also shows it
        while True:
            os.write(signs, b"\n")
            await asyncio.sleep(LIFE_SIGN_SECONDS)


if __name__ == "__main__":
    main()
