"""How a robot stands as a whole, of how its endpoints do: connected, degraded or lost, and in words."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_adapters.ros2.compatibility import MISFIT_KINDS, SHORT_MISFITS, describe_misfits
from rise_adapters.ros2.robot.endpoints import Endpoint
from rise_adapters.ros2.robot.estop_input import EstopInput
from rise_adapters.ros2.transport.port import Transport

Status: TypeAlias = Literal["connected", "degraded", "lost"]


class Standing(Struct, frozen=True):
    """A robot's status, and what is wrong with which of its endpoints."""

    status: Status
    faults: frozenset[tuple[str, str]] = frozenset()
    """By the endpoint's label, the kind of its misfit, or its fault."""

    def is_news_after(self, before: Standing) -> bool:
        """Whether people have to be told. (Of a robot that is lost anyway only what does not fit is.)"""
        if self.status == "lost" == before.status:
            return self._misfits() != before._misfits()
        return self != before

    def _misfits(self) -> frozenset[tuple[str, str]]:
        return frozenset(each for each in self.faults if each[1].startswith((*MISFIT_KINDS, "inactive")))


def assess(
    transport: Transport, endpoints: Sequence[Endpoint], busy: Collection[Endpoint], estop: EstopInput | None = None
) -> Standing:
    """How the robot stands now. `busy`: the endpoints that do something of ours."""
    if transport.failure():
        return Standing("lost")
    faults = frozenset((each.label, each.misfit_kind or each.fault) for each in endpoints if each.fault)
    if faults and all(_is_useless(each, busy) for each in endpoints):
        return Standing("lost", faults)
    if estop is not None and estop.fault:
        faults |= {(estop.label, estop.fault)}
    return Standing("degraded" if faults else "connected", faults)


def _is_useless(endpoint: Endpoint, busy: Collection[Endpoint]) -> bool:
    """Nothing can be sent to it, and it does nothing of ours. (Beside what is doing something another program may have
    appeared that does not fit.)"""
    if endpoint.fault in ("unfit", "inactive"):
        return endpoint not in busy
    return endpoint.fault == "missing"


def describe(
    status: Status, title: str, transport: Transport, endpoints: Sequence[Endpoint], estop: EstopInput | None = None
) -> str:
    """For a person; `title` is the robot's. Of what is wrong, what to do about it comes first: on a small screen the
    rest is cut."""
    failure = transport.failure()
    if failure:
        return f"the connection to ROS is gone: {failure}"
    if status == "connected":
        return f"{title} on ROS 2 ({transport.about})"
    misfits = [misfit for each in endpoints for misfit in each.comparison.misfits]
    told = [
        *([describe_misfits(misfits)] if misfits else []),
        *(each.trouble for each in endpoints if each.fault not in ("", "unfit", "unheard")),
        *([estop.trouble] if estop is not None and estop.fault else []),
    ]
    trouble = "; ".join(dict.fromkeys(told))
    if status == "degraded":
        return trouble
    if misfits:
        kind = misfits[0].kind
        return f"{kind}: {title} {SHORT_MISFITS[kind]} ({trouble})"
    if any(each.fault == "inactive" for each in endpoints):
        return f"inactive: {title} is not active ({trouble})"
    if any(each.presence.was_seen for each in endpoints):
        return f"server-gone: the program of {title} has gone; start it again ({trouble})"
    return f"server-missing: {title} is not there; is its wrapper running? ({trouble})"
