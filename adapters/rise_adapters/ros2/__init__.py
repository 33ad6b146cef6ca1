"""ROS 2: one bridge over a narrow port, two transports."""
