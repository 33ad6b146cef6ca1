"""Markers of a running session for the Lab Streaming Layer (https://labstreaminglayer.readthedocs.io)."""

from rise_adapters.lsl.outlet import LslOutlet, open_outlet

__all__ = ["LslOutlet", "open_outlet"]
