"""The DDS domain of this process, configured from the environment like ROS's own rmw_cyclonedds, so that both find each
other with the same settings.

These are first `ROS_AUTOMATIC_DISCOVERY_RANGE`, `ROS_STATIC_PEERS` and `ROS_LOCALHOST_ONLY`, then `CYCLONEDDS_URI`,
which overrides them. A domain has one configuration in a process, the first; all transports of the domain share it.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping
from threading import Lock
from xml.sax.saxutils import quoteattr

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain

from rise_adapters.ros2.transport.port import PortError

DISCOVERY_RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")
LARGEST_DOMAIN = 232
"""Above this, the ports that DDS computes do not exist."""
_MAX_PARTICIPANTS = 32
"""The number of programs that find each other on one machine without multicast, as in rmw_cyclonedds."""
_LEASE_SECONDS = 1.0
"""Seconds without a sign of life after which other programs consider this one dead."""


def read_domain_id(environment: Mapping[str, str]) -> int:
    """Read `ROS_DOMAIN_ID`; 0: not set. Raises PortError if it is not a valid number."""
    text = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    try:
        number = int(text)
    except ValueError:
        number = -1
    if not 0 <= number <= LARGEST_DOMAIN:
        raise PortError(f"ROS_DOMAIN_ID must be a number from 0 to {LARGEST_DOMAIN}, not {text!r}")
    return number


def make_configuration(environment: Mapping[str, str]) -> str:
    """Make the configuration for Cyclone DDS. Raises PortError for an unknown discovery range."""
    discovery, general = "", ""
    reach, peers = _read_discovery_range(environment)
    if reach in ("LOCALHOST", "OFF"):
        general = "<General><AllowMulticast>false</AllowMulticast></General>"
    if reach == "OFF":
        discovery = f"<ParticipantIndex>none</ParticipantIndex><Tag>ros_discovery_off_{os.getpid()}</Tag>"
    elif reach != "SYSTEM_DEFAULT":
        discovery = "<ParticipantIndex>auto</ParticipantIndex>"
        discovery += f"<MaxAutoParticipantIndex>{_MAX_PARTICIPANTS}</MaxAutoParticipantIndex>"
        if peers:
            discovery += f"<Peers>{''.join(f'<Peer address={quoteattr(peer)}/>' for peer in peers)}</Peers>"
    # Four signs of life in a lease, so that one or two may get lost.
    discovery += (
        f"<LeaseDuration>{_LEASE_SECONDS:.3f}s</LeaseDuration><SPDPInterval>{_LEASE_SECONDS / 4:.3f}s</SPDPInterval>"
    )
    own = f"<CycloneDDS><Domain>{general}<Discovery>{discovery}</Discovery></Domain></CycloneDDS>"
    return ",".join(part for part in (own, environment.get("CYCLONEDDS_URI", "")) if part)


def _read_discovery_range(environment: Mapping[str, str]) -> tuple[str, list[str]]:
    if environment.get("ROS_LOCALHOST_ONLY") == "1":
        return "LOCALHOST", ["localhost"]
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "") or "SUBNET"
    if reach not in DISCOVERY_RANGES:
        raise PortError(f"ROS_AUTOMATIC_DISCOVERY_RANGE is {reach!r}, but must be one of {', '.join(DISCOVERY_RANGES)}")
    peers = [peer.strip() for peer in environment.get("ROS_STATIC_PEERS", "").split(";") if peer.strip()]
    if reach == "LOCALHOST":
        return reach, ["localhost", *peers]
    return reach, peers if reach == "SUBNET" else []


_domains: dict[int, Domain | None] = {}
_users: Counter[int] = Counter()
_lock = Lock()


def acquire_domain(number: int, environment: Mapping[str, str]) -> None:
    """Configure the domain; pair each call with `release_domain`. Raises PortError for a wrong configuration."""
    with _lock:
        if number not in _domains:
            _domains[number] = _create_domain(number, make_configuration(environment))
        _users[number] += 1


def release_domain(number: int) -> None:
    with _lock:
        _users[number] -= 1
        if not _users[number]:
            del _domains[number]


def _create_domain(number: int, config: str) -> Domain | None:
    try:
        return Domain(number, config)
    except DDSException as error:
        if error.code == DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
            return None  # Something else in this process has it already; that configuration stays.
        raise PortError(
            f"Cyclone DDS does not take its configuration for ROS domain {number}: {error.msg or error}. "
            "It comes from CYCLONEDDS_URI and the ROS_... variables"
        ) from None
    except UnicodeEncodeError:
        raise PortError("CYCLONEDDS_URI has letters in it that Cyclone DDS does not take") from None
