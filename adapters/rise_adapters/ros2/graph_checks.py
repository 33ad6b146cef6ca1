"""What can be told from the ROS graph about programs that do not fit together, as sentences for a person: for
`rise-engine doctor`, and for nodes that hear what others publish (`compatibility` does it for the actions of a robot).
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
    """The full names under which others offer an action of the mapping's type (listen to a topic of it). None are known
    of services, which a transport does not list."""
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
    """The nodes of others that may send goals to an action (its full name), as far as they say who they are. The doctor
    only looks, and what has this node's name is its predecessor, which has just gone."""
    return [
        node
        for node in transport.client_nodes(action_topic(action, SEND_GOAL))
        if node.startswith("/") and "_UNKNOWN_" not in node and node != transport.node
        if node.rpartition("/")[2] != DOCTOR_NODE_NAME
    ]


def describe_other_client(node: str, action: str) -> str:
    """The sentence about somebody who may move the robot, too."""
    return f"{describe_node(node)} may send goals to {action}, too; the record of this session does not contain these"


def describe_strangers(transport: Transport) -> list[str]:
    """A sentence about each program that can be seen but not be talked to as ROS wants it."""
    return [
        f"{describe_node(who)} uses {vendors.vendor_name(vendor)}: topics may arrive, services and actions "
        f"{'do' if vendors.services_cross(transport.vendor, vendor) == 'no' else 'may'} not. "
        f"What to do: {same_middleware_remedy(transport, vendor)}"
        for who, vendor in transport.programs_of_other_vendors()
    ]


def describe_other_versions(transport: Transport, topic: str, type: str) -> list[str]:
    """Who publishes a topic with another version of `type` than this side's: a sentence for each."""
    own, full = transport.type_hash(type), transport.resolve(topic)
    return [
        f"{describe_node(end.node)} publishes {full} with another version of {type} than this node listens for: what "
        f"arrives would be garbage. What to do: {SAME_RELEASE}"
        for end in transport.publisher_endpoints(topic)
        if end.type == type and own and end.hash and end.hash != own
    ]


def describe_topic_misfits(transport: Transport, topic: str) -> list[str]:
    """Of what other nodes have on one topic, who does not hear whom, and who would hear garbage: a sentence for each
    pair."""
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
