"""Whatever becomes of the robot's wrapper (killed, ended, started again while the old one still shows, several times),
stopping everything is right again as soon as one wrapper is there: whole sessions on a wire in memory, in virtual time.
"""

from __future__ import annotations

from typing import TypeAlias

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rise_adapters.ros2.actions.client import CANCELED, CANCELING, EXECUTING
from rise_adapters.ros2.robot.endings import RETRY_SECONDS

from tests.ros.badrobot import BadServer, Plan
from tests.ros.bench import SPEECH, Bench
from tests.ros.memory import MemoryTransport

LONG = Plan(seconds=600)
BOTH = ("pepper/look_at", "pepper/speech")
LEASE = 12.0
"""Seconds after which everything about a killed wrapper is settled: its lease, and some."""
SOON = 0.5
"""Seconds that a stop takes at most in which nothing stands in the way (it gives up after 2.5)."""


class Lab(Bench):
    """A robot whose wrapper is killed and started again."""

    def __init__(self, stopping: float = 0.05) -> None:
        """`stopping`: seconds that it takes the robot to stop."""
        plan = Plan(seconds=600, cancel_seconds=stopping)
        super().__init__([plan], [plan], robot=False)
        self.wire.first_answer_only = True
        self.alive: list[MemoryTransport] = []
        self.dead: list[MemoryTransport] = []
        """Killed, and still seen by the others."""
        self.started = 0
        self.made: list[BadServer] = []
        self.start()

    def start(self) -> None:
        self.started += 1
        self.alive.append(self.robot_appears(node=f"/robot_{self.started}"))
        self.made += self.servers.values()

    def kill(self) -> None:
        if self.alive:
            self.dead.append(node := self.alive.pop(0))
            self.wire.kill(node.node)

    def expire(self) -> None:
        if self.dead:
            self.wire.forget(self.dead.pop(0).node)

    def end(self) -> None:
        if self.alive:
            self.alive.pop(0).close()

    def foreign(self) -> None:
        """Somebody else's goal."""
        if self.alive:
            self.speech.foreign(bytes([*range(15), self.started]), LONG)

    def pass_time(self, seconds: float) -> None:
        self.run(self.clock.now() + seconds)

    def stopped(self) -> tuple[float, tuple[str, ...], tuple[str, ...]]:
        """Stop everything: how long that took, who confirmed, and who did not."""
        before = len(self.stops())
        self.stop_all()
        seconds = self.run_until(lambda: len(self.stops()) > before)
        stop = self.stops()[-1]
        self.submit("releaseStop")
        return seconds, stop.confirmed, stop.unconfirmed

    def running(self, part: str) -> list[bytes]:
        """What goes on at the one wrapper that is there."""
        there = self.alive[0]
        return [id for server in self.made if server._transport is there and part in server.name
                for id in server.running()]  # fmt: skip

    def settle(self) -> None:
        """The leases of the dead run out, and one wrapper is there."""
        while self.dead:
            self.expire()
            self.pass_time(0.3)
        while len(self.alive) > 1:
            self.end()
        if not self.alive:
            self.start()
        self.pass_time(LEASE)


def test_after_a_kill_and_a_restart_within_the_lease_stopping_is_right_again() -> None:
    """E3: the new wrapper answers `unknown` while the old one still shows, and nobody is asked again when it goes."""
    lab = Lab()
    lab.pass_time(1)
    lab.act()
    lab.pass_time(1)
    lab.kill()
    lab.start()
    lab.pass_time(3)
    assert lab.ending("2/1").startswith("lost: server-restarted")
    assert lab.stopped()[2] == tuple(f"{part} (2 servers, and only one can have answered)" for part in BOTH)
    lab.expire()
    lab.pass_time(1)
    for _ in range(3):
        seconds, confirmed, unconfirmed = lab.stopped()
        assert (confirmed, unconfirmed) == (BOTH, ()) and seconds < SOON
        lab.pass_time(1)
    lab.check()


def test_what_a_dead_wrapper_said_last_about_goals_of_others_does_not_count_for_ever() -> None:
    lab = Lab()
    lab.pass_time(1)
    lab.foreign()
    lab.pass_time(0.1)
    lab.kill()
    lab.start()
    lab.pass_time(1)
    lab.expire()
    lab.pass_time(1)
    seconds, confirmed, unconfirmed = lab.stopped()
    assert (confirmed, unconfirmed) == (BOTH, ()) and seconds < SOON
    lab.check()


def test_a_goal_that_said_it_stops_when_its_wrapper_was_killed() -> None:
    lab = Lab()
    lab.plans[SPEECH][0] = Plan(seconds=600, cancel="ignore")  # type: ignore[index]
    lab.end()
    lab.start()
    lab.pass_time(2)
    lab.act()
    lab.pass_time(1)
    lab.stop_act()
    lab.pass_time(5)
    assert lab.ending("2/1").startswith("lost: cancel-unconfirmed")
    lab.kill()
    lab.plans[SPEECH][0] = LONG  # type: ignore[index]
    lab.start()
    lab.pass_time(1)
    lab.expire()
    lab.pass_time(1)
    seconds, confirmed, unconfirmed = lab.stopped()
    assert (confirmed, unconfirmed) == (BOTH, ()) and seconds < SOON


def test_a_goal_that_goes_on_at_the_first_of_two_servers_is_not_forgotten_because_the_other_does_not_know_it() -> None:
    lab = Lab(1.0)
    lab.pass_time(1)
    lab.act()
    lab.pass_time(1)
    lab.wire.delay("*/cancel_goal", 0.1, what="request", times=1)  # the second one is the first to answer
    lab.start()
    lab.pass_time(0.4)
    assert lab.ending("2/1").startswith("lost: server-restarted")
    lab.alive.pop().close()
    lab.pass_time(0.3)
    _, confirmed, unconfirmed = lab.stopped()
    assert (confirmed, unconfirmed) == (BOTH, ()) and not lab.running("speech")


Step: TypeAlias = "tuple[str, float]"
STEPS = st.lists(
    st.tuples(
        st.sampled_from(
            ["act", "both", "stop_act", "kill", "start", "start", "end", "expire", "stop", "foreign", "wait"]
        ),
        st.sampled_from([0.0, 0.0, 0.01, 0.2, 0.6, 1.1, 3.0]),
    ),
    max_size=25,
)


@pytest.mark.slow
@given(STEPS, st.sampled_from([0.05, 1.0]))
def test_whatever_happens_to_the_wrapper_stopping_is_right_in_the_end(steps: list[Step], stopping: float) -> None:
    lab = Lab(stopping)
    for step, seconds in steps:
        match step:
            case "act":
                lab.act("Greet")
            case "both":
                lab.act("Both")
            case "stop_act":
                lab.stop_act("Greet")
            case "kill":
                lab.kill()
            case "start":
                lab.start()
            case "end":
                lab.end()
            case "expire":
                lab.expire()
            case "stop":
                lab.stop_all()
            case "foreign":
                lab.foreign()
        lab.pass_time(seconds)
    lab.settle()
    _, confirmed, unconfirmed = lab.stopped()  # whatever still runs is stopped by this one
    assert (confirmed, unconfirmed) == (BOTH, ())
    assert not lab.running("speech") and not lab.running("look_at"), "what is called stopped is"
    lab.pass_time(5)
    seconds, confirmed, unconfirmed = lab.stopped()
    assert (confirmed, unconfirmed) == (BOTH, ()), "nothing runs, and everybody says so"
    assert seconds < SOON
    assert not [note for note in lab.notes() if note.startswith("cancel-refused")], "nobody refused anything"
    lab.pass_time(30)
    lab.check()


# --- the record of a stop -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("answer", ["refused", "over"])
def test_a_goal_that_cancel_everything_stops_is_not_called_refused(answer: str) -> None:
    """E4: rclpy, asked about one goal while it is cancelling everything, answers that it cancels nothing."""
    bench = Bench([Plan(seconds=60, cancel_seconds=0.02)])
    bench.run(1)
    bench.act()
    bench.run(2)
    speech = bench.speech
    service = speech._services[1]
    plain = service.on_request

    def racing(request, reply):  # type: ignore[no-untyped-def]
        if any(bytes(request["goal_info"]["goal_id"]["uuid"])):
            reply({"return_code": 0 if answer == "refused" else 3, "goals_canceling": []})
        else:
            plain(request, reply)

    service.on_request = racing  # type: ignore[misc]
    bench.stop_all()
    bench.run(2 + RETRY_SECONDS * 3)
    assert bench.stops()[-1].confirmed == BOTH
    assert bench.ending("2/1") == "canceled"
    assert bench.notes() == []
    bench.check()


def test_one_that_goes_on_is_called_refused() -> None:
    bench = Bench([Plan(seconds=60, cancel="refuse")])
    bench.run(1)
    bench.act()
    bench.run(2)
    bench.stop_all()
    bench.run(20)
    assert bench.stops()[-1].unconfirmed == ("pepper/speech (it refused to stop)",)
    assert bench.notes()[0] == f"cancel-refused: {SPEECH} does not stop 2/1; it goes on"
    assert bench.ending("2/1").startswith("failed: cancel-refused")
    bench.check()


def test_the_status_topic_says_that_it_stops_although_the_answer_did_not() -> None:
    """It is being cancelled: that is no refusal, and what follows is its end."""
    bench = Bench([Plan(seconds=60, cancel="refuse")])
    bench.run(1)
    bench.act()
    bench.run(2)
    goal = bench.speech.goals[bench.speech.received[0]]
    bench.stop_act()
    goal.status = CANCELING
    bench.speech._tell()
    bench.run(4)
    bench.speech._end(goal, CANCELED)
    bench.run(5)
    assert bench.ending("2/1") == "canceled" and bench.notes() == []
    bench.check()


# --- results that nobody keeps --------------------------------------------------------------------------------------


@pytest.mark.parametrize("status_first", [True, False])
@pytest.mark.parametrize(
    ("end", "ending"),
    [
        (4, f"succeeded: result-not-kept: it says that it succeeded, and {SPEECH} did not keep its result"),
        (6, f"failed: aborted: the reason is unknown; {SPEECH} did not keep its result"),
        (5, f"canceled: canceled: somebody else stopped it; {SPEECH} did not keep its result"),
    ],
)
def test_a_goal_that_is_over_at_once_at_a_server_that_keeps_no_results(
    end: int, ending: str, status_first: bool
) -> None:
    """E8: `result_timeout=0`. The result is gone before it can be asked for; the status topic has said how it ended."""
    bench = Bench([Plan(seconds=0.001, end=end)])
    if not status_first:
        bench.wire.delay("*speech/_action/status", 0.1, what="message")
    bench.run(1)

    def forgotten(request, reply):  # type: ignore[no-untyped-def]
        reply({"status": 0})

    bench.speech._services[2].on_request = forgotten  # type: ignore[misc]
    bench.act()
    bench.run(3)
    assert bench.ending("2/1").startswith(ending)
    assert "result_timeout" in bench.ending("2/1")
    bench.check()


def test_a_server_that_runs_it_and_says_that_it_does_not_know_it() -> None:
    """No end is known: never a success."""
    bench = Bench([Plan(seconds=60)])
    bench.run(1)
    bench.speech._services[2].on_request = lambda request, reply: reply({"status": 0})  # type: ignore[misc]
    bench.act()
    bench.run(3)
    assert bench.speech.goals[bench.speech.received[0]].status == EXECUTING or bench.speech.cancels
    assert bench.ending("2/1").startswith("lost: server-restarted")
    bench.check()
