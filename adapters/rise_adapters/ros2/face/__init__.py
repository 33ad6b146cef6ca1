"""A session as other nodes see it: tasks, memory, states, the record, diagnostics (docs/explanation/ros2.md)."""

from rise_adapters.ros2.face.face import Face

__all__ = ["Face"]
