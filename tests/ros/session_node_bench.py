"""A session with its face on a wire, and a node that uses it."""

from __future__ import annotations

import asyncio
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

from rise_adapters.ros2.actions.client import ActionClient, CancelResponse
from rise_adapters.ros2.session_node import RosSessionInterface
from rise_adapters.ros2.session_node.neighbours import NeighbourSessions
from rise_adapters.ros2.transport.port import Message, QoS, Transport

from rise_engine.base.files import Disk
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.records import TaskRecord
from rise_engine.kernel.view import SessionView
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.run.server.hub import SessionHub
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, create_session
from rise_engine.session.journal import Journal
from tests.ros.memory import MemoryTransport, MemoryWire

FAST = 50.0
START_ACT, START_RULE = "startCommunicationRobotAct", "startInteractionRule"

ACTS = """<Dialogs>
<Dialog name="Hello"><Speech><actionID>1</actionID><message>Hello</message></Speech></Dialog>
<Dialog name="Story"><Wait><actionID>1</actionID><duration>600000</duration></Wait></Dialog>
<Dialog name="Nod"><Animation><actionID>1</actionID><value>head_nod</value></Animation></Dialog>
</Dialogs>"""

RULES = """<InteractionRules>
<InteractionRule name="Doors" initial="Closed" priority="2">
  <State id="Closed"><transition eventTopic="/open" target="Open"/></State>
  <State id="Open">
    <transition eventTopic="/close" target="Closed"/>
    <transition eventTopic="/knock"/>
    <transition eventTopic="/leave" target="Gone"/>
  </State>
  <State id="Gone"/>
</InteractionRule>
<InteractionRule name="Patient" initial="Waiting"><State id="Waiting">
  <transition eventTopic="/never" target="Done"/></State><State id="Done"/></InteractionRule>
</InteractionRules>"""

MEMORY = """{"name": "Anna", "age": 7, "near": false, "nobody": null, "list": [1, {"x": 2.5}],
"person": {"name": "Bob", "at": {"x": 1}}, "person.age": 30, "umlaut": "\\u00e4\\ud83d\\ude00"}"""


_HEADER = {"header": "std_msgs/msg/Header"}
TYPES = {
    "std_msgs/msg/Header": {"stamp": "builtin_interfaces/msg/Time", "frame_id": "string"},
    "diagnostic_msgs/msg/KeyValue": {"key": "string", "value": "string"},
    "diagnostic_msgs/msg/DiagnosticStatus": {
        "level": "byte", "name": "string", "message": "string", "hardware_id": "string",
        "values": "diagnostic_msgs/msg/KeyValue[]",
    },
    "diagnostic_msgs/msg/DiagnosticArray": _HEADER | {"status": "diagnostic_msgs/msg/DiagnosticStatus[]"},
    "rise_interfaces/action/DomainTask_Goal": {
        "domain_task_behavior": "string", "function_type": "string", "calling_type": "string",
    },
    "rise_interfaces/action/DomainTask_Result": {"status": "string", "reason": "string", "task": "uint64"},
    "rise_interfaces/action/DomainTask_Feedback": {"status": "string", "reason": "string", "position": "int32"},
    "rise_interfaces/srv/GetMemory_Request": {"request_by_key": "string"},
    "rise_interfaces/srv/GetMemory_Response": {"found": "bool", "value": "string", "type": "string"},
    "rise_interfaces/msg/RuleState": _HEADER | {
        "rule": "string", "status": "string", "state": "string", "previous_state": "string", "trigger": "string",
        "priority": "float64",
    },
    "rise_interfaces/msg/TaskState": _HEADER | {
        "id": "uint64", "domain_task_behavior": "string", "function_type": "string", "calling_type": "string",
        "source": "string", "status": "string", "reason": "string", "position": "int32", "goal_id": "string",
    },
    "rise_interfaces/msg/Record": _HEADER | {
        "session": "string", "seq": "uint64", "t": "float64", "kind": "string", "json": "string",
    },
}  # fmt: skip
"""What is on the wire, also where the package that reads definitions is not installed."""


def scenario_folder(place: Path) -> Path:
    folder = place / "scenario"
    for name, text in (("acts/acts.xml", ACTS), ("rules/rules.xml", RULES), ("memory.json", MEMORY)):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    return folder


class Faced:
    """A session that others see on ROS."""

    def __init__(self, engine: Engine, hub: SessionHub, face: RosSessionInterface) -> None:
        self.engine, self.hub, self.face = engine, hub, face


@asynccontextmanager
async def faced(
    place: Path,
    transport: Transport,
    *,
    speed: float = FAST,
    disk: Disk | None = None,
    view: SessionView | None = None,
    scenario: Path | None = None,
    start: bool = True,
) -> AsyncIterator[Faced]:
    loaded = load(scenario or scenario_folder(place))
    assert loaded.scenario is not None, loaded.diagnostics
    loop = asyncio.get_running_loop()
    clock = RealClock(loop, speed)
    robot = make_robot(loaded.scenario.robot, "debug", clock, 1, ())

    def changed() -> None:
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(engine.flush_durable)

    folder, begun = "", SessionStarted(speed=speed)
    journal = None
    if disk is not None:
        versions = {"rise-tui": "t"}
        made = create_session(
            place / "sessions", loaded.scenario, loaded.files, seed=1, faults=(), versions=versions, begun=begun
        )
        folder = str(made)
        journal = Journal(made / JOURNAL, changed=changed, disk=disk, retry=0.01)
    engine = Engine(loaded.scenario, robot, clock, 1, started=begun, journal=journal)
    hub = SessionHub(engine, folder, view=view)
    face = RosSessionInterface(transport, hub, NeighbourSessions(transport))
    if start:
        engine.start()
    try:
        yield Faced(engine, hub, face)
    finally:
        if not engine.ended:
            engine.end("the test is over")
            engine.end_now("the test is over")
        await face.close()
        if journal is not None:
            await asyncio.to_thread(journal.close, 1.0)


async def until(true: Callable[[], Any], seconds: float = 10) -> Any:
    """Wait for a condition; gives what it gave."""
    async with asyncio.timeout(seconds):
        while not (found := true()):  # noqa: ASYNC110
            await asyncio.sleep(0.002)
    return found


class Asked:
    """A goal that a node has sent, and everything that it heard of it."""

    def __init__(self, id: bytes) -> None:
        self.id = id
        self.accepted: bool | None = None
        self.feedback: list[Message] = []
        self.status: int | None = None
        self.result: Message = {}
        self.canceled: list[CancelResponse] = []

    @property
    def progress(self) -> list[str]:
        return [each["status"] for each in self.feedback]

    async def decided(self) -> bool:
        await until(lambda: self.accepted is not None)
        assert self.accepted is not None
        return self.accepted

    async def ended(self) -> tuple[str, str]:
        """The task's status and reason."""
        await until(lambda: self.status is not None)
        return self.result["status"], self.result["reason"]


class Node:
    """Another node: it asks for tasks, and hears what happens."""

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.client = ActionClient(transport, "/rise/domain_task", "rise_interfaces/action/DomainTask")
        self.client.on_feedback = self._feedback
        self.asked: dict[bytes, Asked] = {}
        self.memory = transport.client("/rise/get_memory", "rise_interfaces/srv/GetMemory")
        self.rules = self.hear("/rise/rule_state", "rise_interfaces/msg/RuleState", QoS(100, latched=True))
        self.tasks = self.hear("/rise/task_state", "rise_interfaces/msg/TaskState", QoS(100, latched=True))
        self.records = self.hear("/rise/record", "rise_interfaces/msg/Record", QoS(1000, latched=True))
        self.diagnostics = self.hear("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")

    def hear(self, topic: str, type: str, qos: QoS = QoS()) -> list[Message]:  # noqa: B008
        got: list[Message] = []
        self.transport.subscribe(topic, type, got.append, qos)
        return got

    async def ready(self) -> None:
        await until(lambda: self.client.count_servers() and self.memory.count_servers())

    def ask(self, function: str, behavior: str = "", calling_type: str = "") -> Asked:
        asked = Asked(os.urandom(16))
        self.asked[asked.id] = asked
        goal = {"function_type": function, "domain_task_behavior": behavior, "calling_type": calling_type}
        self.client.send(asked.id, goal, lambda accepted: self._accepted(asked, accepted))
        return asked

    def cancel(self, asked: Asked) -> None:
        self.client.cancel(asked.id, asked.canceled.append)

    async def get(self, key: str) -> Message:
        got: list[Message] = []
        self.memory.call({"request_by_key": key}, got.append)
        await until(lambda: got)
        return got[0]

    def _accepted(self, asked: Asked, accepted: bool) -> None:
        asked.accepted = accepted
        if accepted:
            self.client.get_result(asked.id, lambda status, result: self._ended(asked, status, result))

    def _ended(self, asked: Asked, status: int, result: Message) -> None:
        asked.status, asked.result = status, result

    def _feedback(self, id: bytes, message: Message) -> None:
        if id in self.asked:
            self.asked[id].feedback.append(message)


@asynccontextmanager
async def session_and_node(place: Path, **more: Any) -> AsyncIterator[tuple[Faced, Node, MemoryWire]]:
    wire = MemoryWire(TYPES)
    loop = asyncio.get_running_loop()
    async with faced(place, MemoryTransport(wire, loop, "/rise"), **more) as session:
        node = Node(MemoryTransport(wire, loop, "/node"))
        await node.ready()
        yield session, node, wire


def task_records(session: Any) -> list[TaskRecord]:
    """What a session records of tasks from now on."""
    found: list[TaskRecord] = []
    session.hub.subscribe(lambda update: found.append(update) if isinstance(update, TaskRecord) else None)
    return found


def status_of(node: Node, name: str) -> Message:
    if not node.diagnostics:
        return {"level": None}
    return next(s for s in node.diagnostics[-1]["status"] if s["name"] == f"rise: {name}")
