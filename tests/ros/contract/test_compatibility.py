"""What the one node finds out about what the other one has (`rise_adapters.ros2.compatibility`), on the real wire."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from .conftest import PAIRS, Pair, why_not
from .peers import Peer, cyclone_rmw, fast_dds, has_rmw, missing, until

pytestmark = pytest.mark.dds

FIBONACCI = "example_interfaces/action/Fibonacci"
OTHER = "int32 order\nint32 step\n---\nint32[] sequence\n---\nint32[] sequence\n"
"""The definition of another version of it."""
NEAR = [near for near, far in PAIRS if far == "dds" and not why_not((near, far))]


def looked(near: Peer, name: str, what: str = "complete", **qos: Any) -> dict[str, Any]:
    """What is found as soon as there is anything of that kind."""
    found: dict[str, Any] = until(lambda: each if (each := near.look(name=name, type=FIBONACCI, **qos))[what] else None)
    return found


def test_an_action_that_fits(pair: Pair) -> None:
    assert pair.near.look(name=pair.name, type=FIBONACCI)["seen"] == []
    pair.far.action_server(key=pair.name, name=pair.name, type=FIBONACCI)
    found = looked(pair.near, pair.name)
    assert found["unusable"] == found["unheard"] == [] and not found["unannounced"]
    until(lambda: pair.near.look(name=pair.name, type=FIBONACCI)["seen"] == [f"the node {pair.far.about()['node']}"])
    pair.far.close(key=pair.name)


def test_an_action_of_another_type(pair: Pair) -> None:
    pair.far.serve(key=pair.name, name=f"{pair.name}/_action/send_goal", type="std_srvs/srv/Trigger")
    (sentence,) = looked(pair.near, pair.name, "unusable")["sentences"]
    assert sentence == f"/{pair.name} is offered as std_srvs/srv/Trigger, not as {FIBONACCI}"
    pair.far.close(key=pair.name)


def test_feedback_that_is_not_heard(pair: Pair) -> None:
    pair.far.publisher(
        key=pair.name, topic=f"{pair.name}/_action/feedback", type=f"{FIBONACCI}_FeedbackMessage", reliable=False
    )
    (sentence,) = looked(pair.near, pair.name, "unheard")["sentences"]
    assert sentence == f"/{pair.name} publishes its feedback as best effort, and this program wants it reliably"
    assert pair.near.look(name=pair.name, type=FIBONACCI, feedback={"reliable": False})["unheard"] == []
    pair.far.close(key=pair.name)


@pytest.mark.slow
@pytest.mark.parametrize("kind", NEAR)
def test_an_action_of_another_version(kind: str, tmp_path: Path) -> None:
    """Two builds of one package: this side's is the standard one."""
    file = tmp_path / "example_interfaces/action/Fibonacci.action"
    file.parent.mkdir(parents=True)
    file.write_text(OTHER, "utf-8")
    with Peer(kind) as near, Peer("dds", share=tmp_path, node="other") as far:
        far.action_server(key="a", name="count", type=FIBONACCI)
        until(lambda: near.look(name="count", type=FIBONACCI)["seen"] == ["the node /other"])
        found = looked(near, "count")
        assert found["unusable"][0]["kind"] == "other-version"
        assert found["sentences"] == [f"/count is offered by the node /other with another version of {FIBONACCI}"]


@pytest.mark.skipif(
    bool(missing("rclpy")) or not has_rmw("rmw_fastrtps_cpp") or not cyclone_rmw(),
    reason="needs rclpy on Cyclone DDS, and Fast DDS beside it",
)
@pytest.mark.parametrize("kind", ["rclpy", "dds"])
def test_a_robot_on_fast_dds(kind: str, tmp_path: Path) -> None:
    """What Jazzy uses unless it is told otherwise."""
    with Peer(kind) as near, Peer("rclpy", node="fast", settings=fast_dds(tmp_path)) as far:
        far.action_server(key="a", name="count", type=FIBONACCI)
        found = looked(near, "count", "unusable")
        assert {each["kind"] for each in found["unusable"]} == {"other-middleware"}
        assert "over eProsima Fast DDS (rmw_fastrtps_cpp), and this program uses Cyclone DDS" in found["sentences"][0]
        until(lambda: [vendor for _, vendor in near.strangers()] != [])
        assert {vendor for _, vendor in near.strangers()} == {"010f"}
