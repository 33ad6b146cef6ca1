"""Starting and ending a node: its options, its connection, ctrl+c.

    def main() -> None:
        parser = node_parser("my_node", "What it does, in one sentence.")
        parser.add_argument("--key", default="gaze", help="...")
        run_node(parser, work)

    async def work(transport: Transport, options: Namespace) -> None:
        ...

`work` goes on until it is cancelled.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Final, TypeAlias, TypeVar

from rise_adapters.ros2.choose import open_transport
from rise_adapters.ros2.port import PortError, Transport
from rise_engine.arguments import split_ros_args
from rise_engine.bridge import BridgeError
from rise_engine.terminal import guarded

T = TypeVar("T")
Work: TypeAlias = Callable[[Transport, Namespace], Awaitable[None]]

FAILED, USAGE = 1, 2
_LOOK_SECONDS: Final = 0.5


class NodeError(Exception):
    """The node cannot do what it is for; a sentence for a person."""


def node_parser(node: str, about: str) -> ArgumentParser:
    """The options that every node has."""
    parser = ArgumentParser(
        prog=node, description=about, epilog="Remappings and parameters of ROS come last, after --ros-args."
    )
    parser.set_defaults(node=node)
    parser.add_argument(
        "--ros", choices=("auto", "rclpy", "dds"), default="auto", help="how ROS 2 is spoken (default: %(default)s)"
    )
    parser.add_argument(
        "--share",
        action="append",
        default=[],
        type=Path,
        metavar="DIR",
        help="a further folder with definitions of message types, for --ros dds; repeatable",
    )
    return parser


def run_node(parser: ArgumentParser, work: Work, arguments: Sequence[str] | None = None) -> None:
    """Read the command line, run `work` until it returns, fails, or somebody ends the program, and exit.

    Exit status: 0; 1 what stands in the way was said; 2 wrong usage.
    """
    ours, theirs = split_ros_args(sys.argv[1:] if arguments is None else arguments)
    options = parser.parse_args(ours)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(line_buffering=True)
    try:
        with guarded():
            asyncio.run(_run(work, options, theirs))
    except BridgeError as error:
        _fail(parser, error.lines)
    except (NodeError, PortError) as error:
        _fail(parser, [str(error)])
    except BrokenPipeError:  # nobody reads what it says any more
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:  # before there was anything to end
        pass
    sys.exit(0)


def _fail(parser: ArgumentParser, lines: Sequence[str]) -> None:
    for line in lines:
        print(f"{parser.prog}: {line}", file=sys.stderr)
    sys.exit(FAILED)


async def _run(work: Work, options: Namespace, theirs: Sequence[str]) -> None:
    transport = await open_transport(options.ros, theirs, node=options.node, share=options.share)
    try:
        working = asyncio.ensure_future(work(transport, options))
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            with suppress(NotImplementedError):  # Windows has its own way, KeyboardInterrupt
                loop.add_signal_handler(number, working.cancel)
        while not working.done():
            await asyncio.wait([working], timeout=_LOOK_SECONDS)
            if transport.lost():
                working.cancel()
                with suppress(asyncio.CancelledError):
                    await working
                raise NodeError(f"the connection to ROS was lost: {transport.lost()}")
        if not working.cancelled():
            working.result()
    finally:
        transport.close()


async def forever() -> None:
    """What a node waits for whose work is done by callbacks."""
    await asyncio.Event().wait()


async def in_thread(function: Callable[..., T], *arguments: object) -> T:
    """Call what waits for something outside, without keeping the node from its work. Unlike `asyncio.to_thread`, nobody
    waits for the thread when the node ends."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[T] = loop.create_future()

    def settle(result: T | None, error: Exception | None) -> None:
        if done.done():
            return
        if error is not None:
            done.set_exception(error)
        else:
            done.set_result(result)  # type: ignore[arg-type]

    def call() -> None:
        result: T | None = None
        error: Exception | None = None
        try:
            result = function(*arguments)
        except Exception as caught:
            error = caught
        with suppress(RuntimeError):  # the node has ended
            loop.call_soon_threadsafe(settle, result, error)

    Thread(target=call, daemon=True).start()
    return await done
