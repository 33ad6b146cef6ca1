"""The port over Cyclone DDS, without a ROS installation (the extra `dds`)."""

from rise_adapters.ros2.transport.dds.transport import DdsTransport

__all__ = ["DdsTransport"]
