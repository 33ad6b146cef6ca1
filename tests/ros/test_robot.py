"""`Ros2Robot` beyond the fault table: how stop-all is answered, topics as carriers, how the robot stands, closing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rise_adapters.ros2.actions.client import ABORTED, CANCELED, SUCCEEDED, ActionClient
from rise_adapters.ros2.mapping import read_mappings
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.robot.endpoints import short_labels
from rise_adapters.ros2.transport.port import PortError, RemoteEndpoint

from rise_engine.base.suspend import suspended_seconds
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, Note, RobotChanged, StopReport
from rise_engine.ports.robot import RobotReport
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.scenario.model import RobotProfile
from tests.chance import examples
from tests.ros.badrobot import BadServer, Plan
from tests.ros.bench import GAZE, SPEECH, TYPES, profile
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire

LONG = Plan(seconds=60)
OTHERS = bytes(range(16))


class Alone:
    """A robot without an engine: what it reports is what there is."""

    def __init__(self, *plans: Plan, serving: bool = True, which: RobotProfile | None = None, **deadlines: float):
        self.clock = VirtualClock()
        self.loop = ClockLoop(self.clock)
        self.wire = MemoryWire()
        self.near = MemoryTransport(self.wire, self.loop, "/engine")
        self.far = MemoryTransport(self.wire, self.loop, "/robot")
        self.plans = plans or (Plan(),)
        self.servers: dict[str, BadServer] = {}
        if serving:
            self.serve()
        self.told: list[RobotReport] = []
        which = which or profile(**deadlines)
        self.robot = Ros2Robot(which, self.clock, self.near, read_mappings(which, self.near.fields))
        self.robot.connect(self.told.append)

    def recover(
        self, *left: StartAction, held_by: Sequence[str] = (), which: RobotProfile | None = None, **options: Any
    ) -> None:
        """The engine is killed. Another one continues the session, for which these goals were not over, and these
        emergency stops were pressed."""
        self.robot._report, self.robot._closed = lambda report: None, True
        self.near.close()
        self.near = MemoryTransport(self.wire, self.loop, "/engine")
        which = which or msgspec.structs.replace(profile(), options=options)
        self.robot = Ros2Robot(which, self.clock, self.near, read_mappings(which, self.near.fields))
        self.robot.adopt(left)
        self.robot.adopt_estop(held_by)
        self.robot.connect(self.told.append)

    def serve(self) -> None:
        for name, type in TYPES.items():
            self.servers[name] = BadServer(self.far, name, type, self.loop.call_later, self.plans)

    def start(self, name: str = "1/a", kind: str = "Speech", **parameters: Any) -> None:
        parameters = parameters or ({"message": "Hello"} if kind == "Speech" else {"pointx": 1.0})
        self.robot.start(StartAction(name, kind, parameters, 2.0))

    def run(self, until: float) -> None:
        self.loop.run_until(until)

    def of(self, kind: type) -> list[Any]:
        return [report for report in self.told if isinstance(report, kind)]

    def stop(self, seconds: float = 2.6) -> StopReport:
        before = len(self.of(StopReport))
        self.robot.stop_all()
        self.run(self.clock.now() + seconds)
        reports = self.of(StopReport)
        assert len(reports) == before + 1
        return reports[-1]  # type: ignore[no-any-return]


# --- who has ended it -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("plan", "status", "aborted", "word"),
    [
        (Plan(end=ABORTED), "failed", True, "aborted: "),
        (Plan(end=CANCELED), "canceled", False, "canceled: somebody else stopped it"),
        (Plan(accept=False), "failed", False, "rejected: "),
    ],
)
def test_what_the_robot_gave_up_is_told_from_what_it_refused(plan: Plan, status: str, aborted: bool, word: str) -> None:
    robot = Alone(plan)
    robot.start()
    robot.run(60)
    end = robot.of(ActionReport)[-1]
    assert (end.status, end.aborted, end.reason.startswith(word)) == (status, aborted, True), end


# --- stop-all -------------------------------------------------------------------------------------------------------


def test_a_stop_when_nothing_runs_is_confirmed_by_every_part() -> None:
    robot = Alone()
    assert robot.stop() == StopReport(confirmed=("pepper/look_at", "pepper/speech"))
    assert [server.cancels for server in robot.servers.values()] == [[bytes(16)], [bytes(16)]]


def test_a_stop_waits_until_what_runs_has_ended() -> None:
    robot = Alone(Plan(seconds=60, cancel_seconds=1.0))
    robot.start()
    robot.run(1)
    robot.robot.stop_all()
    robot.run(1.9)
    assert robot.of(StopReport) == []
    robot.run(2.1)
    assert robot.of(StopReport) == [StopReport(confirmed=("pepper/look_at", "pepper/speech"))]
    assert robot.of(ActionReport)[-1].status == "canceled"


def test_a_stop_reaches_what_others_asked_for() -> None:
    robot = Alone()
    server = robot.servers[SPEECH]
    server.foreign(OTHERS, LONG)
    robot.run(1)
    assert robot.stop() == StopReport(confirmed=("pepper/look_at", "pepper/speech"))
    assert server.running() == [] and server.goals[OTHERS].status == CANCELED


@pytest.mark.parametrize(
    ("cancel", "reason"),
    [("refuse", "it refused to stop"), ("silent", "asked, no answer"), ("ignore", "still running")],
)
def test_what_others_run_and_does_not_stop_is_not_confirmed(cancel: Any, reason: str) -> None:
    robot = Alone()
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=60, cancel=cancel))
    robot.run(1)
    assert robot.stop() == StopReport(confirmed=("pepper/look_at",), unconfirmed=(f"pepper/speech ({reason})",))


def test_what_a_person_has_released_and_still_runs_is_not_confirmed() -> None:
    """A release lets the study go on. What the server says of a goal is said of it all the same."""
    robot = Alone(Plan(seconds=30, cancel="reject"))
    robot.start()
    robot.run(1)
    robot.robot.cancel("1/a")
    robot.run(8)
    robot.robot.release_open_goals("pepper/speech")
    stopped = StopReport(confirmed=("pepper/look_at",), unconfirmed=("pepper/speech (it refused to stop)",))
    assert robot.stop() == stopped and robot.servers[SPEECH].running()
    robot.run(33)
    assert robot.of(StopReport)[-1].confirmed == ("pepper/look_at", "pepper/speech")


def test_what_ran_before_the_session_is_shown_and_nothing_goes_beside_it() -> None:
    """As after a crash whose session nobody continued, or one that another version continued."""
    robot = Alone()
    server = robot.servers[SPEECH]
    server.foreign(OTHERS, Plan(seconds=60))
    robot.run(1)
    robot.start()
    robot.run(7)
    state = robot.of(RobotChanged)[-1]
    (goal,) = state.open
    assert (state.status, goal.part, goal.type, goal.reason) == (
        *("degraded", "pepper/speech", "Speech"),
        "it was running when the robot was found",
    )
    end = robot.of(ActionReport)[-1]
    held = f"held: {SPEECH} may still be doing Speech (it was running when the robot was found) and gets nothing else"
    assert (end.status, end.reason) == ("failed", held) and server.at_once == 1
    robot.robot.cancel_open_goals("pepper/speech")
    robot.run(8)
    assert server.goals[OTHERS].status == CANCELED and robot.of(RobotChanged)[-1].status == "connected"
    robot.start("2/a")
    robot.run(9)
    assert server.at_once == 1 and robot.of(ActionReport)[-1].status == "succeeded"


def test_what_ran_before_the_session_is_over_with_its_result_if_its_status_is_missed() -> None:
    robot = Alone()
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=5))
    robot.run(1)
    robot.wire.drop("*/status")
    robot.run(6)
    assert robot.of(RobotChanged)[-1].open == () and robot.of(Note) == []


@pytest.mark.parametrize("status_after", [0.0, 1.0])
def test_what_others_have_begun_is_known_to_the_engine_that_continues(status_after: float) -> None:
    """The kernel names every open goal to the next engine, which makes ids of ours from the names."""
    robot = Alone()
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=30))
    robot.run(1)
    (goal,) = robot.of(RobotChanged)[-1].open
    robot.wire.delay("*/status", status_after, times=1)
    robot.recover(StartAction(goal.action, goal.type, {}, 0.0, goal=bytes(reversed(OTHERS)).hex(), accepted=True))
    for until in (1.5, 10):
        robot.run(until)
        assert [each.action for each in robot.of(RobotChanged)[-1].open] == [goal.action]
    robot.run(31)
    assert robot.of(RobotChanged)[-1].open == ()
    robot.start("1/a", "LookAt")
    robot.run(33)
    assert robot.of(ActionReport)[-1].status == "succeeded"


def test_what_waits_beside_what_an_engine_left_fails_with_a_reason_and_polls_no_more_often() -> None:
    robot = Alone()
    robot.run(1)
    robot.recover(StartAction("old", "LookAt", {}, 1.0))
    robot.run(2)
    robot.start()
    turns = 0
    while (due := robot.clock.next_at) is not None and due < 10.9:
        robot.clock.advance()
        turns += 1
    assert turns < 300, "it waits for 9 s, and the servers are polled 20 times a second"
    held = "/pepper/rise/look_at may still be doing LookAt (an engine that has gone may have begun it)"
    assert robot.of(ActionReport) == []
    robot.run(11.1)
    (end,) = robot.of(ActionReport)
    assert (end.status, end.reason) == ("failed", f"held: {held}, and nothing begins beside that")


def test_a_robot_that_acts_by_itself_goes_on_after_a_crash_before_a_goal_was_accepted() -> None:
    """rclpy answers "unknown" about a goal that was never sent, and about one that its goal callback still looks at."""
    robot = Alone()
    robot.run(1)
    robot.recover(StartAction("old", "LookAt", {}, 1.0), unattended="go on")
    robot.run(55)
    assert [goal.action for goal in robot.of(RobotChanged)[-1].open] == ["old"]
    robot.run(62)
    assert robot.of(RobotChanged)[-1].open == ()
    robot.start()
    robot.run(65)
    assert robot.of(ActionReport)[-1].status == "succeeded"


def test_a_robot_that_acts_by_itself_begins_nothing_beside_a_goal_that_its_server_may_know() -> None:
    plan = Plan(seconds=600, status=False)
    robot = Alone(plan)
    robot.run(1)
    old = StartAction("old", "Speech", {"message": "x"}, 1.0, goal=OTHERS.hex())
    robot.servers[SPEECH].foreign(OTHERS, plan)
    robot.recover(old, unattended="go on", leftovers="keep")
    robot.run(70)
    robot.start()
    robot.run(90)
    assert robot.servers[SPEECH].at_once == 1 and [goal.action for goal in robot.of(RobotChanged)[-1].open] == ["old"]


def test_a_robot_that_acts_by_itself_goes_on_after_a_crash_during_a_call_whose_program_is_away() -> None:
    which = profile()
    call = {"service": "pepper/say", "type": "std_srvs/srv/Trigger", "unstoppable": True}
    spec = msgspec.structs.replace(which.actions["Emotion"], carrier=call, supported=True)
    which = msgspec.structs.replace(which, actions={**which.actions, "Emotion": spec}, options={"unattended": "go on"})
    robot = Alone(which=which)
    robot.recover(StartAction("old", "Emotion", {"value": "x"}, 1.0, accepted=True), which=which)
    robot.run(55)
    assert [goal.action for goal in robot.of(RobotChanged)[-1].open] == ["old"]
    robot.run(65)
    robot.start()
    robot.run(70)
    assert robot.of(ActionReport)[-1].status == "succeeded"


@pytest.mark.parametrize("is_used_before", [True, False])
def test_what_others_begin_during_the_session_holds_nothing(is_used_before: bool) -> None:
    """A gaze controller may always be doing something; a session's own act takes its place."""
    robot = Alone()
    if is_used_before:
        robot.start("1/a", "LookAt")
    robot.run(6)
    robot.servers[GAZE].foreign(OTHERS, Plan(seconds=60))
    robot.run(7)
    assert robot.of(RobotChanged)[-1].status == "connected"


def test_what_ran_before_the_session_is_shown_although_its_status_arrives_late() -> None:
    robot = Alone()
    robot.wire.delay("*/status", 3.0)
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=60))
    robot.run(4)
    assert [goal.part for goal in robot.of(RobotChanged)[-1].open] == ["pepper/speech"]


@pytest.mark.parametrize(
    ("cancel", "confirmed", "unconfirmed"),
    [
        ("yes", ("pepper/look_at", "pepper/speech"), ()),
        ("refuse", ("pepper/speech",), ("pepper/look_at (it refused to stop)",)),
    ],
)
def test_what_others_begin_before_the_answer_at_a_part_that_had_confirmed(
    cancel: Any, confirmed: tuple[str, ...], unconfirmed: tuple[str, ...]
) -> None:
    robot = Alone(Plan(seconds=60, cancel_seconds=2.0))
    robot.start()
    robot.run(1)
    robot.robot.stop_all()
    robot.run(1.5)
    robot.servers[GAZE].foreign(OTHERS, Plan(seconds=60, cancel=cancel))
    robot.run(5)
    assert robot.of(StopReport)[0] == StopReport(confirmed=confirmed, unconfirmed=unconfirmed)
    assert len(robot.servers[GAZE].cancels) > 1  # it was asked again


def test_a_lost_stop_request_is_sent_again() -> None:
    robot = Alone()
    robot.start()
    robot.run(1)
    robot.wire.drop("*/cancel_goal", what="request", times=3)
    assert robot.stop() == StopReport(confirmed=("pepper/look_at", "pepper/speech"))


def test_parts_that_are_not_there_are_never_confirmed() -> None:
    robot = Alone(serving=False)
    assert robot.stop() == StopReport(unconfirmed=("pepper/look_at (never seen)", "pepper/speech (never seen)"))
    robot.serve()
    robot.run(10)
    robot.far.close()
    assert robot.stop() == StopReport(unconfirmed=("pepper/look_at (gone)", "pepper/speech (gone)"))


def test_two_servers_cannot_confirm() -> None:
    robot = Alone()
    twin = MemoryTransport(robot.wire, robot.loop, "/twin")
    BadServer(twin, SPEECH, TYPES[SPEECH], robot.loop.call_later)
    robot.run(1)
    reason = "2 servers, and only one can have answered"
    assert robot.stop().unconfirmed == (f"pepper/speech ({reason})",)


def test_what_goes_away_during_a_stop_is_asked_again_when_it_is_back() -> None:
    robot = Alone()
    robot.run(1)
    both = StopReport(confirmed=("pepper/look_at", "pepper/speech"))
    assert robot.stop() == both
    robot.wire.forget("/robot")
    robot.run(5)
    assert robot.of(StopReport) == [both], "what has confirmed and is gone does nothing"
    robot.wire.heal("/robot")
    robot.run(13)  # it had no goal yet, so its status says nothing
    assert [server.cancels for server in robot.servers.values()] == [[bytes(16)] * 2] * 2
    appeared = "(it has only just appeared)"
    back = StopReport(unconfirmed=(f"pepper/look_at {appeared}", f"pepper/speech {appeared}"))
    assert robot.of(StopReport) == [both, back, both]


@pytest.mark.parametrize("then", ["it is waited for", "everything is stopped again", "the connection is made anew"])
def test_what_goes_on_at_a_server_that_is_back_is_not_confirmed_before_its_status_arrives(then: str) -> None:
    """rclpy answers a refusal as if nothing ran."""
    robot = Alone()
    robot.start("0/a")  # what others begin later is not taken over
    robot.run(6)
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=60, cancel="refuse"))
    robot.run(7)
    robot.stop()
    anew = "anew" in then
    if anew:
        robot.near.break_down("the context was shut down")
    else:
        robot.wire.forget("/robot")
    robot.run(12)
    robot.wire.delay("*/status", 3.0)
    before = len(robot.of(StopReport))
    if anew:
        robot.robot.switch_transport(MemoryTransport(robot.wire, robot.loop, "/engine_again"))
    else:
        robot.wire.heal("/robot")
    robot.run(13)
    if "again" in then:
        robot.robot.stop_all()
    robot.run(20)
    since = robot.of(StopReport)[before:]
    assert since[-1].unconfirmed == ("pepper/speech (it refused to stop)",)
    assert not any("pepper/speech" in report.confirmed for report in since)


@pytest.mark.parametrize("is_restarted", [False, True])
def test_what_others_begin_out_of_sight_is_not_confirmed_before_its_status_arrives(is_restarted: bool) -> None:
    robot = Alone()
    robot.run(7)
    robot.stop()
    robot.wire.forget("/robot")
    robot.run(12)
    if is_restarted:
        robot.far.close()
        robot.far = MemoryTransport(robot.wire, robot.loop, "/robot")
        robot.wire.forget("/robot")
        robot.serve()
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=600, cancel="refuse"))
    robot.run(15)
    robot.wire.delay("*/status", 3.0)
    before = len(robot.of(StopReport))
    robot.wire.heal("/robot")
    robot.run(17)
    assert "pepper/speech (it has only just appeared)" in robot.of(StopReport)[-1].unconfirmed
    robot.run(30)
    assert robot.servers[SPEECH].running() == [OTHERS]
    assert not any("pepper/speech" in report.confirmed for report in robot.of(StopReport)[before:])


def test_what_has_no_status_and_comes_and_goes_confirms_again() -> None:
    robot = Alone()
    for server in robot.servers.values():
        server._status.close()
    for gone, back in ((5, 8), (8.3, 9)):
        robot.run(gone)
        robot.wire.forget("/robot")
        robot.run(back)
        robot.wire.heal("/robot")
    robot.run(20)
    assert robot.stop() == StopReport(confirmed=("pepper/look_at", "pepper/speech"))


@pytest.mark.parametrize("overlap", [True, False], ids=["the dead one is shown", "between two looks"])
def test_a_wrapper_that_refused_to_stop_and_was_started_again_confirms(overlap: bool) -> None:
    robot = Alone()
    robot.start("0/a")
    robot.run(6)
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=600, cancel="refuse"))
    robot.run(7)
    robot.stop()
    if overlap:
        robot.wire.kill("/robot")
        robot.run(12)
    else:
        robot.far.close()
    robot.far = MemoryTransport(robot.wire, robot.loop, "/again")
    robot.serve()
    robot.run(20)
    robot.wire.forget("/robot")
    robot.run(30)
    assert robot.of(StopReport)[-1].confirmed == ("pepper/look_at", "pepper/speech")


def test_what_is_back_and_runs_nothing_has_not_refused() -> None:
    robot = Alone()
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=60, cancel="refuse"))
    robot.run(1)
    robot.stop()
    robot.far.close()
    robot.run(5)
    robot.far = MemoryTransport(robot.wire, robot.loop, "/robot")
    robot.serve()
    before = len(robot.of(StopReport))
    robot.run(12)
    since = robot.of(StopReport)[before:]
    assert {why for report in since for why in report.unconfirmed if "speech" in why} == {
        "pepper/speech (it has only just appeared)"
    }
    assert since[-1].confirmed == ("pepper/look_at", "pepper/speech")


@pytest.mark.parametrize("was_known", [True, False])
def test_what_goes_on_is_not_confirmed_because_a_second_server_did_not_know_it(was_known: bool) -> None:
    """Somebody has started the wrapper twice, and ends the second one during the stop."""
    robot = Alone()
    if was_known:  # what others begin later is not taken over
        robot.start("0/a")
        robot.run(6)
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=600, cancel="refuse"))
    robot.run(7)
    twin = MemoryTransport(robot.wire, robot.loop, "/twin")
    BadServer(twin, SPEECH, TYPES[SPEECH], robot.loop.call_later)
    robot.run(8)
    robot.robot.stop_all()
    robot.run(15)
    twin.close()
    robot.run(35)
    assert robot.servers[SPEECH].running() == [OTHERS]
    assert not any("pepper/speech" in report.confirmed for report in robot.of(StopReport))
    assert robot.of(StopReport)[-1].unconfirmed == ("pepper/speech (it refused to stop)",)


@pytest.mark.parametrize(
    "who_leaves", ["the second one, during the stop", "the second one, before it", "the first one"]
)
def test_the_status_of_a_second_server_hides_nothing_that_goes_on_at_the_first(who_leaves: str) -> None:
    """A message does not say who sent it, and what a server has told last is latched."""
    robot = Alone()
    robot.start("0/a")  # what others begin later is not taken over
    robot.run(6)
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=600, cancel="refuse"))
    robot.run(7)
    twin = MemoryTransport(robot.wire, robot.loop, "/twin")
    for name, type in TYPES.items():
        BadServer(twin, name, type, robot.loop.call_later).foreign(bytes(range(3, 19)), Plan(seconds=0.2))
    robot.run(9)
    if "before" in who_leaves:
        twin.close()
        robot.run(13)
    robot.robot.stop_all()
    robot.run(17)
    (robot.far if "first" in who_leaves else twin).close()
    robot.run(40)
    if "first" in who_leaves:
        assert robot.of(StopReport)[-1].confirmed == ("pepper/look_at", "pepper/speech")
    else:
        assert robot.servers[SPEECH].running() == [OTHERS]
        assert not any("pepper/speech" in report.confirmed for report in robot.of(StopReport))
        assert robot.of(StopReport)[-1].unconfirmed[-1].startswith("pepper/speech (")


def test_a_refusal_confirms_nothing_where_the_status_is_not_heard() -> None:
    robot = Alone()
    robot.servers[SPEECH].foreign(OTHERS, Plan(seconds=8, cancel="reject", status=False))
    robot.run(1)
    refused = StopReport(confirmed=("pepper/look_at",), unconfirmed=("pepper/speech (it refused to stop)",))
    assert robot.stop() == refused
    robot.run(12)
    assert robot.of(StopReport)[-1].confirmed == ("pepper/look_at", "pepper/speech"), "it is asked until it has ended"


@pytest.mark.parametrize("how", ["its link is back", "the connection is made anew"])
def test_after_the_release_of_a_stop_what_is_back_is_not_stopped(how: str) -> None:
    robot = Alone()
    robot.run(1)
    robot.stop()
    robot.robot.end_stop()
    robot.servers[SPEECH].foreign(OTHERS, LONG)
    robot.run(10)
    if "link" in how:
        robot.wire.forget("/robot")
        robot.run(12)
        robot.wire.heal("/robot")
    else:
        robot.near.break_down("the context was shut down")
        robot.run(12)
        robot.robot.switch_transport(MemoryTransport(robot.wire, robot.loop, "/engine_again"))
    robot.run(20)
    assert robot.servers[SPEECH].running() == [OTHERS]


def test_an_answer_to_a_stop_that_comes_after_its_release_stops_nobody_elses_goal() -> None:
    robot = Alone()
    robot.run(1)
    late = robot.wire.hold("*speech*cancel_goal", what="reply")
    robot.robot.stop_all()
    robot.run(4)
    robot.start("1/a", "LookAt")  # it was released, and the study goes on
    robot.run(5)
    robot.servers[SPEECH].foreign(OTHERS, LONG)
    robot.run(6)
    late.release()
    robot.run(10)
    assert robot.servers[SPEECH].running() == [OTHERS]


def test_an_error_of_the_middleware_hinders_neither_a_stop_nor_what_comes_after_it() -> None:
    robot = Alone(LONG)
    robot.start()
    robot.run(1)

    def broken(service: str) -> list[RemoteEndpoint]:
        raise RuntimeError("as rclpy, between the look and the call")

    working, robot.near.server_endpoints = robot.near.server_endpoints, broken  # type: ignore[method-assign]
    robot.robot.stop_all()
    robot.run(4)
    robot.near.server_endpoints = working  # type: ignore[method-assign]
    robot.run(8)
    assert robot.servers[SPEECH].running() == []
    assert robot.of(StopReport)[-1].confirmed == ("pepper/look_at", "pepper/speech")
    robot.far.close()
    robot.run(9)
    assert robot.of(RobotChanged)[-1].status == "lost"


@pytest.mark.parametrize("leaves", [False, True], ids=["it stays", "it leaves before the next look"])
def test_an_open_goal_is_not_forgotten_because_a_twin_that_has_just_come_does_not_know_it(leaves: bool) -> None:
    robot = Alone(Plan(seconds=600, cancel="refuse"))
    robot.run(1)
    robot.start()
    robot.run(2)
    robot.robot.cancel("1/a")
    robot.run(12.01)
    twin = MemoryTransport(robot.wire, robot.loop, "/twin")
    BadServer(twin, SPEECH, TYPES[SPEECH], robot.loop.call_later)
    robot.robot.cancel_open_goals("")  # before the next look finds the twin
    robot.run(12.02)
    if leaves:
        twin.close()
    asked = len(robot.servers[SPEECH].cancels)
    robot.run(20)
    assert robot.of(RobotChanged)[-1].open and robot.servers[SPEECH].running()
    assert len(robot.servers[SPEECH].cancels) > asked, "it is asked again"


def test_what_runs_is_not_over_because_a_twin_that_has_just_come_does_not_know_it() -> None:
    robot = Alone(Plan(seconds=600, cancel="refuse"))
    robot.start()
    robot.run(4.01)
    twin = MemoryTransport(robot.wire, robot.loop, "/twin")
    BadServer(twin, SPEECH, TYPES[SPEECH], robot.loop.call_later)
    robot.robot.cancel("1/a")
    robot.run(4.1)  # so the twin is asked for the result, and answers before the next look finds it ...
    robot.wire.delay("*/get_result", 0.35, what="reply")
    robot.run(6)  # ... and its next answer is slower
    twin.close()
    robot.run(12)
    assert robot.of(RobotChanged)[-1].open and robot.servers[SPEECH].running()
    assert "pepper/speech" not in robot.stop(10).confirmed


def failing(times: int) -> Any:
    """A call of the middleware that fails so often; afterwards nothing is there."""
    left = [times]

    def fail(*arguments: object) -> int:
        left[0] -= 1
        if left[0] >= 0:
            raise RuntimeError("as rclpy, in a call that nothing guards")
        return 0

    return fail


def test_an_error_at_one_part_does_not_hide_that_another_has_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Alone(LONG, serving=False)
    robot.servers[SPEECH] = BadServer(robot.far, SPEECH, TYPES[SPEECH], robot.loop.call_later, [LONG])
    gaze = MemoryTransport(robot.wire, robot.loop, "/gaze")
    robot.servers[GAZE] = BadServer(gaze, GAZE, TYPES[GAZE], robot.loop.call_later, [LONG])
    robot.run(1)
    robot.start()
    robot.run(2)
    robot.far.close()
    monkeypatch.setattr(robot.robot._endpoint_of["LookAt"].client, "count_servers", failing(1))  # type: ignore[union-attr]
    robot.run(30)
    assert [report.status for report in robot.of(ActionReport)] == ["accepted", "lost"]


def test_an_error_that_lasts_neither_spins_nor_prolongs_what_another_part_does(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    eyes = Eyes(rate=5.0, reset={"data": "neutral"})
    eyes.run(1)
    eyes.show("1/a", "drive", 2)
    eyes.run(1.5)
    calls: list[float] = []

    def fail() -> int:
        calls.append(eyes.clock.now())
        raise RuntimeError("as rclpy, in a call that nothing guards")

    monkeypatch.setattr(eyes.robot._endpoint_of["LookAt"].client, "count_servers", fail)  # type: ignore[union-attr]
    eyes.run(6)
    assert eyes.statuses("1/a") == ["accepted", "succeeded"] and eyes.seen[-1][1] == "neutral"
    assert eyes.seen[-1][0] < 3.3 and len(calls) < 40
    assert len(caplog.records) == 1, "it is logged once"


def test_two_errors_that_last_are_logged_once_each(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    robot = Alone()
    robot.run(7)
    for kind in ("Speech", "LookAt"):

        def fail(kind: str = kind) -> int:
            raise RuntimeError(kind)

        monkeypatch.setattr(robot.robot._endpoint_of[kind].client, "count_servers", fail)  # type: ignore[union-attr]
    robot.run(67)
    assert len(caplog.records) == 2


@pytest.mark.parametrize("then", ["stop", "close"])
def test_an_error_at_one_part_does_not_keep_another_from_being_asked_to_stop(
    then: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = Alone(LONG)
    robot.run(1)
    robot.start("1/a", "LookAt")
    robot.start("1/b")
    robot.run(2)
    monkeypatch.setattr(robot.robot._endpoint_of["LookAt"].client, "cancel", failing(9))  # type: ignore[union-attr]
    if then == "close":
        robot.robot.close()
        robot.run(3)
    else:
        report = robot.stop()
        assert report.confirmed == ("pepper/speech",)
    assert robot.servers[SPEECH].running() == []


def test_asked_twice_it_asks_twice_and_answers_once() -> None:
    robot = Alone(Plan(seconds=60, cancel_seconds=1.0))
    robot.start()
    robot.run(1)
    robot.robot.stop_all()
    robot.run(1.5)
    robot.robot.stop_all()
    robot.run(10)
    assert len(robot.of(StopReport)) == 1
    assert robot.servers[SPEECH].cancels.count(bytes(16)) == 2


def test_a_goal_that_is_stopped_before_it_was_accepted() -> None:
    robot = Alone(Plan(accept_after=0.5, seconds=60, status=False))
    robot.start()
    assert robot.stop() == StopReport(confirmed=("pepper/look_at", "pepper/speech"))
    assert robot.servers[SPEECH].running() == []
    assert [report.status for report in robot.of(ActionReport)] == ["accepted", "canceled"]


def test_who_else_may_send_goals_is_noted_once() -> None:
    robot = Alone()
    for node in ("/teleop", "/lab/rise_doctor", "/engine"):
        there = MemoryTransport(robot.wire, robot.loop, node)
        for name, type in TYPES.items():
            ActionClient(there, name, type)
    robot.run(5)
    (note,) = robot.of(Note)
    assert note.text.startswith("the node /teleop may send goals to /pepper/rise/")
    assert robot.of(RobotChanged)[-1].status == "connected"


# --- topics ---------------------------------------------------------------------------------------------------------

EYES = {"topic": "pepper/eyes", "type": "std_msgs/msg/String"}


def with_eyes(**more: Any) -> RobotProfile:
    base = profile()
    carrier = {**EYES, "message": {"data": "{value}"}, **more}
    spec = msgspec.structs.replace(base.actions["Emotion"], carrier=carrier, supported=True)
    return msgspec.structs.replace(base, actions={**base.actions, "Emotion": spec})


class Eyes(Alone):
    def __init__(self, listening: bool = True, **more: Any) -> None:
        super().__init__(which=with_eyes(**more))
        self.seen: list[tuple[float, str]] = []
        if listening:
            self.listen()

    def listen(self) -> None:
        self.far.subscribe(
            "/pepper/eyes", EYES["type"], lambda m: self.seen.append((round(self.clock.now(), 2), m["data"]))
        )

    def show(self, name: str, value: str, seconds: float = 1.0) -> None:
        self.robot.start(StartAction(name, "Emotion", {"value": value}, seconds))

    def statuses(self, name: str) -> list[str]:
        return [report.status for report in self.of(ActionReport) if report.action == name]


def test_a_topic_takes_its_expected_time_and_is_reset() -> None:
    eyes = Eyes(reset={"data": "neutral"})
    eyes.show("1/a", "happy")
    eyes.run(5)
    assert eyes.seen == [(0.0, "happy"), (1.0, "neutral")]
    assert eyes.statuses("1/a") == ["accepted", "succeeded"]


def test_a_topic_is_cancelled_and_reset() -> None:
    eyes = Eyes(reset={"data": "neutral"})
    eyes.show("1/a", "happy", 60)
    eyes.run(2)
    eyes.robot.cancel("1/a")
    eyes.robot.cancel("1/a")
    eyes.run(5)
    assert eyes.seen == [(0.0, "happy"), (2.0, "neutral")]
    assert eyes.statuses("1/a") == ["accepted", "canceled"]


def test_a_later_one_on_the_same_topic_is_not_taken_back_by_the_earlier() -> None:
    eyes = Eyes(reset={"data": "neutral"})
    eyes.show("1/a", "happy", 2)
    eyes.run(1)
    eyes.show("2/a", "sad", 2)
    eyes.run(10)
    assert eyes.seen == [(0.0, "happy"), (1.0, "sad"), (3.0, "neutral")]
    assert eyes.statuses("1/a") == eyes.statuses("2/a") == ["accepted", "succeeded"]


def test_a_topic_waits_for_somebody_who_listens() -> None:
    eyes = Eyes(listening=False)
    eyes.show("1/a", "happy")
    eyes.run(2)
    eyes.listen()
    eyes.run(5)
    assert eyes.seen == [(2.0, "happy")] or eyes.seen == [(2.05, "happy")]
    assert eyes.statuses("1/a") == ["accepted", "succeeded"]


def test_nobody_listens() -> None:
    eyes = Eyes(listening=False)
    eyes.run(6)
    assert eyes.of(RobotChanged)[-1] == RobotChanged(status="degraded", detail="nothing listens to /pepper/eyes")
    eyes.show("1/a", "happy")
    eyes.run(12)
    assert eyes.statuses("1/a") == ["failed"]
    assert eyes.of(ActionReport)[-1].reason.startswith("server-missing: nothing listens to /pepper/eyes")


def test_whoever_listens_goes_away() -> None:
    eyes = Eyes()
    eyes.show("1/a", "happy", 60)
    eyes.run(1)
    eyes.far.close()
    eyes.run(2)
    assert eyes.statuses("1/a") == ["accepted", "lost"]


def test_a_stop_resets_topics_and_says_that_they_give_no_answer() -> None:
    eyes = Eyes(reset={"data": "neutral"})
    eyes.run(1)
    told = "pepper/eyes (told to stop; a topic gives no answer)"
    assert eyes.stop().unconfirmed == (told,)
    assert [what for _, what in eyes.seen] == ["neutral"]
    eyes.show("1/a", "happy", 60)
    eyes.run(5)
    assert eyes.stop().unconfirmed == (told,)
    assert [what for _, what in eyes.seen] == ["neutral", "happy", "neutral"]
    assert eyes.statuses("1/a") == ["accepted", "canceled"]


def test_a_server_that_has_only_just_appeared_has_not_confirmed_a_stop() -> None:
    """It answers at once, and what it is doing, its status topic tells a moment later."""
    robot = Alone(serving=False)
    robot.run(6)
    robot.robot.stop_all()
    robot.run(9)
    robot.serve()
    robot.run(9.45)
    just = "pepper/speech (it has only just appeared)"
    assert just in robot.of(StopReport)[-1].unconfirmed and robot.of(StopReport)[-1].confirmed == ()
    robot.run(13)
    assert robot.of(StopReport)[-1].confirmed == ("pepper/look_at", "pepper/speech")


def test_who_has_released_a_topic_is_noted() -> None:
    eyes = Eyes(reset={"data": "neutral"})
    eyes.run(1)
    eyes.show("1/a", "happy", 2)
    eyes.run(2)
    eyes.wire.forget("/robot")
    eyes.run(5)
    eyes.robot.release_open_goals("")
    why = "it may not have heard that it should stop"
    assert [note.text for note in eyes.of(Note)] == [f"released: somebody has released /pepper/eyes; {why}"]


@pytest.mark.parametrize("noticed", [1.5, 8.0], ids=["while it shows", "after its end"])
def test_who_was_cut_off_is_told_to_stop_when_it_is_back(noticed: float) -> None:
    """The middleware sees late that nobody listens: the reset was sent, and nobody heard it."""
    eyes = Eyes(reset={"data": "neutral"})
    eyes.show("1/a", "happy", 2)
    eyes.run(1)
    eyes.wire.kill("/robot")
    eyes.run(noticed)
    eyes.wire.forget("/robot")
    eyes.run(10)
    (goal,) = eyes.of(RobotChanged)[-1].open
    assert (goal.part, goal.reason) == ("pepper/eyes", "it may not have heard that it should stop")
    assert eyes.of(RobotChanged)[1].open or noticed > 2, "what ran is open with the loss"
    eyes.wire.heal("/robot")
    eyes.run(12)
    assert [what for _, what in eyes.seen[:2]] == ["happy", "neutral"] and {what for _, what in eyes.seen[1:]} == {
        "neutral"
    }
    assert eyes.of(RobotChanged)[-1].open == ()


def test_what_listens_again_is_told_of_the_stop() -> None:
    eyes = Eyes(reset={"data": "neutral"})
    eyes.run(1)
    eyes.wire.forget("/robot")
    eyes.run(2)
    eyes.robot.stop_all()
    eyes.run(5)
    assert "pepper/eyes (gone)" in eyes.of(StopReport)[-1].unconfirmed and eyes.seen == []
    eyes.wire.heal("/robot")
    eyes.run(13)
    assert {what for _, what in eyes.seen} == {"neutral"}
    assert eyes.of(StopReport)[-1].unconfirmed == ("pepper/eyes (told to stop; a topic gives no answer)",)


def test_what_an_earlier_engine_has_published_is_taken_back_when_something_listens() -> None:
    eyes = Eyes(listening=False, reset={"data": "neutral"})
    eyes.run(6)
    which = with_eyes(reset={"data": "neutral"})
    robot = Ros2Robot(which, eyes.clock, eyes.near, read_mappings(which, eyes.near.fields))
    robot.adopt([StartAction("1/a", "Emotion", {"value": "happy"}, 1.0, accepted=True)])
    robot.connect(eyes.told.append)
    eyes.run(7)
    robot.cancel_open_goals("")
    eyes.run(12)
    assert [goal.part for goal in eyes.of(RobotChanged)[-1].open] == ["pepper/eyes"]
    eyes.listen()
    eyes.run(15)
    assert {what for _, what in eyes.seen} == {"neutral"} and eyes.of(RobotChanged)[-1].open == ()


# --- how the robot stands -------------------------------------------------------------------------------------------


def test_it_is_connected_when_all_are_there_and_says_how() -> None:
    robot = Alone()
    assert robot.told == [RobotChanged(status="connected", detail="Pepper on ROS 2 (in memory, node /engine)")]
    robot.run(60)
    assert len(robot.told) == 1


def test_it_waits_for_discovery() -> None:
    robot = Alone(serving=False)
    robot.run(3)
    assert robot.told == []
    robot.serve()
    robot.run(3.5)
    assert [report.status for report in robot.of(RobotChanged)] == ["connected"]


def test_a_silent_server_that_speaks_again() -> None:
    robot = Alone(Plan(accept=None, runs=False, status=False, cancel="silent"), Plan())
    robot.start()
    robot.run(4)
    assert [report.status for report in robot.of(RobotChanged)] == ["connected", "degraded"]
    robot.start("2/a")
    robot.run(9.5)
    assert robot.of(ActionReport)[-1].reason.startswith("held: ")
    robot.robot.release_open_goals("pepper/speech")
    robot.start("3/a")
    robot.run(12)
    assert robot.of(ActionReport)[-1] == ActionReport(action="3/a", status="succeeded")
    assert robot.of(RobotChanged)[-1].status == "connected"


def test_nothing_carries_it() -> None:
    robot = Alone()
    robot.start(kind="Emotion", value="happy")
    assert robot.of(ActionReport)[0].reason == "not-sent: nothing carries Emotion to Pepper"


def test_a_value_that_does_not_fit() -> None:
    robot = Alone()
    robot.start(kind="LookAt", duration=1e300)
    reports = robot.of(ActionReport)
    assert [report.status for report in reports] == ["failed"] and reports[0].reason.startswith("not-sent: ")


def test_two_actions_with_one_server_share_it() -> None:
    base = profile()
    carrier = {**base.actions["Speech"].carrier, "goal": {"message": "{value}"}}
    spec = msgspec.structs.replace(base.actions["SocialExpression"], carrier=carrier, supported=True)
    which = msgspec.structs.replace(base, actions={**base.actions, "SocialExpression": spec})
    robot = Alone(which=which)
    robot.start("1/a")
    robot.start("1/b", "SocialExpression", value="grin")
    robot.run(3)
    assert len(robot.servers[SPEECH].executed) == 2 and robot.stop().confirmed == ("pepper/look_at", "pepper/speech")
    assert [report.status for report in robot.of(ActionReport)].count("succeeded") == 2


@pytest.mark.parametrize("reset", [{"reset": {"data": "other"}}, {"unstoppable": True}])
def test_two_actions_on_one_topic_have_one_reset_however_its_name_is_written(reset: dict[str, Any]) -> None:
    """The reset of one would not take back what the other has published."""
    which = with_eyes(reset={"data": "neutral"})
    carrier = {**EYES, "message": {"data": "{value}"}, **reset, "topic": "/pepper/eyes"}
    mood = msgspec.structs.replace(which.actions["Emotion"], carrier=carrier)
    which = msgspec.structs.replace(which, actions={**which.actions, "Mood": mood})
    with pytest.raises(PortError, match="the resets of Emotion and Mood, which both go to /pepper/eyes, differ"):
        Alone(which=which)


def test_labels_are_short_and_never_the_same() -> None:
    assert short_labels("nao", ["/nao/rise/speech", "/nao/rise/look_at"]) == {
        "/nao/rise/speech": "nao/speech",
        "/nao/rise/look_at": "nao/look_at",
    }
    assert short_labels("nao", ["/a/say", "/b/say"]) == {"/a/say": "nao/a/say", "/b/say": "nao/b/say"}
    assert short_labels("nao", ["/say", "/b/say"]) == {"/say": "nao/say", "/b/say": "nao/b/say"}


def test_what_is_remembered_has_bounds() -> None:
    robot = Alone(Plan(seconds=0.01, status=False))
    for number in range(1200):
        robot.start(f"{number}/a")
        robot.run(robot.clock.now() + 0.05)
    assert len(robot.robot._goals) <= 201 and len(robot.robot._by_id) <= 201
    assert sum(report.status == "succeeded" for report in robot.of(ActionReport)) == 1200


def test_what_cannot_be_stopped_is_remembered_within_bounds() -> None:
    eyes = Eyes()
    for number in range(300):
        eyes.show(f"{number}/a", "happy", 0.1)
        eyes.run(eyes.clock.now() + 0.5)
    assert len(eyes.robot._goals) <= 201 and [goal.action for goal in eyes.of(RobotChanged)[-1].open] == ["299/a"]


# --- a session that stands still ------------------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["its process stands still", "the computer sleeps"])
@pytest.mark.parametrize("kind", ["Speech", "Emotion"])
def test_what_waited_does_not_begin_after_a_standstill(kind: str, how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Eyes(listening=False)
    robot.far.close()
    robot.run(6)
    robot.start("1/a", kind, **{"message": "Hello"} if kind == "Speech" else {"value": "happy"})
    robot.run(7)
    robot.far = MemoryTransport(robot.wire, robot.loop, "/robot")
    robot.serve()
    robot.listen()
    if "sleeps" in how:
        slept = suspended_seconds() + 60
        monkeypatch.setattr("rise_adapters.ros2.robot.waiting.suspended_seconds", lambda: slept)
        robot.run(8)
    else:
        robot.loop.stand_still(60)
    (end,) = robot.of(ActionReport)
    assert (end.status, end.reason.split(":")[0]) == ("failed", "standstill")
    assert robot.servers[SPEECH].received == [] and robot.seen == []


# --- closing --------------------------------------------------------------------------------------------------------


def test_closing_cancels_what_runs_and_says_nothing_more() -> None:
    robot = Alone(LONG)
    robot.start("1/a")
    robot.run(1)
    robot.start("1/b")
    before = len(robot.told)
    robot.robot.close()
    robot.robot.close()
    robot.run(5)
    assert len(robot.told) == before
    assert len(robot.servers[SPEECH].running()) <= 1, "one that was not accepted yet cannot be waited for"
    assert robot.clock.next_at is None or robot.clock.next_at > 50, "no timer of its own is left"


def test_closing_after_the_transport() -> None:
    robot = Alone(LONG)
    robot.start("1/a")
    robot.run(1)
    robot.near.close()
    robot.robot.close()
    robot.run(5)


def test_closing_during_a_stop() -> None:
    robot = Alone(LONG)
    robot.start("1/a")
    robot.run(1)
    robot.robot.stop_all()
    robot.robot.close()
    robot.run(5)
    assert robot.servers[SPEECH].running() == [] and robot.of(StopReport) == []


# --- any order of anything ------------------------------------------------------------------------------------------

plans = st.builds(
    Plan,
    accept=st.sampled_from([True, True, True, False, None]),
    accept_after=st.sampled_from([0.0, 0.0, 0.5, 2.5]),
    runs=st.booleans(),
    seconds=st.sampled_from([0.01, 0.5, 3.0, 30.0]),
    end=st.sampled_from([SUCCEEDED, SUCCEEDED, ABORTED, CANCELED, 0, None]),
    answers=st.sampled_from([True, True, False]),
    cancel=st.sampled_from(["yes", "refuse", "reject", "silent", "ignore"]),
    status=st.booleans(),
    feedback_every=st.sampled_from([0.0, 0.3]),
)
moves = st.tuples(
    st.sampled_from([0.0, 0.0, 0.1, 0.6, 2.1, 6.0]),
    st.sampled_from(
        [
            *(
                "start",
                "start",
                "start",
                "cancel",
                "cancel",
                "stop",
                "kill",
                "forget",
                "heal",
                "leave",
                "appear",
                "twin",
            ),
            *("drop request", "drop reply", "double", "late", "hold", "release", "break", "mend"),
        ]
    ),
)


class Chaos(Alone):
    def __init__(self, *which: Plan, **deadlines: float) -> None:
        super().__init__(*which, **deadlines)
        self.started: list[str] = []
        self.held: list[Any] = []

    def do(self, move: str) -> None:
        wire = self.wire
        actions: dict[str, Callable[[], object]] = {
            "start": self.begin,
            "cancel": lambda: self.started and self.robot.cancel(self.started[-1]),
            "stop": self.robot.stop_all,
            "kill": lambda: wire.kill("/robot"),
            "forget": lambda: wire.forget("/robot"),
            "heal": lambda: wire.heal("/robot"),
            "leave": self.far.close,
            "appear": self.appear,
            "twin": lambda: BadServer(
                MemoryTransport(wire, self.loop, "/twin"), SPEECH, TYPES[SPEECH], self.loop.call_later, self.plans
            ),
            "drop request": lambda: wire.drop("*", what="request", times=1),
            "drop reply": lambda: wire.drop("*", what="reply", times=1),
            "double": lambda: wire.duplicate("*", what="reply", times=2),
            "late": lambda: wire.delay("*", 3.0, what="reply", times=2),
            "hold": lambda: self.held.append(wire.hold("*", times=3)),
            "release": lambda: self.held and self.held.pop().release(),
            "break": self.near.break_down,
            "mend": lambda: self.near.break_down(""),
        }
        actions[move]()

    def begin(self) -> None:
        name = f"{len(self.started) + 1}/a"
        self.started.append(name)
        self.start(name, "LookAt" if len(self.started) % 4 == 0 else "Speech")

    def appear(self) -> None:
        self.far.close()
        self.far = MemoryTransport(self.wire, self.loop, "/robot")
        self.serve()


@settings(max_examples=examples(150))
@given(st.lists(plans, min_size=1, max_size=4), st.lists(moves, max_size=25), st.sampled_from([0.0, 1.0]))
def test_whatever_happens_every_goal_has_exactly_one_ending(
    which: list[Plan], happenings: list[tuple[float, str]], result: float
) -> None:
    robot = Chaos(*which, result=1.0, feedback=result)
    for wait, move in happenings:
        robot.run(robot.clock.now() + wait)
        robot.do(move)
    robot.run(robot.clock.now() + 15)
    reports = robot.of(ActionReport)
    for name in robot.started:
        own = [report.status for report in reports if report.action == name]
        assert own[:-1] in ([], ["accepted"]), own
        assert own and own[-1] != "accepted", f"{name} has not ended"
    assert len(robot.of(Note)) <= 6 * len(robot.started), "what repeats itself is said once"
    stops = sum(move == "stop" for _, move in happenings)
    assert bool(robot.of(StopReport)) == bool(stops)
    before = len(robot.told)
    robot.robot.close()
    robot.run(robot.clock.now() + 10)
    assert len(robot.told) == before
