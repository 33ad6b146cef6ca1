"""rise-tui in a ROS workspace: programs, a launch file, the reference robot wrapper, and a leaf for behaviour trees."""
