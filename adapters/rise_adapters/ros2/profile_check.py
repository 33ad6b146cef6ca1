"""Checks a robot's profile without a connection, for `rise-engine check` (an entry point of the group
`rise.checks`)."""

from __future__ import annotations

from collections.abc import Sequence

from rise_adapters.ros2.mapping import mapping_findings, read_options
from rise_adapters.ros2.mapping.field_types import ReadFields
from rise_adapters.ros2.transport.port import PortError
from rise_adapters.ros2.transport.rclpy.types import InstalledTypes
from rise_adapters.ros2.transport.selection import why_unavailable
from rise_engine.ports.bridge import ProfileFinding
from rise_engine.scenario.model import RobotProfile


def check_profile(profile: RobotProfile) -> list[ProfileFinding]:
    """Return the diagnostics about a profile without a connection, for `rise-engine check`. They include all reasons
    that prevent a session, because both read the same types."""
    try:
        options = read_options(profile)
    except PortError:
        return mapping_findings(profile)
    try:
        fields = _field_reader(options.share)
    except PortError as error:
        return [ProfileFinding(str(error), "options.share", "missing")]
    return mapping_findings(profile, fields)


def _field_reader(share: Sequence[str]) -> ReadFields | None:
    """The types of the transport that a session would use here; None: no transport."""
    missing = why_unavailable()
    if not missing["rclpy"]:
        return InstalledTypes().fields
    if missing["dds"]:
        return None
    from rise_adapters.ros2.transport.interfaces import InterfaceCatalog  # needs the extra rosbags

    return InterfaceCatalog(share).fields
