"""A study tried out on a virtual clock: no robot, no journal, nothing is kept."""
