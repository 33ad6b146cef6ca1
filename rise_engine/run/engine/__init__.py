"""A kernel with what it does not have itself: a clock, a journal, a robot."""
