"""The simulated robot: believable, deterministic, and wrong on request."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest
from msgspec.structs import replace
from rise_adapters.simulated import SimulatedRobot
from rise_adapters.simulated.faults import ActionFault, LinkFault, parse_fault

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, RobotChanged, StopReport
from rise_engine.ports.robot import RobotReport
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.scenario.model import RobotProfile
from rise_engine.scenario.reading.action_declarations import core_actions

ALL = ("generic/arms", "generic/body", "generic/face", "generic/gaze", "generic/speech")


def profile(driver: str = "simulated", **options: Any) -> RobotProfile:
    return RobotProfile("generic", "Generic", driver, dict(core_actions()), options)


class Bench:
    def __init__(self, *faults: str, seed: int = 0, robot: RobotProfile | None = None) -> None:
        self.clock = VirtualClock()
        self.told: list[tuple[float, RobotReport]] = []
        self.robot = SimulatedRobot(robot or profile(), self.clock, seed, faults)
        self.robot.connect(lambda report: self.told.append((round(self.clock.now(), 3), report)))

    def start(self, name: str, kind: str = "Speech", seconds: float = 2.0) -> None:
        self.robot.start(StartAction(name, kind, {}, seconds))

    def run(self, until: float = 1e9) -> Sequence[tuple[float, str, str]]:
        """What was reported: time, who, status."""
        while (following := self.clock.next_at) is not None and following <= until:
            self.clock.advance()
        return self.lines()

    def lines(self) -> list[tuple[float, str, str]]:
        found: list[tuple[float, str, str]] = []
        for t, report in self.told:
            match report:
                case ActionReport():
                    found.append((t, report.action, report.status))
                case RobotChanged():
                    found.append((t, "robot", report.status))
                case StopReport():
                    found.append((t, "stop", ",".join(report.unconfirmed) or "all"))
        return found


def test_it_is_connected_at_once_and_says_that_it_is_not_real() -> None:
    bench = Bench()
    assert bench.lines() == [(0, "robot", "connected")]
    report = bench.told[0][1]
    assert isinstance(report, RobotChanged) and "simulated" in report.detail and "nothing leaves" in report.detail


def test_a_goal_is_accepted_soon_and_takes_its_time() -> None:
    bench = Bench()
    bench.start("1/a", seconds=2.5)
    bench.start("1/b", "LookAt", seconds=0)
    assert bench.run()[1:] == [
        (0.02, "1/a", "accepted"),
        (0.02, "1/b", "accepted"),
        (0.021, "1/b", "succeeded"),
        (2.5, "1/a", "succeeded"),
    ]


def test_cancel_reaches_a_goal_that_was_only_just_started() -> None:
    bench = Bench()
    bench.start("1/a")
    bench.robot.cancel("1/a")
    bench.robot.cancel("1/a")
    bench.robot.cancel("never heard of")
    assert bench.run()[1:] == [(0.05, "1/a", "canceled")]


def test_stop_all_cancels_everything_and_names_its_parts() -> None:
    bench = Bench()
    bench.start("1/a")
    bench.start("2/a", "LookAt")
    bench.run(1.0)
    bench.robot.stop_all()
    assert [line[1:] for line in bench.run()[-3:]] == [("1/a", "canceled"), ("2/a", "canceled"), ("stop", "all")]
    report = bench.told[-1][1]
    assert isinstance(report, StopReport) and report.confirmed == ALL


def test_after_close_it_is_silent() -> None:
    bench = Bench("vanish@5")
    bench.start("1/a")
    bench.robot.close()
    assert bench.run() == [(0, "robot", "connected")]


# --- faults ---------------------------------------------------------------------------------------------------------


def test_reject() -> None:
    bench = Bench("Speech=reject")
    bench.start("1/a")
    bench.start("1/b", "LookAt", 1)
    assert [line[1:] for line in bench.run()[1:]] == [("1/a", "failed"), ("1/b", "accepted"), ("1/b", "succeeded")]


def test_fail_only_the_second() -> None:
    bench = Bench("Speech=fail@2")
    for name in ("1/a", "1/b", "1/c"):
        bench.start(name)
    ends = [line for line in bench.run()[1:] if line[2] != "accepted"]
    assert ends == [(1.0, "1/b", "failed"), (2.0, "1/a", "succeeded"), (2.0, "1/c", "succeeded")]


def test_slow() -> None:
    bench = Bench("LookAt=slow:3")
    bench.start("1/a", "LookAt")
    assert bench.run()[-1] == (6.0, "1/a", "succeeded")


def test_hang_never_ends_and_its_part_does_not_confirm_a_stop() -> None:
    bench = Bench("Speech=hang")
    bench.start("1/a")
    bench.start("1/b", "LookAt", 100)
    bench.clock.call_at(5, lambda: bench.robot.cancel("1/a"))
    bench.clock.call_at(5, bench.robot.stop_all)
    assert bench.run()[3:] == [
        (5.05, "1/b", "canceled"),
        (5.051, "stop", "generic/speech"),
        (9.0, "robot", "degraded"),
        (9.0, "1/a", "lost"),
    ]


@pytest.mark.parametrize(
    ("fault", "ended", "reason"),
    [("refuse-cancel", "failed", "refused to stop"), ("ignore-cancel", "lost", "has not ended yet")],
)
def test_what_does_not_stop_holds_its_part_until_it_has_ended(fault: str, ended: str, reason: str) -> None:
    bench = Bench(f"Speech={fault}@1")
    bench.start("1/a", seconds=20)
    bench.clock.call_at(1, bench.robot.stop_all)
    bench.run(6)
    assert bench.lines()[2:] == [
        (1.051, "stop", "generic/speech"),
        (5.0, "robot", "degraded"),
        (5.0, "1/a", ended),
    ]
    report = bench.told[3][1]
    assert isinstance(report, RobotChanged)
    (goal,) = report.open
    assert (goal.part, goal.type, goal.holds, goal.accepted) == ("generic/speech", "Speech", True, True)
    assert reason in goal.reason and reason in report.detail
    bench.clock.call_at(7, lambda: bench.start("2/a"))
    bench.clock.call_at(18, lambda: bench.start("3/a", seconds=1))
    assert bench.run()[5:] == [
        (12.0, "2/a", "failed"),
        (20.0, "robot", "connected"),
        (20.0, "stop", "all"),
        (23.02, "3/a", "accepted"),
        (24.0, "3/a", "succeeded"),
    ]
    held = bench.told[5][1]
    assert isinstance(held, ActionReport) and held.reason.startswith("held: generic/speech")


def test_a_person_can_release_what_hangs() -> None:
    bench = Bench("Speech=hang@1")
    bench.start("1/a")
    bench.run(1)
    bench.robot.cancel("1/a")
    bench.run()
    bench.robot.cancel_open_goals("")
    bench.robot.release_open_goals("generic/gaze")
    assert bench.run()[-1][1:] == ("1/a", "lost")
    bench.robot.release_open_goals("generic/speech")
    bench.start("2/a", seconds=1)
    assert [line[1:] for line in bench.run()[-3:]] == [
        ("robot", "connected"),
        ("2/a", "accepted"),
        ("2/a", "succeeded"),
    ]


def test_a_carrier_that_takes_no_stop_is_never_confirmed() -> None:
    actions = dict(core_actions())
    carriers = {
        "LookAt": {"topic": "look", "type": "x"},
        "Speech": {"service": "say", "type": "x"},
        "Emotion": {"topic": "face", "type": "x", "unstoppable": True},
        "Animation": {"topic": "wave", "type": "x", "reset": {"data": 0}},
    }
    for name, carrier in carriers.items():
        actions[name] = replace(actions[name], carrier=carrier)
    bench = Bench(robot=RobotProfile("generic", "Generic", "ros2", actions, {}))
    bench.start("1/a", "LookAt", 5)
    bench.start("1/b", "Speech", 5)
    bench.clock.call_at(1, bench.robot.stop_all)
    bench.run()
    report, ended = bench.told[-2][1], bench.told[-1][1]
    assert isinstance(report, StopReport)
    assert report.unstoppable == ("generic/LookAt", "generic/Speech")
    assert report.unconfirmed and all(
        each.endswith(" (told to stop; a topic gives no answer)") for each in report.unconfirmed
    )
    assert {"generic/gaze", "generic/speech"}.isdisjoint(report.confirmed)
    assert isinstance(ended, RobotChanged) and ended.status == "connected"  # the call has been answered
    (goal,) = ended.open
    assert (goal.part, goal.reason, goal.holds) == ("generic/LookAt", "its topic cannot be stopped", False)
    bench.start("2/a", "LookAt", 1)  # what is published next replaces it, and goes on in its place
    assert [line[1:] for line in bench.run()[-4:]] == [
        ("robot", "connected"),
        ("2/a", "accepted"),
        ("robot", "connected"),
        ("2/a", "succeeded"),
    ]


def test_vanish_and_return() -> None:
    bench = Bench("vanish@2.5-4")
    bench.start("1/a", seconds=10)
    assert bench.run(3)[-1] == (2.5, "robot", "lost")
    bench.start("1/b")
    bench.robot.stop_all()
    assert bench.run(3.5)[-2:][0][1:] == ("1/b", "failed")
    assert bench.lines()[-1][1:] == ("stop", ",".join(ALL))
    assert bench.run(5)[-2:] == [(4.0, "robot", "connected"), (4.0, "stop", "all")]
    bench.start("1/c", seconds=1)
    assert bench.run()[-1][1:] == ("1/c", "succeeded")


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("slow-accept:2", [(2.02, "accepted"), (4.0, "succeeded")]),
        ("slow-reject:2", [(2.02, "failed")]),
        ("lost-accept", [(2.0, "succeeded")]),
        ("late-begin:2", [(0.02, "accepted"), (4.0, "succeeded")]),
        ("refuse-cancel", [(0.02, "accepted"), (2.0, "succeeded")]),  # it has ended before anybody gave it up
        ("ignore-cancel", [(0.02, "accepted"), (2.0, "succeeded")]),
        ("slow-cancel:2", [(0.02, "accepted"), (3.05, "canceled")]),
        ("die-on-goal:5", [(0.02, "lost"), (5.02, "connected")]),
        ("die-on-cancel:5", [(0.02, "accepted"), (1.02, "lost"), (6.02, "connected")]),
    ],
)
def test_what_else_goes_wrong(fault: str, told: list[tuple[float, str]]) -> None:
    bench = Bench(f"Speech={fault}")
    bench.start("1/a")
    if "cancel" in fault:
        bench.run(1)
        bench.clock.call_at(1.0, lambda: bench.robot.cancel("1/a"))
    assert [(t, status) for t, _, status in bench.run()[1:]] == told


def test_a_robot_that_is_inactive_takes_nothing() -> None:
    bench = Bench("inactive@1-2")
    bench.run(1.5)
    bench.start("1/a")
    bench.run(2.5)
    bench.start("1/b")
    assert [line[1:] for line in bench.run()[1:]] == [
        ("robot", "degraded"),
        ("1/a", "failed"),
        ("robot", "connected"),
        ("1/b", "accepted"),
        ("1/b", "succeeded"),
    ]


def test_a_fault_for_every_action() -> None:
    bench = Bench("*=slow:2")
    bench.start("1/a", "Animation")
    assert bench.run()[-1] == (4.0, "1/a", "succeeded")


def test_parsed() -> None:
    assert parse_fault("Speech=fail@2", profile()) == ActionFault("Speech", "fail", nth=2)
    assert parse_fault("LookAt=slow:1.5", profile()) == ActionFault("LookAt", "slow", 1.5)
    assert parse_fault("vanish@12.5", profile()) == LinkFault(12.5)
    assert parse_fault("vanish@12.5-20", profile()) == LinkFault(12.5, 20)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Speach=fail", "'Speech'"),
        ("speech=fail", "'Speech'"),
        ("Speech=reject_it", "'reject'"),
        ("Speech=", "unknown kind"),
        ("Speech", "write ACTION="),
        ("", "write ACTION="),
        ("Speech=slow", "factor above 0"),
        ("Speech=slow:0", "factor above 0"),
        ("Speech=slow:many", "factor above 0"),
        ("Speech=fail:2", "only `slow`"),
        ("Speech=slow-accept", "seconds, as in slow-accept:2"),
        ("Speech=die-on-goal:soon", "seconds, as in die-on-goal:5"),
        ("Speech=fail@0", "1 for the first"),
        ("Speech=fail@x", "1 for the first"),
        ("Wait=fail", "in the engine"),
        ("vanish", "vanish@12.5"),
        ("inactive", "inactive@12.5-20"),
        ("vanish@soon", "vanish@12.5"),
        ("vanish@20-10", "come back after"),
    ],
)
def test_what_cannot_be_understood_is_said_in_a_sentence(text: str, said: str) -> None:
    with pytest.raises(ValueError, match="fault") as caught:
        Bench(text)
    assert said in str(caught.value)


# --- chance and options ---------------------------------------------------------------------------------------------


def durations(seed: int) -> list[float]:
    bench = Bench(seed=seed, robot=profile(variation=0.2))
    for number in range(20):
        bench.start(str(number), seconds=10)
    return [t for t, _, status in bench.run() if status == "succeeded"]


def test_durations_vary_only_when_asked_and_with_the_seed() -> None:
    assert durations(1) == durations(1) != durations(2)
    assert all(8 <= each <= 12 for each in durations(1))


@pytest.mark.parametrize("options", [{"latency": -1}, {"latency": "fast"}, {"variation": 0.9}, {"latncy": 1}])
def test_options_that_make_no_sense(options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="robot profile 'generic'"):
        Bench(robot=profile(**options))


def test_in_debug_mode_it_stands_in_for_another_driver_whose_options_it_ignores() -> None:
    Bench(robot=profile("ros2", latency="fast", speech_topic="/say"))
