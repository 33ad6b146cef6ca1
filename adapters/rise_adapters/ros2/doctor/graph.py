"""Which other nodes are seen, and which of them cannot be talked to."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from rise_adapters.ros2 import graph_checks
from rise_adapters.ros2.doctor.finding import DoctorFinding
from rise_adapters.ros2.transport.port import Transport


def check_graph(transport: Transport) -> Iterator[DoctorFinding]:
    """Which other nodes are seen, and which of them cannot be talked to."""
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
        for sentence in graph_checks.describe_topic_misfits(transport, topic):
            yield DoctorFinding("warning", "graph", sentence, "make both the same")
