"""Starts and ends a node: its options, its connection, ctrl+c.

    def main() -> None:
        parser = node_parser("my_node", "What it does, in one sentence.")
        parser.add_argument("--key", default="gaze", help="...")
        run_node(parser, work)

    async def work(transport: Transport, options: Namespace) -> None:
        ...

`work` runs until it is cancelled.
"""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from argparse import Action, ArgumentParser, Namespace
from collections.abc import Awaitable, Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Final, NoReturn, TypeAlias, TypeVar

from rise_adapters.ros2.parameters import (
    ParameterOption,
    ParameterServices,
    ParameterValue,
    ReadableParameter,
    parameters_as_options,
)
from rise_adapters.ros2.transport.port import PortError, Transport
from rise_adapters.ros2.transport.selection import open_transport

from rise_engine.base.errors import AdapterError, RiseError
from rise_engine.base.exit_status import OK, REFUSED, USAGE
from rise_engine.cli.program import split_ros_args
from rise_engine.cli.terminal import clean_standard_streams

T = TypeVar("T")
Work: TypeAlias = Callable[[Transport, Namespace], Awaitable[None]]

_POLL_SECONDS: Final = 0.5


class NodeError(RiseError):
    """The node cannot do its work; a sentence for a person."""


def node_parser(node: str, about: str) -> ArgumentParser:
    """The options of every node."""
    parser = ArgumentParser(
        prog=node,
        description=about,
        epilog="Remappings come last, after --ros-args. Every option is a ROS parameter, too: -p name:=value.",
    )
    parser.set_defaults(node=node)
    parser.add_argument(
        "--ros", choices=("auto", "rclpy", "dds"), default="auto", help="how to reach ROS 2 (default: %(default)s)"
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


def run_node(
    parser: ArgumentParser,
    work: Work,
    arguments: Sequence[str] | None = None,
    *,
    prepare: Callable[[Namespace], None] | None = None,
) -> None:
    """Read the command line, run `work` until it returns, fails, or the program is ended, and exit. `prepare` may
    complete the options before the connection is opened.

    Every option can be given as a ROS parameter, and is shown as one. The command line overrides parameters.

    Exit status: 0; 1 an error, which was printed; 2 wrong usage.
    """
    ours, theirs = split_ros_args(sys.argv[1:] if arguments is None else arguments)
    try:
        given, theirs = parameters_as_options(theirs, parser.get_default("node"), list_parameter_options(parser), ours)
    except PortError as error:
        _fail(parser, [str(error)], USAGE)
    options = parser.parse_args([*given, *ours])
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(line_buffering=True)
    try:
        with clean_standard_streams():
            if prepare is not None:
                prepare(options)
            asyncio.run(_run(work, options, theirs, parser))
    except AdapterError as error:
        _fail(parser, error.lines)
    except (NodeError, PortError) as error:
        _fail(parser, [str(error)])
    except BrokenPipeError:  # nothing reads its output any more
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:  # before there was anything to stop
        pass
    sys.exit(OK)


def list_parameter_options(parser: ArgumentParser) -> dict[str, ParameterOption]:
    """The parser's options, by the names of their parameters."""
    return {
        action.dest: ParameterOption(
            action.option_strings[-1], switch=action.nargs == 0, repeatable=isinstance(action.default, list)
        )
        for action in _list_options(parser)
    }


def list_parameters(parser: ArgumentParser, options: Namespace) -> dict[str, ReadableParameter]:
    """The parser's options with their values, as parameters."""
    return {
        action.dest: ReadableParameter(
            _as_parameter_value(getattr(options, action.dest)), (action.help or "").partition(" (default")[0]
        )
        for action in _list_options(parser)
    }


def _list_options(parser: ArgumentParser) -> list[Action]:
    return [action for action in parser._actions if action.option_strings and action.dest != "help"]


def _as_parameter_value(value: object) -> ParameterValue:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return [str(each) for each in value] if isinstance(value, list) else str(value)


def _fail(parser: ArgumentParser, lines: Sequence[str], status: int = REFUSED) -> NoReturn:
    for line in lines:
        print(f"{parser.prog}: {line}", file=sys.stderr)
    sys.exit(status)


async def _run(work: Work, options: Namespace, theirs: Sequence[str], parser: ArgumentParser) -> None:
    transport = await open_transport(options.ros, theirs, node=options.node, share=options.share)
    settings = list_parameters(parser, options)
    try:
        ParameterServices(transport, lambda: settings)
        working = asyncio.ensure_future(work(transport, options))
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            with suppress(NotImplementedError):  # on Windows it is KeyboardInterrupt
                loop.add_signal_handler(number, working.cancel)
        while not working.done():
            await asyncio.wait([working], timeout=_POLL_SECONDS)
            if transport.failure():
                working.cancel()
                with suppress(asyncio.CancelledError):
                    await working
                raise NodeError(f"the connection to ROS was lost: {transport.failure()}")
        if not working.cancelled():
            working.result()
    finally:
        transport.close()


async def wait_forever() -> None:
    """Wait forever, for nodes whose callbacks do all the work."""
    await asyncio.Event().wait()


async def run_in_thread(function: Callable[..., T], *arguments: object) -> T:
    """Call a blocking function while the node continues. The node's end does not wait for it, unlike
    `asyncio.to_thread`."""
    result: Future[T] = Future()
    result.set_running_or_notify_cancel()

    def run() -> None:
        try:
            result.set_result(function(*arguments))
        except Exception as error:  # any error goes to the caller
            result.set_exception(error)

    Thread(target=run, daemon=True).start()
    return await asyncio.wrap_future(result)
