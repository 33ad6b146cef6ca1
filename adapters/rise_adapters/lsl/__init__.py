"""Markers of a running session for the Lab Streaming Layer (https://labstreaminglayer.readthedocs.io)."""

from rise_adapters.lsl.outlet import send_markers

__all__ = ["send_markers"]
