"""The leaf for py_trees (adapters/rise_ros/rise_ros/task_leaf.py) beside a real session, on a wire in memory."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
from py_trees import behaviours, composites
from py_trees.common import Status

from rise_engine.kernel.inputs import Submit
from tests.ros import fake_rclpy
from tests.ros.memory import MemoryTransport, MemoryWire
from tests.ros.session_node_bench import TYPES, Faced, session_and_node, task_records, until

SOURCE = Path(__file__).parents[2] / "adapters/rise_ros/rise_ros/task_leaf.py"
PERIOD = 0.1


@pytest.fixture
def task_leaf(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The module, with the fakes in the place of ROS."""
    fake_rclpy.install(monkeypatch)
    spec = spec_from_file_location("task_leaf", SOURCE)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Tree:
    """A tree that somebody ticks ten times a second."""

    def __init__(self, wire: MemoryWire, root: Any) -> None:
        loop = asyncio.get_running_loop()
        self.root = root
        for leaf in root.iterate():
            leaf.clock = loop.time
            leaf.setup(node=MemoryTransport(wire, loop, "/tree"))

    async def tick_until(self, *wanted: Status) -> Status:
        async with asyncio.timeout(60):
            while True:
                self.root.tick_once()
                if self.root.status in wanted:
                    status: Status = self.root.status
                    return status
                await asyncio.sleep(PERIOD)

    async def end(self) -> tuple[Status, str]:
        """How it ended, and what it said."""
        return await self.tick_until(Status.SUCCESS, Status.FAILURE), self.root.feedback_message

    async def tick_until_it_says(self, words: str) -> None:
        async with asyncio.timeout(60):
            while self.root.feedback_message != words:
                self.root.tick_once()
                assert self.root.status == Status.RUNNING, self.root.feedback_message
                await asyncio.sleep(PERIOD)


@asynccontextmanager
async def beside_session(place: Path, root: Any, **more: Any) -> AsyncIterator[tuple[Tree, Faced, MemoryWire]]:
    async with session_and_node(place, **more) as (session, _, wire):
        yield Tree(wire, root), session, wire


async def test_an_act_is_a_leaf_that_succeeds(task_leaf: Any, tmp_path: Path) -> None:
    leaf = task_leaf.start_act("Hello", calling_type="None")
    async with beside_session(tmp_path, leaf, speed=1) as (tree, session, _):
        records = task_records(session)
        await tree.tick_until_it_says("ACTIVE")
        assert await tree.end() == (Status.SUCCESS, "SUCCEEDED")
        assert leaf.is_over
        assert [(each.behavior, each.calling_type, each.status) for each in records] == [
            ("Hello", "None", status) for status in ("PENDING", "ACTIVE", "SUCCEEDED")
        ]


async def test_a_leaf_that_is_ticked_again_is_a_new_task(task_leaf: Any, tmp_path: Path) -> None:
    async with beside_session(tmp_path, task_leaf.start_act("Hello")) as (tree, session, _):
        records = task_records(session)
        for _ in range(2):
            assert await tree.end() == (Status.SUCCESS, "SUCCEEDED")
        assert {each.id for each in records} == {1, 2}


async def test_events_rules_and_values_are_the_same_leaf(task_leaf: Any, tmp_path: Path) -> None:
    steps = composites.Sequence("steps", memory=True)
    steps.add_children(
        [task_leaf.raise_event("/open"), task_leaf.raise_event("/leave"), task_leaf.assign("n", [1, "ä"])]
    )
    root = composites.Parallel("both", task_leaf.py_trees.common.ParallelPolicy.SuccessOnAll())
    rule = task_leaf.start_rule("Doors")
    root.add_children([rule, steps])
    async with session_and_node(tmp_path) as (session, _, wire):
        tree = Tree(wire, rule)
        await tree.tick_until_it_says("ACTIVE")
        tree.root = root
        for leaf in steps.children:
            Tree(wire, leaf)
        assert await tree.tick_until(Status.SUCCESS, Status.FAILURE) == Status.SUCCESS
        assert [leaf.feedback_message for leaf in (rule, *steps.children)] == ["SUCCEEDED"] * 4
        assert session.hub.view.memory["n"].value == [1, "ä"]


async def test_halting_the_leaf_cancels_the_task(task_leaf: Any, tmp_path: Path) -> None:
    leaf = task_leaf.start_act("Story")
    async with beside_session(tmp_path, leaf) as (tree, session, _):
        await tree.tick_until_it_says("ACTIVE")
        leaf.stop(Status.INVALID)
        assert not leaf.is_over
        await until(lambda: leaf.is_over)
        assert session.hub.view.tasks[1].status == "CANCELED"
        assert leaf.status == Status.INVALID


async def test_a_branch_of_higher_priority_cancels_the_task(task_leaf: Any, tmp_path: Path) -> None:
    story = task_leaf.start_act("Story")
    urgent = behaviours.StatusQueue("urgent", [Status.FAILURE] * 3, Status.SUCCESS)
    root = composites.Selector("root", memory=False)
    root.add_children([urgent, story])
    async with session_and_node(tmp_path) as (session, _, wire):
        Tree(wire, story)
        tree = Tree.__new__(Tree)
        tree.root = root
        assert await tree.tick_until(Status.SUCCESS) == Status.SUCCESS
        await until(lambda: story.is_over)
        assert session.hub.view.tasks[1].status == "CANCELED"


async def test_a_leaf_that_is_halted_before_the_session_has_answered_leaves_nothing_running(
    task_leaf: Any, tmp_path: Path
) -> None:
    leaf = task_leaf.start_act("Story")
    async with beside_session(tmp_path, leaf) as (_, session, wire):
        answer = wire.hold("*/send_goal", what="reply")
        leaf.tick_once()
        leaf.stop(Status.INVALID)
        await until(lambda: answer.held)
        assert not wire.messages("*/cancel_goal", "request") and session.hub.view.tasks[1].status == "ACTIVE"
        answer.release()
        await until(lambda: leaf.is_over)
        assert session.hub.view.tasks[1].status == "CANCELED"


async def test_a_task_that_the_wizard_ends_fails_with_the_reason(task_leaf: Any, tmp_path: Path) -> None:
    async with beside_session(tmp_path, task_leaf.start_act("Story")) as (tree, session, _):
        await tree.tick_until_it_says("ACTIVE")
        wizard = session.hub.attach("wizard", "wizard", "wizard")
        session.hub.submit(wizard, Submit(function="stopCommunicationRobotAct", behavior="Story"), lambda _: None)
        status, reason = await tree.end()
        assert (status, reason) == (Status.FAILURE, session.hub.view.tasks[1].reason or "CANCELED")


async def test_after_f9_the_leaf_fails_and_so_does_the_next(task_leaf: Any, tmp_path: Path) -> None:
    async with beside_session(tmp_path, task_leaf.start_act("Story")) as (tree, session, _):
        await tree.tick_until_it_says("ACTIVE")
        wizard = session.hub.attach("wizard", "wizard", "wizard")
        session.hub.submit(wizard, Submit(function="stopAll", behavior=""), lambda _: None)
        status, reason = await tree.end()
        assert (status, reason) == (Status.FAILURE, "stop-all by wizard")
        assert await tree.end() == (
            Status.FAILURE,
            "the session refused the task; rise/task_state and its record say why",
        )
        assert session.hub.view.stop.latched


async def test_what_the_session_does_not_know_fails(task_leaf: Any, tmp_path: Path) -> None:
    async with beside_session(tmp_path, task_leaf.start_act("Helo")) as (tree, _, _wire):
        assert await tree.end() == (
            Status.FAILURE,
            "the session refused the task; rise/task_state and its record say why",
        )


async def test_without_a_session_it_fails_when_its_patience_is_over(task_leaf: Any) -> None:
    tree = Tree(MemoryWire(TYPES), task_leaf.start_act("Hello", patience=3.0))
    loop = asyncio.get_running_loop()
    begun = loop.time()
    assert await tree.end() == (Status.FAILURE, "no session is there")
    assert 3.0 <= loop.time() - begun < 3.0 + 2 * PERIOD


async def test_a_session_that_comes_within_patience_is_waited_for(task_leaf: Any, tmp_path: Path) -> None:
    leaf = task_leaf.start_act("Hello")
    async with session_and_node(tmp_path) as (_, _node, wire):
        wire.forget("/rise")
        tree = Tree(wire, leaf)
        await tree.tick_until_it_says("waits for a session")
        wire.heal("/rise")
        assert await tree.end() == (Status.SUCCESS, "SUCCEEDED")


async def test_a_session_that_does_not_answer_fails_and_its_late_answer_is_cancelled(
    task_leaf: Any, tmp_path: Path
) -> None:
    leaf = task_leaf.start_act("Story")
    async with beside_session(tmp_path, leaf) as (tree, session, wire):
        answer = wire.hold("*/send_goal", what="reply")
        assert await tree.end() == (Status.FAILURE, "the session did not answer")
        answer.release()
        await until(lambda: leaf.is_over)
        assert session.hub.view.tasks[1].status == "CANCELED"


async def test_a_session_that_goes_fails_the_leaf(task_leaf: Any, tmp_path: Path) -> None:
    async with beside_session(tmp_path, task_leaf.start_act("Story")) as (tree, _, wire):
        await tree.tick_until_it_says("ACTIVE")
        wire.forget("/rise")
        assert await tree.end() == (Status.FAILURE, "the session went before the task had ended")


async def test_a_session_that_ends_in_order_ends_the_leaf(task_leaf: Any, tmp_path: Path) -> None:
    async with beside_session(tmp_path, task_leaf.start_act("Story")) as (tree, session, _):
        await tree.tick_until_it_says("ACTIVE")
        session.engine.end("that was all")
        assert await tree.end() == (Status.FAILURE, "stop-all by engine")
