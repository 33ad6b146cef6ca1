"""What a goal can be on a robot, explored: no report says that it has stopped while it moves or may still begin."""

from __future__ import annotations

import pytest

from tests.chance import SEARCH, seeds
from tests.ros import goal_model
from tests.ros.goal_model import TWIN, World, play

DEPTH, ORDERS = (5, 2_000) if SEARCH else (3, 200)
"""Events after the start, and how many orders of them there are at least. `./dev soak --goals 6` explores further."""


def test_whatever_happens_the_session_says_what_is_so() -> None:
    assert goal_model.explore(DEPTH).states > ORDERS


def test_every_state_of_one_goal_is_explored() -> None:
    """Whatever the robot, the network, the wizard and the engine do: there are no more states than these."""
    found = goal_model.explore(goal_model.ENOUGH, goals=1, without=(*TWIN, *(() if SEARCH else ("other_begins",))))
    assert found.is_whole and found.states > (1_000 if SEARCH else 500)


def test_every_state_without_a_goal_of_the_session_is_explored() -> None:
    """Somebody else may have begun something, before or after the session has found the robot."""
    found = goal_model.explore(goal_model.ENOUGH, goals=0)
    assert found.is_whole and found.states > 200


def test_while_a_second_program_comes_and_goes_the_session_says_what_is_so() -> None:
    never = ("cut", "heal", "engine_dies", "release", "take_unheard", "refuse")
    assert goal_model.explore(goal_model.ENOUGH, goals=0, without=never).is_whole
    assert goal_model.explore(6 if SEARCH else 4, goals=1, without=never).states > 200


@pytest.mark.search
def test_after_many_events_the_session_says_what_is_so() -> None:
    for seed in seeds(100):
        goal_model.walk(seed)


@pytest.mark.parametrize(
    ("events", "reason"),
    [
        (("start", "stop", "wait"), "it has not answered and may still begin"),
        (("start", "take", "cancel", "refuses_to_stop", "wait", "refuses_to_stop"), "it refused to stop"),
        (("start", "take", "cancel", "wait"), "it has not ended yet"),
        (("start", "take", "cut"), "its program has gone"),
        (("start", "stop", "wait", "take"), "it began late and should stop"),
        (("start", "take", "engine_dies"), "an engine that has gone began it"),
        (("start", "engine_dies"), "an engine that has gone may have begun it"),
    ],
)
def test_what_may_be_going_on_is_named_with_its_reason(events: tuple[str, ...], reason: str) -> None:
    world = play(events)
    assert [goal.reason for goal in world.open()] == [reason]


def test_a_goal_that_begins_after_its_stop_is_stopped_and_the_panel_says_so() -> None:
    world = play(("start", "stop", "wait"))
    said = world.stop_said()
    assert said is not None and said.unconfirmed == (f"{goal_model.PART} (it has not answered and may still begin)",)
    play_more(world, "take")
    said = world.stop_said()
    assert said is not None and said.unconfirmed == (f"{goal_model.PART} (it began late and should stop)",)
    play_more(world, "is_stopped_by_robot")
    said = world.stop_said()
    assert said is not None and said.confirmed == (goal_model.PART,) and said.unconfirmed == ()


def test_what_somebody_else_begins_after_a_stop_takes_the_confirmation_back_until_the_next_stop() -> None:
    world = play(("start", "take", "stop", "is_stopped_by_robot"))
    said = world.stop_said()
    assert said is not None and said.confirmed == (goal_model.PART,)
    for event in ("other_begins", "finish"):
        play_more(world, event)
        said = world.stop_said()
        assert said is not None and said.unconfirmed == (
            f"{goal_model.PART} (something was begun there after the stop)",
        )
        assert not any(program.cancels for program in world.programs)
    play_more(world, "stop")
    said = world.stop_said()
    assert said is not None and said.confirmed == (goal_model.PART,)


def test_what_an_engine_left_behind_runs_on_until_somebody_asks() -> None:
    world = play(("start", "take", "engine_dies", "wait"))
    assert world.moving() and not any(program.cancels for program in world.programs)
    world.robot.cancel_open_goals("")
    world.settle()
    play_more(world, "is_stopped_by_robot")
    assert not world.moving() and world.open() == ()


def test_what_is_being_stopped_has_not_ended_although_rcl_calls_it_terminated() -> None:
    """And so no next engine confirms its stop before it hears of it."""
    world = play(("start", "take", "stop"))
    for program in world.programs:
        program.answer_cancels(stops=True)
    late = world.wire.hold("*/status")
    world.engine_dies()
    world.settle()
    assert [goal.reason for goal in world.open()] == ["an engine that has gone began it"]
    goal_model.check(world)
    late.release()
    play_more(world, "finish")
    assert world.open() == ()


def test_a_part_that_a_person_releases_is_used_again() -> None:
    world = play(("start", "take", "cancel", "refuses_to_stop", "wait", "refuses_to_stop", "start", "wait"))
    assert world.reports[-1].status == "failed" and world.reports[-1].reason.startswith("held: ")  # type: ignore[union-attr]
    world.robot.release_open_goals(goal_model.PART)
    assert world.open() == ()


def play_more(world: World, event: str) -> None:
    goal_model.EVENTS[event](world)
    world.settle()
    goal_model.check(world)
