"""One node on the wire of ROS 2: the port, and the two transports that implement it."""
