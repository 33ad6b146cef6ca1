"""What becomes of an act that has failed (semantics.md 12.2)."""

from __future__ import annotations

from dataclasses import dataclass

from .rules import Run
from .session import Clock, Session
from .tasks import STARTS_ACT, Refused, Task

FIRST_PAUSE, LONGEST_PAUSE = 2.0, 10.0


@dataclass(eq=False)
class Question:
    """The events of a failed act are held until somebody answers."""

    task: Task
    act: str
    starter: Run | None
    by_itself: bool = False
    """Whether it is repeated when nobody answers: after the pause, or when the robot is back."""
    pause: Clock | None = None


class Failures:
    """Decides, or asks."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.questions: list[Question] = []
        self.times: dict[int, int] = {}
        """By task: which repetition it is."""
        self.starters: dict[int, Run | None] = {}
        """By task: the rule that has started the act."""

    def started(self, task: Task) -> None:
        """An act was asked for: perhaps by a rule."""
        kind, _, name = task.source.partition(":")
        runs = [run for run in self.session.rules.stack if kind == "rule" and run.name == name]
        self.starters[task.id] = runs[0] if runs else None

    def ended(self, task: Task, act: str, status: str, why: str, ours: bool) -> bool:
        """Whether the events of an act's end are raised now. `ours`: nobody else, and not the robot, has ended it."""
        if status != "ABORTED" or task.function != STARTS_ACT:
            return True
        policy = self.session.scenario.failure_policy(act)
        done = self.times.get(task.id, 0)
        by_itself = policy.kind == "repeat" and ours and not self.session.acts.of_another_engine
        if policy.kind == "go_on":
            return True
        if by_itself and done >= policy.times:
            self._record(task, "gone-on", "engine", reason=f"failed {done + 1} times")
            return True
        self.session.marks.failed.pop(task.id, None)
        question = Question(task, act, self.starters.get(task.id), by_itself)
        self.questions.append(question)
        if not by_itself:
            self._record(task, "asked", "engine", reason=why)
        else:
            self._wait(question, why)
        return False

    def _wait(self, question: Question, why: str) -> None:
        """The pause begins; without the robot, when it is back."""
        if not self.session.acts.connected:
            self._record(question.task, "waiting", "engine", reason=why)
            return
        seconds = min(LONGEST_PAUSE, FIRST_PAUSE * 2 ** self.times.get(question.task.id, 0))
        question.pause = self.session.after(seconds, lambda: self._pause_is_over(question), question.task.id)
        self._record(question.task, "waiting", "engine", reason=why, seconds=seconds)

    def _pause_is_over(self, question: Question) -> None:
        question.pause = None
        if not self.session.acts.connected:
            self._wait(question, "the robot is not there")
            self.session.scheduler.arrange()
            return
        self._close(question)
        self._repeat(question.task, "engine")
        self.session.scheduler.arrange()

    def robot_is_back(self) -> None:
        """What has waited for it is repeated after a pause."""
        for question in self.questions:
            if question.by_itself and question.pause is None:
                self.times[question.task.id] = 0
                self._wait(question, "the robot is back")

    def that_wait(self, behavior: str, *, by_name: bool) -> list[Question]:
        """The repetitions that can be stopped under a name, or a task's number."""
        waiting = [each for each in self.questions if each.by_itself]
        return [each for each in waiting if behavior == (each.act if by_name else str(each.task.id))]

    def in_pause(self) -> list[Question]:
        """Those in whose pause the session is."""
        return [each for each in self.questions if each.pause is not None]

    def stop(self, questions: list[Question], source: str, why: str = "") -> None:
        """There is no repetition."""
        for question in questions:
            self._close(question)
            self._record(question.task, "gone-on", source, reason=why)
            self.session.rules.act_ended(question.task, question.act, "failed")
        self.session.scheduler.arrange()

    def _close(self, question: Question) -> None:
        self.questions.remove(question)
        self.session.forget(question.pause)

    def _repeat(self, task: Task, source: str) -> None:
        again = self.session.tasks.numbered(task.function, task.behavior, task.calling_type, task.source)
        again.cause, again.via = task.id, []
        self._record(task, "repeated", source, by=again.id)
        self.times[again.id] = self.times.get(task.id, 0) + 1
        for run in self.session.rules.stack:
            for name, own in run.own_acts.items():
                if own is task:
                    run.own_acts[name] = again
        self.session.scheduler.add_repetition(again, task)
        self.starters[again.id] = self.starters.get(task.id)

    # --- answers ---

    def asked(self, behavior: str) -> Question | None:
        """The question that an answer names, by its task or its act."""
        text = behavior.strip()
        for question in self.questions:
            if text in (str(question.task.id), question.act):
                return question
        return None

    def go_on(self, task: Task, question: Question) -> None:
        """It is gone on without it."""
        self.session.tasks.record(task, "SUCCEEDED")
        self.stop([question], task.source)

    def repeat(self, task: Task) -> None:
        """It is started again."""
        question = self._question(task)
        self.session.stop.refuse_if_stopped()
        self.session.tasks.record(task, "SUCCEEDED")
        self._close(question)
        self._repeat(question.task, task.source)
        self.session.scheduler.arrange()

    def stop_rule(self, task: Task) -> None:
        """The rule that has started it is stopped."""
        question = self._question(task)
        if question.starter is None or question.starter not in self.session.rules.stack:
            raise Refused("no rule has started it, or it has ended")
        self.session.tasks.record(task, "SUCCEEDED")
        self.session.rules.stop(question.starter, f"stopped by {task.source}")

    def _question(self, task: Task) -> Question:
        question = self.asked(task.behavior)
        if question is None:
            raise Refused("nobody is asked about this")
        return question

    # --- questions that are void ---

    def rule_stopped(self, run: Run) -> None:
        """Its acts' questions are void, and others may start."""
        if self.drop_those_of(run):
            self.session.scheduler.arrange()

    def drop_those_of(self, run: Run) -> bool:
        """Questions about what a rule has started are void."""
        found = [each for each in self.questions if each.starter is run]
        for question in found:
            self._drop(question)
        return bool(found)

    def drop_all(self) -> None:
        """A stop-all."""
        for question in list(self.questions):
            self._drop(question)

    def _drop(self, question: Question) -> None:
        self._close(question)
        self._record(question.task, "dropped", "engine", reason="stopped")

    def _record(
        self,
        task: Task,
        status: str,
        source: str,
        by: int | None = None,
        reason: str = "",
        seconds: float | None = None,
    ) -> None:
        about = {"task": task.id, "act": task.act, "status": status, "source": source}
        self.session.put("failure", **about, by=by, reason=reason, seconds=seconds)
