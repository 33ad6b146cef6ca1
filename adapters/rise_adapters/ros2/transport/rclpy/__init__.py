"""The port over rclpy, with any RMW, for machines with a ROS installation."""

from rise_adapters.ros2.transport.rclpy.installation import rclpy_missing
from rise_adapters.ros2.transport.rclpy.transport import RclpyTransport

__all__ = ["RclpyTransport", "rclpy_missing"]
