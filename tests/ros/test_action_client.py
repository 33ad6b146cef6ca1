"""The client's side of an action: what goes on the wire, and what comes back, without any opinion about it."""

from __future__ import annotations

from typing import Any

import pytest
from rise_adapters.ros2.actions.client import (
    ABORTED,
    ALL_GOALS,
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCEL_UNKNOWN,
    CANCELED,
    EXECUTING,
    SUCCEEDED,
    UNKNOWN,
    ActionClient,
    CancelResponse,
)
from rise_adapters.ros2.transport.port import PortError

from rise_engine.run.engine.clock import VirtualClock
from tests.ros.badrobot import BadServer, Plan
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire

TYPE = "rise_interfaces/action/Speech"
ONE, TWO = bytes(range(16)), bytes(range(16, 32))


class Pair:
    def __init__(self, *plans: Plan, serving: bool = True) -> None:
        self.clock = VirtualClock()
        self.loop = ClockLoop(self.clock)
        self.wire = MemoryWire()
        self.near = MemoryTransport(self.wire, self.loop, "/lab/engine")
        self.far = MemoryTransport(self.wire, self.loop, "/lab/robot")
        if serving:
            self.serve(*plans)
        self.client = ActionClient(self.near, "speech", TYPE, now=self.clock.now)
        self.got: list[Any] = []

    def serve(self, *plans: Plan) -> None:
        self.server = BadServer(self.far, "speech", TYPE, self.loop.call_later, plans or (Plan(),))

    def run(self, until: float = 100.0) -> list[Any]:
        self.loop.run_until(until)
        got, self.got = self.got, []
        return got

    def send(self, goal: bytes = ONE, text: str = "Hello") -> None:
        self.client.send(goal, {"message": text}, self.got.append)

    def ask(self, goal: bytes = ONE) -> None:
        self.client.get_result(goal, lambda status, result: self.got.append((status, result)))


def test_a_goal_under_an_id_of_our_own() -> None:
    pair = Pair(Plan(seconds=2, result={"reason": ""}))
    pair.send()
    assert pair.got == [], "never inside the call"
    assert pair.run(0.1) == [True]
    assert pair.server.received == [ONE]
    sent = pair.wire.messages("/lab/speech/_action/send_goal", "request")
    assert sent[0]["goal_id"] == {"uuid": ONE} and sent[0]["goal"]["message"] == "Hello"
    pair.ask()
    assert pair.run(1.9) == []
    assert pair.run(3) == [(SUCCEEDED, {"reason": ""})]


def test_a_rejection() -> None:
    pair = Pair(Plan(accept=False))
    pair.send()
    assert pair.run() == [False]


@pytest.mark.parametrize("status", [SUCCEEDED, ABORTED, CANCELED])
def test_a_result_before_and_after_the_end_and_again(status: int) -> None:
    pair = Pair(Plan(seconds=1, end=status))
    pair.send()
    pair.ask()
    assert [got[0] for got in pair.run(5) if got is not True] == [status]
    pair.ask()
    pair.ask()
    assert [got[0] for got in pair.run(6)] == [status, status]


def test_the_result_of_a_goal_that_nobody_has() -> None:
    pair = Pair()
    pair.ask(TWO)
    assert pair.run() == [(UNKNOWN, {"reason": ""})]


@pytest.mark.parametrize(
    ("plan", "code", "stops"),
    [
        (Plan(seconds=9), CANCEL_NONE, True),
        (Plan(seconds=9, cancel="refuse"), CANCEL_NONE, False),
        (Plan(seconds=9, cancel="reject"), CANCEL_REJECTED, False),
        (Plan(seconds=0.1), CANCEL_TERMINATED, False),
    ],
)
def test_cancelling_one(plan: Plan, code: int, stops: bool) -> None:
    pair = Pair(plan)
    pair.send()
    pair.run(1)
    pair.client.cancel(ONE, pair.got.append)
    assert pair.run(2) == [CancelResponse(code, (ONE,) if stops else ())]
    request = pair.wire.messages("*/cancel_goal", "request")[-1]["goal_info"]
    assert request == {"goal_id": {"uuid": ONE}, "stamp": {"sec": 0, "nanosec": 0}}


def test_cancelling_one_that_was_never_accepted() -> None:
    pair = Pair(Plan(accept=None))
    pair.send()
    pair.client.cancel(ONE, pair.got.append)
    assert pair.run(2) == [CancelResponse(CANCEL_NONE, (ONE,))], "it needs no handle"
    pair.client.cancel(TWO, pair.got.append)
    assert pair.run(3) == [CancelResponse(CANCEL_UNKNOWN, ())]


def test_cancelling_everything_also_of_others() -> None:
    pair = Pair(Plan(seconds=60))
    pair.send()
    pair.server.foreign(TWO, Plan(seconds=60))
    pair.run(1)
    assert pair.client.unfinished_goals() == {ONE, TWO}
    pair.client.cancel(ALL_GOALS, pair.got.append)
    answers = pair.run(2)
    assert answers[0].code == CANCEL_NONE and set(answers[0].goals) == {ONE, TWO}
    assert pair.server.cancels == [ALL_GOALS]
    assert pair.client.unfinished_goals() == set()
    assert pair.client.statuses == {ONE: CANCELED, TWO: CANCELED}


def test_feedback_goes_by_the_goal() -> None:
    pair = Pair(Plan(seconds=0.25, feedback_every=0.1), Plan(seconds=0.15, feedback_every=0.1))
    pair.client.on_feedback = lambda goal, feedback: pair.got.append((goal, sorted(feedback)))
    pair.send(ONE)
    pair.send(TWO)
    assert [got for got in pair.run(1) if got is not True] == [
        (ONE, ["progress"]),
        (TWO, ["progress"]),
        (ONE, ["progress"]),
    ]


def test_status_also_for_one_who_comes_late() -> None:
    pair = Pair(Plan(seconds=60))
    pair.send()
    pair.run(1)
    late = ActionClient(pair.near, "/lab/speech", TYPE)
    late.on_status = lambda statuses: pair.got.append(dict(statuses))
    assert pair.run(2) == [{ONE: EXECUTING}]


def test_servers_are_counted_when_all_three_services_are_there() -> None:
    pair = Pair(serving=False)
    assert pair.client.count_servers() == 0
    pair.far.serve("speech/_action/send_goal", f"{TYPE}_SendGoal", lambda request, reply: None)
    pair.far.serve("speech/_action/get_result", f"{TYPE}_GetResult", lambda request, reply: None)
    assert pair.client.count_servers() == 0
    pair.far.serve("speech/_action/cancel_goal", "action_msgs/srv/CancelGoal", lambda request, reply: None)
    assert pair.client.count_servers() == 1
    pair.serve()
    assert pair.client.count_servers() == 2


def test_every_answer_is_a_sign_of_life() -> None:
    pair = Pair(Plan(seconds=9, status=False, feedback_every=2))
    assert pair.client.heard_at is None
    pair.send()
    pair.run(1)
    assert pair.client.heard_at == 0
    pair.run(3)
    assert pair.client.heard_at == 2


def test_a_second_answer_is_handed_on() -> None:
    pair = Pair()
    pair.wire.duplicate("*/send_goal", what="reply")
    pair.send()
    assert pair.run() == [True, True]


def test_after_closing_nothing_comes() -> None:
    pair = Pair(Plan(seconds=1, feedback_every=0.1))
    pair.client.on_feedback = lambda *what: pair.got.append(what)
    pair.send()
    pair.ask()
    pair.run(0.05)
    pair.client.close()
    assert pair.run() == []
    with pytest.raises(PortError):
        pair.send()


def test_a_goal_that_does_not_fit_its_type() -> None:
    pair = Pair()
    with pytest.raises(PortError, match="volumme"):
        pair.client.send(ONE, {"volumme": 1.0}, pair.got.append)


def test_names_are_remapped_before_the_hidden_part_is_added() -> None:
    pair = Pair()
    remapped = MemoryTransport(pair.wire, pair.loop, "/lab/other", {"talk": "speech"})
    client = ActionClient(remapped, "talk", TYPE)
    assert client.name == "/lab/speech" and client.count_servers() == 1
