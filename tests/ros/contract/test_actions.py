"""Actions, made of services and topics by `ActionClient` and `ActionServer` over each transport."""

from __future__ import annotations

import uuid

import pytest

from .conftest import Pair
from .peers import Peer, until

pytestmark = pytest.mark.dds

FIBONACCI = "example_interfaces/action/Fibonacci"
UNKNOWN, ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(7)
NONE, REJECTED, UNKNOWN_ID, TERMINATED = range(4)


def offered(pair: Pair) -> str:
    name = f"{pair.name}/count"
    pair.far.action_server(key=name, name=name, type=FIBONACCI)
    pair.near.action_client(key=name, name=name, type=FIBONACCI)
    until(lambda: pair.near.servers(key=name) == 1)
    return name


def sent(pair: Pair, key: str, order: int = 3) -> bytes:
    goal = uuid.uuid4().bytes
    pair.near.send(key=key, goal=goal, message={"order": order})
    assert pair.far.event("wanted", key=key, goal=goal)["message"] == {"order": order}
    return goal


def accepted(pair: Pair, key: str, order: int = 3) -> bytes:
    goal = sent(pair, key, order)
    assert pair.far.goal(goal=goal, does="execute")
    assert pair.near.event("decided", key=key, goal=goal)["accepted"] is True
    return goal


def test_a_goal_with_feedback_status_and_result(pair: Pair) -> None:
    key = offered(pair)
    goal = accepted(pair, key)
    until(lambda: pair.near.status(key=key, goal=goal) == EXECUTING)
    pair.near.get_result(key=key, goal=goal)
    for length in (1, 2, 3):
        assert pair.far.goal(goal=goal, does="publish_feedback", message={"sequence": list(range(length))})
        assert pair.near.event("feedback", key=key, goal=goal)["message"] == {"sequence": list(range(length))}
    assert pair.near.none("result", key=key)
    assert pair.far.goal(goal=goal, does="succeed", message={"sequence": [0, 1, 1]})
    result = pair.near.event("result", key=key, goal=goal)
    assert result["status"] == SUCCEEDED and result["message"] == {"sequence": [0, 1, 1]}
    until(lambda: pair.near.status(key=key, goal=goal) == SUCCEEDED)


def test_a_goal_is_rejected(pair: Pair) -> None:
    key = offered(pair)
    goal = sent(pair, key)
    pair.far.goal(goal=goal, does="reject")
    assert pair.near.event("decided", key=key, goal=goal)["accepted"] is False
    pair.near.get_result(key=key, goal=goal)
    assert pair.near.event("result", key=key, goal=goal)["status"] == UNKNOWN


def test_a_goal_is_accepted_late(pair: Pair) -> None:
    key = offered(pair)
    goal = sent(pair, key)
    pair.near.get_result(key=key, goal=goal)
    pair.far.freeze(seconds=0.05)
    assert pair.near.none("decided", key=key)
    pair.far.goal(goal=goal, does="accept")
    assert pair.near.event("decided", key=key, goal=goal)["accepted"] is True
    pair.far.goal(goal=goal, does="succeed", message={})
    assert pair.near.event("result", key=key, goal=goal)["status"] == SUCCEEDED


def test_a_goal_is_aborted(pair: Pair) -> None:
    key = offered(pair)
    goal = accepted(pair, key)
    pair.near.get_result(key=key, goal=goal)
    pair.far.goal(goal=goal, does="abort", message={"sequence": [7]})
    result = pair.near.event("result", key=key, goal=goal)
    assert (result["status"], result["message"]) == (ABORTED, {"sequence": [7]})


def test_two_goals_at_once(pair: Pair) -> None:
    key = offered(pair)
    first, second = accepted(pair, key, 1), accepted(pair, key, 2)
    for goal in (first, second):
        pair.near.get_result(key=key, goal=goal)
    pair.far.goal(goal=second, does="publish_feedback", message={"sequence": [2]})
    assert pair.near.event("feedback", key=key)["goal"] == second
    pair.far.goal(goal=second, does="succeed", message={"sequence": [2]})
    assert pair.near.event("result", key=key)["goal"] == second
    until(lambda: pair.near.status(key=key, goal=second) == SUCCEEDED)
    assert pair.near.status(key=key, goal=first) == EXECUTING
    pair.far.goal(goal=first, does="succeed", message={"sequence": [1]})
    assert pair.near.event("result", key=key)["message"] == {"sequence": [1]}


def test_the_result_can_be_asked_for_after_the_end_and_again(pair: Pair) -> None:
    key = offered(pair)
    goal = accepted(pair, key)
    pair.far.goal(goal=goal, does="succeed", message={"sequence": [5]})
    for _ in range(2):
        pair.near.get_result(key=key, goal=goal)
        assert pair.near.event("result", key=key, goal=goal)["message"] == {"sequence": [5]}


def test_cancelling(pair: Pair) -> None:
    key = offered(pair)
    goal = accepted(pair, key)
    pair.near.get_result(key=key, goal=goal)
    pair.near.cancel(key=key, goal=goal)
    pair.far.event("cancel", key=key, goal=goal)
    pair.far.decide(goal=goal, yes=True)
    answer = pair.near.event("canceling", key=key, goal=goal)
    assert (answer["code"], answer["goals"]) == (NONE, [goal])
    until(lambda: pair.near.status(key=key, goal=goal) == CANCELING)
    pair.far.goal(goal=goal, does="cancel", message={})
    assert pair.near.event("result", key=key, goal=goal)["status"] == CANCELED
    pair.near.cancel(key=key, goal=goal)
    answer = pair.near.event("canceling", key=key, goal=goal)
    assert (answer["code"], answer["goals"]) == (TERMINATED, [])


def test_cancelling_is_refused(pair: Pair) -> None:
    key = offered(pair)
    goal = accepted(pair, key)
    pair.near.cancel(key=key, goal=goal)
    pair.far.event("cancel", key=key, goal=goal)
    pair.far.decide(goal=goal, yes=False)
    answer = pair.near.event("canceling", key=key, goal=goal)
    assert (answer["code"], answer["goals"]) == (REJECTED, [])
    assert pair.far.goal(goal=goal, does="succeed", message={})


def test_cancelling_what_is_not_known(pair: Pair) -> None:
    key = offered(pair)
    goal = uuid.uuid4().bytes
    pair.near.cancel(key=key, goal=goal)
    answer = pair.near.event("canceling", key=key, goal=goal)
    assert (answer["code"], answer["goals"]) == (UNKNOWN_ID, [])


def test_cancelling_everything(pair: Pair) -> None:
    key = offered(pair)
    goals = [accepted(pair, key, order) for order in range(3)]
    pair.near.cancel_all(key=key)
    for goal in goals:
        pair.far.event("cancel", key=key, goal=goal)
        pair.far.decide(goal=goal, yes=True)
    answer = pair.near.event("canceling", key=key)
    assert answer["code"] == NONE and sorted(answer["goals"]) == sorted(goals)


def test_who_comes_late_sees_what_runs(pair: Pair) -> None:
    key = offered(pair)
    goal = accepted(pair, key)
    until(lambda: pair.near.status(key=key, goal=goal) == EXECUTING)
    pair.near.action_client(key="late", name=key, type=FIBONACCI)
    until(lambda: pair.near.status(key="late", goal=goal) == EXECUTING)
    pair.near.close(key="late")


def test_a_server_that_is_started_again_has_forgotten_its_goals(pair: Pair) -> None:
    key = offered(pair)
    ended, goal = accepted(pair, key), accepted(pair, key)
    pair.far.goal(goal=ended, does="succeed", message={})
    for each in (goal, ended):  # the second is answered: the first was taken, too
        pair.near.get_result(key=key, goal=each)
    pair.near.event("result", key=key, goal=ended)
    pair.far.close(key=key)
    assert pair.near.event("result", key=key, goal=goal)["status"] == ABORTED
    until(lambda: pair.near.servers(key=key) == 0)
    pair.far.action_server(key=key, name=key, type=FIBONACCI)
    until(lambda: pair.near.servers(key=key) == 1)
    pair.near.get_result(key=key, goal=goal)
    assert pair.near.event("result", key=key, goal=goal)["status"] == UNKNOWN
    pair.near.cancel(key=key, goal=goal)
    assert pair.near.event("canceling", key=key, goal=goal)["code"] == UNKNOWN_ID
    again = accepted(pair, key)
    pair.far.goal(goal=again, does="succeed", message={})
    pair.near.get_result(key=key, goal=again)
    assert pair.near.event("result", key=key, goal=again)["status"] == SUCCEEDED


def test_an_action_is_remapped_with_all_its_parts(pair: Pair) -> None:
    other = f"/{pair.name}/robot/count"
    with Peer(pair.near.kind, "--ros-args", "-r", f"{pair.name}/count:={other}") as near:
        pair.far.action_server(key=other, name=other, type=FIBONACCI)
        near.action_client(key="c", name=f"{pair.name}/count", type=FIBONACCI)
        until(lambda: near.servers(key="c") == 1)
        goal = uuid.uuid4().bytes
        near.send(key="c", goal=goal, message={"order": 1})
        pair.far.event("wanted", key=other, goal=goal)
        pair.far.goal(goal=goal, does="execute")
        assert near.event("decided", goal=goal)["accepted"] is True
        until(lambda: near.status(key="c", goal=goal) == EXECUTING)
        pair.far.goal(goal=goal, does="publish_feedback", message={"sequence": [1]})
        assert near.event("feedback", goal=goal)
        near.cancel(key="c", goal=goal)
        pair.far.event("cancel", goal=goal)
        pair.far.decide(goal=goal, yes=True)
        assert near.event("canceling", goal=goal)["goals"] == [goal]
        near.get_result(key="c", goal=goal)
        pair.far.goal(goal=goal, does="cancel", message={})
        assert near.event("result", goal=goal)["status"] == CANCELED
