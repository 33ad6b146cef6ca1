"""The deterministic kernel: inputs in, records and commands out (architecture, "The kernel").

Importing this package is cheap: consoles need its inputs and records, and not the kernel itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rise_engine.kernel.kernel import Kernel

__all__ = ["Kernel"]


def __getattr__(name: str) -> Any:
    if name != "Kernel":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from rise_engine.kernel.kernel import Kernel

    return Kernel
