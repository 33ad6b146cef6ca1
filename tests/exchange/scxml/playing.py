"""One rule, played by the kernel and by a document in SCION, on the same inputs.

The kernel is driven by a script of inputs. What comes to the rule from outside in its session (events, changes of the
memory) is written down as a *feed*, with the place at which it came among the rule's functions, and handed to the
document; what each of them does are *lines*: states entered, functions in their order, the end, and when the times are
up that are being counted.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import pytest
from rise_exchange.scxml.export import event_name, export_rule, key_name
from rise_exchange.scxml.limits import RuleAnalysis

from rise_engine.kernel.behaviors import read_rule_start
from rise_engine.kernel.core import EventTopic
from rise_engine.kernel.inputs import AnyInput, TimerElapsed
from rise_engine.kernel.kept_events import KEPT_OFFER
from rise_engine.kernel.records import AnyRecord, EventRecord, MemoryRecord, RuleRecord, TaskRecord
from rise_engine.scenario.model import Rule, Scenario
from tests.kernel.harness import Session

RUNNER = Path(__file__).with_name("scion_runner.js")
VARIABLE = "RISE_SCION"
SEED = 1

Script = list[list[Any]]
"""Inputs: `["event", topic]`, `["set", key, value]`, `["delete", key]`, `["act", name]`, `["end", which, status]`,
`["wait", seconds]`, `["rule", name]`."""
Line = list[Any]
Steps = list[list[Line]]


@dataclass
class Played:
    """What the kernel did with a script."""

    steps: list[dict[str, Any]]
    """The feed for a document, step by step."""
    lines: Steps
    """What the rule did in each."""
    faulted: bool = False
    """Whether it went round in circles, and the engine ended it."""


def needs_scion() -> Path:
    """The folder of node_modules with SCION, or the end of the test."""
    folder = os.environ.get(VARIABLE)
    if not folder or shutil.which("node") is None:
        pytest.skip(
            f"SCION is not here: name a folder node_modules that has @scion-scxml/scxml in {VARIABLE}, and install node"
        )
    return Path(folder)


def run_documents(modules: Path, cases: Iterable[tuple[str, list[dict[str, Any]]]]) -> list[Steps]:
    """What documents do with their feeds in SCION, as lines."""
    given = {"modules": str(modules.absolute()), "cases": [{"document": each, "steps": steps} for each, steps in cases]}
    done = subprocess.run(["node", str(RUNNER)], input=json.dumps(given), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [[[canonical(line) for line in lines] for lines in steps] for steps in json.loads(done.stdout)]


def document_of(scenario: Scenario, rule: Rule) -> str:
    return export_rule(scenario, rule, seed=SEED)


def play(scenario: Scenario, rule: Rule, script: Script) -> Played:
    """Play a script in a session in which the rule is started first."""
    session = _WatchedSession(scenario, rule)
    session.rule(rule.name)
    for kind, *given in script:
        match kind:
            case "event":
                session.event(f"/{given[0]}")
            case "set":
                session.assign(json.dumps({given[0]: given[1]}))
            case "delete":
                session.submit("deleteValue", given[0])
            case "act":
                session.act(given[0])
            case "end" if session.goals:
                session.report(list(session.goals)[given[0] % len(session.goals)], given[1])
            case "wait":
                session.wait(given[0])
    return session.played


class _WatchedSession(Session):
    """Writes down what comes to one rule, and what it does."""

    def __init__(self, scenario: Scenario, rule: Rule) -> None:
        self.rule_name = rule.name
        self._ids = {state: f"s{number}" for number, state in enumerate(rule.states)}
        self._analysis = RuleAnalysis(scenario, rule)
        self.played = Played([], [])
        self._queued: _WatchedQueue | None = None
        super().__init__(scenario, SEED)
        self.kernel.core.events = self._queued = _WatchedQueue(self._count_calls)
        rules = self.kernel.rules.compiled
        self._own_ends = {id(topic): end for end, topic in rules[rule.name].own_ends.items()}

    @property
    def _source(self) -> str:
        return f"rule:{self.rule_name}"

    def _count_calls(self) -> int:
        return len(self._calls(self.kernel.core.records))

    def _calls(self, records: list[AnyRecord]) -> set[int]:
        """The tasks that are functions of the rule, called now: what the document calls, too."""
        tasks = [each for each in records if isinstance(each, TaskRecord) and each.source == self._source]
        others = {each.id for each in tasks if each.reason.startswith("repeats task")}  # by the engine, after a failure
        others |= {each.id for each in tasks if each.function == "assignValue" and each.status == "ABORTED"}
        return {each.id for each in tasks} - others - self._known_tasks

    def do(self, input: AnyInput) -> list[AnyRecord]:
        if self._queued is None:  # the session's own beginning
            self._known_tasks: set[int] = set()
            return super().do(input)
        self._queued.appended.clear()
        timed = isinstance(input, TimerElapsed) and self._is_of_rule(input.timer)
        records = super().do(input)
        lines: list[Line] = []
        feed: list[dict[str, Any]] = []
        calls = 0
        routed = iter([record for record in records if isinstance(record, EventRecord)])
        for topic, source, after in self._queued.appended:
            if topic is not KEPT_OFFER:
                taker = next(routed).taken_by
                if self._matches_path(topic, source, taker):
                    feed.append({"name": self._name(topic), "data": None, "after": after, "first": False})
        new = self._calls(records)
        for record in records:
            match record:
                case TaskRecord() if record.id in new:
                    new.remove(record.id)
                    calls += 1
                    if record.function != "assignValue":
                        lines.append(["call", record.function, *_meaning(record)])
                case MemoryRecord() if record.source == self._source:
                    lines.append(["assignValue", record.key, record.value])
                case MemoryRecord():
                    kind = "forgotten" if record.deleted else "memory"
                    name = f"{kind}.{key_name(record.key)}"
                    feed.append({"name": name, "data": record.value, "after": calls, "first": True})
                case RuleRecord() if record.name == self.rule_name and record.status == "entered":
                    lines.append(["enter", self._ids[record.state or ""]])
                case RuleRecord() if record.name == self.rule_name and record.status == "ended":
                    lines.append(["end"])
                case RuleRecord() if record.name == self.rule_name and record.status == "faulted":
                    self.played.faulted = True
        self._known_tasks |= {record.id for record in records if isinstance(record, TaskRecord)}
        lines.append(["pending", sorted(at for timer, at in self.timers.items() if self._is_of_rule(timer))])
        self.played.steps.append({"t": self.t, "timer": timed, "feed": feed})
        self.played.lines.append([canonical(line) for line in lines])
        return records

    def wait(self, seconds: float) -> None:
        super().wait(seconds)
        self.t = round(self.t, 6)

    def _is_of_rule(self, timer: int) -> bool:
        target = self.kernel.core.timers.get(timer)
        return target is not None and target.purpose == "after" and target.owner == self.rule_name

    def _matches_path(self, topic: EventTopic, source: str, taker: str | None) -> bool:
        """Whether whoever runs the document sends it this event."""
        if source == self._source:
            return topic.name not in self._analysis.own_topics and taker == self.rule_name
        return taker in (None, self.rule_name)

    def _name(self, topic: EventTopic) -> str:
        if (end := self._own_ends.get(id(topic))) is not None:
            return f"ended.{event_name(end[0])}.{end[1]}"
        return event_name(topic.name)


class _WatchedQueue(deque[Any]):
    """The kernel's queue of events, which notes what joins it, and after how many calls of the rule."""

    def __init__(self, count_calls: Any) -> None:
        super().__init__()
        self._count_calls = count_calls
        self.appended: list[tuple[EventTopic, str, int]] = []

    def append(self, item: Any) -> None:
        self.appended.append((item[0], item[1], self._count_calls()))
        super().append(item)


def _meaning(record: TaskRecord) -> list[Any]:
    if record.function != "startInteractionRule":
        return [record.behavior]
    start = read_rule_start(record.behavior)
    return [start.rule, start.state, start.enter]


def canonical(line: Line) -> Line:
    """A line of either side in one form."""
    if line[0] == "pending":
        return ["pending", [round(at, 6) for at in line[1]]]
    if line[0] == "call" and isinstance(line[2], dict):  # as the document says it
        function, given = line[1], line[2]
        if function == "assignValue":
            line = ["assignValue", given["key"], given.get("value")]
        elif function == "startInteractionRule":
            line = ["call", function, given["behavior"], given.get("state"), given.get("enter", True)]
        else:
            line = ["call", function, given["behavior"]]
    return [_plain(each) for each in line]


def _plain(value: Any) -> Any:
    """A JSON value in which 2.0 is 2, and large whole numbers are doubles, of which JSON has several spellings."""
    if isinstance(value, int | float) and not isinstance(value, bool) and value == int(value):
        return int(value) if abs(value) <= 2**53 else float(value)
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in sorted(value.items())}
    return value


def alone(scenario: Scenario, rule: Rule) -> Scenario:
    """The scenario with one rule only: then nobody else takes its events."""
    topics = frozenset(each.event for each in RuleAnalysis(scenario, rule).transitions if each.event is not None)
    return msgspec.structs.replace(scenario, rules={rule.name: rule}, topics=topics)
