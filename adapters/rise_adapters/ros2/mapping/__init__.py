"""How a robot profile says which ROS action, topic or service carries an action, and what goes into its fields
(docs/reference/robots.md, "Carriers").

`read_mappings` checks all of a profile at once and prepares it; an `ActionMapping` then makes the message of a
goal, and reads from a result whether the robot did what it was asked for. Nothing here sends anything.
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
