"""Nodes that run beside a session (docs/how-to/feature-nodes.md): `python -m rise_ros.examples.NAME`."""
