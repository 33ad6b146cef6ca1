"""A session for other ROS nodes: tasks, memory, states, the record, diagnostics (docs/explanation/ros2.md)."""

from rise_adapters.ros2.session_node.interface import RosSessionInterface

__all__ = ["RosSessionInterface"]
