"""A whole session on a wire in memory and in virtual time: engine, kernel, `Ros2Robot`, and a robot that does wrong."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
from rise_adapters.ros2.mapping import read_mappings
from rise_adapters.ros2.robot import Ros2Robot

from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import (
    ENDINGS,
    ActionRecord,
    AnyRecord,
    EventRecord,
    MemoryRecord,
    NoteRecord,
    RobotRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import RobotProfile, Scenario
from rise_engine.scenario.reading.action_declarations import core_actions
from tests.kernel.harness import write
from tests.ros.badrobot import BadServer, Plan
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire
from tests.run.engine.samples import assert_one_ending_each

SPEECH, GAZE = "/pepper/rise/speech", "/pepper/rise/look_at"
LONG = Plan(seconds=60)
TASK = "2/1"
"""The speech of the first act: task 1 is the rule that counts the acts' ends."""
TYPES = {SPEECH: "rise_interfaces/action/Speech", GAZE: "rise_interfaces/action/LookAt"}

_SPEECH = "<Speech><actionID>1</actionID><message>Hello, this takes about two seconds</message>{}</Speech>"
_GAZE = (
    "<LookAt><actionID>2</actionID>{}<pointx>1</pointx><pointy>0</pointy><pointz>0</pointz>"
    "<duration>1000</duration></LookAt>"
)
_AFTER = "<waitForActions>1</waitForActions>"
_ACTS = {
    "Greet": _SPEECH.format(""),
    "Look": _GAZE.format(""),
    "Both": _SPEECH.format("") + _GAZE.format(""),
    "Chain": _SPEECH.format("") + _GAZE.format(_AFTER),
    "Anyway": _SPEECH.format("<onFailure>continue</onFailure>") + _GAZE.format(_AFTER),
}
_RULE = (
    '<InteractionRule name="Watch" initial="a"><State id="a">'
    + "".join(
        f'<transition eventTopic="{act}_end"><function assignValue="ends = ends + 1"/></transition>'
        f'<transition eventTopic="{act}_stopped"><function assignValue="stopped = stopped + 1"/></transition>'
        f'<transition eventTopic="{act}_failed"><function assignValue="failed = failed + 1"/></transition>'
        for act in _ACTS
    )
    + "</State></InteractionRule>"
)


@cache
def _scenario() -> Scenario:
    with tempfile.TemporaryDirectory() as folder:
        acts = "".join(f'<Dialog name="{name}">{actions}</Dialog>' for name, actions in _ACTS.items())
        memory = {"ends": 0, "stopped": 0, "failed": 0}
        loaded, findings = load(write(Path(folder), acts=acts, rules=_RULE, memory=memory))
        assert loaded is not None, findings
        return loaded


def scenario(robot: RobotProfile) -> Scenario:
    """Acts that speak and look, and a rule that counts their ends."""
    return msgspec.structs.replace(_scenario(), robot=robot, mode="real")


def profile(**deadlines: float) -> RobotProfile:
    """A robot with two action servers."""
    core = core_actions()
    carriers: dict[str, dict[str, Any]] = {
        "Speech": {
            "action": "pepper/rise/speech",
            "type": TYPES[SPEECH],
            "goal": {"message": "{message}"},
            "error": {"text": "reason"},
        },
        "LookAt": {"action": "/pepper/rise/look_at", "type": TYPES[GAZE], "goal": {"duration": "{duration}"}},
    }
    actions = {
        name: msgspec.structs.replace(spec, carrier=carriers.get(name, {}), supported=spec.engine or name in carriers)
        for name, spec in core.items()
    }
    return RobotProfile("pepper", "Pepper", "ros2", actions, {"deadlines": deadlines} if deadlines else {})


class Records:
    """A session by its engine and what it has recorded."""

    engine: Engine
    records: list[AnyRecord]

    # --- the session ---

    def submit(self, function: str, behavior: str = "", calling: str = "") -> None:
        self.engine.accept(Submit(function=function, behavior=behavior, calling_type=calling, source="wizard:test"))

    def act(self, name: str = "Greet", calling: str = "") -> None:
        self.submit("startCommunicationRobotAct", name, calling)

    def stop_act(self, name: str = "Greet") -> None:
        self.submit("stopCommunicationRobotAct", name)

    def stop_all(self) -> None:
        self.submit("stopAll")

    # --- what was recorded ---

    def of(self, kind: type) -> list[Any]:
        return [record for record in self.records if isinstance(record, kind)]

    def history(self, action: str) -> list[str]:
        """The statuses of an action, `task/action`."""
        return [r.status for r in self.of(ActionRecord) if f"{r.task}/{r.action}" == action]

    def ending(self, action: str) -> str:
        """How an action ended: `failed: rejected: ...`; empty: not yet."""
        for record in self.of(ActionRecord):
            if f"{record.task}/{record.action}" == action and record.status in ENDINGS:
                return f"{record.status}: {record.reason}" if record.reason else str(record.status)
        return ""

    def ended_at(self, action: str) -> float:
        """When."""
        return next(
            float(r.t) for r in self.of(ActionRecord) if f"{r.task}/{r.action}" == action and r.status in ENDINGS
        )

    def task(self, name: str = "Greet") -> str:
        """The status of the latest task of an act."""
        return [r.status for r in self.of(TaskRecord) if r.behavior == name][-1]

    def notes(self) -> list[str]:
        return [record.text for record in self.of(NoteRecord)]

    def robot_statuses(self) -> list[str]:
        return [record.status for record in self.of(RobotRecord)]

    def memory(self, key: str) -> Any:
        return ([r.value for r in self.of(MemoryRecord) if r.key == key] or [None])[-1]

    def stops(self) -> list[StopRecord]:
        return [record for record in self.of(StopRecord) if record.status == "latched"]

    def check(self) -> None:
        """What holds whatever happened: every act that is over said so once, and every action ended once."""
        assert self.engine.idle
        assert_one_ending_each(self.records)
        over = Counter(
            r.behavior
            for r in self.of(TaskRecord)
            if r.behavior in _ACTS
            and r.function == "startCommunicationRobotAct"
            and r.status in ("SUCCEEDED", "ABORTED", "CANCELED")
        )
        said = Counter(
            r.topic.strip("/").removesuffix("_end") for r in self.of(EventRecord) if r.topic.endswith("_end")
        )
        assert said == over


class Bench(Records):
    """`plans` by server: what becomes of the goals that it gets."""

    def __init__(
        self,
        speech: Sequence[Plan] = (Plan(),),
        gaze: Sequence[Plan] = (Plan(),),
        *,
        robot: bool = True,
        **deadlines: float,
    ) -> None:
        self.clock = VirtualClock()
        self.loop = ClockLoop(self.clock)
        self.wire = MemoryWire()
        self.transport = MemoryTransport(self.wire, self.loop, "/engine")
        self.plans: dict[str, Sequence[Plan]] = {SPEECH: speech, GAZE: gaze}
        self.servers: dict[str, BadServer] = {}
        self.node: MemoryTransport | None = None
        if robot:
            self.robot_appears()
        which = profile(**deadlines)
        self.robot = Ros2Robot(which, self.clock, self.transport, read_mappings(which, self.transport.fields))
        self.records = []
        self.engine = Engine(scenario(which), self.robot, self.clock, 1, sinks=[self.records.append])
        self.engine.start()
        self.submit("startInteractionRule", "Watch")

    # --- the robot ---

    def robot_appears(self, *names: str, node: str = "/robot") -> MemoryTransport:
        """Its servers, or some of them. They know nothing of goals that others had before them."""
        transport = MemoryTransport(self.wire, self.loop, node)
        for name in names or TYPES:
            self.servers[name] = BadServer(transport, name, TYPES[name], self.loop.call_later, self.plans[name])
        self.node = transport
        return transport

    def robot_leaves(self) -> None:
        """With a goodbye, as on SIGTERM."""
        assert self.node is not None
        self.node.close()

    @property
    def speech(self) -> BadServer:
        return self.servers[SPEECH]

    @property
    def gaze(self) -> BadServer:
        return self.servers[GAZE]

    # --- time ---

    def run(self, until: float) -> None:
        """Let time pass until then (session time)."""
        self.loop.run_until(until)

    def run_until(self, happened: Callable[[], object], limit: float = 100.0) -> float:
        """Let time pass until that has happened; how much has."""
        began = self.clock.now()
        while not happened():
            assert self.clock.now() < began + limit, "it did not happen"
            assert self.clock.advance()
        return self.clock.now() - began


def heard(bench: Bench, topic: str) -> int:
    """How often an event was raised."""
    return sum(record.topic.strip("/") == topic for record in bench.of(EventRecord))
