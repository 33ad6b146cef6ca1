"""A kernel with somebody to play the world: the robot's answers, the clock, the wizard."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import CancelAction, CancelTimer, SetTimer, StartAction, StopRobot
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    EstopReport,
    RobotChanged,
    SessionStarted,
    StopReport,
    Submit,
    TimerElapsed,
)
from rise_engine.kernel.records import (
    ENDINGS,
    ActionRecord,
    AnyRecord,
    ConditionRecord,
    EventRecord,
    MemoryRecord,
    NoteRecord,
    RobotRecord,
    RuleRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.kernel.view import SessionView
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario

SHORT = {
    "startCommunicationRobotAct": "act",
    "stopCommunicationRobotAct": "stop-act",
    "startInteractionRule": "rule",
    "stopInteractionRule": "stop-rule",
    "raiseEventTopic": "raise",
    "assignValue": "assign",
}


def write(
    folder: Path,
    *,
    acts: str = "",
    rules: str = "",
    memory: dict[str, Any] | None = None,
    toml: str = "",
    tables: dict[str, str] | None = None,
) -> Path:
    """Write a scenario folder from the inside of its files."""
    for name, content, wrapper in (("acts", acts, "Dialogs"), ("rules", rules, "InteractionRules")):
        (folder / name).mkdir(parents=True, exist_ok=True)
        (folder / name / "all.xml").write_text(f"<{wrapper}>{content}</{wrapper}>", encoding="utf-8")
    (folder / "memory.json").write_text(json.dumps(memory or {}), encoding="utf-8")
    (folder / "scenario.toml").write_text(toml, encoding="utf-8")
    for name, content in (tables or {}).items():
        (folder / "tables").mkdir(exist_ok=True)
        (folder / "tables" / f"{name}.csv").write_text(content, encoding="utf-8")
    return folder


def read(folder: Path) -> Scenario:
    scenario, findings = load(folder)
    assert scenario is not None, "\n".join(map(str, findings))
    return scenario


def speech(id: int | str, text: str = "Hello", wait: str = "", more: str = "") -> str:
    waits = f"<waitForActions>{wait}</waitForActions>" if wait else ""
    return f"<Speech><actionID>{id}</actionID>{waits}<message>{text}</message>{more}</Speech>"


def pause(id: int | str, ms: int, wait: str = "") -> str:
    waits = f"<waitForActions>{wait}</waitForActions>" if wait else ""
    return f"<Wait><actionID>{id}</actionID>{waits}<duration>{ms}</duration></Wait>"


def gaze(id: int | str, wait: str = "") -> str:
    waits = f"<waitForActions>{wait}</waitForActions>" if wait else ""
    point = "<pointx>1</pointx><pointy>0</pointy><pointz>0</pointz>"
    return f"<LookAt><actionID>{id}</actionID>{waits}{point}</LookAt>"


def dialog(name: str, *actions: str) -> str:
    return f'<Dialog name="{name}">{"".join(actions)}</Dialog>'


class Session:
    """Drives a kernel by hand. `lines()` gives what has been recorded since it was last asked, one short line each."""

    def __init__(
        self, scenario: Scenario, seed: int = 1, kernel: Kernel | None = None, started: SessionStarted | None = None
    ) -> None:
        self.scenario = scenario
        self.kernel = kernel or Kernel(scenario, seed)
        self.t = 0.0
        self.records: list[AnyRecord] = []
        self.goals: dict[str, StartAction] = {}
        """What the robot was given and has not ended, by goal id."""
        self.cancels: list[str] = []
        self.robot_stops = 0
        self.timers: dict[int, float] = {}
        self._seen = 0
        if kernel is None:
            self.do(started or SessionStarted())
            self._seen = len(self.records)

    # --- the world ---

    def do(self, input: AnyInput) -> list[AnyRecord]:
        import msgspec

        records, commands = self.kernel.handle(msgspec.structs.replace(input, t=self.t))
        self.records += records
        for command in commands:
            match command:
                case StartAction():
                    assert command.action not in self.goals
                    self.goals[command.action] = command
                case CancelAction():
                    self.cancels.append(command.action)
                case StopRobot():
                    self.robot_stops += 1
                case SetTimer():
                    assert command.at >= self.t
                    self.timers[command.timer] = command.at
                case CancelTimer():
                    del self.timers[command.timer]
        for record in records:
            if isinstance(record, ActionRecord) and record.status in ENDINGS:
                self.goals.pop(f"{record.task}/{record.action}", None)
        return records

    def submit(self, function: str, behavior: str = "", calling_type: str = "", source: str = "wizard:w") -> TaskRecord:
        records = self.do(Submit(function=function, behavior=behavior, calling_type=calling_type, source=source))
        first = next(record for record in records if isinstance(record, TaskRecord))
        assert (first.function, first.behavior) == (function, behavior)
        return first

    def act(self, name: str, calling_type: str = "") -> TaskRecord:
        return self.submit("startCommunicationRobotAct", name, calling_type)

    def rule(self, name: str) -> TaskRecord:
        return self.submit("startInteractionRule", name)

    def event(self, topic: str) -> TaskRecord:
        return self.submit("raiseEventTopic", topic)

    def assign(self, text: str) -> TaskRecord:
        return self.submit("assignValue", text)

    def report(self, goal: str, status: Any = "succeeded", reason: str = "") -> None:
        self.do(ActionReport(action=goal, status=status, reason=reason))

    def robot(self, status: Any, detail: str = "") -> None:
        self.do(RobotChanged(status=status, detail=detail))

    def confirm_stop(self, *confirmed: str, unconfirmed: tuple[str, ...] = ()) -> None:
        self.do(StopReport(confirmed=confirmed, unconfirmed=unconfirmed))

    def estop(self, source: str, *, pressed: bool = True) -> None:
        self.do(EstopReport(source=source, pressed=pressed))

    def wait(self, seconds: float) -> None:
        """Let time pass; timers go off in order."""
        until = round(self.t + seconds, 6)
        while self.timers:
            timer, at = min(self.timers.items(), key=lambda item: (item[1], item[0]))
            if at > until:
                break
            del self.timers[timer]
            self.t = at
            self.do(TimerElapsed(timer=timer))
        self.t = until

    def finish_all(self) -> None:
        """The robot succeeds with everything, also with what that starts."""
        while self.goals:
            self.report(next(iter(self.goals)))

    # --- what was recorded ---

    def lines(self, *kinds: str) -> list[str]:
        new, self._seen = self.records[self._seen :], len(self.records)
        return [line for record in new if (line := short(record)) and (not kinds or line.split()[0] in kinds)]

    @property
    def states(self) -> dict[str, str]:
        return {name: run.state.id for name, run in self.kernel.rules.stack.items()}

    @property
    def stack(self) -> list[str]:
        """Top first."""
        return list(reversed(self.kernel.rules.stack))

    @property
    def memory(self) -> dict[str, Any]:
        return self.kernel.core.memory


def short(record: AnyRecord) -> str:
    match record:
        case TaskRecord():
            reason = f" ({record.reason})" if record.reason else ""
            return f"task {SHORT.get(record.function, record.function)} {record.behavior} {record.status}{reason}"
        case ActionRecord():
            reason = f" ({record.reason})" if record.reason else ""
            return f"action {record.act}/{record.action} {record.status}{reason}"
        case RuleRecord():
            came = f" from {record.previous} on {record.trigger}" if record.previous else ""
            return f"rule {record.name} {record.status} {record.state}{came}"
        case EventRecord():
            return f"event {record.topic} -> {record.taken_by}"
        case ConditionRecord():
            error = f" ({record.error})" if record.error else ""
            return f"condition {record.rule} {record.expression} {json.dumps(record.values)} {record.result}{error}"
        case MemoryRecord():
            return f"memory {record.key} {json.dumps(record.old)} -> {json.dumps(record.value)}"
        case RobotRecord():
            return f"robot {record.status}"
        case StopRecord():
            estop = record.source.startswith("estop:")
            by = f" by {record.source}" * estop + "".join(f" [{each}]" for each in record.held_by)
            return f"stop {record.status} {list(record.confirmed)} {list(record.unconfirmed)}{by}"
        case NoteRecord():
            return f"note {record.text}"
        case _:
            return ""


def folded(records: Iterable[AnyRecord]) -> SessionView:
    """The state of a session, from its records alone."""
    view = SessionView()
    for record in records:
        view.apply(record)
    return view


def view_of(s: Session) -> SessionView:
    return folded(s.records)
