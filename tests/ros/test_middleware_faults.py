"""What can go wrong with two servers, many goals and the middleware: A23-A28 of the table in `test_faults.py`."""

from __future__ import annotations

import pytest
from rise_adapters.ros2.compatibility import describe_several_servers
from rise_adapters.ros2.transport.port import PortError

from rise_engine.kernel.records import RobotRecord
from tests.ros.badrobot import Plan
from tests.ros.bench import GAZE, LONG, SPEECH, TASK, Bench
from tests.ros.memory import MemoryTransport

# --- two servers, many goals, flapping ------------------------------------------------------------------------------


def test_a23_two_servers_on_one_name() -> None:
    bench = Bench(robot=False)
    bench.robot_appears()
    first = bench.speech
    bench.robot_appears(SPEECH, node="/twin")
    bench.run(6)
    assert bench.robot_statuses() == ["degraded"]
    assert bench.of(RobotRecord)[0].detail == describe_several_servers(2, SPEECH)
    bench.act()
    assert bench.ending(TASK).startswith(f"failed: two-servers: {describe_several_servers(2, SPEECH)}")
    bench.run(10)
    assert first.received == bench.speech.received == [], "the participant sees it neither once nor twice"
    assert bench.node is not None
    bench.node.close()
    bench.run(12)
    bench.act()
    bench.run(20)
    assert bench.task() == "SUCCEEDED" and len(first.executed) == 1
    assert bench.robot_statuses() == ["degraded", "connected"]
    bench.check()


def test_a23_a_second_server_joins() -> None:
    bench = Bench()
    bench.run(1)
    first = bench.speech
    bench.robot_appears(SPEECH, node="/twin")
    bench.act()
    bench.run(10)
    assert bench.ending(TASK).startswith("failed: two-servers")
    assert first.received == bench.speech.received == []
    bench.check()


def test_a25_ten_speech_acts_at_once() -> None:
    bench = Bench()
    for _ in range(10):
        bench.act()
    bench.run(30)
    tasks = [record.task for record in bench.records if getattr(record, "status", "") == "succeeded"]
    assert len(bench.speech.executed) == 10 and bench.speech.at_once == 1
    assert tasks == sorted(tasks)
    bench.check()


def test_a26_a_server_that_restarts_twenty_times_in_ten_seconds() -> None:
    bench = Bench([LONG])
    bench.run(1)
    bench.act()
    for number in range(20):
        bench.run(1.1 + number * 0.5)
        bench.robot_leaves()
        bench.run(1.35 + number * 0.5)
        bench.robot_appears()
        if number % 4 == 0:
            bench.act()
    bench.run(14)
    assert bench.robot_statuses() == ["connected", "lost"], "one message, not twenty"
    assert len(bench.notes()) <= 1
    bench.plans[SPEECH] = [Plan()]
    bench.robot_leaves()
    bench.robot_appears()
    bench.run(40)
    assert bench.robot_statuses() == ["connected", "lost", "connected"]
    bench.act()
    bench.run(50)
    assert bench.task() == "SUCCEEDED"
    bench.check()


def test_a26_one_of_two_servers_flaps() -> None:
    """The goal is sent a few times at most, under one id, and then it has failed."""
    bench = Bench(robot=False)
    bench.robot_appears(GAZE, node="/head")
    bench.plans[SPEECH] = [Plan(accept=None, runs=False, status=False)]
    mouth = bench.robot_appears(SPEECH, node="/mouth")
    bench.run(1)
    bench.act()
    received = [bench.speech.received]
    for number in range(20):
        mouth.close()
        bench.run(1.25 + number * 0.9)
        mouth = bench.robot_appears(SPEECH, node="/mouth")
        bench.run(1.9 + number * 0.9)
        received.append(bench.speech.received)
    bench.run(40)
    sent = [id for each in received for id in each]
    assert 1 <= len(sent) <= 3 and len(set(sent)) == 1
    assert bench.ending(TASK).startswith("failed: server-missing")
    assert bench.robot_statuses()[-1] == "connected" and bench.robot_statuses().count("degraded") <= 4
    bench.check()


# --- the middleware -------------------------------------------------------------------------------------------------


def test_a27_the_middleware_is_shut_down() -> None:
    bench = Bench([LONG, Plan()], [LONG])
    bench.act("Both")
    bench.run(1)
    bench.transport.break_down("the context was shut down")
    bench.run(1.3)
    for action in ("2/1", "2/2"):
        assert bench.ending(action) == "lost: the connection to ROS is gone: the context was shut down"
    assert bench.robot_statuses() == ["connected", "lost"]
    bench.act()
    bench.run(2)
    assert bench.task() == "ABORTED" and bench.memory("ends") == 2, "the engine lives"
    running = set(bench.speech.running()) | set(bench.gaze.running())
    assert len(running) == 2
    bench.robot.switch_transport(MemoryTransport(bench.wire, bench.loop, "/engine_again"))
    bench.run(3)
    assert bench.robot_statuses() == ["connected", "lost", "connected"]
    assert not bench.speech.running() and not bench.gaze.running(), "what went on without us is stopped"
    bench.act()
    bench.run(6)
    assert bench.task() == "SUCCEEDED"
    bench.check()


def test_a27_the_connection_is_made_anew_before_the_loss_is_noticed() -> None:
    bench = Bench([LONG], [LONG])
    bench.act("Both")
    bench.run(1)
    bench.transport.break_down("the context was shut down")
    bench.robot.switch_transport(MemoryTransport(bench.wire, bench.loop, "/engine_again"))
    bench.run(3)
    assert bench.robot_statuses() == ["connected", "lost", "connected"]
    assert not bench.speech.running() and not bench.gaze.running(), "what went on without us is stopped"
    bench.check()


def test_a27_the_new_connection_is_gone_before_it_is_used() -> None:
    bench = Bench([LONG, Plan()], [LONG])
    bench.act("Both")
    bench.run(1)
    bench.transport.break_down("the context was shut down")
    bench.run(1.3)
    gone = MemoryTransport(bench.wire, bench.loop, "/engine_again")
    gone.break_down("gone again")
    with pytest.raises(PortError, match="gone again"):
        bench.robot.switch_transport(gone)
    gone.close()
    bench.robot.switch_transport(MemoryTransport(bench.wire, bench.loop, "/engine_once_more"))
    bench.run(3)
    assert bench.robot_statuses() == ["connected", "lost", "connected"]
    assert not bench.speech.running() and not bench.gaze.running(), "what went on without us is stopped"
    bench.check()


def test_a27_the_middleware_comes_back_by_itself() -> None:
    bench = Bench([LONG, Plan()])
    bench.act()
    bench.run(1)
    bench.transport.break_down()
    bench.run(3)
    bench.transport.break_down("")
    bench.run(5)
    assert bench.robot_statuses() == ["connected", "lost", "connected"]
    bench.act()
    bench.run(8)
    assert bench.task() == "SUCCEEDED"
    bench.check()


def test_a28_the_link_is_gone_for_five_seconds() -> None:
    bench = Bench([LONG, Plan()], [LONG])
    bench.act("Both")
    bench.run(1)
    bench.wire.forget("/robot")
    bench.run(2)
    assert bench.ending("2/1").startswith("lost") and bench.ending("2/2").startswith("lost")
    assert bench.task("Both") == "ABORTED"
    bench.run(6)
    bench.wire.heal("/robot")
    bench.run(8)
    assert bench.robot_statuses() == ["connected", "lost", "connected"]
    assert not bench.speech.running() and not bench.gaze.running(), "what went on without us is stopped"
    bench.act()
    bench.run(12)
    assert bench.task() == "SUCCEEDED"
    bench.check()


def test_an_act_that_was_lost_with_the_whole_robot_does_not_begin_when_it_is_back() -> None:
    bench = Bench([LONG], [LONG], robot=False)
    head = bench.robot_appears(GAZE, node="/head")
    bench.run(7)
    bench.act("Greet")  # waits for the missing part
    bench.act("Look")  # waits in the line, begins when the other has failed, and is lost at once
    bench.run(7.5)
    head.close()
    bench.run(8.5)
    bench.robot_appears(GAZE, node="/head")
    bench.run(11)
    assert bench.robot_statuses()[-2:] == ["lost", "degraded"] and bench.ending("3/2").startswith("lost")
    assert bench.gaze.received == []
