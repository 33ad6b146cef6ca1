"""A task over ROS 2: DomainTask goal in, an act of one action, the robot's result, DomainTask result out.

The floor, in the same run and over the same transport, is two plain action round trips one after the other: the cost of
the wire. With rclpy they use its own action client and server (`result_timeout` fixed on both sides); with the DDS
wheel, which has no actions, ours. Everything stays on the loopback.

A trip is four messages in sequence: goal, accepted, request for the result, result. So two trips are eight between two
processes. A task is six such messages in sequence (goal, the four of the robot's trip, result) between three processes.
The session adds three steps, two of which must be on the disk before anything goes out. In parallel, it sends an
acceptance, two feedbacks, and what it publishes: seven records and three task states. The robot's answers to the plain
trips also reach the session's process, because the clients of a service share its topic of replies. The floor includes
this, as any system with a session does.

The same eight messages between three processes, without a session, are one goal through a relay: a plain action server
that is a plain client of the robot. It takes less than the floor, because two of the messages are not in sequence. So
the floor is fair, and the difference is the session's own time.

It also measures the wizard's acts: the time of an act through the engine, compared with the same two plain trips. It
measures a key's acknowledgement, while 3 x 500 feedback messages or 1,000 tasks a second come in, and without load. The
journal of that session is in memory if possible: `acknowledge` measures the disk.

It measures a stop, from the key to the answer of every part, of a robot that answers immediately in the middle of a
long act.

And it measures the share of a core for listening: of a session to 3 x 500 feedbacks a second of its robot, and of a
feature node to 1,000 points a second, best effort, compared with a node without our code
(`ros_peers.py listen plainly`).

For rclpy: run it with a Python that has rclpy and rise_interfaces, and set `RISE_BENCH_ROS=rclpy`.
"""

from __future__ import annotations

import asyncio
import os
import random
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter

from measure import Report
from rise_adapters.ros2.actions.client import ActionClient
from rise_adapters.ros2.transport.selection import open_transport
from ros_peers import TALKERS

from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import ActionRecord, StopRecord
from rise_engine.run.client.socket import SocketClient

HERE = Path(__file__).parent
ROUNDS, GOALS, KEYS = 7, 60, 600
KEY_P50_MS, KEY_P99_MS = 5, 30
STOPS, STOP_P50_MS, STOP_P99_MS = 100, 25, 60
TASK_TRIPS = 1.75
"""A task goes through a third process, which writes two of its steps to the disk before anything goes out."""
TALK_SECONDS = 10.0
FEEDBACK_PERCENT = 10
"""Maximum share of a core if the profile waits for feedback; otherwise the session does not listen to any."""
LISTENER_PERCENT = 5
"""Maximum share of a core."""
LOOPBACK = (
    "<General><AllowMulticast>false</AllowMulticast><Interfaces><NetworkInterface name='lo'/></Interfaces></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    "<Peers><Peer address='localhost'/></Peers></Discovery>"
)
ACTS = """<Acts><Dialog name="A"><Speech><actionID>1</actionID><message>x</message></Speech></Dialog>
<Dialog name="Talk">{talk}</Dialog></Acts>"""
ROBOT = """driver = "ros2"
options.deadlines.feedback = 5
[actions.Speech]
carrier = { action = "bench/act", type = "rise_interfaces/action/Speech", goal = { message = "{message}" } }
"""
GABBLE = """[actions.Gabble{}]
limit = 600
parameters.message = {{ type = "text" }}
carrier = {{ action = "bench/talk{}", type = "rise_interfaces/action/Speech", goal = {{ message = "{{message}}" }} }}
"""


def scenario(folder: Path) -> Path:
    """One act of one action, and one of three that talk without end."""
    numbers = range(1, TALKERS + 1)
    talk = "".join(f"<Gabble{n}><actionID>{n}</actionID><message>x</message></Gabble{n}>" for n in numbers)
    for name, text in {
        "scenario.toml": 'robot = "bench"\nmode = "real"\n[act.A]\ndebounce = 0\n',
        "acts/a.xml": ACTS.format(talk=talk).replace("Acts>", "CommunicationRobotActs>"),
        "robots/bench.toml": ROBOT + "".join(GABBLE.format(n, n) for n in numbers),
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


@contextmanager
def process(*command: str, environment: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    """A process that prints a line when it is ready, and ends when its input does."""
    running = subprocess.Popen(
        [sys.executable, *command],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert running.stdout is not None and running.stdin is not None
        yield running
    finally:
        running.terminate()
        running.wait()
        running.stdout.close()


def ready(running: subprocess.Popen[str], word: str) -> None:
    assert running.stdout is not None
    for line in running.stdout:
        if word in line:
            return
    raise SystemExit(f"a process of the benchmark ended before it was ready: {running.args}")


# --- one goal after the other ---------------------------------------------------------------------------------------


class Ours:
    """Our action clients."""

    @classmethod
    async def make(cls, choice: str) -> Ours:
        it = cls()
        it.transport = await open_transport(choice, node="bench_client")
        it.tasks = ActionClient(it.transport, "rise/domain_task", "rise_interfaces/action/DomainTask")
        it.acts = ActionClient(it.transport, "bench/act", "rise_interfaces/action/Speech")
        it.relayed = ActionClient(it.transport, "bench/relay", "rise_interfaces/action/Speech")
        async with asyncio.timeout(20):
            while not all(client.count_servers() for client in (it.tasks, it.acts, it.relayed)):  # noqa: ASYNC110  # discovery says nothing
                await asyncio.sleep(0.01)
        return it

    async def goal(self, client: object, message: dict[str, str]) -> float:
        done: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        id = os.urandom(16)
        began = perf_counter()

        def answered(accepted: bool) -> None:
            assert accepted
            client.get_result(id, lambda status, result: done.set_result(status))  # type: ignore[attr-defined]

        client.send(id, message, answered)  # type: ignore[attr-defined]
        assert await done == 4
        return perf_counter() - began

    async def task(self) -> float:
        return await self.goal(self.tasks, {"function_type": "startCommunicationRobotAct", "domain_task_behavior": "A"})

    async def two_plain(self) -> float:
        return await self.goal(self.acts, {"message": "x"}) + await self.goal(self.acts, {"message": "x"})

    async def through_relay(self) -> float:
        return await self.goal(self.relayed, {"message": "x"})


def plain_rclpy() -> Callable[[], float]:
    """Two round trips with rclpy's own action client, which spins in its own thread."""
    import rclpy
    from rclpy.action import ActionClient as PlainClient
    from rise_interfaces.action import Speech

    rclpy.init()
    node = rclpy.create_node("bench_plain_client")
    client = PlainClient(node, Speech, "bench/plain")
    assert client.wait_for_server(20)

    def one() -> None:
        goal = Speech.Goal()
        goal.message = "x"
        sending = client.send_goal_async(goal)
        rclpy.spin_until_future_complete(node, sending)
        ending = sending.result().get_result_async()
        rclpy.spin_until_future_complete(node, ending)
        assert ending.result().status == 4

    def two() -> float:
        began = perf_counter()
        one()
        one()
        return perf_counter() - began

    return two


async def trips(choice: str) -> tuple[float, float, float]:
    """Median seconds of a task, of two plain round trips, and of one goal through a relay."""
    ours = await Ours.make(choice)
    plain = plain_rclpy() if choice == "rclpy" else None
    medians: list[tuple[float, float, float]] = []
    for turn in range(ROUNDS + 1):
        through = [await ours.task() for _ in range(GOALS)]
        below = [plain() if plain is not None else await ours.two_plain() for _ in range(GOALS)]
        beside = [await ours.through_relay() for _ in range(GOALS)]
        if turn:  # the first round warms up
            medians.append((statistics.median(through), statistics.median(below), statistics.median(beside)))
    ours.transport.close()
    task, floor, relay = zip(*medians, strict=True)
    return statistics.median(task), statistics.median(floor), statistics.median(relay)


# --- the wizard's key -----------------------------------------------------------------------------------------------


class Wizard:
    """Presses a key 100 times a second."""

    def __init__(self, socket: Path) -> None:
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, daemon=True).start()
        self._client = SocketClient(socket, "anna")
        self._await(self._attach())

    def _await(self, work: object) -> object:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(120)  # type: ignore[arg-type]

    async def _attach(self) -> None:
        await self._client.attach()
        self._updates: asyncio.Queue[StopRecord | ActionRecord] = asyncio.Queue()

        async def follow() -> None:
            async for update in self._client.records():
                for record in update if isinstance(update, list) else [update]:
                    if isinstance(record, StopRecord | ActionRecord):
                        self._updates.put_nowait(record)

        self._following = asyncio.get_running_loop().create_task(follow())

    def send(self, function: str, behavior: str) -> None:
        assert self._await(self._client.send(Submit(function=function, behavior=behavior)))

    def key_times(self) -> tuple[float, float]:
        """Milliseconds until a key is acknowledged: the median, and the maximum of 99 of 100."""
        hundredths = statistics.quantiles(self._await(self._press_keys()), n=100)  # type: ignore[arg-type]
        return hundredths[49] * 1e3, hundredths[98] * 1e3

    def stop_times(self) -> tuple[float, float]:
        """Milliseconds from the stop key to the robot's answer: the median, and the maximum of 99 of 100."""
        hundredths = statistics.quantiles(self._await(self._stop()), n=100)  # type: ignore[arg-type]
        return hundredths[49] * 1e3, hundredths[98] * 1e3

    def act_times(self) -> tuple[float, float]:
        """Median seconds of an act that the wizard starts: from the key until the console gets its end, and on the
        session's own clock from its start to the robot's result."""
        seen, took = zip(*self._await(self._act()), strict=True)  # type: ignore[call-overload]
        return statistics.median(seen), statistics.median(took)

    async def _act(self) -> list[tuple[float, float]]:
        times = []
        for _ in range(ROUNDS * GOALS):
            while not self._updates.empty():
                self._updates.get_nowait()
            pressed = perf_counter()
            await self._client.send(Submit(function="startCommunicationRobotAct", behavior="A"))
            began, ended = await self._until("started"), await self._until("succeeded")
            times.append((perf_counter() - pressed, ended.t - began.t))
        return times

    async def _stop(self) -> list[float]:
        took = []
        for _ in range(STOPS):
            while not self._updates.empty():
                self._updates.get_nowait()
            await self._client.send(Submit(function="startCommunicationRobotAct", behavior="Talk"))
            await self._until("accepted")
            began = perf_counter()
            await self._client.send(Submit(function="stopAll"))
            answer = await self._until("latched")
            took.append(perf_counter() - began)
            assert isinstance(answer, StopRecord) and not answer.unconfirmed, answer
            await self._client.send(Submit(function="releaseStop"))
        return took

    async def _until(self, status: str) -> StopRecord | ActionRecord:
        async with asyncio.timeout(20):
            while True:
                record = await self._updates.get()
                if getattr(record, "status", "") == status:
                    return record

    async def _press_keys(self) -> list[float]:
        took = []
        for _ in range(KEYS):
            began = perf_counter()
            assert (await self._client.send(Note(text="key"))).accepted
            took.append(perf_counter() - began)
            await asyncio.sleep(0.01)
        return took


# --- what comes a thousand times a second ---------------------------------------------------------------------------


def core_percent(pid: int) -> float | None:
    """The share of a core that a process uses for a while; None: this system does not report it."""

    def used() -> float:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    try:
        before = used()
        time.sleep(TALK_SECONDS)
        return 100 * (used() - before) / TALK_SECONDS
    except OSError:
        return None


def compare_listeners(report: Report, choice: str, environment: dict[str, str]) -> None:
    peers = str(HERE / "ros_peers.py")
    found: dict[str, list[tuple[float, float]]] = {"plainly": [], "every": [], "newest": []}
    with process(peers, "stream", "1000", "--ros", choice, environment=environment) as stream:
        ready(stream, "ready")
        for how in [*found] * 3:
            with process(peers, "listen", how, "--ros", choice, environment=environment) as listener:
                assert listener.stdout is not None
                percent, heard = map(float, listener.stdout.readlines()[-1].split())
            found[how].append((percent, heard))
    medians = {how: sorted(each)[1] for how, each in found.items()}
    for how, (percent, heard) in medians.items():
        report.row(f"listening to points, {how}", f"{percent:.1f} %", f"of a core; {heard:.0f} a second")
    newest, plain = medians["newest"][0], medians["plainly"][0]
    report.target("% of a core, the newest point", newest, LISTENER_PERCENT, at_least=False)
    report.target("times the plain listener", newest / plain, 1, at_least=False)


def main() -> bool:
    choice = os.environ.get("RISE_BENCH_ROS", "dds")
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randrange(1, 100))
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    report = Report(f"A task over ROS 2 by {choice}", "wall time")
    with tempfile.TemporaryDirectory(prefix="rise-bench-", dir=memory) as name:
        folder = Path(name)
        environment = {**os.environ, "RISE_SESSIONS": str(folder / "sessions"), "RISE_RUNTIME": str(folder / "run")}
        if choice == "rclpy":
            environment["PYTHONPATH"] = os.pathsep.join(sys.path)
        study = scenario(folder / "study")
        peers = str(HERE / "ros_peers.py")
        serve = ("-m", "rise_engine", "serve", str(study), "--name", "bench", "--ros", choice)
        with ExitStack() as stack:
            ready(stack.enter_context(process(peers, "robot", "--ros", choice, environment=environment)), "ready")
            ready(stack.enter_context(process(peers, "relay", "--ros", choice, environment=environment)), "ready")
            if choice == "rclpy":
                ready(stack.enter_context(process(peers, "plain", environment=environment)), "ready")
            engine = stack.enter_context(process(*serve, environment=environment))
            ready(engine, "serving")
            task, floor, relay = asyncio.run(trips(choice))
            report.row("task in, act, robot, result out", f"{task * 1e3:.2f} ms")
            report.row("two plain action round trips", f"{floor * 1e3:.2f} ms")
            report.row(
                "one goal through a relay", f"{relay * 1e3:.2f} ms", f"the task takes {task / relay:.2f} times that"
            )
            report.target("a task, times two plain trips", task / floor, TASK_TRIPS, at_least=False)
            wizard = Wizard(folder / "run" / "bench.sock")
            seen, act = wizard.act_times()
            report.row("an act, from the wizard's key to its end", f"{seen * 1e3:.2f} ms", "as the wizard sees it")
            report.row("an act through the engine", f"{act * 1e3:.2f} ms", "from its start to the robot's result")
            report.target("an act through it, times two plain trips", act / floor, 1, at_least=False)
            keys = {"while nothing comes in": wizard.key_times()}
            with process(peers, "flood", "1000", "--ros", choice, environment=environment) as flood:
                ready(flood, "ready")
                keys["at 1,000 tasks/s"] = wizard.key_times()
                assert flood.stdin is not None and flood.stdout is not None
                flood.stdin.close()
                rate, accepted, sent = flood.stdout.readline().split()
            report.row("tasks a second that really came", rate, f"{accepted} of {sent} accepted")
            half, most_stops = wizard.stop_times()
            report.target("ms a stop takes, p50", half, STOP_P50_MS, at_least=False)
            report.target("ms a stop takes, p99", most_stops, STOP_P99_MS, at_least=False)
            wizard.send("startCommunicationRobotAct", "Talk")
            keys["at 3 x 500 feedbacks/s"] = wizard.key_times()
            percent = core_percent(engine.pid)
            wizard.send("stopAll", "")
            for when, (median, most) in keys.items():
                report.target(f"ms a key takes {when}, p50", median, KEY_P50_MS, at_least=False)
                report.target(f"ms a key takes {when}, p99", most, KEY_P99_MS, at_least=False)
            if percent is not None:
                report.target("% of a core, 3 x 500 feedbacks/s", percent, FEEDBACK_PERCENT, at_least=False)
        compare_listeners(report, choice, environment)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
