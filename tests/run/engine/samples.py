"""Scenarios made in code, for tests that need no files, and what can be read off a session's records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import ENDINGS, ActionRecord, AnyRecord
from rise_engine.scenario.model import Act, Action, ActionCall, RobotProfile, Scenario
from rise_engine.scenario.reading.action_declarations import core_actions
from rise_engine.scenario.speech.template import parse_template


def profile(name: str = "generic", driver: str = "simulated", **options: Any) -> RobotProfile:
    return RobotProfile(name, name.capitalize(), driver, dict(core_actions()), options)


def call(kind: str, **parameters: object) -> ActionCall:
    return ActionCall(kind, {name: parse_template(str(value)) for name, value in parameters.items()})


def act(name: str, *actions: Action) -> Act:
    specs = core_actions()
    channels = {channel for action in actions for each in action.calls for channel in specs[each.type].channels}
    return Act(name, actions, frozenset(channels))


def speech(action: str, text: str = "Hello there", wait: tuple[str, ...] = ()) -> Action:
    return Action(action, (call("Speech", message=text),), wait)


def gaze(action: str, wait: tuple[str, ...] = (), duration: int = 1000) -> Action:
    return Action(action, (call("LookAt", pointx=1, pointy=0, pointz=0, duration=duration),), wait)


def scenario(*acts: Act, robot: RobotProfile | None = None) -> Scenario:
    return Scenario("Sample", "/nowhere", "debug", robot or profile(), {each.name: each for each in acts}, {}, {})


GREETING = act("Greet", speech("1"), gaze("2", ("1",)), speech("3", "How are you?", ("1",)))


def start(name: str, calling_type: str = "", source: str = "wizard:test") -> Submit:
    return Submit(function="startCommunicationRobotAct", behavior=name, calling_type=calling_type, source=source)


def endings(records: Iterable[AnyRecord]) -> Counter[str]:
    """How often each action ended: `task/action` -> number of ending records."""
    return Counter(f"{r.task}/{r.action}" for r in records if isinstance(r, ActionRecord) and r.status in ENDINGS)


def assert_one_ending_each(records: Iterable[Mapping[str, Any]] | Iterable[AnyRecord]) -> None:
    """Exactly one ending for every action that was started, whatever happened. Takes records or their JSON."""
    begun: set[str] = set()
    ended: Counter[str] = Counter()
    for record in records:
        if isinstance(record, Mapping):
            if record["kind"] != "action":
                continue
            key, status = f"{record['task']}/{record['action']}", record["status"]
        elif isinstance(record, ActionRecord):
            key, status = f"{record.task}/{record.action}", record.status
        else:
            continue
        if status == "started":
            assert key not in begun, f"{key} was started twice"
            begun.add(key)
        elif status in ENDINGS:
            ended[key] += 1
    assert all(number == 1 for number in ended.values()), ended
    assert begun <= set(ended), f"without ending: {begun - set(ended)}"
