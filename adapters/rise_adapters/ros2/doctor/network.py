"""Domain and discovery: settings that silently keep programs from finding each other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from rise_adapters.ros2.doctor.finding import CYCLONE_RMW, DEFAULT_RMW, DoctorFinding, Environment
from rise_adapters.ros2.transport import selection

_SAFE_DOMAINS = 101
"""Above this, the ports of DDS overlap with those that Linux gives to programs."""


def check_network(environment: Environment, kind: selection.TransportKind | None = None) -> Iterator[DoctorFinding]:
    """Check settings that silently keep programs from finding each other."""
    yield from _check_domain(environment.get("ROS_DOMAIN_ID", "").strip())
    local = environment.get("ROS_LOCALHOST_ONLY", "")
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if local == "1":
        yield DoctorFinding(
            "warning",
            "network",
            "ROS_LOCALHOST_ONLY is set: nothing outside of this machine is found, whatever the discovery range says",
            "unset it; in Jazzy, ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST does the same",
        )
    elif reach == "LOCALHOST":
        yield DoctorFinding(
            "note", "network", "the discovery range is LOCALHOST: only programs on this machine are found"
        )
    elif reach == "OFF":
        yield DoctorFinding(
            "problem", "network", "the discovery range is OFF: no node is found, not even on this machine",
            "unset ROS_AUTOMATIC_DISCOVERY_RANGE",
        )  # fmt: skip
    elif reach not in ("", "SUBNET", "SYSTEM_DEFAULT"):
        yield DoctorFinding(
            "problem",
            "network",
            f"ROS_AUTOMATIC_DISCOVERY_RANGE is {reach!r}; it can be SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT",
        )
    if uri := environment.get("CYCLONEDDS_URI", "").strip():
        named = environment.get("RMW_IMPLEMENTATION", "")
        if kind == "rclpy" and named != CYCLONE_RMW:
            yield DoctorFinding(
                "note", "network", f"CYCLONEDDS_URI is set, and means nothing to {named or DEFAULT_RMW}"
            )
        else:
            yield from _check_cyclone(
                uri, bool(environment.get("ROS_STATIC_PEERS")) or reach == "LOCALHOST" or local == "1"
            )
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"):
        if (file := environment.get(name, "")) and not Path(file).is_file():
            yield DoctorFinding("warning", "network", f"{name} names {file}, which does not exist")
    if kind == "dds":
        if environment.get("ROS_DISCOVERY_SERVER"):
            yield DoctorFinding(
                "warning", "network", "ROS_DISCOVERY_SERVER is set: what is found through it only, `dds` does not find"
            )
        if environment.get("ROS_SECURITY_ENABLE", "").lower() == "true":
            yield DoctorFinding(
                "problem",
                "network",
                "ROS_SECURITY_ENABLE is set, and the transport `dds` has no security: it and secured nodes do not talk",
                "use --ros rclpy",
            )


def _check_domain(number: str) -> Iterator[DoctorFinding]:
    if not number:
        yield DoctorFinding("ok", "network", "ROS domain 0 (ROS_DOMAIN_ID is not set)")
    elif not (number.isascii() and number.isdigit()) or int(number) > 232:
        yield DoctorFinding("problem", "network", f"ROS_DOMAIN_ID must be a number from 0 to 232, not {number!r}")
    elif int(number) > _SAFE_DOMAINS:
        yield DoctorFinding(
            "note",
            "network",
            f"ROS domain {int(number)}: above {_SAFE_DOMAINS} its ports may be taken by other programs",
            "choose a number from 0 to 101, the same for all programs",
        )
    else:
        yield DoctorFinding("ok", "network", f"ROS domain {int(number)}")


def _check_cyclone(uri: str, peers: bool) -> Iterator[DoctorFinding]:
    """The effect of a CYCLONEDDS_URI on discovery. `peers`: whether addresses to search are set elsewhere."""
    pieces: list[ElementTree.Element] = []
    for part in _split_uri(uri):
        words = part
        if not part.startswith("<"):
            path = Path(part.removeprefix("file://"))
            try:
                words = path.read_text("utf-8")
            except (OSError, UnicodeDecodeError):
                yield DoctorFinding("problem", "network", f"CYCLONEDDS_URI names the file {path}, which cannot be read")
                continue
        try:
            pieces.append(ElementTree.fromstring(f"<all>{_drop_declaration(words)}</all>"))
        except ElementTree.ParseError as error:
            yield DoctorFinding("problem", "network", f"CYCLONEDDS_URI holds XML that is not well-formed: {error}")
    elements = [each for piece in pieces for each in piece.iter()]
    settings = {_local_name(each): (each.text or "").strip() for each in elements}
    interfaces = [each for each in elements if _local_name(each) == "NetworkInterface"]
    names = [each.get("name") or each.get("address") or "" for each in interfaces]
    silent = settings.get("AllowMulticast", "").lower() in ("false", "spdp", "none") or any(
        each.get("multicast", "").lower() == "false" for each in interfaces
    )
    loopback = bool(names) and all(name in ("lo", "localhost") or name.startswith("127.") for name in names)
    if loopback:
        yield DoctorFinding(
            "note", "network", "CYCLONEDDS_URI names the loopback only: just programs on this machine are found"
        )
    elif names:
        yield DoctorFinding("note", "network", f"CYCLONEDDS_URI names the network interface {', '.join(names)}")
    if silent and not peers and not any(_local_name(each) == "Peer" for each in elements):
        yield DoctorFinding(
            "problem",
            "network",
            "CYCLONEDDS_URI switches multicast off and names no peers: no node is found",
            'add <Discovery><Peers><Peer address="localhost"/></Peers></Discovery>, with the robot\'s address too',
        )
    elif silent:
        yield DoctorFinding(
            "note",
            "network",
            "CYCLONEDDS_URI switches multicast off: a program with another setting is not found, and nothing says so",
            "give all programs the same setting",
        )


def _split_uri(uri: str) -> list[str]:
    """Split CYCLONEDDS_URI, a list of files and XML with commas; the XML may contain commas itself."""
    parts: list[str] = []
    for piece in uri.split(","):
        if parts and parts[-1].startswith("<") and not piece.lstrip().startswith(("<", "file://", "/")):
            parts[-1] += f",{piece}"
        elif piece.strip():
            parts.append(piece.strip())
    return parts


def _drop_declaration(words: str) -> str:
    words = words.lstrip("\ufeff \n\t\r")
    return words.partition("?>")[2] if words.startswith("<?xml") else words


def _local_name(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2]
