"""The report of `rise-engine doctor` about ROS 2 on this machine and about the robot: what works, what does not, and
what to do. It also works without ROS, and then says how to continue.

    findings = await examine("auto", profile)
    print(as_text(findings))
    return exit_status(findings)

Nothing here changes anything. It sends no goal, and announces only its own node.
"""

from __future__ import annotations

from rise_adapters.ros2.doctor.examination import examine, examine_robot
from rise_adapters.ros2.doctor.finding import DoctorFinding, as_json, as_text, exit_status

__all__ = ["DoctorFinding", "as_json", "as_text", "examine", "examine_robot", "exit_status"]
