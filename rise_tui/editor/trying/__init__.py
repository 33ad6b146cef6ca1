"""Trying a rule out beside its page, on a virtual clock: no robot, no record."""
