"""The pairs of transports, and what each test gets of them."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import pytest

from .peers import Peer, cyclone_rmw, missing

PAIRS = (("dds", "dds"), ("rclpy", "rclpy"), ("rclpy", "dds"), ("dds", "rclpy"))


@dataclass
class Pair:
    """Two nodes. `near` is the one that subscribes and asks; `far` the one that publishes and answers."""

    near: Peer
    far: Peer
    name: str
    """Of this test only: no other uses names that begin with it."""


@pytest.fixture(scope="session")
def _kept() -> Iterator[Callable[[str, str], tuple[Peer, Peer]]]:
    """Processes that serve many tests."""
    pairs: dict[tuple[str, str], tuple[Peer, Peer]] = {}
    with ExitStack() as stack:

        def get(near: str, far: str) -> tuple[Peer, Peer]:
            found = pairs.get((near, far))
            if found is None or any(peer.process.poll() is not None for peer in found):
                found = pairs[near, far] = stack.enter_context(Peer(near)), stack.enter_context(Peer(far))
            return found

        yield get


def why_not(pair: tuple[str, str]) -> str:
    """Why this machine cannot make the pair; empty when it can."""
    near, far = pair
    for kind in pair:
        if missing(kind):
            return f"{kind}: {missing(kind)}"
    if near != far and not cyclone_rmw():
        return "rclpy does not run on rmw_cyclonedds_cpp here, the only one that the dds transport can talk to"
    return ""


# What cannot be made is skipped once, in test_pairs, and not once for each test.
@pytest.fixture(params=[pair for pair in PAIRS if not why_not(pair)], ids="-".join)
def pair(request: pytest.FixtureRequest, _kept: Callable[[str, str], tuple[Peer, Peer]]) -> Pair:
    near, far = request.param
    return Pair(*_kept(near, far), name=f"t{uuid.uuid4().hex[:8]}")
