"""Which pairs of transports the contract is tested with on this machine, and why not with the others."""

from __future__ import annotations

import pytest

from .conftest import PAIRS, why_not

pytestmark = pytest.mark.dds


@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_a_pair_that_can_be_made_is_tested(pair: tuple[str, str]) -> None:
    why = why_not(pair)
    if why:
        pytest.skip(why)


def test_without_ros_the_wheel_is_tested() -> None:
    pytest.importorskip("cyclonedds", reason="there is no wheel of Cyclone DDS for this machine")
    assert not why_not(("dds", "dds"))
