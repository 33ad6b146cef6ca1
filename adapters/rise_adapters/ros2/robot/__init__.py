"""The robot port over ROS 2 actions and topics: a goal table, a deadline for each phase, one ending for each action,
and stop-all (docs/explanation/ros2.md, "Nothing is lost on the way to the robot")."""

from rise_adapters.ros2.robot.robot import Ros2Robot

__all__ = ["Ros2Robot"]
