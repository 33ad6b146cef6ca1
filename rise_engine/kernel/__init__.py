"""The deterministic kernel: inputs in, records and commands out (architecture, "The kernel")."""

from __future__ import annotations

from rise_engine.kernel.kernel import Kernel

__all__ = ["Kernel"]
