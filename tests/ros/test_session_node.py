"""The session as other nodes see it, on a wire in memory and a real engine."""

from __future__ import annotations

import asyncio
import errno
import json
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from rise_adapters.ros2.actions.client import (
    ABORTED,
    ALL_GOALS,
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCELED,
    EXECUTING,
    SUCCEEDED,
)
from rise_adapters.ros2.session_node import domain_task
from rise_adapters.ros2.session_node.interface import ERROR
from rise_adapters.ros2.session_node.record_topics import REPEATED_STATUS

from rise_engine.base.files import Disk
from rise_engine.kernel.inputs import RobotChanged, Submit
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import RuleView, SessionView
from tests.ros.memory import MemoryTransport
from tests.ros.session_node_bench import START_ACT, START_RULE, Node, session_and_node, status_of, task_records, until


class Failing(Disk):
    """Synchronises when it is let, and fails when it is told to."""

    def __init__(self) -> None:
        self.let = threading.Event()
        self.let.set()
        self.full = False

    def sync(self, descriptor: int) -> None:
        self.let.wait(10)
        if self.full:
            raise OSError(errno.ENOSPC, "full")
        super().sync(descriptor)


# --- tasks --------------------------------------------------------------------------------------------------------


async def test_an_act_from_goal_to_result(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        records = task_records(session)
        asked = node.ask(START_ACT, "Hello")
        assert await asked.decided()
        assert await asked.ended() == ("SUCCEEDED", "")
        assert (asked.status, asked.result["task"]) == (SUCCEEDED, 1)
        assert asked.feedback == [
            {"status": "PENDING", "reason": "", "position": 0},
            {"status": "ACTIVE", "reason": "", "position": -1},
        ]
        assert {(r.source, r.ref, r.calling_type) for r in records} == {("ros:domain_task", asked.id.hex(), "Blocking")}
        states = await until(lambda: len(node.tasks) == 3 and node.tasks)
        assert [(s["id"], s["status"], s["goal_id"], s["position"]) for s in states] == [
            (1, "PENDING", asked.id.hex(), 0),
            (1, "ACTIVE", asked.id.hex(), -1),
            (1, "SUCCEEDED", asked.id.hex(), -1),
        ]
        assert states[0]["domain_task_behavior"] == "Hello" and states[0]["function_type"] == START_ACT
        assert (states[0]["source"], states[0]["calling_type"]) == ("ros:domain_task", "Blocking")


FUNCTIONS = [
    # what is asked for, in turn; the status of the last
    ([(START_ACT, "Hello", "None")], "SUCCEEDED"),
    ([(START_ACT, "Story", "Blocking"), ("stopCommunicationRobotAct", "Story", "")], "SUCCEEDED"),
    ([(START_RULE, "Patient", ""), ("stopInteractionRule", "Patient", "None")], "SUCCEEDED"),
    ([("raiseEventTopic", "/open", "None")], "SUCCEEDED"),
    ([("assignValue", '{"name": "Eve"}', "")], "SUCCEEDED"),
    ([("assignValue", "age = age + 1", "")], "SUCCEEDED"),
    ([("deleteValue", "age", "")], "SUCCEEDED"),
    ([("assignValue", "age = name * 2", "")], "ABORTED"),
    ([(START_ACT, "Story", ""), ("cancelTask", "1", "")], "SUCCEEDED"),
    ([(START_ACT, "Story", ""), (START_ACT, "Hello", ""), (START_ACT, "Nod", "Blocking"), ("moveTask", "3 0", "")],
     "SUCCEEDED"),
    ([("stopAll", "", "")], "SUCCEEDED"),
]  # fmt: skip


@pytest.mark.parametrize(("tasks", "status"), FUNCTIONS, ids=[tasks[-1][0] + tasks[-1][1] for tasks, _ in FUNCTIONS])
async def test_every_function(tmp_path: Path, tasks: list[tuple[str, str, str]], status: str) -> None:
    async with session_and_node(tmp_path) as (_, node, _):
        *first, last = tasks
        for each in first:
            assert await node.ask(*each).decided()
        asked = node.ask(*last)
        assert await asked.decided()
        assert (await asked.ended())[0] == status
        assert asked.status == {"SUCCEEDED": SUCCEEDED, "ABORTED": ABORTED}[status]
        assert asked.result["reason"] or status == "SUCCEEDED"


async def test_who_subscribes_to_task_states_late_gets_those_from_before(tmp_path: Path) -> None:
    """E10: the topic promises that (transient local)."""
    async with session_and_node(tmp_path) as (session, node, wire):
        node.transport.close()
        session.hub.engine.post(Submit(function="assignValue", behavior="age = 1", source="wizard:w"))
        session.hub.engine.post(Submit(function="nonsense", source="wizard:w"))
        await until(lambda: len(wire.messages("/rise/task_state")) == 2)
        late = Node(MemoryTransport(wire, asyncio.get_running_loop(), "/late"))
        await until(lambda: [(s["function_type"], s["status"]) for s in late.tasks] == [
            ("assignValue", "SUCCEEDED"), ("nonsense", "REJECTED"),
        ])  # fmt: skip


async def test_a_rejected_task_is_rejected_on_the_wire_and_the_reason_is_on_the_topic(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (_, node, _):
        asked = node.ask(START_ACT, "Helo")
        assert not await asked.decided()
        (state,) = await until(lambda: node.tasks)
        assert (state["status"], state["goal_id"], state["id"]) == ("REJECTED", asked.id.hex(), 1)
        assert "did you mean 'Hello'" in state["reason"]
        for function, behavior in (("dance", ""), ("", ""), (START_RULE, "Nothing"), ("assignValue", "{")):
            assert not await node.ask(function, behavior).decided()
        await until(lambda: len(node.tasks) == 5)
        assert all(state["reason"] for state in node.tasks)


async def test_nothing_is_done_before_the_session_begins(tmp_path: Path) -> None:
    async with session_and_node(tmp_path, start=False) as (session, node, _):
        asked = node.ask(START_ACT, "Hello")
        assert not await asked.decided()
        (state,) = await until(lambda: node.tasks)
        assert (state["reason"], state["id"], state["goal_id"]) == (
            "the session has not begun yet", 0, asked.id.hex(),
        )  # fmt: skip
        assert state["header"]["stamp"]["sec"] > 1_600_000_000
        session.engine.start()
        assert (await node.get("name"))["found"]


async def test_cancelling_what_runs_and_what_waits(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        records = task_records(session)
        running, waiting = node.ask(START_ACT, "Story"), node.ask(START_ACT, "Hello")
        rule = node.ask(START_RULE, "Patient")
        for each in (running, waiting, rule):
            assert await each.decided()
        assert waiting.feedback == [{"status": "PENDING", "reason": "", "position": 0}]
        for each in (waiting, running, rule):
            node.cancel(each)
            status, reason = await each.ended()
            assert (each.status, status) == (CANCELED, "CANCELED") and "cancelled by ros:domain_task" in reason
            await until(lambda each=each: each.canceled)
            assert (each.canceled[0].code, each.canceled[0].goals) == (CANCEL_NONE, (each.id,))
        assert [r.behavior for r in records if r.function == "cancelTask"] == ["2", "1", "3"]
        node.cancel(running)
        await until(lambda: len(running.canceled) == 2)
        assert running.canceled[1].code == CANCEL_TERMINATED


async def test_cancelling_everything(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (_, node, _):
        goals = [node.ask(START_ACT, "Story") for _ in range(30)]
        goals.append(node.ask(START_RULE, "Doors"))
        answers: list[Any] = []
        node.client.cancel(ALL_GOALS, answers.append)
        for goal in goals:
            assert (await goal.ended())[0] == "CANCELED"
        (answer,) = await until(lambda: answers)
        assert answer.code == CANCEL_NONE and set(answer.goals) == {goal.id for goal in goals}


async def test_what_others_stop_ends_the_goal_too(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        act, rule = node.ask(START_ACT, "Story"), node.ask(START_RULE, "Patient")
        assert await act.decided() and await rule.decided()
        session.engine.accept(Submit(function="stopAll", source="wizard:anna"))
        assert await act.ended() == ("CANCELED", "stop-all by wizard:anna")
        assert await rule.ended() == ("CANCELED", "stop-all by wizard:anna")
        assert act.status == rule.status == CANCELED


async def test_a_failed_act_aborts_the_goal(tmp_path: Path) -> None:
    async with session_and_node(tmp_path, speed=1.0) as (session, node, _):
        asked = node.ask(START_ACT, "Nod")
        assert await asked.decided()
        session.engine.post(RobotChanged(status="lost", detail="the battery is empty"))
        status, reason = await asked.ended()
        assert (asked.status, status) == (ABORTED, "ABORTED") and reason


async def test_a_goal_whose_client_vanishes_goes_on(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, wire):
        asked = node.ask(START_ACT, "Hello")
        assert await asked.decided()
        wire.forget("/node")
        await until(lambda: session.hub.view.tasks[1].status == "SUCCEEDED")


async def test_a_ref_of_somebody_else_is_no_goal(tmp_path: Path) -> None:
    """A console's own number for its task means nothing on ROS."""
    async with session_and_node(tmp_path) as (session, node, _):
        asked = node.ask(START_ACT, "Story")
        assert await asked.decided()
        session.engine.accept(
            Submit(function="raiseEventTopic", behavior="x", source="wizard:anna", ref=asked.id.hex())
        )
        await until(lambda: len(node.tasks) == 3)
        assert node.tasks[-1]["goal_id"] == "" and asked.status is None


async def test_the_end_of_the_session_ends_every_goal(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        rule = node.ask(START_RULE, "Patient")
        assert await rule.decided()
        session.engine.end("lunch", stop=False)
        session.engine.end_now("lunch")
        assert await rule.ended() == ("ABORTED", "the session has ended: lunch")
        assert rule.status == ABORTED
        assert not await node.ask(START_ACT, "Hello").decided()
        await until(lambda: "has ended" in node.tasks[-1]["reason"])


async def test_an_engine_that_fails_ends_every_goal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        rule = node.ask(START_RULE, "Patient")
        assert await rule.decided()

        def fails(fact: object) -> Any:
            raise ValueError("a mistake in the kernel")

        monkeypatch.setattr(session.engine._kernel, "handle", fails)
        asked = node.ask(START_ACT, "Hello")
        assert not await asked.decided()
        assert await rule.ended() == ("ABORTED", "the engine stopped: a mistake in the kernel")


async def test_a_face_that_closes_ends_its_goals_and_says_goodbye(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        act = node.ask(START_ACT, "Story")
        assert await act.decided()
        assert "ros:domain_task" in session.hub.clients
        await session.face.close()
        await session.face.close()
        assert await act.ended() == ("ABORTED", "the session is not on ROS any more")
        assert session.hub.clients == {} and node.client.count_servers() == 0
        session.engine.accept(Submit(function="raiseEventTopic", behavior="x"))
        assert session.hub.view.tasks[1].status == "ACTIVE"


async def test_a_face_that_waits_for_its_last_results_to_be_fetched_takes_no_more_goals(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        session.face._tasks._ended_here.append(SimpleNamespace(is_result_fetched=False))  # type: ignore[arg-type]
        closing = asyncio.ensure_future(session.face.close())
        await asyncio.sleep(0)
        late = node.ask(START_ACT, "Story")
        assert not await late.decided() and not session.hub.view.tasks
        await closing


# --- the disk -----------------------------------------------------------------------------------------------------


async def test_a_goal_is_accepted_when_it_is_on_the_disk(tmp_path: Path) -> None:
    disk = Failing()
    async with session_and_node(tmp_path, disk=disk) as (session, node, _):
        await until(lambda: session.hub.view.session)
        disk.let.clear()
        asked = node.ask(START_ACT, "Story")
        node.cancel(asked)
        other = await node.get("name")
        assert other["found"] and asked.accepted is None and not asked.feedback
        disk.let.set()
        assert await asked.decided()
        assert (await asked.ended())[0] == "CANCELED", "the cancel that came before was not lost"
        await until(lambda: asked.canceled)


@pytest.mark.slow
async def test_while_nothing_can_be_recorded_goals_are_rejected_and_what_runs_goes_on(tmp_path: Path) -> None:
    disk = Failing()
    async with session_and_node(tmp_path, disk=disk) as (session, node, _):
        story = node.ask(START_ACT, "Story")
        assert await story.decided()
        disk.full = True
        session.engine.accept(Submit(function="raiseEventTopic", behavior="x"))
        await until(lambda: session.engine.paused)
        assert not await node.ask(START_ACT, "Hello").decided()
        await until(lambda: "paused" in node.tasks[-1]["reason"])
        node.cancel(story)
        await until(lambda: story.canceled)
        assert story.canceled[0].code == CANCEL_REJECTED and story.status is None
        await until(lambda: status_of(node, "journal")["level"] == ERROR)
        assert "full" in status_of(node, "journal")["message"]
        disk.full = False
        await until(lambda: not session.engine.paused)
        node.cancel(story)
        assert (await story.ended())[0] == "CANCELED"


# --- a session that goes on ---------------------------------------------------------------------------------------


async def test_a_session_that_goes_on_takes_its_goals_and_rules_up(tmp_path: Path) -> None:
    view = SessionView(
        tasks={
            4: TaskView(4, START_RULE, "Patient", "None", "ros:domain_task", "ACTIVE", "", 1.0, ref="07" * 16),
            5: TaskView(5, START_RULE, "Doors", "None", "wizard:anna", "ACTIVE", "", 1.0, ref="08" * 16),
            6: TaskView(6, START_RULE, "Doors", "None", "ros:domain_task", "ACTIVE", "", 1.0, ref="not hex"),
        },
        rules={
            "Patient": RuleView(True, "Waiting", status="started", trigger="start"),
            "Doors": RuleView(False, None, status="ended"),
        },
    )
    async with session_and_node(tmp_path, view=view) as (_, node, _):
        (rule,) = await until(lambda: node.rules)
        assert (rule["rule"], rule["status"], rule["state"]) == ("Patient", REPEATED_STATUS, "Waiting")
        await until(lambda: node.client.statuses)
        assert node.client.statuses == {b"\x07" * 16: EXECUTING}
        ended: list[Any] = []
        node.client.get_result(b"\x07" * 16, lambda status, result: ended.append((status, result["reason"])))
        await node.get("name")
    assert await until(lambda: ended) == [(ABORTED, "the session has ended: the test is over")]


# --- the memory ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "kind"),
    [
        ("name", "Anna", "string"),
        ("age", 7, "number"),
        ("near", False, "boolean"),
        ("nobody", None, "null"),
        ("list", [1, {"x": 2.5}], "array"),
        ("list.1.x", 2.5, "number"),
        ("person", {"name": "Bob", "at": {"x": 1}}, "object"),
        ("person.name", "Bob", "string"),
        ("person.at.x", 1, "number"),
        ("person.age", 30, "number"),
        ("umlaut", "ä😀", "string"),
        ("person.height", None, ""),
        ("list.7", None, ""),
        ("nothing", None, ""),
        ("", None, ""),
    ],
)
async def test_reading_the_memory(tmp_path: Path, key: str, value: Any, kind: str) -> None:
    async with session_and_node(tmp_path) as (_, node, _):
        answer = await node.get(key)
        assert (answer["found"], answer["type"]) == (bool(kind), kind)
        assert (json.loads(answer["value"]) if kind else answer["value"]) == (value if kind else "")


# --- floods -------------------------------------------------------------------------------------------------------


async def test_what_waits_has_bounds_and_stop_all_is_taken_first(tmp_path: Path) -> None:
    disk = Failing()
    async with session_and_node(tmp_path, disk=disk) as (session, node, _):
        await until(lambda: session.hub.view.session)
        disk.let.clear()
        goals = [node.ask("raiseEventTopic", f"e{number}") for number in range(domain_task.MAX_UNDECIDED + 50)]
        await until(lambda: sum(goal.accepted is False for goal in goals) == 50)
        stop = node.ask("stopAll")
        await until(lambda: not session.face._tasks._goals)
        assert stop.accepted is None, "it waits for the disk only"
        disk.let.set()
        assert await stop.decided()
        for goal in goals[: domain_task.MAX_UNDECIDED]:
            assert await goal.decided()
        refused = [state for state in node.tasks if state["status"] == "REJECTED"]
        assert len(refused) == 50 and "waiting already" in refused[0]["reason"]
        functions = [task.function for task in session.hub.view.tasks.values()]
        assert len(functions) == domain_task.MAX_UNDECIDED + 1


async def test_what_runs_has_a_bound_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(domain_task, "MAX_OPEN", 5)
    async with session_and_node(tmp_path) as (_, node, _):
        goals = [node.ask(START_ACT, "Story") for _ in range(7)]
        assert [await goal.decided() for goal in goals] == [True] * 5 + [False] * 2
        await until(lambda: "running or waiting already" in node.tasks[-1]["reason"])
        assert await node.ask("raiseEventTopic", "x").decided(), "what ends at once is not counted"
        node.cancel(goals[0])
        await goals[0].ended()
        assert await node.ask(START_ACT, "Story").decided()


async def test_a_task_may_not_be_endless(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (_, node, _):
        assert not await node.ask("assignValue", "x" * 70_000).decided()
        state = (await until(lambda: node.tasks))[-1]
        assert "65,536 characters" in state["reason"] and len(state["domain_task_behavior"]) == 100


async def test_half_characters_are_published_as_they_are_written(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        session.engine.accept(Submit(function="raiseEventTopic", behavior="a\udcffb", source="wizard:anna"))
        record = await until(lambda: [r for r in node.records if "a\\\\udcffb" in r["json"]])
        assert msgspec.json.decode(record[0]["json"])["behavior"] == "a\\udcffb"
