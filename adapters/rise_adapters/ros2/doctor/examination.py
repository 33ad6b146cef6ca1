"""All examinations of the doctor, in the order of their importance."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import suppress
from typing import TypeAlias

from rise_adapters.ros2 import graph_checks
from rise_adapters.ros2.doctor import finding
from rise_adapters.ros2.doctor.computer import (
    check_installation,
    check_interfaces,
    check_middleware,
    check_network,
    check_transport,
)
from rise_adapters.ros2.doctor.finding import DoctorFinding, Environment
from rise_adapters.ros2.doctor.robot import SEARCH_SECONDS, check_robot, definition_folders
from rise_adapters.ros2.graph_checks import DOCTOR_NODE_NAME
from rise_adapters.ros2.transport import selection
from rise_adapters.ros2.transport.port import Transport
from rise_engine.base.errors import AdapterError
from rise_engine.ports.bridge import RosConnection
from rise_engine.scenario.model import RobotProfile

# --- other nodes ------------------------------------------------------------------------------------------------------


def check_graph(transport: Transport) -> Iterator[DoctorFinding]:
    """Report the visible nodes, and those that cannot be reached."""
    if lost := transport.failure():
        yield DoctorFinding("problem", "graph", f"the connection is lost: {lost}")
        return
    others = transport.nodes()
    with suppress(ValueError):
        others.remove(transport.node)
    if others:
        counts = {node: others.count(node) for node in others}
        names = ", ".join(node if number == 1 else f"{node} ({number} times)" for node, number in counts.items())
        yield DoctorFinding(
            "ok", "graph", f"{len(others)} other node{'s are' if len(others) > 1 else ' is'} seen: {names}"
        )
        for node, number in counts.items():
            if number > 1:
                yield DoctorFinding(
                    "warning", "graph", f"{number} nodes have the name {node}", "give each a name of its own"
                )
    else:
        yield DoctorFinding(
            "note",
            "graph",
            "no other node is seen",
            "if there are some: same ROS domain, same network, same middleware? A firewall may be in the way "
            "(docs/how-to/two-computers.md)",
        )
    for sentence in graph_checks.describe_strangers(transport):
        yield DoctorFinding("warning", "graph", sentence)
    for topic in transport.topics():
        for sentence in graph_checks.describe_topic_mismatches(transport, topic):
            yield DoctorFinding("warning", "graph", sentence, "make both the same")


TransportOpener: TypeAlias = Callable[..., Awaitable[Transport]]


async def examine(
    choice: str = "auto",
    profile: RobotProfile | None = None,
    *,
    arguments: Sequence[str] = (),
    environment: Environment = os.environ,
    seconds: float = SEARCH_SECONDS,
    open_transport: TransportOpener = selection.open_transport,
) -> list[DoctorFinding]:
    """Examine everything, in the order of importance. `choice` and `arguments` are those of a session (`--ros`,
    `--ros-args`). With a profile, the search for its robot takes `seconds` at most. Findings are never raised."""
    if choice == "off":
        return [DoctorFinding("note", "transport", "ROS is off", "omit `--ros off` to examine it")]
    kind, about_transport = check_transport(choice)
    found = [*check_installation(environment, wanted=kind == "rclpy" or choice == "rclpy")]
    found += check_middleware(environment, kind)
    found += check_network(environment, kind)
    found += about_transport
    found += check_interfaces(environment, kind)
    if kind is None:
        return found
    try:
        transport = await open_transport(choice, arguments, node=DOCTOR_NODE_NAME, share=definition_folders(profile))
    except AdapterError as error:
        return [*found, *(DoctorFinding("problem", "transport", line) for line in error.lines)]
    try:
        found.append(DoctorFinding("ok", "transport", f"connected: {transport.about}, as the node {transport.node}"))
        found += await check_robot(transport, profile, seconds)
        found += check_graph(transport)
    finally:
        transport.close()
    return found


def examine_robot(
    wire: RosConnection, profile: RobotProfile | None, *, seconds: float, as_json: bool
) -> tuple[str, int]:
    """Return the output of `rise-engine doctor` and its exit status (`rise_engine.ports.bridge.Examiner`)."""
    found = asyncio.run(examine(wire.transport, profile, arguments=wire.arguments, seconds=seconds))
    return (finding.as_json(found) + "\n" if as_json else finding.as_text(found)), finding.exit_status(found)
