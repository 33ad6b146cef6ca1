"""ROS 2 actions, client and server, built from their three services and two topics."""
