"""A recorded session as a bag of ROS 2: `rise-engine export --format mcap` (entry-point group `rise.exports`)."""

from rise_adapters.ros2.bag.export import FORMAT

__all__ = ["FORMAT"]
