"""A kernel with a clock, a journal and a robot."""
