"""The report of `rise-engine doctor` on ROS 2 on this machine and on the robot: what works, what does not, and the
remedy. It also works without ROS, and then shows the next steps.

    findings = await examine("auto", profile)
    print(as_text(findings))
    return exit_status(findings)

It changes nothing, sends no goal, and announces only its own node.
"""

from __future__ import annotations

from rise_adapters.ros2.doctor.examination import examine, examine_robot
from rise_adapters.ros2.doctor.finding import DoctorFinding, as_json, as_text, exit_status

__all__ = ["DoctorFinding", "as_json", "as_text", "examine", "examine_robot", "exit_status"]
