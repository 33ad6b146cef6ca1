"""What the environment of a terminal says about ROS."""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TypeAlias

Environment: TypeAlias = Mapping[str, str]

DISTRIBUTION = "jazzy"
DEFAULT_RMW = "rmw_fastrtps_cpp"
"""Of that distribution."""
CYCLONE_RMW = "rmw_cyclonedds_cpp"


def sourced_prefixes(environment: Environment) -> list[Path]:
    """The folders of the installations and workspaces that are sourced, as AMENT_PREFIX_PATH names them."""
    return [Path(prefix) for prefix in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]


def installed_version(package: str) -> str:
    """Of a Python package; empty when it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
