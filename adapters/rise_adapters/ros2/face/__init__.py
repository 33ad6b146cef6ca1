"""What a session publishes on ROS (moves to `session_node`)."""
