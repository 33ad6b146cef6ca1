"""Nodes that run beside a session: `python -m rise_adapters.ros2.examples.NAME --help` (docs/how-to/feature-nodes.md)."""
