"""Peers as a test sees them, and the world they run in: the loopback interface, and a domain of their own."""

from __future__ import annotations

import os
import tempfile
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any

from tests.forked import PIPE, Forked
from tests.patience import PATIENCE
from tests.ros.domains import own_domain

from .lines import decode, encode

ROOT = Path(__file__).parents[3]
LEASE = 2.0
"""Seconds after which a participant that says nothing is taken as gone (with Cyclone DDS and Fast DDS, here)."""
_CYCLONE = (
    "<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast><Interfaces>"
    '<NetworkInterface address="127.0.0.1"/></Interfaces></General><Discovery><ParticipantIndex>auto</ParticipantIndex>'
    '<MaxAutoParticipantIndex>64</MaxAutoParticipantIndex><Peers><Peer address="localhost"/></Peers>'
    f"<LeaseDuration>{LEASE:g} s</LeaseDuration></Discovery></Domain></CycloneDDS>"
)
_CYCLONE_RMW = "rmw_cyclonedds_cpp"
_DOMAIN = str(own_domain())


@cache
def missing(kind: str) -> str:
    """Why a transport cannot be tried here; empty when it can."""
    if kind == "dds":
        absent = [name for name in ("cyclonedds", "rosbags") if find_spec(name) is None]
        return f"{' and '.join(absent)} not installed" if absent else ""
    from rise_adapters.ros2.transport.rclpy import rclpy_missing

    return rclpy_missing()


def cyclone_rmw() -> bool:
    """Whether rclpy runs on Cyclone DDS here: it is installed, and `RMW_IMPLEMENTATION` names no other. A process keeps
    the middleware that it loaded first, so one test run has one, in this process and in all that it starts."""
    return os.environ.get("RMW_IMPLEMENTATION", _CYCLONE_RMW) == _CYCLONE_RMW and has_rmw(_CYCLONE_RMW)


@cache
def has_rmw(name: str) -> bool:
    """Whether a middleware is installed."""
    try:
        import_module("ament_index_python.packages").get_package_prefix(name)
    except (ImportError, LookupError):
        return False
    return True


def environment() -> dict[str, str]:
    """Nothing leaves the machine, and nothing of another test run comes in."""
    values = dict(os.environ)
    for name in ("ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ROS_NAMESPACE"):
        values.pop(name, None)
    values |= {"ROS_DOMAIN_ID": _DOMAIN, "CYCLONEDDS_URI": _CYCLONE, "PYTHONUNBUFFERED": "1", "PYTHONWARNINGS": "error"}
    if cyclone_rmw():
        values |= {"RMW_IMPLEMENTATION": _CYCLONE_RMW, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}
    else:  # another RMW is kept on this machine by ROS's own setting
        values["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        values["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(ROOT / "tests/ros/data/fastdds.xml")
    return values


def fast_dds(folder: Path) -> dict[str, str]:
    """Settings for a peer on Fast DDS that those on Cyclone DDS and the loopback can see. `folder`: for a file."""
    loopback = "<locator><udpv4><address>127.0.0.1</address></udpv4></locator>"
    profile = folder / "fastdds.xml"
    profile.write_text(
        '<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><transport_descriptors>'
        "<transport_descriptor><transport_id>loopback</transport_id><type>UDPv4</type>"
        "<interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>"
        "<maxInitialPeersRange>64</maxInitialPeersRange></transport_descriptor></transport_descriptors>"
        '<participant profile_name="loopback" is_default_profile="true"><rtps>'
        "<userTransports><transport_id>loopback</transport_id></userTransports>"
        "<useBuiltinTransports>false</useBuiltinTransports>"
        f"<builtin><metatrafficUnicastLocatorList>{loopback}</metatrafficUnicastLocatorList>"
        f"<initialPeersList>{loopback}</initialPeersList></builtin></rtps></participant></profiles>",
        "utf-8",
    )
    return {
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
    }


def until(holds: Callable[[], Any], patience: float = PATIENCE) -> Any:
    """Wait for a condition, and give what it gave."""
    limit = time.monotonic() + patience
    while not (found := holds()):
        assert time.monotonic() < limit, "it did not come to that"
        time.sleep(0.005)
    return found


class Refused(Exception):
    """The transport raised a PortError; this is its sentence."""


class Peer:
    """One process with one transport. `peer.publish(key=..., ...)` does what `tests.ros.contract.peer.Peer` can do."""

    def __init__(
        self,
        kind: str,
        *arguments: str,
        node: str = "",
        share: Path | None = None,
        settings: Mapping[str, str] | None = None,
    ) -> None:
        """`share`: a folder of definitions that come before all others (of a `dds` peer); `settings`: of its
        environment."""
        self.kind = kind
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process, in __exit__
        self.process = Forked(
            *(kind, node or f"peer_{uuid.uuid4().hex[:8]}"),
            *(f"share={each}" for each in (share,) if each is not None),
            *arguments,
            module="tests.ros.contract.peer",
            loads=("rise_adapters.ros2.transport.dds",),
            stdin=PIPE,
            stderr=self._errors,
            cwd=ROOT,
            env=environment() | dict(settings or {}),
        )
        self._count = 0
        self._answers: dict[int, dict[str, Any]] = {}
        self._events: list[dict[str, Any]] = []
        self._changed = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Peer:
        try:
            self.event("ready", patience=4 * PATIENCE)
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.wait()
        self._errors.close()

    def __getattr__(self, do: str) -> Callable[..., Any]:
        if do.startswith("_"):
            raise AttributeError(do)

        def request(**fields: Any) -> Any:
            self._count += 1
            number = self._count
            assert self.process.stdin is not None
            self.process.stdin.write(encode({"id": number, "do": do, **fields}) + "\n")
            self.process.stdin.flush()
            answer = self._await(lambda: self._answers.pop(number, None))
            if "error" in answer:
                raise Refused(answer["error"])
            return answer["is"]

        return request

    def event(self, kind: str, patience: float = PATIENCE, **fields: Any) -> dict[str, Any]:
        """The oldest event of that kind with these fields that was not given out yet."""
        return self._await(lambda: self._pick(kind, fields), patience)

    def none(self, kind: str, **fields: Any) -> bool:
        """Whether no such event has come."""
        with self._changed:
            return not any(self._is(event, kind, fields) for event in self._events)

    def leave(self) -> int:
        """End it as a program ends; gives its exit status."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        return self.wait()

    def wait(self) -> int:
        status = self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None and not pipe.closed:
                pipe.close()
        return status

    def errors(self) -> str:
        """The end of what it wrote to its standard error."""
        return os.pread(self._errors.fileno(), 2**20, 0).decode(errors="replace")[-4000:]

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            said = decode(line)
            with self._changed:
                if "event" in said:
                    self._events.append(said)
                else:
                    self._answers[said["id"]] = said
                self._changed.notify_all()
        with self._changed:
            self._changed.notify_all()

    def _pick(self, kind: str, fields: dict[str, Any]) -> dict[str, Any] | None:
        for place, event in enumerate(self._events):
            if self._is(event, kind, fields):
                return self._events.pop(place)
        return None

    @staticmethod
    def _is(event: dict[str, Any], kind: str, fields: dict[str, Any]) -> bool:
        return event["event"] == kind and all(event.get(name) == value for name, value in fields.items())

    def _await(self, take: Callable[[], dict[str, Any] | None], patience: float = PATIENCE) -> dict[str, Any]:
        limit = time.monotonic() + patience
        with self._changed:
            while (found := take()) is None:
                assert self._reader.is_alive(), (
                    f"the {self.kind} peer has ended, {self.process.poll()}: {self.errors()}"
                )
                assert time.monotonic() < limit, (
                    f"the {self.kind} peer said nothing like it; it said {self._events[-3:]}"
                )
                self._changed.wait(0.1)
        return found
