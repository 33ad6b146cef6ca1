"""A robot that exists only in this program: the driver `simulated`, used by every session in debug mode."""

from rise_adapters.simulated.robot import SimulatedRobot

__all__ = ["SimulatedRobot"]
