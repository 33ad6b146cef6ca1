"""Finds programs on the ROS graph that do not fit together, for `rise-engine doctor` and listening nodes.

`compatibility` checks the actions of a robot.
"""

from __future__ import annotations

from rise_adapters.ros2.compatibility import (
    SAME_RELEASE,
    describe_node,
    qos_conflict,
    ros_type,
    same_middleware_remedy,
)
from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.port import FEEDBACK, SEND_GOAL, Transport, action_topic

DOCTOR_NODE_NAME = "rise_doctor"


def names_elsewhere(transport: Transport, mapping: ActionMapping) -> list[str]:
    """The full names under which other nodes offer an action of the mapping's type, or listen to a topic of it. A
    transport does not list services, so they have none."""
    own = transport.resolve(mapping.name)
    names: list[str] = []
    for topic in transport.topics():
        if mapping.kind == "service":
            break
        if mapping.kind == "action":
            name = topic.removesuffix(action_topic("", FEEDBACK))
            found = transport.publisher_endpoints(topic) if name != topic else []
        else:
            name, found = topic, transport.subscriber_endpoints(topic)
        if name != own and any(ros_type(end.type) == mapping.type for end in found):
            names.append(name)
    return names


def other_clients(transport: Transport, action: str) -> list[str]:
    """Other nodes that may send goals to an action (its full name), as far as they announce themselves. The doctor only
    listens, and a node with this node's own name is its predecessor, which has just gone."""
    return [
        node
        for node in transport.client_nodes(action_topic(action, SEND_GOAL))
        if node.startswith("/") and "_UNKNOWN_" not in node and node != transport.node
        if node.rpartition("/")[2] != DOCTOR_NODE_NAME
    ]


def describe_other_client(node: str, action: str) -> str:
    """The sentence about another client that may move the robot."""
    return f"{describe_node(node)} may send goals to {action}, too; the record of this session does not contain these"


def describe_strangers(transport: Transport) -> list[str]:
    """A sentence about each visible program that cannot be reached as ROS requires."""
    return [
        f"{describe_node(who)} uses {vendors.vendor_name(vendor)}: topics may arrive, services and actions "
        f"{'do' if vendors.services_cross(transport.vendor, vendor) == 'no' else 'may'} not. "
        f"What to do: {same_middleware_remedy(transport, vendor)}"
        for who, vendor in transport.programs_of_other_vendors()
    ]


def describe_other_versions(transport: Transport, topic: str, type: str) -> list[str]:
    """A sentence for each node that publishes a topic with a version of `type` other than this side's."""
    own, full = transport.type_hash(type), transport.resolve(topic)
    return [
        f"{describe_node(end.node)} publishes {full} with another version of {type} than this node listens for: what "
        f"arrives would be garbage. What to do: {SAME_RELEASE}"
        for end in transport.publisher_endpoints(topic)
        if end.type == type and own and end.hash and end.hash != own
    ]


def describe_topic_mismatches(transport: Transport, topic: str) -> list[str]:
    """A sentence for each pair of other nodes on a topic that do not hear each other, or would receive garbage."""
    found: dict[str, None] = {}
    for publisher in transport.publisher_endpoints(topic):
        for listener in transport.subscriber_endpoints(topic):
            who, whom = describe_node(publisher.node), describe_node(listener.node)
            if publisher.type != listener.type:
                if publisher.type and listener.type:
                    what = f"{who} publishes {topic} as {publisher.type}, and {whom} listens for {listener.type}"
                    found[f"{what}: nothing arrives"] = None
            elif publisher.hash and listener.hash and publisher.hash != listener.hash:
                what = f"{who} publishes {topic} with another version of {publisher.type} than {whom} listens for"
                found[f"{what}: the data is garbage"] = None
            elif conflict := qos_conflict(publisher.qos, listener.qos):
                what = f"{who} publishes {topic} {conflict.offered}, and {whom} wants it {conflict.wanted}"
                found[f"{what}: nothing arrives"] = None
    return list(found)
