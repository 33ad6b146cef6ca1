"""What `rise-engine doctor` says about ROS 2 on this machine and about the robot: what is there, what is not, and what
to do. It works without any ROS too, and says how to get on then.

    findings = await examine("auto", profile)
    print(text(findings))
    return status(findings)

Nothing here changes anything: no goal is sent, and nothing is published but that this node is there.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import textwrap
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, TypeAlias
from xml.etree import ElementTree

import msgspec
from msgspec import Struct

from rise_adapters.ros2 import choose, ends
from rise_adapters.ros2.action_client import ActionClient
from rise_adapters.ros2.carriers import Carrier, CarrierErrors, read_carriers, read_options
from rise_adapters.ros2.port import PortError, Transport
from rise_adapters.ros2.transport.rclpy import rclpy_missing
from rise_engine.bridge import BridgeError
from rise_engine.scenario.model import RobotProfile

Level: TypeAlias = Literal["ok", "note", "warning", "problem"]
Environment: TypeAlias = Mapping[str, str]
Opener: TypeAlias = Callable[..., Awaitable[Transport]]

DISTRIBUTION = "jazzy"
DEFAULT_RMW = "rmw_fastrtps_cpp"
"""Of that distribution."""
CYCLONE_RMW = "rmw_cyclonedds_cpp"
INTERFACES = "rise_interfaces"
DRIVER = "ros2"
NODE = "rise_doctor"

SECONDS = 3.0
"""For which the robot's servers are waited for. Discovery takes milliseconds on one machine, and longer on Wi-Fi."""
SETTLE = 0.5
"""For which it goes on after all were found, because a second server may come."""
_LOOK = 0.05
_MOST_NAMES = 8
_SAFE_DOMAINS = 101
"""Above it, the ports of DDS overlap those that Linux gives to programs."""
_INSTALLED = Path("/opt/ros")


class Finding(Struct, frozen=True):
    """One thing to know."""

    level: Level
    about: str
    """ros, rmw, network, transport, interfaces, robot or graph."""
    sentence: str
    remedy: str = ""
    """What to do about it."""


# --- all of it ----------------------------------------------------------------------------------------------------


async def examine(
    choice: str = "auto",
    profile: RobotProfile | None = None,
    *,
    arguments: Sequence[str] = (),
    environment: Environment = os.environ,
    seconds: float = SECONDS,
    open_wire: Opener = choose.open_transport,
) -> list[Finding]:
    """Everything, in the order in which it matters. `choice` and `arguments` as a session has them (`--ros`,
    `--ros-args`); with a profile, its robot is looked for for `seconds` at most. Never raises for what it finds."""
    if choice == "off":
        return [Finding("note", "transport", "ROS is off", "leave `--ros off` away to have it looked at")]
    kind, about_transport = transport(choice)
    found = [*ros(environment, wanted=kind == "rclpy" or choice == "rclpy")]
    found += rmw(environment, kind)
    found += network(environment, kind)
    found += about_transport
    found += interfaces(environment, kind)
    if kind is None:
        return found
    try:
        wire = await open_wire(choice, arguments, node=NODE, share=_share(profile))
    except (BridgeError, PortError) as error:
        return [*found, *(Finding("problem", "transport", line) for line in str(error).splitlines())]
    try:
        found.append(Finding("ok", "transport", f"connected: {wire.about}, as the node {wire.node}"))
        found += await robot(wire, profile, seconds)
        found += graph(wire)
    finally:
        wire.close()
    return found


def status(findings: Sequence[Finding]) -> int:
    """The exit status: 1 when there is a problem."""
    return 1 if any(finding.level == "problem" for finding in findings) else 0


def text(findings: Sequence[Finding], width: int = 100) -> str:
    """For a person, with a last line that counts."""
    lines: list[str] = []
    for finding in findings:
        head = f"{finding.level:<9}"
        lines += textwrap.wrap(finding.sentence, width, initial_indent=head, subsequent_indent=" " * 9)
        if finding.remedy:
            lines += textwrap.wrap(finding.remedy, width, initial_indent=" " * 9 + "→ ", subsequent_indent=" " * 11)
    counts = [(level, sum(finding.level == level for finding in findings)) for level in ("problem", "warning")]
    said = [f"{number} {level}{'s' if number != 1 else ''}" for level, number in counts if number]
    lines.append(", ".join(said) if said else "nothing is in the way")
    return "\n".join(lines) + "\n"


def document(findings: Sequence[Finding]) -> str:
    """The same as one JSON object."""
    levels = [finding.level for finding in findings]
    return msgspec.json.encode(
        {"problems": levels.count("problem"), "warnings": levels.count("warning"), "findings": list(findings)}
    ).decode()


# --- what is installed --------------------------------------------------------------------------------------------


def ros(environment: Environment, *, wanted: bool = False, installed: Path = _INSTALLED) -> Iterator[Finding]:
    """Whether ROS 2 is installed and sourced, and whether this Python can use it. `wanted`: rclpy is what is used."""
    name, prefixes = environment.get("ROS_DISTRO", ""), _prefixes(environment)
    if name and prefixes:
        yield Finding("ok", "ros", f"ROS 2 {name.capitalize()} is sourced: {', '.join(map(str, prefixes[:6]))}")
        if name != DISTRIBUTION:
            yield Finding(
                "warning",
                "ros",
                f"this program is made for and tested with ROS 2 {DISTRIBUTION.capitalize()}, not {name}",
            )
    elif name or prefixes:
        which = "ROS_DISTRO, but not AMENT_PREFIX_PATH" if name else "AMENT_PREFIX_PATH, but not ROS_DISTRO"
        yield Finding(
            "warning", "ros", f"ROS 2 is sourced only in part: there is {which}", f"source {_setup(installed)}"
        )
    elif found := _distributions(installed):
        level: Level = "warning" if wanted else "note"
        yield Finding(
            level,
            "ros",
            f"ROS 2 is installed ({', '.join(found)}), but not sourced in this terminal",
            f"source {_setup(installed)}",
        )
    else:
        yield Finding(
            "note",
            "ros",
            "there is no ROS 2 on this machine; it is not needed for robots whose nodes use "
            f"{CYCLONE_RMW}: the transport `dds` talks to them without it",
        )
    for prefix in prefixes:
        if not prefix.is_dir():
            yield Finding(
                "warning",
                "ros",
                f"AMENT_PREFIX_PATH names {prefix}, which is not there",
                "open a new terminal and source again",
            )
    missing = choose.available()["rclpy"] or rclpy_missing()
    if not missing:
        yield Finding("ok", "ros", f"rclpy {_version('rclpy') or 'of an unknown version'} can be used from this Python")
    else:
        yield Finding("problem" if wanted else "warning" if name else "note", "ros", missing)


def rmw(environment: Environment, kind: choose.Kind | None = None) -> Iterator[Finding]:
    """Which middleware nodes of this terminal use, and whether the transport can talk to it."""
    there = installed_rmw(environment)
    named = environment.get("RMW_IMPLEMENTATION", "")
    if there:
        yield Finding("ok", "rmw", f"installed middleware: {', '.join(there)}")
    if named and there and named not in there:
        yield Finding(
            "problem" if kind == "rclpy" else "warning",
            "rmw",
            f"RMW_IMPLEMENTATION is {named}, which is not installed",
            f"sudo apt install ros-{environment.get('ROS_DISTRO') or DISTRIBUTION}-{named.replace('_', '-')}",
        )
    elif named:
        yield Finding("ok", "rmw", f"RMW_IMPLEMENTATION is {named}")
    elif there:
        default = DEFAULT_RMW if DEFAULT_RMW in there else there[0]
        yield Finding("note", "rmw", f"RMW_IMPLEMENTATION is not set, so nodes of this terminal use {default}")
    used = named or (DEFAULT_RMW if there else "")
    if kind == "dds" and used and used != CYCLONE_RMW:
        yield Finding(
            "warning",
            "rmw",
            f"nodes that are started in this terminal use {used}; of those, the transport `dds` gets topics at best, "
            "and no services or actions",
            f"export RMW_IMPLEMENTATION={CYCLONE_RMW} for the robot's nodes, or use --ros rclpy here",
        )


def installed_rmw(environment: Environment) -> list[str]:
    """The middlewares that the sourced workspaces have, by the index of ament."""
    names = {
        entry.name
        for prefix in _prefixes(environment)
        for entry in (prefix / "share/ament_index/resource_index/rmw_typesupport").glob("rmw_*")
    }
    return sorted(names - {"rmw_implementation"})


def transport(choice: str) -> tuple[choose.Kind | None, list[Finding]]:
    """The transport that a session would use with `--ros CHOICE`, and why."""
    found: list[Finding] = []
    missing = choose.available()
    try:
        kind: choose.Kind | None = choose.choose(choice)
    except BridgeError as error:
        kind = None
        found += [Finding("problem", "transport", line) for line in error.lines]
    else:
        why = "as asked for" if choice != "auto" else "rclpy is here" if kind == "rclpy" else "rclpy is not here"
        found.append(Finding("ok", "transport", f"ROS is spoken by {kind}: {why}"))
    wheels = {name: _version(name) for name in ("cyclonedds", "rosbags")}
    there = [f"{name} {number}" for name, number in wheels.items() if number]
    if not missing["dds"]:
        found.append(Finding("ok", "transport", f"for the transport `dds`: {', '.join(there)}"))
    elif kind is not None and kind != "dds":
        found.append(Finding("note", "transport", f"the transport `dds` cannot be used: {missing['dds']}"))
    if missing["dds"] and kind != "rclpy" and not wheels["cyclonedds"] and sys.version_info >= (3, 14):
        found.append(
            Finding("note", "transport", "cyclonedds is not offered for this Python; it is for Python 3.11 to 3.13")
        )
    return kind, found


# --- the network --------------------------------------------------------------------------------------------------


def network(environment: Environment, kind: choose.Kind | None = None) -> Iterator[Finding]:
    """Domain and discovery: settings because of which programs do not find each other, and nobody says so."""
    yield from _domain(environment.get("ROS_DOMAIN_ID", "").strip())
    local = environment.get("ROS_LOCALHOST_ONLY", "")
    reach = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "")
    if local == "1":
        yield Finding(
            "warning",
            "network",
            "ROS_LOCALHOST_ONLY is set: nothing outside of this machine is found, whatever the discovery range says",
            "unset it; in Jazzy, ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST does the same",
        )
    elif reach == "LOCALHOST":
        yield Finding("note", "network", "the discovery range is LOCALHOST: only programs on this machine are found")
    elif reach == "OFF":
        yield Finding(
            "problem", "network", "the discovery range is OFF: nobody is found, not even on this machine",
            "unset ROS_AUTOMATIC_DISCOVERY_RANGE",
        )  # fmt: skip
    elif reach not in ("", "SUBNET", "SYSTEM_DEFAULT"):
        yield Finding(
            "problem",
            "network",
            f"ROS_AUTOMATIC_DISCOVERY_RANGE is {reach!r}; it can be SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT",
        )
    if uri := environment.get("CYCLONEDDS_URI", "").strip():
        named = environment.get("RMW_IMPLEMENTATION", "")
        if kind == "rclpy" and named != CYCLONE_RMW:
            yield Finding("note", "network", f"CYCLONEDDS_URI is set, and means nothing to {named or DEFAULT_RMW}")
        else:
            yield from _cyclone(uri, bool(environment.get("ROS_STATIC_PEERS")) or reach == "LOCALHOST" or local == "1")
    for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"):
        if (file := environment.get(name, "")) and not Path(file).is_file():
            yield Finding("warning", "network", f"{name} names {file}, which is not there")
    if kind == "dds":
        if environment.get("ROS_DISCOVERY_SERVER"):
            yield Finding(
                "warning", "network", "ROS_DISCOVERY_SERVER is set: what is found through it only, `dds` does not find"
            )
        if environment.get("ROS_SECURITY_ENABLE", "").lower() == "true":
            yield Finding(
                "problem",
                "network",
                "ROS_SECURITY_ENABLE is set, and the transport `dds` has no security: it and secured nodes do not talk",
                "use --ros rclpy",
            )


def _domain(number: str) -> Iterator[Finding]:
    if not number:
        yield Finding("ok", "network", "ROS domain 0 (ROS_DOMAIN_ID is not set)")
    elif not (number.isascii() and number.isdigit()) or int(number) > 232:
        yield Finding("problem", "network", f"ROS_DOMAIN_ID must be a number from 0 to 232, not {number!r}")
    elif int(number) > _SAFE_DOMAINS:
        yield Finding(
            "note",
            "network",
            f"ROS domain {int(number)}: above {_SAFE_DOMAINS} its ports may be taken by other programs",
            "choose a number from 0 to 101, the same for all programs",
        )
    else:
        yield Finding("ok", "network", f"ROS domain {int(number)}")


def _cyclone(uri: str, peers: bool) -> Iterator[Finding]:
    """What a CYCLONEDDS_URI does to discovery. `peers`: addresses to look at are set elsewhere."""
    pieces: list[ElementTree.Element] = []
    for part in _parts(uri):
        words = part
        if not part.startswith("<"):
            path = Path(part.removeprefix("file://"))
            try:
                words = path.read_text("utf-8")
            except (OSError, UnicodeDecodeError):
                yield Finding("problem", "network", f"CYCLONEDDS_URI names the file {path}, which cannot be read")
                continue
        try:
            pieces.append(ElementTree.fromstring(f"<all>{_without_declaration(words)}</all>"))
        except ElementTree.ParseError as error:
            yield Finding("problem", "network", f"CYCLONEDDS_URI holds XML that is not well-formed: {error}")
    elements = [each for piece in pieces for each in piece.iter()]
    said = {_tag(each): (each.text or "").strip() for each in elements}
    interfaces = [each for each in elements if _tag(each) == "NetworkInterface"]
    names = [each.get("name") or each.get("address") or "" for each in interfaces]
    silent = said.get("AllowMulticast", "").lower() in ("false", "spdp", "none") or any(
        each.get("multicast", "").lower() == "false" for each in interfaces
    )
    loopback = bool(names) and all(name in ("lo", "localhost") or name.startswith("127.") for name in names)
    if loopback:
        yield Finding(
            "note", "network", "CYCLONEDDS_URI names the loopback only: just programs on this machine are found"
        )
    elif names:
        yield Finding("note", "network", f"CYCLONEDDS_URI names the network interface {', '.join(names)}")
    if silent and not peers and not any(_tag(each) == "Peer" for each in elements):
        yield Finding(
            "problem",
            "network",
            "CYCLONEDDS_URI switches multicast off and names no peers: nobody is found",
            'add <Discovery><Peers><Peer address="localhost"/></Peers></Discovery>, with the robot\'s address too',
        )
    elif silent:
        yield Finding(
            "note",
            "network",
            "CYCLONEDDS_URI switches multicast off: a program with another setting is not found, and nothing says so",
            "give all programs the same setting",
        )


def _parts(uri: str) -> list[str]:
    """CYCLONEDDS_URI is a list with commas of files and of XML, which may hold commas itself."""
    parts: list[str] = []
    for piece in uri.split(","):
        if parts and parts[-1].startswith("<") and not piece.lstrip().startswith(("<", "file://", "/")):
            parts[-1] += f",{piece}"
        elif piece.strip():
            parts.append(piece.strip())
    return parts


def _without_declaration(words: str) -> str:
    words = words.lstrip("\ufeff \n\t\r")
    return words.partition("?>")[2] if words.startswith("<?xml") else words


def _tag(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2]


# --- the interfaces -----------------------------------------------------------------------------------------------


def interfaces(environment: Environment, kind: choose.Kind | None = None) -> Iterator[Finding]:
    """Whether `rise_interfaces` is built and sourced, and is the one that this program speaks."""
    built = [prefix / "share" / INTERFACES for prefix in _prefixes(environment)]
    built = [folder for folder in built if folder.is_dir()]
    remedy = f"colcon build --packages-select {INTERFACES}, and source install/setup.bash"
    if not built:
        if kind == "rclpy":
            yield Finding(
                "problem", "interfaces", f"{INTERFACES} is not built, or its workspace is not sourced", remedy
            )
        elif _prefixes(environment):
            yield Finding(
                "note", "interfaces", f"{INTERFACES} is not built here; `dds` needs no build, but `ros2` does", remedy
            )
        else:
            yield Finding("ok", "interfaces", f"{INTERFACES} comes with this program")
        return
    if len(built) > 1:
        yield Finding(
            "warning",
            "interfaces",
            f"{INTERFACES} is sourced {len(built)} times; the first counts: {', '.join(map(str, built))}",
        )
    if kind == "rclpy" and not _importable(INTERFACES):
        yield Finding("problem", "interfaces", f"{INTERFACES} is built, but this Python does not find it", remedy)
        return
    ours, theirs = own_hashes(environment), built_hashes(built[0])
    if not ours:
        yield Finding(
            "note", "interfaces", f"{INTERFACES} is built; whether it is the right one cannot be told without rosbags"
        )
        return
    missing = sorted(set(ours) - set(theirs))
    other = sorted(name for name in ours if name in theirs and ours[name] != theirs[name])
    for names, what in ((missing, "lacks"), (other, "has another version of")):
        if names:
            said = ", ".join(name.removeprefix(f"{INTERFACES}/") for name in names)
            yield Finding(
                "problem",
                "interfaces",
                f"the {INTERFACES} in {built[0]} {what} {said}",
                f"build the {INTERFACES} of this release: {remedy}",
            )
    if not missing and not other:
        yield Finding("ok", "interfaces", f"{INTERFACES} is built and is the one of this program ({len(ours)} types)")


def own_hashes(environment: Environment = os.environ) -> dict[str, str]:
    """Of the types that this program speaks, by name; empty when that cannot be told here."""
    try:
        from rise_adapters.ros2.types import SHARE, Types
    except ImportError:
        return {}
    types = Types([SHARE], environment)  # ours first; ROS has the standard ones that they are made of
    names = [
        f"{INTERFACES}/{kind}/{file.stem}"
        for kind in ("msg", "srv", "action")
        for file in sorted((SHARE / INTERFACES / kind).glob(f"*.{kind}"))
    ]
    try:
        return {name: types.type_hash(name) for name in names}
    except PortError:  # neither ROS nor rosbags has those
        return {}


def built_hashes(folder: Path) -> dict[str, str]:
    """Those that were computed when an interface package was built, `PREFIX/share/PACKAGE`."""
    found: dict[str, str] = {}
    for file in (*folder.glob("msg/*.json"), *folder.glob("srv/*.json"), *folder.glob("action/*.json")):
        with suppress(OSError, ValueError, KeyError, TypeError):
            for each in json.loads(file.read_text("utf-8"))["type_hashes"]:
                found[each["type_name"]] = each["hash_string"]
    return found


# --- the robot ----------------------------------------------------------------------------------------------------


async def robot(wire: Transport, profile: RobotProfile | None, seconds: float = SECONDS) -> list[Finding]:
    """Whether each of the robot's actions is offered: once, and as what the profile says (`ends`)."""
    if profile is None:
        return [Finding("note", "robot", "no robot was named, so none was looked for", "add --robot NAME")]
    if profile.driver != DRIVER:
        return [
            Finding(
                "note",
                "robot",
                f"the robot {profile.name} was not looked for: its driver is {profile.driver!r}, which is not on ROS",
            )
        ]
    try:
        carriers = read_carriers(profile, wire.fields)
    except CarrierErrors as errors:
        return [Finding("problem", "robot", sentence) for sentence in errors.findings]
    looked_for: list[_LookedFor] = []
    try:
        for name, carrier in _by_carrier(carriers).items():
            looked_for.append(_LookedFor(wire, name, carrier))
        await _look(looked_for, seconds)
        if len(looked_for) > 1 and not any(each.seen() for each in looked_for):
            names = ", ".join(each.full for each in looked_for)
            others = list(dict.fromkeys(name for each in looked_for for name in each.elsewhere()))
            remedy = _rename("these", others) if others else _start_it("these")
            return [Finding("problem", "robot", f"nothing of {profile.name} is there: {names}", remedy)]
        return [finding for each in looked_for for finding in each.findings()]
    except PortError as error:
        return [Finding("problem", "robot", str(error))]
    finally:
        for each in looked_for:
            each.close()


def _by_carrier(carriers: Mapping[str, Carrier]) -> dict[str, Carrier]:
    """Several actions may go the same way: `Emotion, SocialExpression`."""
    ways: dict[tuple[str, str, str], list[str]] = {}
    for name, carrier in carriers.items():
        ways.setdefault((carrier.kind, carrier.name, carrier.type), []).append(name)
    return {", ".join(names): carriers[names[0]] for names in ways.values()}


async def _look(looked_for: Sequence[_LookedFor], seconds: float) -> None:
    loop = asyncio.get_running_loop()
    until = loop.time() + seconds
    complete: float | None = None
    while loop.time() < until and (complete is None or loop.time() < complete + SETTLE):
        if complete is None and all(each.complete() for each in looked_for):
            complete = loop.time()
        await asyncio.sleep(_LOOK)


class _LookedFor:
    """What carries one action of the robot, or several."""

    def __init__(self, wire: Transport, name: str, carrier: Carrier) -> None:
        self._wire = wire
        self._name = name
        self._carrier = carrier
        self.full = wire.resolve(carrier.name)
        self._end: Any
        if carrier.kind == "action":
            self._end = ActionClient(
                wire, carrier.name, carrier.type, feedback=carrier.feedback_qos, status=carrier.status_qos
            )
        else:
            self._end = wire.publisher(carrier.name, carrier.type, carrier.topic_qos)

    def close(self) -> None:
        self._end.close()

    def count(self) -> int:
        """How many offer it, or take it."""
        return int(self._end.servers() if self._carrier.kind == "action" else self._end.subscribers())

    def complete(self) -> bool:
        """Everything of it is there, and can be compared."""
        return self.count() > 0 and ends.look(self._wire, self._carrier).whole

    def seen(self) -> bool:
        """Whether there is anything of that name, be it the right thing or not."""
        return self.count() > 0 or bool(ends.look(self._wire, self._carrier).seen)

    def elsewhere(self) -> list[str]:
        """The names under which there is something of its type."""
        return ends.elsewhere(self._wire, self._carrier)

    def findings(self) -> Iterator[Finding]:
        number, name, full = self.count(), self._name, self.full
        action = self._carrier.kind == "action"
        found = ends.look(self._wire, self._carrier)
        for misfit in found.all:
            yield Finding("problem", "robot", f"{name}: {misfit.sentence}", misfit.remedy)
        if number > 1 and action:
            yield Finding("problem", "robot", f"{name}: {ends.several(number, full)}", "end all but one of them")
        elif number and not found.all:
            listens = f"has {number} subscriber{'s' if number > 1 else ''}"
            yield Finding(
                "ok", "robot", f"{name}: {full} {f'is offered, as {self._carrier.type}' if action else listens}"
            )
        elif not found.all:
            others = self.elsewhere()
            remedy = "" if found.seen else _rename(full, others) if others else _start_it(full)
            yield Finding("problem", "robot", f"{name}: {ends.nothing(found, self._carrier, full)}", remedy)
        if found.unannounced:
            yield Finding("note", "robot", f"{name}: {ends.uncompared(full)}")


def _rename(name: str, others: Sequence[str]) -> str:
    are = "there is one of this type" if name.startswith("/") else "of their types there are"
    names = ", ".join(others[:_MOST_NAMES]) + (", ..." if len(others) > _MOST_NAMES else "")
    return f"{are}, by other names: {names}; correct the names in the profile, or start with --ros-args -r FROM:=TO"


def _start_it(name: str) -> str:
    names = f"is {name} the name" if name.startswith("/") else f"are {name} the names"
    return (
        f"is the robot's wrapper running, in the same ROS domain, and {names} that it uses "
        "(else: --ros-args -r FROM:=TO)?"
    )


# --- who is there -------------------------------------------------------------------------------------------------


def graph(wire: Transport) -> Iterator[Finding]:
    """Which other nodes are seen, and which of them cannot be talked to."""
    if lost := wire.lost():
        yield Finding("problem", "graph", f"the connection is lost: {lost}")
        return
    others = wire.nodes()
    with suppress(ValueError):
        others.remove(wire.node)
    if others:
        counts = {node: others.count(node) for node in others}
        said = ", ".join(node if number == 1 else f"{node} ({number} times)" for node, number in counts.items())
        yield Finding("ok", "graph", f"{len(others)} other node{'s are' if len(others) > 1 else ' is'} seen: {said}")
        for node, number in counts.items():
            if number > 1:
                yield Finding("warning", "graph", f"{number} nodes have the name {node}", "give each a name of its own")
    else:
        yield Finding(
            "note",
            "graph",
            "no other node is seen",
            "if there are some: same ROS domain, same network, same middleware? A firewall may be in the way",
        )
    for sentence in ends.strangers(wire):
        yield Finding("warning", "graph", sentence)
    for topic in wire.topics():
        for sentence in ends.topic_misfits(wire, topic):
            yield Finding("warning", "graph", sentence, "make both the same")


# --- small things -------------------------------------------------------------------------------------------------


def _share(profile: RobotProfile | None) -> list[Path]:
    """Folders with definitions that the robot needs."""
    if profile is None or profile.driver != DRIVER:
        return []
    try:
        return [Path(folder).expanduser() for folder in read_options(profile).share]
    except CarrierErrors:  # said with everything else that is wrong in the profile
        return []


def _prefixes(environment: Environment) -> list[Path]:
    return [Path(prefix) for prefix in environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if prefix]


def _distributions(installed: Path) -> list[str]:
    return sorted(file.parent.name for file in installed.glob("*/setup.bash"))


def _setup(installed: Path) -> str:
    there = _distributions(installed)
    name = DISTRIBUTION if DISTRIBUTION in there or not there else there[-1]
    return f"{installed}/{name}/setup.bash"


def _importable(package: str) -> bool:
    spec = find_spec(package)
    return spec is not None and spec.origin is not None  # a mere folder of that name is no package


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
