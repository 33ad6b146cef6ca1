"""What `rise-engine doctor` says about ROS 2 on this machine and about the robot: what is there, what is not, and what
to do. It works without any ROS too, and says how to get on then.

    findings = await examine("auto", profile)
    print(as_text(findings))
    return exit_status(findings)

Nothing here changes anything: no goal is sent, and nothing is published but that this node is there.
"""

from __future__ import annotations

from rise_adapters.ros2.doctor.examination import examine, examine_robot
from rise_adapters.ros2.doctor.finding import DoctorFinding, as_json, as_text, exit_status

__all__ = ["DoctorFinding", "as_json", "as_text", "examine", "examine_robot", "exit_status"]
