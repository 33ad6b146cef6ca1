"""The deterministic kernel: inputs in, records and commands out. Knows no clock, disk, robot, thread or screen."""

from rise_engine.kernel.kernel import Kernel

__all__ = ["Kernel"]
