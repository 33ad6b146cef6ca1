"""rise-tui in a ROS workspace: programs for `ros2 run`, a launch file, and the reference robot wrapper."""
