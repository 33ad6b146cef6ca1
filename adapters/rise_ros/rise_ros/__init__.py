"""rise-tui in a ROS workspace: programs for `ros2 run`, a launch file, the reference robot wrapper, and
a leaf for behaviour trees."""
