"""How a robot profile maps an action to a ROS action, topic or service, and what fills its fields
(docs/reference/robots.md, "Carriers").

`read_mappings` checks a whole profile at once and prepares it. An `ActionMapping` then makes the message of a goal, and
reads from a result whether the robot did what it was asked to do. Nothing here sends anything.
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
