"""A kernel with the parts that it lacks: a clock, a journal, a robot."""
