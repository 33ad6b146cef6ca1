"""What only a wizard does: cues, fillers, mistakes, going on (semantics.md 4)."""

from __future__ import annotations

from .session import Clock, Session
from .tasks import STARTS_ACT, Refused, Task, two_words

MISTAKES = ("wrong", "late", "early", "double", "none")
NO_DEEDS = ("markMistake", "goOn", "repeatAct", "stopRuleOfAct")


class Marks:
    """Remembers the cue, the last filler and the acts that have failed."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.cue_at: float | None = None
        """Of the cue that is open."""
        self.last_filler = ""
        self.clock: Clock | None = None
        self.failed: dict[int, str] = {}

    # --- cues ---

    def mark_cue(self, task: Task) -> None:
        """The participant's turn has ended."""
        session = self.session
        session.tasks.record(task, "SUCCEEDED")
        pressed = session.pressed
        self.cue_at = session.now if pressed is None else pressed
        words = task.behavior
        session.put("cue", status="marked", source=task.source, text=words, task=None, since=None, key_at=pressed)
        keep = session.scenario.cue_keep
        if keep is None or "cue" not in session.scenario.topics:
            session.rules.raise_engine_event("cue")
        else:
            raised = session.tasks.numbered("raiseEventTopic", "/cue", "None", "engine")
            raised.cause = task.id
            session.kept.raise_event(raised, "cue", keep)
        self.nothing_by_itself()
        seconds = session.scenario.fillers.auto_after
        if seconds is not None and self._next() is not None:
            self.clock = session.after(seconds, self._fill)

    def undo_cue(self, task: Task) -> None:
        """It has not ended after all."""
        if self.cue_at is None:
            raise Refused("no cue is open")
        session = self.session
        session.tasks.record(task, "SUCCEEDED")
        self.cue_at = None
        self.nothing_by_itself()
        session.put("cue", status="undone", source=task.source, text="", task=None, since=None, key_at=None)
        for kept in list(session.kept.all):
            if kept.topic == "cue":
                session.kept.take_back(kept, "the cue was taken back")
        session.rules.raise_engine_event("cue_undone")

    def act_starts(self, task: Task) -> None:
        """An act has started: does it answer the cue?"""
        filler = self.is_filler(task)
        self.nothing_by_itself()
        if self.cue_at is None:
            return
        answers = task.function != STARTS_ACT or self.session.scenario.settings_of(task.act).answers
        if not filler and not answers:
            return
        since = round(self.session.now - self.cue_at, 6)
        status = "filled" if filler else "answered"
        self.session.put("cue", status=status, source=task.source, text="", task=task.id, since=since, key_at=None)
        task.bridged = filler
        if not filler:
            self.cue_at = None

    def act_asked(self, task: Task) -> None:
        """The turn of the fillers goes on after the one that was asked for last."""
        if self.is_filler(task):
            self.last_filler = task.act

    def is_filler(self, task: Task) -> bool:
        """Whether a task's act only bridges the time."""
        return task.function == STARTS_ACT and self.session.scenario.settings_of(task.act).filler

    # --- fillers ---

    def next_filler(self, task: Task) -> None:
        """Start the next one, in turn."""
        self.session.scheduler.refuse_if_no_act_may_begin()
        name = self._next()
        if name is None:
            raise Refused("the scenario has no filler")
        self.session.tasks.record(task, "SUCCEEDED", name)
        self.session.tasks.new(STARTS_ACT, name, source=task.source, cause=task.id)

    def _next(self) -> str | None:
        names = [name for name in self.session.scenario.acts if self.session.scenario.settings_of(name).filler]
        if not names:
            return None
        return names[(names.index(self.last_filler) + 1) % len(names)] if self.last_filler in names else names[0]

    def nothing_by_itself(self) -> None:
        """No filler is to start by itself."""
        self.session.forget(self.clock)
        self.clock = None

    def _fill(self) -> None:
        self.clock = None
        name = self._next()
        busy = self.session.scheduler.running or self.session.failures.in_pause()
        held = self.session.stop.in_force or self.session.scheduler.waits_for_wizard
        if name is not None and not busy and not held:
            self.session.tasks.new(STARTS_ACT, name, source="engine")

    # --- mistakes and failures ---

    def mark_mistake(self, task: Task) -> None:
        """A wizard's own mistake."""
        words = two_words(task.behavior)
        if not words or words[1] not in MISTAKES:
            raise Refused("write a task and a mark")
        other = self.session.tasks.all.get(words[0])
        if other is None or other.refused or other is task:
            raise Refused("there is no such task")
        if not other.act and (other.follows or not other.source.startswith("wizard:") or other.function in NO_DEEDS):
            raise Refused("no wizard did that")
        self.session.tasks.record(task, "SUCCEEDED")
        self.session.put("mistake", task=other.id, act=other.act, mark=words[1], source=task.source)

    def act_ends(self, task: Task, status: str) -> None:
        """Of each act, its latest failure waits for an answer until it succeeds."""
        if status == "CANCELED":
            return
        same = f"{task.function} {task.behavior}"
        for id in [id for id, asked in self.failed.items() if asked == same]:
            del self.failed[id]
        if status == "ABORTED":
            self.failed[task.id] = same

    def go_on(self, task: Task) -> None:
        """Somebody has seen a failure."""
        question = self.session.failures.asked(task.behavior)
        if question is not None:
            self.failed.pop(question.task.id, None)
            self.session.failures.go_on(task, question)
            return
        text = task.behavior.strip()
        number = int(text) if text.isascii() and text.isdigit() and len(text) < 10 else 0
        if number not in self.failed:
            raise Refused("no act of this task waits for an answer")
        self.session.tasks.record(task, "SUCCEEDED")
        del self.failed[number]
