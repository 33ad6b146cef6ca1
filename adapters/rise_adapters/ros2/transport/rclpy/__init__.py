"""The port over rclpy, with any RMW: for machines on which ROS is installed."""

from rise_adapters.ros2.transport.rclpy.installation import rclpy_missing
from rise_adapters.ros2.transport.rclpy.transport import RclpyTransport

__all__ = ["RclpyTransport", "rclpy_missing"]
