"""The mapping of a robot profile's actions to ROS actions, topics and services, and to their fields
(docs/reference/robots.md, "Carriers").

`read_mappings` checks and prepares a whole profile. An `ActionMapping` then makes the message of a goal, and reads from
a result whether the robot succeeded. Nothing here sends messages.
"""

from __future__ import annotations

from rise_adapters.ros2.mapping.action_mapping import ActionMapping, GoalDeadlines, RosOptions
from rise_adapters.ros2.mapping.profile import (
    mapping_findings,
    mapping_problems,
    read_mappings,
    read_options,
    with_all_carriers,
)
from rise_adapters.ros2.transport.port import PortError

__all__ = [
    "ActionMapping",
    "GoalDeadlines",
    "PortError",
    "RosOptions",
    "mapping_findings",
    "mapping_problems",
    "read_mappings",
    "read_options",
    "with_all_carriers",
]
