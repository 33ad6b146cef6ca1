"""Selects and opens the transport of a session."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from rise_adapters.ros2.transport.port import Transport
from rise_adapters.ros2.transport.rclpy import RclpyTransport, rclpy_missing
from rise_engine.base.errors import AdapterError

TransportKind = Literal["rclpy", "dds"]


def why_unavailable() -> dict[TransportKind, str]:
    """The transports, with the reason if one cannot be used here; empty: it can."""
    return {"rclpy": _why_no_rclpy(), "dds": _why_no_dds()}


def select_transport(choice: str) -> TransportKind:
    """Return the transport that `auto`, `rclpy` or `dds` means here. Raises AdapterError."""
    missing = why_unavailable()
    wanted = [kind for kind in missing if choice in (kind, "auto")]
    for kind in wanted:
        if not missing[kind]:
            return kind
    hints = ["to rehearse without a robot: --mode debug"] if choice == "auto" else []
    raise AdapterError(*(missing[kind] for kind in wanted), *hints)


async def open_transport(
    choice: str = "auto", arguments: Sequence[str] = (), *, node: str, share: Sequence[Path] = ()
) -> Transport:
    """Open a node on the wire.

    `arguments` are those after `--ros-args`. `share`: folders with definitions of types, in addition to those of this
    program and of a ROS installation (`dds` only: `rclpy` has the types that are built and sourced). Raises
    AdapterError.
    """
    kind = select_transport(choice)
    loop = asyncio.get_running_loop()
    if kind == "rclpy":
        return RclpyTransport(loop, node=node, arguments=arguments)
    from rise_adapters.ros2.transport.dds import DdsTransport  # imports the wheel, which may be missing

    return DdsTransport(loop, node=node, arguments=arguments, share=share)


def _why_no_rclpy() -> str:
    why = rclpy_missing()
    if why and find_spec("rclpy") is None and "AMENT_PREFIX_PATH" in os.environ:
        return (
            f"ROS 2 is sourced here, but this Python ({sys.version.split()[0]}) has no rclpy: it belongs to the "
            "system's own Python; make the environment of rise-tui from that one, with --system-site-packages"
        )
    return why


def _why_no_dds() -> str:
    missing = [name for name in ("cyclonedds", "rosbags") if find_spec(name) is None]
    if not missing:
        return ""
    return f"ROS 2 without an installation needs {' and '.join(missing)}: pip install 'rise-tui[dds]'"
