"""ROS 2 actions, client and server, on the three services and two topics that make one up."""
