"""The other processes of the benchmark `ros`: ros_peers.py robot | relay | flood RATE | plain | stream RATE | listen
HOW, with --ros TRANSPORT.

robot: a robot whose actions end immediately (`bench/act`, `bench/behind_relay`), and three that send feedback 500 times
a second each (`bench/talk1` to `bench/talk3`). relay: passes each goal of `bench/relay` on to the robot and its result
back: a session that does nothing. It has an action of the robot to itself, because the clients of a service hear each
other's replies. flood: DomainTask goals at a steady rate until its input is closed. plain: rclpy's own action server
(`bench/plain`). stream: points at a steady rate, best effort (`bench/gaze`), until its input is closed. listen: hears
them and says what part of a core that takes; HOW: `every` message, the `newest` as feature nodes do, or `plainly`, with
nothing of ours between: rclpy's own subscription, or a reader of Cyclone DDS that decodes nothing.
"""

from __future__ import annotations

import asyncio
import os
import sys
import time
from argparse import ArgumentParser
from collections.abc import Callable
from threading import Thread

from rise_adapters.ros2.actions.client import ActionClient
from rise_adapters.ros2.actions.server import ActionServer
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.transport.port import SENSOR, QoS
from rise_adapters.ros2.transport.selection import open_transport

from rise_engine.run.engine.clock import RealClock

SPEECH = "rise_interfaces/action/Speech"
RESULT_TIMEOUT = 0.2
TALKERS, FEEDBACK_HZ = 3, 500


async def robot(choice: str) -> None:
    loop = asyncio.get_running_loop()
    transport = await open_transport(choice, node="bench_robot")

    def act(goal: ServerGoal) -> None:
        goal.accept()
        goal.succeed({})

    def talk(goal: ServerGoal) -> None:
        goal.accept()

        async def go_on() -> None:
            began, sent = loop.time(), 0
            while not goal.has_ended:
                while sent < (loop.time() - began) * FEEDBACK_HZ:
                    goal.publish_feedback({"progress": 0.5})
                    sent += 1
                await asyncio.sleep(0.001)

        tasks.append(loop.create_task(go_on()))

    def stop(goal: ServerGoal, decide: object) -> None:
        assert callable(decide)
        decide(True)
        goal.cancel({})

    tasks: list[object] = []
    clock = RealClock(loop, 1.0, 0.0)
    servers = [
        ActionServer(transport, "bench/act", SPEECH, act, clock=clock, result_timeout=RESULT_TIMEOUT),
        ActionServer(transport, "bench/behind_relay", SPEECH, act, clock=clock, result_timeout=RESULT_TIMEOUT),
        *(
            ActionServer(transport, f"bench/talk{n}", SPEECH, talk, stop, clock=clock, result_timeout=RESULT_TIMEOUT)
            for n in range(1, TALKERS + 1)
        ),
    ]
    print("ready", flush=True)
    await _input_closed()
    for server in servers:
        server.close()
    transport.close()


async def relay(choice: str) -> None:
    loop = asyncio.get_running_loop()
    transport = await open_transport(choice, node="bench_relay")
    client = ActionClient(transport, "bench/behind_relay", SPEECH)

    def pass_on(goal: ServerGoal) -> None:
        def answered(accepted: bool) -> None:
            assert accepted
            client.get_result(goal.id, lambda status, result: goal.succeed(result))

        goal.accept()
        client.send(goal.id, goal.message, answered)

    clock = RealClock(loop, 1.0, 0.0)
    server = ActionServer(transport, "bench/relay", SPEECH, pass_on, clock=clock, result_timeout=RESULT_TIMEOUT)
    while not client.count_servers():  # noqa: ASYNC110  # discovery says nothing
        await asyncio.sleep(0.01)
    print("ready", flush=True)
    await _input_closed()
    server.close()
    transport.close()


async def flood(choice: str, rate: float) -> None:
    loop = asyncio.get_running_loop()
    transport = await open_transport(choice, node="bench_flood")
    client = ActionClient(transport, "rise/domain_task", "rise_interfaces/action/DomainTask")
    goal = {"function_type": "raiseEventTopic", "domain_task_behavior": "/noise"}
    while not client.count_servers():  # noqa: ASYNC110  # discovery says nothing
        await asyncio.sleep(0.01)
    print("ready", flush=True)
    closed = loop.create_task(_input_closed())
    began, sent = loop.time(), 0
    answers: list[bool] = []
    while not closed.done():
        while sent < (loop.time() - began) * rate:
            client.send(os.urandom(16), goal, answers.append)
            sent += 1
        await asyncio.sleep(0.001)
    print(f"{sent / (loop.time() - began):.0f} {sum(answers)} {sent}", flush=True)
    transport.close()


def plain() -> None:
    """rclpy's own action server, spinning in one thread."""
    import rclpy
    from rclpy.action import ActionServer as PlainServer
    from rclpy.executors import ExternalShutdownException
    from rise_interfaces.action import Speech

    rclpy.init()
    node = rclpy.create_node("bench_plain")

    def execute(goal: object) -> object:
        goal.succeed()  # type: ignore[attr-defined]
        return Speech.Result()

    PlainServer(node, Speech, "bench/plain", execute, result_timeout=RESULT_TIMEOUT)
    print("ready", flush=True)
    try:
        rclpy.spin(node)
    except (ExternalShutdownException, KeyboardInterrupt):
        return


GAZE, POINT = "bench/gaze", "geometry_msgs/msg/PointStamped"
LISTEN_SECONDS = 10.0


async def stream(choice: str, rate: float) -> None:
    loop = asyncio.get_running_loop()
    transport = await open_transport(choice, node="bench_stream")
    publisher = transport.publisher(GAZE, POINT, SENSOR)
    print("ready", flush=True)
    closed = loop.create_task(_input_closed())
    began, sent = loop.time(), 0
    while not closed.done():
        while sent < (loop.time() - began) * rate:
            publisher.publish({"point": {"x": 1.0, "y": 2.0, "z": 3.0}})
            sent += 1
        await asyncio.sleep(0.001)
    transport.close()


async def listen(choice: str, how: str) -> None:
    heard: list[object] = []
    if how == "plainly":
        listen_plainly(choice, lambda message: heard.append(1))
    else:
        transport = await open_transport(choice, node="bench_listener")
        pause, qos = (0.0, SENSOR) if how == "every" else (0.02, QoS(depth=1, reliable=False))
        transport.subscribe(GAZE, POINT, heard.append, qos, pause)
    async with asyncio.timeout(20):
        while not heard:  # noqa: ASYNC110  # discovery says nothing
            await asyncio.sleep(0.01)
    heard.clear()
    began, before = time.monotonic(), time.process_time()
    await asyncio.sleep(LISTEN_SECONDS)
    seconds = time.monotonic() - began
    print(f"{100 * (time.process_time() - before) / seconds:.2f} {len(heard) / seconds:.0f}", flush=True)
    os._exit(0)  # whatever threads there are


def listen_plainly(choice: str, take: Callable[[object], object]) -> None:
    """Listen in a thread."""
    if choice == "rclpy":
        import rclpy
        from geometry_msgs.msg import PointStamped
        from rclpy.experimental.events_executor import EventsExecutor
        from rclpy.qos import qos_profile_sensor_data

        rclpy.init()
        node = rclpy.create_node("bench_plain_listener")
        node.create_subscription(PointStamped, GAZE, take, qos_profile_sensor_data)
        executor = EventsExecutor()
        executor.add_node(node)
        Thread(target=executor.spin, daemon=True).start()
        return
    from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.util import duration
    from rise_adapters.ros2.transport.dds.node import IdlTypes
    from rise_adapters.ros2.transport.dds.reader_thread import dds_qos, make_reader, take_samples
    from rise_adapters.ros2.transport.interfaces.catalog import InterfaceCatalog

    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    types = InterfaceCatalog((), os.environ)
    idl = IdlTypes(types).find_or_make(POINT, headed=False)
    reader = make_reader(participant, f"rt/{GAZE}", idl, dds_qos(SENSOR, {}, reader=True))
    waitset = WaitSet(participant)
    waitset.attach(ReadCondition(reader, ViewState.Any | InstanceState.Any | SampleState.NotRead))

    def run() -> None:
        while True:
            waitset.wait(duration(seconds=1))
            for sample in take_samples(int(reader._ref), 500) or ():
                take(sample)

    Thread(target=run, daemon=True).start()


async def _input_closed() -> None:
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)


if __name__ == "__main__":
    parser = ArgumentParser()
    parser.add_argument("what", choices=("robot", "relay", "flood", "plain", "stream", "listen"))
    parser.add_argument("more", nargs="?", default="1000")
    parser.add_argument("--ros", default="dds")
    options = parser.parse_args()
    if options.what == "plain":
        plain()
    elif options.what == "robot":
        asyncio.run(robot(options.ros))
    elif options.what == "relay":
        asyncio.run(relay(options.ros))
    elif options.what == "listen":
        asyncio.run(listen(options.ros, options.more))
    elif options.what == "stream":
        asyncio.run(stream(options.ros, float(options.more)))
    else:
        asyncio.run(flood(options.ros, float(options.more)))
