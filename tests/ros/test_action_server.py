"""The two sides of an action, one against the other, on a wire in memory and in virtual time."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
from rise_adapters.ros2.actions import server as action_server
from rise_adapters.ros2.actions.client import (
    ABORTED,
    ACCEPTED,
    ALL_GOALS,
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCEL_UNKNOWN,
    CANCELED,
    CANCELING,
    EXECUTING,
    SUCCEEDED,
    UNKNOWN,
    ActionClient,
    CancelResponse,
)
from rise_adapters.ros2.actions.server import (
    MAX_ENDED,
    MAX_LISTED,
    MAX_WAITING_REPLIES,
    ActionServer,
    Decide,
    accept_cancel,
)
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.transport.port import CANCEL_TYPE, STATUS, STATUS_TYPE, Message, PortError

from rise_engine.run.engine.clock import VirtualClock
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire

TYPE = "test_interfaces/action/Count"
FIELDS = {
    f"{TYPE}_Goal": {"until": "int32"},
    f"{TYPE}_Result": {"reached": "int32"},
    f"{TYPE}_Feedback": {"at": "int32"},
}
NAME = "/robot/count"


class Pair:
    """A server and a client of one action."""

    def __init__(
        self,
        wanted: Callable[[ServerGoal], object] | None = None,
        cancel: Callable[[ServerGoal, Decide], object] = accept_cancel,
        **more: Any,
    ) -> None:
        self.clock = VirtualClock()
        self.loop = loop = ClockLoop(self.clock)
        self.wire = MemoryWire(FIELDS)
        self.robot = MemoryTransport(self.wire, loop, "/robot/node")
        self.engine = MemoryTransport(self.wire, loop, "/engine")
        self.goals: list[ServerGoal] = []
        self.deciding: list[tuple[ServerGoal, Decide]] = []
        self.server = ActionServer(
            self.robot, "count", TYPE, wanted or self.goals.append, cancel, clock=self.clock, **more
        )
        self.client = ActionClient(self.engine, NAME, TYPE, now=self.clock.now)
        self.feedback: list[tuple[bytes, int]] = []
        self.client.on_feedback = lambda id, message: self.feedback.append((id, message["at"]))
        self.accepted: dict[bytes, bool] = {}
        self.results: list[tuple[bytes, int, Message]] = []
        self.canceled: list[CancelResponse] = []

    def later(self, goal: ServerGoal, decide: Decide) -> None:
        self.deciding.append((goal, decide))

    def run(self, seconds: float = 0.1) -> None:
        self.loop.run_until(self.clock.now() + seconds)

    def send(self, number: int = 1, until: int = 3) -> ServerGoal:
        """Send a goal; what the server got, if it got one."""
        id = identity(number)
        self.client.send(id, {"until": until}, lambda accepted: self.accepted.update({id: accepted}))
        self.run()
        return self.goals[-1] if self.goals else None  # type: ignore[return-value]

    def ask_result(self, number: int = 1) -> None:
        id = identity(number)
        self.client.get_result(id, lambda status, result: self.results.append((id, status, result)))
        self.run()

    def cancel(self, id: bytes = ALL_GOALS, *, until: int = 0) -> None:
        seconds, rest = divmod(until, 10**9)
        if until:
            client = self.engine.client(f"{NAME}/_action/cancel_goal", CANCEL_TYPE)
            client.call(
                {"goal_info": {"goal_id": {"uuid": id}, "stamp": {"sec": seconds, "nanosec": rest}}},
                lambda reply: self.canceled.append(
                    CancelResponse(
                        reply["return_code"], tuple(each["goal_id"]["uuid"] for each in reply["goals_canceling"])
                    )
                ),
            )
        else:
            self.client.cancel(id, self.canceled.append)
        self.run()

    def latched(self) -> list[int]:
        """What a late joiner reads."""
        got: list[Message] = []
        handle = self.engine.subscribe(f"{NAME}/_action/status", STATUS_TYPE, got.append, STATUS)
        self.run(0.001)
        handle.close()
        return [each["status"] for each in got[-1]["status_list"]]


def identity(number: int) -> bytes:
    return number.to_bytes(16, "big")


def test_the_life_of_a_goal() -> None:
    pair = Pair()
    assert pair.client.count_servers() == 1
    goal = pair.send(7, until=2)
    assert goal.id == identity(7) and goal.message == {"until": 2}
    assert pair.accepted == {} and goal.status == UNKNOWN and not goal.is_decided
    assert pair.server.goals == [goal]
    assert not goal.publish_feedback({"at": 0}), "it is not accepted yet"
    assert goal.accept() and not goal.accept() and not goal.reject()
    pair.run()
    assert pair.accepted == {goal.id: True}
    assert pair.client.statuses == {goal.id: ACCEPTED}
    assert goal.execute()
    pair.ask_result(7)
    assert goal.publish_feedback({"at": 1})
    pair.run()
    assert pair.client.statuses == {goal.id: EXECUTING} and pair.feedback == [(goal.id, 1)]
    assert goal.succeed({"reached": 2}) and goal.has_ended
    assert not goal.succeed() and not goal.abort() and not goal.cancel() and not goal.publish_feedback({"at": 9})
    pair.run()
    assert pair.results == [(goal.id, SUCCEEDED, {"reached": 2})]
    assert pair.client.statuses == {goal.id: SUCCEEDED} and pair.server.goals == []
    assert pair.client.unfinished_goals() == set()
    assert pair.wire.messages("*/send_goal", "reply")[0]["stamp"]["sec"] == pytest.approx(time.time(), abs=60)


@pytest.mark.parametrize(("end", "status"), [("succeed", SUCCEEDED), ("abort", ABORTED), ("cancel", CANCELED)])
def test_each_ending_may_come_at_once(end: str, status: int) -> None:
    pair = Pair(lambda goal: getattr(goal, end)({"reached": 1}))
    pair.send()
    pair.ask_result()
    pair.ask_result()
    assert pair.accepted == {identity(1): True}
    assert pair.results == [(identity(1), status, {"reached": 1})] * 2


def test_a_rejected_goal_is_no_goal() -> None:
    pair = Pair()
    goal = pair.send()
    pair.ask_result()
    pair.cancel(goal.id)
    assert goal.reject() and goal.has_ended and not goal.accept() and not goal.succeed()
    pair.run()
    assert pair.accepted == {goal.id: False}
    assert pair.results == [(goal.id, UNKNOWN, {"reached": 0})]
    assert pair.canceled == [CancelResponse(CANCEL_UNKNOWN, ())]
    assert pair.server.goals == [] and not pair.client.statuses
    pair.goals.clear()
    assert pair.send() is not None, "the id is free"


def test_an_id_is_taken_once() -> None:
    pair = Pair(result_timeout=5)
    first = pair.send()
    pair.send()
    assert pair.goals == [first] and pair.accepted == {first.id: False}
    first.succeed()
    pair.send()
    assert len(pair.goals) == 1 and pair.accepted == {first.id: False}
    pair.run(6)
    pair.send()
    assert len(pair.goals) == 2
    pair.client.send(ALL_GOALS, {}, lambda accepted: pair.accepted.update({ALL_GOALS: accepted}))
    pair.run()
    assert pair.accepted[ALL_GOALS] is False, "it could not be cancelled by itself"


def test_a_result_can_be_asked_for_before_the_acceptance_and_for_a_while_after_the_end() -> None:
    pair = Pair(result_timeout=5)
    goal = pair.send()
    pair.ask_result()
    goal.accept()
    pair.run()
    assert not pair.results
    goal.abort({"reached": 1})
    pair.run(4)
    pair.ask_result()
    assert pair.results == [(goal.id, ABORTED, {"reached": 1})] * 2
    assert pair.latched() == [ABORTED]
    pair.run(2)
    pair.ask_result()
    pair.cancel(goal.id)
    assert pair.results[2:] == [(goal.id, UNKNOWN, {"reached": 0})]
    assert pair.canceled == [CancelResponse(CANCEL_UNKNOWN, ())]
    assert pair.latched() == []


def test_who_asks_for_a_result_again_and_again_is_not_remembered_for_ever() -> None:
    pair = Pair()
    goal = pair.send()
    for _ in range(MAX_WAITING_REPLIES + 10):
        pair.ask_result()
    goal.succeed()
    pair.run()
    assert len(pair.results) == MAX_WAITING_REPLIES


def test_a_result_that_does_not_fit_leaves_nobody_waiting(caplog: pytest.LogCaptureFixture) -> None:
    pair = Pair()
    goal = pair.send()
    pair.ask_result()
    goal.succeed({"no such field": 1})
    pair.run()
    pair.ask_result()
    assert pair.results and set(map(repr, pair.results)) == {repr((goal.id, ABORTED, {"reached": 0}))}
    assert "could not be sent" in caplog.text


def test_a_handler_that_fails_leaves_nobody_waiting(caplog: pytest.LogCaptureFixture) -> None:
    def fails(goal: ServerGoal) -> None:
        if goal.message["until"]:
            goal.accept()
        raise ValueError("a mistake")

    def cannot(goal: ServerGoal, decide: Decide) -> None:
        raise ValueError("another mistake")

    pair = Pair(fails)
    pair.send(1, until=0)
    pair.send(2, until=1)
    pair.ask_result(2)
    assert pair.accepted == {identity(1): False, identity(2): True}
    assert [status for _, status, _ in pair.results] == [ABORTED]
    pair = Pair(cancel=cannot)
    goal = pair.send()
    goal.accept()
    pair.cancel(goal.id)
    assert pair.canceled == [CancelResponse(CANCEL_REJECTED, ())] and goal.status == ACCEPTED
    assert "a mistake" in caplog.text and "another mistake" in caplog.text


# --- cancelling ---------------------------------------------------------------------------------------------------


def test_cancelling_one() -> None:
    pair = Pair()
    goal, other = pair.send(1), pair.send(2)
    goal.execute()
    other.execute()
    pair.cancel(goal.id)
    assert pair.canceled == [CancelResponse(CANCEL_NONE, (goal.id,))]
    assert (goal.status, other.status) == (CANCELING, EXECUTING)
    (request,) = pair.wire.messages("*/cancel_goal", "request")
    assert request["goal_info"] == {"goal_id": {"uuid": goal.id}, "stamp": {"sec": 0, "nanosec": 0}}
    pair.cancel(goal.id)
    assert pair.canceled[1:] == [CancelResponse(CANCEL_NONE, (goal.id,))], "once more does no harm"
    assert goal.cancel({"reached": 1})
    pair.cancel(goal.id)
    pair.cancel(identity(9))
    assert pair.canceled[2:] == [CancelResponse(CANCEL_TERMINATED, ()), CancelResponse(CANCEL_UNKNOWN, ())]
    pair.ask_result(1)
    assert pair.results == [(goal.id, CANCELED, {"reached": 1})]


def test_a_goal_that_is_being_cancelled_may_still_succeed() -> None:
    pair = Pair()
    goal = pair.send()
    goal.accept()
    pair.cancel(goal.id)
    assert goal.execute() and goal.status == CANCELING and goal.publish_feedback({"at": 1}) and goal.succeed()


def test_a_refused_cancel_is_not_an_empty_success() -> None:
    pair = Pair(cancel=lambda goal, decide: decide(False))
    goal = pair.send()
    goal.execute()
    pair.cancel(goal.id)
    pair.cancel()
    assert pair.canceled == [CancelResponse(CANCEL_REJECTED, ())] * 2 and goal.status == EXECUTING


def test_a_cancel_that_comes_before_the_acceptance_is_not_lost() -> None:
    """navigation2 #6426: the goal ran on as an orphan."""
    pair = Pair()
    goal = pair.send()
    pair.cancel(goal.id)
    assert not pair.canceled
    goal.accept()
    pair.run()
    assert pair.canceled == [CancelResponse(CANCEL_NONE, (goal.id,))] and goal.status == CANCELING


@pytest.mark.parametrize(
    ("end", "answer"),
    [
        ("cancel", CancelResponse(CANCEL_NONE, (identity(1),))),
        ("succeed", CancelResponse(CANCEL_TERMINATED, ())),
        ("abort", CancelResponse(CANCEL_TERMINATED, ())),
    ],
)
def test_a_goal_that_ends_while_its_cancel_is_decided(end: str, answer: CancelResponse) -> None:
    pair = Pair(cancel=lambda goal, decide: pair.later(goal, decide))
    goal = pair.send()
    goal.execute()
    pair.cancel(goal.id)
    pair.cancel(goal.id)
    ((asked, decide),) = pair.deciding
    assert asked is goal and not pair.canceled, "one question at a time"
    getattr(goal, end)()
    decide(False)
    pair.run()
    assert pair.canceled == [answer] * 2


def test_deciding_twice_counts_once() -> None:
    pair = Pair(cancel=lambda goal, decide: pair.later(goal, decide))
    goal = pair.send()
    goal.execute()
    pair.cancel(goal.id)
    pair.deciding[0][1](True)
    pair.deciding[0][1](False)
    pair.run()
    assert pair.canceled == [CancelResponse(CANCEL_NONE, (goal.id,))] and goal.status == CANCELING


def test_cancelling_everything() -> None:
    pair = Pair(cancel=lambda goal, decide: decide(goal.message["until"] > 1))
    pair.cancel()
    assert pair.canceled.pop() == CancelResponse(CANCEL_NONE, ()), "nothing runs, and nothing was refused"
    running = [pair.send(number, until=number) for number in (1, 2, 3)]
    for goal in running:
        goal.execute()
    pair.run()
    assert pair.client.unfinished_goals() == {goal.id for goal in running}
    undecided = pair.send(4, until=4)
    pair.cancel()
    assert not pair.canceled, "a word about each"
    undecided.accept()
    pair.run()
    (answer,) = pair.canceled
    assert (answer.code, sorted(answer.goals)) == (CANCEL_NONE, [identity(2), identity(3), identity(4)])
    assert [goal.status for goal in running] == [EXECUTING, CANCELING, CANCELING]


def test_cancelling_by_time(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1_700_000_000_000_000_000
    monkeypatch.setattr(time, "time_ns", lambda: now)
    pair = Pair()
    goals = []
    for number in (1, 2, 3, 4):
        goals.append(pair.send(number))
        goals[-1].execute()
        now += 1_000_000_000
    until = goals[1].received_at_ns
    assert goals[1].info["stamp"] == {"sec": 1_700_000_001, "nanosec": 0}
    pair.cancel(until=until)
    assert pair.canceled.pop() == CancelResponse(CANCEL_NONE, (identity(1), identity(2)))
    pair.cancel(identity(4), until=until)
    assert pair.canceled.pop() == CancelResponse(CANCEL_NONE, (identity(1), identity(2), identity(4)))
    assert goals[2].status == EXECUTING
    pair.cancel(identity(77), until=1)
    assert pair.canceled.pop() == CancelResponse(CANCEL_NONE, ())


def test_requests_to_cancel_that_nobody_decides_have_a_bound() -> None:
    pair = Pair()
    goal = pair.send()
    for _ in range(MAX_WAITING_REPLIES + 5):
        pair.cancel(goal.id)
    assert pair.canceled == [CancelResponse(CANCEL_REJECTED, ())] * 5
    pair.server.close()
    pair.run()
    assert pair.canceled[5:] == [CancelResponse(CANCEL_UNKNOWN, ())] * MAX_WAITING_REPLIES, "it was never accepted"


# --- many, and for long -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_status_array_lists_what_runs_and_the_latest_that_ended() -> None:
    pair = Pair()
    for number in range(1, 201):
        goal = pair.send(number)
        if number % 2:
            goal.succeed()
        else:
            goal.execute()
    pair.run(1)
    statuses = pair.latched()
    assert statuses.count(EXECUTING) == 100 and statuses.count(SUCCEEDED) == MAX_LISTED
    assert list(pair.client.statuses)[-1] == identity(199)
    pair.run(20)
    assert pair.latched() == [EXECUTING] * 100


def test_a_day_of_goals_leaves_nothing_behind() -> None:
    pair = Pair(lambda goal: goal.succeed())
    for number in range(1, 3001):
        pair.client.send(identity(number), {}, lambda accepted: None)
        if number % 10 == 0:
            pair.run(0.01)
        if number % 500 == 0:
            pair.wire.sent.clear()
    pair.run(20)
    assert not pair.server.goals and not pair.server._ended and pair.latched() == []
    assert pair.clock.next_at is None, "no timer is left"


def test_what_is_kept_has_a_bound_whatever_the_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    assert MAX_ENDED >= 1000
    monkeypatch.setattr(action_server, "MAX_ENDED", 100)
    pair = Pair(lambda goal: goal.succeed(), result_timeout=10_000)
    for number in range(1, 301):
        pair.send(number)
    assert len(pair.server._ended) == 100
    pair.ask_result(200)
    pair.ask_result(201)
    assert [status for _, status, _ in pair.results] == [UNKNOWN, SUCCEEDED]


def test_a_burst_is_told_in_few_status_arrays() -> None:
    pair = Pair(lambda goal: goal.execute())
    for number in range(1, 1001):
        pair.client.send(identity(number), {}, lambda accepted: None)
    pair.run(1)
    assert len(pair.client.statuses) == 1000
    assert len(pair.wire.messages("*/status")) < 5


# --- beginning and end --------------------------------------------------------------------------------------------


def test_closing_ends_what_runs_and_rejects_the_rest() -> None:
    pair = Pair()
    running, undecided = pair.send(1), pair.send(2)
    running.execute()
    pair.ask_result(1)
    pair.server.close({"reached": 5})
    pair.server.close()
    assert running.status == ABORTED and undecided.has_ended and not running.succeed()
    sent = pair.wire.messages("*/get_result", "reply")
    assert [each["status"] for each in sent] == [ABORTED] and sent[0]["result"] == {"reached": 5}
    assert [each["accepted"] for each in pair.wire.messages("*/send_goal", "reply")] == [True, False]
    assert pair.client.count_servers() == 0
    pair.run(30)
    assert pair.clock.next_at is None


def test_taking_up_a_goal_of_an_earlier_server() -> None:
    pair = Pair()
    goal = pair.server.adopt(identity(5))
    pair.ask_result(5)
    pair.cancel(identity(5))
    assert pair.canceled == [CancelResponse(CANCEL_NONE, (identity(5),))]
    goal.cancel({"reached": 1})
    pair.run()
    assert pair.results == [(identity(5), CANCELED, {"reached": 1})]
    for bad in (identity(5), ALL_GOALS, b"short"):
        with pytest.raises(ValueError, match="cannot be taken up"):
            pair.server.adopt(bad)


# --- the client alone ---------------------------------------------------------------------------------------------


def test_feedback_goes_by_the_goal() -> None:
    pair = Pair()
    one, two = pair.send(1), pair.send(2)
    one.execute()
    two.execute()
    for goal, at in ((one, 1), (two, 1), (one, 2)):
        goal.publish_feedback({"at": at})
    pair.run()
    assert pair.feedback == [(one.id, 1), (two.id, 1), (one.id, 2)]


def test_who_comes_late_gets_the_status() -> None:
    pair = Pair()
    goal = pair.send()
    goal.execute()
    pair.run(1)
    late, told = ActionClient(pair.engine, NAME, TYPE), []
    late.on_status = lambda statuses: told.append(dict(statuses))
    pair.run()
    assert told == [{goal.id: EXECUTING}]


def test_servers_are_counted_when_all_three_services_are_there() -> None:
    pair = Pair()
    robot = MemoryTransport(pair.wire, pair.loop, "/robot/node2")
    client = ActionClient(pair.engine, "/other", TYPE)
    assert client.count_servers() == 0
    robot.serve("/other/_action/send_goal", f"{TYPE}_SendGoal", lambda request, reply: None)
    robot.serve("/other/_action/get_result", f"{TYPE}_GetResult", lambda request, reply: None)
    assert client.count_servers() == 0
    robot.serve("/other/_action/cancel_goal", CANCEL_TYPE, lambda request, reply: None)
    assert client.count_servers() == 1
    ActionServer(pair.robot, "/other", TYPE, pair.goals.append, clock=pair.clock)
    assert client.count_servers() == 2


def test_every_answer_is_a_sign_of_life() -> None:
    pair = Pair()
    pair.wire.drop("*/status")
    goal = pair.send()
    assert pair.client.heard_at is None
    for act in (goal.execute, lambda: goal.publish_feedback({"at": 1}), lambda: pair.cancel(identity(9))):
        pair.run(1)
        now = pair.clock.now()
        act()
        pair.run()
        assert pair.client.heard_at == now


def test_a_second_answer_is_handed_on() -> None:
    pair = Pair(lambda goal: goal.accept())
    pair.wire.duplicate("*/send_goal", what="reply")
    got: list[bool] = []
    pair.client.send(identity(1), {}, got.append)
    pair.run()
    assert got == [True, True]


def test_after_closing_nothing_comes() -> None:
    pair = Pair()
    goal = pair.send()
    goal.execute()
    pair.ask_result()
    pair.client.close()
    goal.publish_feedback({"at": 1})
    goal.succeed()
    pair.run(10)
    assert not pair.feedback and not pair.results and pair.client.statuses == {goal.id: EXECUTING}
    with pytest.raises(PortError):
        pair.send()


def test_a_goal_that_does_not_fit_its_type() -> None:
    pair = Pair()
    with pytest.raises(PortError, match="untill"):
        pair.client.send(identity(1), {"untill": 1}, lambda accepted: None)


def test_names_are_remapped_before_the_hidden_part_is_added() -> None:
    pair = Pair()
    remapped = MemoryTransport(pair.wire, pair.loop, "/robot/other", {"talk": "count"})
    client = ActionClient(remapped, "talk", TYPE)
    assert client.name == NAME and client.count_servers() == 1
