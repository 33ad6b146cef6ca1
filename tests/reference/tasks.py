"""Everything is a task (semantics.md 1)."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from rise_engine.expression import Assignment, EvaluationError, ExpressionError
from rise_engine.kernel.inputs import Submit

from .session import Session

STARTS_ACT = "startCommunicationRobotAct"
STARTS_RULE = "startInteractionRule"


@dataclass(eq=False)
class Task:
    """What somebody asked for."""

    id: int
    function: str
    behavior: str
    calling_type: str
    source: str
    ref: str | None = None
    key_at: float | None = None
    accepted_at: float = 0.0
    act: str = ""
    """The act that it starts."""
    started_at: float | None = None
    robot_at: float | None = None
    voice_at: float | None = None
    bridged: bool = False
    """Whether it is a filler that started while a cue was open."""
    cue_at: float | None = None
    refused: bool = False
    follows: bool = False
    """Whether it is part of what another task of somebody does."""
    again: bool = False
    """Whether it repeats another one."""
    cause: int | None = None
    """What led to it, of something that a rule asks for (semantics.md 4.5)."""
    via: list[str] = field(default_factory=list)


class Refused(Exception):
    """A task that cannot be done, and why."""


class Failed(Exception):
    """A task that was tried and failed."""


class Tasks:
    """Submits them."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.all: dict[int, Task] = {}

    def record(self, task: Task, status: str, reason: str = "", position: int | None = None) -> None:
        """Write down how a task is going."""
        self.session.put(
            "task",
            id=task.id,
            function=task.function,
            behavior=task.behavior,
            calling_type=task.calling_type,
            source=task.source,
            status=status,
            reason=reason,
            position=position,
            ref=task.ref,
            cause=task.cause,
            via=task.via,
            key_at=self.session.pressed if task.id == self.session.origin else None,
        )

    def submit(self, asked: Submit) -> None:
        """Do what is asked, or say why not."""
        session = self.session
        if asked.pressed is not None:
            session.pressed = min(asked.pressed, session.now)
        with suppress(Failed):
            self.new(asked.function, asked.behavior, asked.calling_type, asked.source, asked.ref)

    def new(
        self,
        function: str,
        behavior: str = "",
        calling_type: str = "",
        source: str = "engine",
        ref: str | None = None,
        cause: int | None = None,
    ) -> Task:
        """A task of anybody. Gives it with its number, also when it was refused or has failed."""
        task = self.numbered(function, behavior, calling_type, source, ref)
        task.cause = task.cause if cause is None else cause
        if function != STARTS_ACT:
            task.calling_type = calling_type or "None"
        try:
            self._do(task, calling_type)
        except Refused as why:
            task.refused = True
            self.find_cause(task)
            self.record(task, "REJECTED", str(why))
        return task

    def numbered(self, function: str, behavior: str, calling_type: str, source: str, ref: str | None = None) -> Task:
        """A task with the next number."""
        session = self.session
        task = Task(len(self.all) + 1, function, behavior, calling_type, source, ref, session.pressed, session.now)
        self.all[task.id] = task
        task.cue_at = session.marks.cue_at
        if function in (STARTS_ACT, STARTS_RULE, "say"):
            self.find_cause(task)
        return task

    def find_cause(self, task: Task) -> None:
        """Of what a rule asks for: back along the steps to what began it, which is the input's task, or a kept event's,
        or that of an act that was lost with the robot."""
        kind, _, asking = task.source.partition(":")
        if kind != "rule":
            return
        way: list[str] = []
        at = self.session.rules.step
        while at is not None and at.task is None:
            way.insert(0, at.rule)
            at = at.cause
        way = [each for number, each in enumerate(way) if each != asking and each not in way[:number]]
        task.cause, task.via = (self.session.origin if at is None else at.task), way

    def _do(self, task: Task, calling_type: str) -> None:
        session = self.session
        match task.function:
            case "startCommunicationRobotAct":
                session.scheduler.start_act(task)
            case "stopCommunicationRobotAct":
                session.scheduler.stop_act(task)
            case "startInteractionRule":
                session.rules.start_rule(task)
            case "stopInteractionRule":
                session.rules.stop_rule(task)
            case "raiseEventTopic":
                topic, seconds = session.kept.read(task.behavior)
                if not topic:
                    raise Refused("the event has no name")
                if seconds is not None and task.behavior.strip().startswith("{"):
                    task.behavior = json.loads(task.behavior)["event"]
                if seconds is not None:
                    session.kept.raise_event(task, topic, seconds)
                else:
                    self.record(task, "SUCCEEDED")
                    session.rules.raise_event(topic, task.source)
            case "assignValue":
                self._assign(task)
            case "deleteValue":
                if task.behavior not in session.memory.values or session.memory.why_not_set(task.behavior):
                    raise Refused("there is no such key")
                self.record(task, "SUCCEEDED")
                session.memory.delete(task.behavior, task.source)
            case "cancelTask":
                self._cancel(task)
            case "moveTask":
                session.scheduler.move(task)
            case "stopAll":
                session.stop.stop_all(task)
            case "releaseStop":
                session.stop.release(task)
            case "cancelOpenGoals" | "releaseOpenGoals":
                holding = {goal["part"] for goal in session.acts.open if goal["holds"]}
                if not holding or task.behavior not in ("", *holding):
                    raise Refused("nothing of that is open")
                self.record(task, "SUCCEEDED")
                session.orders.append((task.function, task.behavior))
            case "say":
                session.scheduler.say(task, calling_type)
            case "markCue":
                session.marks.mark_cue(task)
            case "undoCue":
                session.marks.undo_cue(task)
            case "nextFiller":
                session.marks.next_filler(task)
            case "markMistake":
                session.marks.mark_mistake(task)
            case "goOn":
                session.marks.go_on(task)
            case "stepBack":
                session.going_on.step_back(task)
            case "repeatAct":
                session.failures.repeat(task)
            case "stopRuleOfAct":
                session.failures.stop_rule(task)
            case _:
                raise Refused("there is no such function")

    def _assign(self, task: Task) -> None:
        try:
            changes = Assignment.parse_all(task.behavior)
        except ExpressionError as error:
            raise Refused(str(error)) from None
        if any(self.session.memory.why_not_set(change.key) for change in changes):
            if not task.source.startswith("rule:"):
                raise Refused("nobody may set that")
            self.record(task, "ABORTED", "nobody may set that")
            raise Failed
        self.assign(task, changes)

    def assign(self, task: Task, changes: tuple[Assignment, ...]) -> None:
        """Change the memory; a value that cannot be computed makes the task fail."""
        memory = self.session.memory
        try:
            entries = memory.computed(changes)
        except EvaluationError as error:
            self.record(task, "ABORTED", str(error))
            raise Failed(str(error)) from None
        values = zip(changes, entries, strict=True)
        words = [change for change, (_, value) in values if memory.taken_as_text(change, value)]
        if task.source.startswith("rule:"):
            words = []  # the check has told the author
        self.record(task, "SUCCEEDED")
        for change in words:
            self.session.put(
                "note", text=f"{change.bare_word} is taken as a text", source="engine", stood=None, suspended=False
            )
        for key, value in entries:
            memory.set(key, value, task.source)

    def _cancel(self, task: Task) -> None:
        number = task.behavior.strip()
        other = self.all.get(int(number)) if number.isascii() and number.isdigit() and len(number) < 10 else None
        why = f"cancelled by {task.source}"
        if other is not None and self.session.scheduler.is_there(other):
            self.record(task, "SUCCEEDED")
            self.session.scheduler.cancel(other, why)
        elif other is not None and (run := self.session.rules.run_of(other)) is not None:
            self.record(task, "SUCCEEDED")
            self.session.rules.stop(run, why)
        elif other is not None and (kept := self.session.kept.of(other)) is not None:
            self.record(task, "SUCCEEDED")
            self.session.kept.take_back(kept, why)
        elif failed := self.session.failures.that_wait(number, by_name=False):
            self.record(task, "SUCCEEDED")
            self.session.failures.stop(failed, task.source)
        else:
            raise Refused("no such task is running or waiting")


def two_words(text: str) -> tuple[Any, ...]:
    """`17 late` as a number and a word; nothing when it is not that."""
    words = text.split()
    if len(words) != 2 or not (words[0].isascii() and words[0].isdigit() and len(words[0]) < 10):
        return ()
    return int(words[0]), words[1]
