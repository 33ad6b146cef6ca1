"""What the console knows: the engine's view, and what it has asked for that the engine has not yet answered.

A read model without any screen. Panes read it; only `Session` and the screens change it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from secrets import token_hex
from typing import Any, Literal, TypeAlias

from msgspec import Struct

from rise_engine.kernel.records import (
    AnyRecord,
    ControlRecord,
    EventRecord,
    MemoryRecord,
    NoteRecord,
    RobotRecord,
    RuleRecord,
    SessionRecord,
    StopRecord,
    TaskRecord,
)
from rise_engine.link.client import Hello, Journaling, Update
from rise_engine.scenario.model import KeyBinding, Scenario, normal_topic
from rise_engine.view import ActView, RuleView, View
from rise_tui import control
from rise_tui.graph import estimate
from rise_tui.notice import Notice
from rise_tui.text import value_text

Topic: TypeAlias = Literal["acts", "rules", "memory", "tasks", "status", "stop", "notice"]
"""What a batch of records changed; a pane says which of these it shows."""

EVERYTHING: frozenset[Topic] = frozenset({"acts", "rules", "memory", "tasks", "status", "stop", "notice"})

_TOPICS: dict[type, frozenset[Topic]] = {
    MemoryRecord: frozenset({"memory"}),
    RuleRecord: frozenset({"rules"}),
    StopRecord: frozenset({"stop", "status"}),
    RobotRecord: frozenset({"status"}),
    SessionRecord: frozenset({"status"}),
    EventRecord: frozenset({"tasks"}),
    NoteRecord: frozenset(),
    ControlRecord: frozenset({"status"}),
}
_ACT_OR_TASK: frozenset[Topic] = frozenset({"acts", "rules", "tasks"})

FUNCTION_WORDS = {
    "startCommunicationRobotAct": "act",
    "stopCommunicationRobotAct": "stop act",
    "startInteractionRule": "rule",
    "stopInteractionRule": "stop rule",
    "raiseEventTopic": "event",
    "assignValue": "set",
    "deleteValue": "delete",
    "cancelTask": "cancel",
    "moveTask": "move",
    "stopAll": "STOP ALL",
    "releaseStop": "release",
}
"""A task's function in a word or two."""

JUST = 1.0
"""Seconds after its start in which what a rule does counts as the deed of the wizard who started it."""


BACK = "the connection was cut and is back; what was sent meanwhile may or may not have arrived: look at the log"
BACK_STOPPING = "the connection was cut and is back; STOP may not have arrived: press F9 again unless it says STOPPED"


class Sent(Struct, frozen=True):
    """Something asked for, until the engine's record of it arrives (law 3)."""

    function: str
    behavior: str
    at: float


@dataclass
class Store:
    """One console's knowledge of one session."""

    hello: Hello
    wizard: str
    now: Callable[[], float]
    """Session time in seconds."""
    view: View = field(init=False)
    refs: str = field(default_factory=lambda: f"{token_hex(3)}-")
    """How this console's own references begin; a second console of the same wizard has others."""
    sent: dict[str, Sent] = field(default_factory=dict)
    """By the console's own reference."""
    log: list[int] = field(default_factory=list)
    """Task ids in order of arrival."""
    notice: Notice | None = None
    gone: str = ""
    """Why the session is over or the engine has gone; empty while it lives."""
    over: bool = False
    """The session came to its end in order. With `gone` and not this, the engine has gone without one."""
    cut: float | None = None
    """Since when this connection has been cut, on a clock of the console's own; None while it holds."""
    unstopped: bool = False
    """The stop key was pressed while it could not be sent."""
    journaling: Journaling = field(init=False)
    taken: control.Taken | None = None
    """Control was taken from this console, and the wizard has pressed no key since that showed."""
    reclaims: bool = False
    """It had control when the connection was cut, and nobody else has it now, but perhaps its own cut connection."""
    attached: int = 0
    """How often this console has attached again; lists that were built step by step start anew."""
    armed: str = ""
    """The act whose first of two keys was pressed."""
    act_shown: str = ""
    rule_shown: str = ""
    deleted: tuple[str, Any] | None = None
    """The memory key that the wizard deleted last, and its value."""

    missed: list[int] = field(default_factory=list)
    """Tasks that raised an event for which nobody was waiting, in the order in which that came out."""

    _raised: dict[tuple[str, str], list[int]] = field(default_factory=dict)
    """Tasks that raised an event, by topic and source, until the event's own record tells what became of it."""
    _keys: dict[tuple[str, str], KeyBinding] = field(default_factory=dict)
    _estimates: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for key in reversed(self.scenario.keys.values()):  # of several, the first of the file
            self._keys[key.function, key.behavior.strip().lstrip("/")] = key
        self._take_in(self.hello)
        self.act_shown = self.view.tasks[self.view.running[-1]].behavior if self.view.running else ""
        self.rule_shown = next(iter(self.view.stack()), "")

    def attach_again(self, hello: Hello) -> None:
        """The connection was cut and is back: the truth is in the new snapshot."""
        had, stopping, self.cut, self.unstopped = self.has_control, self.stopping, None, False
        ghost = self.me
        self.sent.clear()
        self.attached += 1
        self._take_in(hello)
        self.reclaims = had and not self.has_control and self.view.control in (None, ghost)
        if had and not self.has_control and not self.reclaims:
            self.taken = control.Taken(self.view.control, None)
        self.notice = Notice(BACK_STOPPING, "fault") if stopping else Notice(BACK, "wait")

    def _take_in(self, hello: Hello) -> None:
        self.hello, self.view, self.journaling = hello, hello.view, hello.journaling
        self.log[:] = self.view.tasks
        self.missed.clear()
        self._raised.clear()

    @property
    def scenario(self) -> Scenario:
        return self.hello.scenario

    @property
    def memory(self) -> Mapping[str, Any]:
        """The working memory as expressions and templates read it."""
        return {key: entry.value for key, entry in self.view.memory.items()}

    @property
    def stopping(self) -> bool:
        """True from the press of the stop key on, before the engine has answered."""
        return any(sent.function == "stopAll" for sent in self.sent.values())

    @property
    def state(self) -> Literal["LIVE", "STOPPED"]:
        return "STOPPED" if self.view.stop.latched or self.stopping else "LIVE"

    @property
    def me(self) -> str:
        """How the session calls this console."""
        return self.hello.you or f"wizard:{self.wizard}"

    @property
    def has_control(self) -> bool:
        """Whether this console may act. An engine that gives no names has one console only."""
        return not self.hello.you or self.view.control == self.hello.you

    @property
    def asker(self) -> str | None:
        """Who waits for this console's answer to the question for control."""
        return self.view.asked if self.has_control and self.view.asked != self.me else None

    def unavailable(self) -> str:
        """Why nothing can be asked of the engine now, or empty."""
        if self.gone:
            return f"the session is over: {self.gone}" if self.over else f"the engine has gone: {self.gone}"
        return "the connection is cut; the console is attaching again" if self.cut is not None else ""

    def cannot_tell(self) -> str:
        """Why not even a note can be sent now, or empty."""
        return self.unavailable() or ("this is a replay" if self.hello.replay else "")

    def cannot_act(self) -> str:
        """Why nothing can be changed from here now, or empty."""
        return self.cannot_tell() or ("" if self.has_control else control.why_not(self.view.control, self.hello.role))

    def cannot_start(self) -> str:
        """Why nothing can be started now, or empty."""
        if reason := self.cannot_act():
            return reason
        if self.journaling.trouble:
            return f"NOT RECORDING, the session is paused: {self.journaling.trouble}"
        return "STOPPED: ctrl+r releases the stop" if self.state == "STOPPED" else ""

    def act(self, name: str) -> ActView:
        return self.view.acts.get(name) or ActView()

    def typical(self, name: str) -> float | None:
        """How long an act takes: the mean of its runs so far, or an estimate before the first."""
        measured = self.act(name).typical
        if measured is None and name in self.scenario.acts:
            if name not in self._estimates:
                self._estimates[name] = estimate(self.scenario, self.scenario.acts[name])
            return self._estimates[name]
        return measured

    def rule(self, name: str) -> RuleView:
        return self.view.rules.get(name) or RuleView()

    def key_of(self, function: str, behavior: str) -> KeyBinding | None:
        """The scenario's key that submits this, if there is one."""
        return self._keys.get((function, behavior.strip().lstrip("/")))

    def is_sent(self, functions: Sequence[str], behavior: str) -> bool:
        return any(sent.function in functions and sent.behavior == behavior for sent in self.sent.values())

    def apply(self, updates: Sequence[Update]) -> set[Topic]:
        """Take a batch in; returns what changed."""
        changed: set[Topic] = set()
        for record in updates:
            if isinstance(record, Journaling):
                changed |= self._journaling(record)
                continue
            if isinstance(record, TaskRecord):
                self._task(record)
            holder = self.view.control
            self.view.apply(record)
            self._tell(record)
            if isinstance(record, ControlRecord) and self.hello.you:
                notice, taken = control.told(record, holder, self.hello.you)
                # A sentence about who had control before would now be wrong.
                self.notice = notice or (None if taken else self.notice)
                self.taken = taken or (None if self.has_control else self.taken)
            if isinstance(record, EventRecord):
                self._event(record)
            changed |= _TOPICS.get(type(record), _ACT_OR_TASK)
        if self.notice is not None:
            changed.add("notice")
        return changed

    def _journaling(self, now: Journaling) -> frozenset[Topic]:
        """How the record stands; nothing is painted for what nobody would see."""
        before, self.journaling = self.journaling, now
        if before.trouble and not now.trouble:
            self.notice = Notice("the disk takes records again: the session goes on")
        shown = before.trouble != now.trouble or int(before.behind) != int(now.behind)
        return frozenset({"status"}) if shown else frozenset()

    def _task(self, record: TaskRecord) -> None:
        if record.id not in self.view.tasks:
            self.log.append(record.id)
        if record.ref is not None:
            self.sent.pop(record.ref, None)
            own = record.ref.startswith(self.refs)
            if own and record.status == "SUCCEEDED" and (text := done(record.function, record.behavior)):
                self.notice = Notice(text)
        if record.status == "SUCCEEDED" and record.function == "raiseEventTopic":
            self._raised.setdefault((normal_topic(record.behavior), record.source), []).append(record.id)
        if record.status == "ACTIVE" and record.function == "startCommunicationRobotAct":
            self.act_shown = record.behavior
        elif record.status == "ACTIVE" and record.function == "startInteractionRule" and not self.rule_shown:
            self.rule_shown = record.behavior

    def _event(self, record: EventRecord) -> None:
        """An event found its rule, or nobody."""
        which = normal_topic(record.topic), record.source
        ids = self._raised.get(which, [])
        task = ids.pop(0) if ids else None
        if not ids:
            self._raised.pop(which, None)
        if record.taken_by is not None:
            return
        if task is not None:
            self.missed.append(task)
        if self._by_wizard(record):
            self.notice = Notice(f"{record.topic}: nobody was waiting for it", "wait")

    def _by_wizard(self, record: EventRecord) -> bool:
        """Whether a wizard raised it: directly, or by a rule that a wizard has just started."""
        kind, _, name = record.source.partition(":")
        if kind != "rule":
            return kind == "wizard"
        task = self.view.tasks.get(self.rule(name).task or 0)
        if task is None or not task.source.startswith("wizard:"):
            return False
        return record.t - (task.started if task.started is not None else task.submitted) <= JUST

    def _tell(self, record: AnyRecord) -> None:
        match record:
            case TaskRecord(status="REJECTED"):
                self.notice = Notice(
                    f"{describe(record.function, record.behavior)} was rejected: {record.reason}", "wait"
                )
            case TaskRecord(status="ABORTED"):
                self.notice = Notice(f"{describe(record.function, record.behavior)} failed: {record.reason}", "fault")
            case RuleRecord(status="faulted"):
                self.notice = Notice(f"rule {record.name} was stopped by a fault: {record.reason}", "fault")
            case NoteRecord(source="engine"):
                self.notice = Notice(record.text, "wait")
            case NoteRecord():
                self.notice = Notice(f"note by {control.short(record.source)}: {record.text}")
            case RobotRecord(status="lost" | "degraded"):
                self.notice = Notice(f"robot {record.status}: {record.detail}", "fault")
            case StopRecord(status="released"):
                self.notice = Notice("the stop is released: LIVE")
            case _:
                pass


def describe(function: str, behavior: str) -> str:
    """A task in words."""
    return f"{FUNCTION_WORDS.get(function, function)} {behavior}".strip()


def done(function: str, behavior: str) -> str:
    """What a task without any row of its own has done, in words; empty for others."""
    match function:
        case "raiseEventTopic":
            return f"raised {normal_topic(behavior)}"
        case "assignValue":
            try:
                values = json.loads(behavior)
            except (ValueError, RecursionError):
                return behavior.strip()
            if not isinstance(values, dict):
                return behavior.strip()
            return ", ".join(f"{key} = {value_text(value)}" for key, value in values.items())
        case _:
            return ""
