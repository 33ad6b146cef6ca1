"""What can become of an order on a topic and of a call of a service, explored: whoever should stop is told as soon as
it listens, or the session says that it may go on."""

from __future__ import annotations

import pytest

from tests.chance import SEARCH, seeds
from tests.ros import simple_goal_model as model

TOLD, NOT_HEARD = (), ("it may not have heard that it should stop",)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "with_bag", "states"), [("topic", False, 300), ("rate", True, 300), ("service", False, 100)]
)
def test_whatever_happens_the_session_says_what_may_go_on(kind: model.Kind, with_bag: bool, states: int) -> None:
    assert model.explore(kind, 4 if SEARCH else 3, with_bag=with_bag) > states


@pytest.mark.search
@pytest.mark.parametrize("kind", model.EVENTS)
def test_after_many_events_the_session_says_what_may_go_on(kind: model.Kind) -> None:
    for seed in seeds(60):
        model.walk(kind, seed)


BAG_CASES = {
    "cut off, and its end is not heard": ("cut", "wait", "notice"),
    "cut off before its end": ("cut", "notice", "wait"),
    "cut off, and what follows ends": ("cut", "notice", "start", "wait"),
    "stopped while it is cut off": ("cut", "notice", "stop"),
    "the bag is gone with it": ("join", "wait"),
}


@pytest.mark.parametrize("case", BAG_CASES)
def test_a_bag_that_listens_too_hides_nobody_who_has_not_heard_the_reset(case: str) -> None:
    world = model.play("topic", ("start", *BAG_CASES[case]), with_bag=True)
    assert [goal.reason for goal in world.open()] == list(NOT_HEARD)
    if world.is_stopped:
        said = world.stop_said()
        assert said is not None and said.unconfirmed == (f"pepper/part ({NOT_HEARD[0]})",)
    for event in ("heal", "join", "settle"):
        getattr(world, event)()
        world.settle()
    assert not any(program.order for program in world.programs)


LONG_AGO = {
    "its program runs somewhere else": ("cut", "notice", "replace", "wait_long"),
    "a person released it": ("cut", "notice", "release", "wait_long"),
    "an engine that has gone ordered it": ("cut", "notice", "recover", "join", "stop_open", "wait_long"),
}


@pytest.mark.parametrize("case", LONG_AGO)
def test_who_is_back_after_a_long_time_is_told(case: str) -> None:
    world = model.play("topic", ("start",))
    for event in LONG_AGO[case]:
        getattr(world, event)()
        world.settle()
        if event == "release":
            world.base.order = "1/a"  # type: ignore[union-attr]  # the person was wrong
    assert world.open() == () and world.base is not None and world.base.order
    world.heal()
    world.settle()
    assert world.base.order == ""


CALLS = {
    "out of sight": (("cut",), ["its program has gone"]),
    "out of sight and back": (("cut", "heal"), ["nothing stops a call, and it has not answered"]),
    "answered when it is back": (("cut", "heal", "answer"), []),
    "its program is started again": (("respawn", "notice"), []),
    "both programs are shown": (("cancel", "respawn"), ["nothing stops a call, and it has not answered"]),
    "over another connection": (("switch",), ["nothing stops a call, and it has not answered"]),
}


@pytest.mark.parametrize("case", CALLS)
def test_a_call_is_over_when_it_is_answered_or_another_program_is_there(case: str) -> None:
    events, reasons = CALLS[case]
    world = model.play("service", ("start", *events))
    assert [goal.reason for goal in world.open()] == reasons
    world.stop()
    world.settle(3)
    said = world.stop_said()
    assert said is not None and bool(said.unstoppable) == bool(reasons)
