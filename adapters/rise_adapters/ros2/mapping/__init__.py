"""How a robot profile says which ROS action or topic carries an action, and what goes into its fields
(docs/reference/robots.md, "Carriers").

`read_carriers` checks all of a profile at once and prepares it; a `Carrier` then makes the message of a goal, and reads
from a result whether the robot did what it was asked for. Nothing here sends anything.
"""

from __future__ import annotations

from rise_adapters.ros2.carriers.carrier import Carrier, CarrierErrors, Deadlines, Options
from rise_adapters.ros2.mapping.profile import profile_findings, read_carriers, read_options, written_out

__all__ = [
    "Carrier",
    "CarrierErrors",
    "Deadlines",
    "Options",
    "profile_findings",
    "read_carriers",
    "read_options",
    "written_out",
]
