"""Calls: answered at once, later, in another order, never; and by one who comes or goes."""

from __future__ import annotations

from functools import partial

import pytest

from .conftest import Pair
from .peers import Refused, until

pytestmark = pytest.mark.dds

SET, TRIGGER = "std_srvs/srv/SetBool", "std_srvs/srv/Trigger"
YES, NO = {"success": True, "message": "ja ✓"}, {"success": False, "message": ""}


def served(pair: Pair, type: str = SET, answer: dict[str, object] | None = None) -> str:
    name = f"{pair.name}/ask"
    pair.far.serve(key=name, name=name, type=type, answer=answer)
    pair.near.client(key=name, name=name, type=type)
    until(lambda: pair.near.servers(key=name) == 1)
    return name


def test_a_call_is_answered(pair: Pair) -> None:
    key = served(pair, answer=YES)
    for number in range(50):
        pair.near.call(key=key, number=number, message={"data": number % 2 == 0})
        assert pair.far.event("asked", key=key)["message"] == {"data": number % 2 == 0}
        assert pair.near.event("answer", key=key, number=number)["message"] == YES


def test_a_first_call_is_answered_as_soon_as_there_is_a_server(pair: Pair) -> None:
    for turn in range(5):
        key = f"{pair.name}/first{turn}"
        pair.near.client(key=key, name=key, type=SET)
        pair.far.serve(key=key, name=key, type=SET, answer=YES)
        until(partial(pair.near.servers, key=key))
        pair.near.call(key=key, number=turn, message={"data": True})
        assert pair.near.event("answer", key=key)["message"] == YES


def test_an_empty_request(pair: Pair) -> None:
    key = served(pair, TRIGGER, answer=YES)
    pair.near.call(key=key, number=1, message={})
    assert pair.far.event("asked", key=key)["message"] == {}
    assert pair.near.event("answer", key=key)["message"] == YES


def test_an_answer_that_comes_later(pair: Pair) -> None:
    key = served(pair)
    pair.near.call(key=key, number=1, message={"data": True})
    asked = pair.far.event("asked", key=key)
    pair.far.freeze(seconds=0.05)
    assert pair.near.none("answer", key=key)
    pair.far.reply(number=asked["number"], message=YES)
    assert pair.near.event("answer", key=key, number=1)["message"] == YES


def test_two_calls_answered_in_the_other_order(pair: Pair) -> None:
    key = served(pair)
    numbers = []
    for number in (1, 2):
        pair.near.call(key=key, number=number, message={"data": number == 1})
        numbers.append(pair.far.event("asked", key=key, message={"data": number == 1})["number"])
    pair.far.reply(number=numbers[1], message=NO)
    assert pair.near.event("answer", key=key)["number"] == 2
    pair.far.reply(number=numbers[0], message=YES)
    assert pair.near.event("answer", key=key)["number"] == 1


def test_only_the_first_answer_counts(pair: Pair) -> None:
    key = served(pair)
    pair.near.call(key=key, number=1, message={"data": True})
    number = pair.far.event("asked", key=key)["number"]
    with pytest.raises(Refused, match="success"):
        pair.far.reply(number=number, message={"success": "perhaps"})
    pair.far.reply(number=number, message=YES)
    pair.far.reply(number=number, message=NO)
    pair.near.call(key=key, number=2, message={"data": True})
    pair.far.reply(number=pair.far.event("asked", key=key)["number"], message=NO)
    assert pair.near.event("answer", key=key) == {"event": "answer", "key": key, "number": 1, "message": YES}
    assert pair.near.event("answer", key=key) == {"event": "answer", "key": key, "number": 2, "message": NO}


def test_a_hundred_calls_at_once(pair: Pair) -> None:
    """More than ROS's own queue of ten requests."""
    key = served(pair, answer=YES)
    pair.far.freeze(seconds=0.0)
    for number in range(100):
        pair.near.call(key=key, number=number, message={"data": True})
    assert {pair.near.event("answer", key=key)["number"] for _ in range(100)} == set(range(100))


def test_a_hundred_calls_that_wait_are_answered_backwards(pair: Pair) -> None:
    key = served(pair)
    for number in range(100):
        pair.near.call(key=key, number=number, message={"data": True})
    waiting = [pair.far.event("asked", key=key)["number"] for _ in range(100)]
    for number in reversed(waiting):
        pair.far.reply(number=number, message=YES)
    assert {pair.near.event("answer", key=key)["number"] for _ in range(100)} == set(range(100))


def test_two_clients_get_their_own_answers(pair: Pair) -> None:
    key = served(pair)
    pair.near.client(key="second", name=key, type=SET)
    pair.far.client(key="own", name=key, type=SET)
    until(lambda: pair.near.servers(key="second") == 1 and pair.far.servers(key="own") == 1)
    numbers = []
    for peer, client in ((pair.near, key), (pair.near, "second"), (pair.far, "own")):
        peer.call(key=client, number=7, message={"data": True})
        numbers.append(pair.far.event("asked", key=key)["number"])
    for number, answer in zip(numbers, ("first", "second", "third"), strict=True):
        pair.far.reply(number=number, message={"message": answer})
    assert pair.near.event("answer", key=key)["message"] == {"success": False, "message": "first"}
    assert pair.near.event("answer", key="second")["message"] == {"success": False, "message": "second"}
    assert pair.far.event("answer", key="own")["message"] == {"success": False, "message": "third"}
    pair.near.close(key="second")
    pair.far.close(key="own")


def test_a_closed_client_hears_no_answer(pair: Pair) -> None:
    key = served(pair)
    pair.near.call(key=key, number=1, message={"data": True})
    number = pair.far.event("asked", key=key)["number"]
    pair.near.close(key=key)
    pair.far.reply(number=number, message=YES)
    pair.near.client(key=key, name=key, type=SET)
    until(lambda: pair.near.servers(key=key) == 1)
    pair.near.call(key=key, number=2, message={"data": True})
    pair.far.reply(number=pair.far.event("asked", key=key)["number"], message=NO)
    assert pair.near.event("answer", key=key)["number"] == 2
    assert pair.near.none("answer", key=key)


def test_servers_are_counted_as_they_come_and_go(pair: Pair) -> None:
    name = f"{pair.name}/ask"
    pair.near.client(key=name, name=name, type=SET)
    assert pair.near.servers(key=name) == 0
    pair.far.serve(key=name, name=name, type=SET, answer=YES)
    until(lambda: pair.near.servers(key=name) == 1)
    pair.near.serve(key="second", name=name, type=SET, answer=NO)
    until(lambda: pair.near.servers(key=name) == 2)
    pair.near.close(key="second")
    until(lambda: pair.near.servers(key=name) == 1)
    pair.far.close(key=name)
    until(lambda: pair.near.servers(key=name) == 0)
    pair.far.serve(key=name, name=name, type=SET, answer=YES)
    until(lambda: pair.near.servers(key=name) == 1)
    pair.near.call(key=name, number=1, message={"data": True})
    assert pair.near.event("answer", key=name)["message"] == YES


def test_a_request_that_does_not_fit_is_refused(pair: Pair) -> None:
    key = served(pair, answer=YES)
    with pytest.raises(Refused, match="data"):
        pair.near.call(key=key, number=1, message={"data": "on"})
    with pytest.raises(Refused, match="volume"):
        pair.near.call(key=key, number=1, message={"volume": 1})
