"""The effect of each function of a DomainTask (semantics.md 1.1): the six of RISE and the console's own.

Every task leaves at least one record. The first task record of a `Submit` is that of its own task. Only notes about
missing memory values, which an assignment reads, may come before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache

from rise_engine.base.nearest_name import nearest_name
from rise_engine.expression import Assignment, EvaluationError, ExpressionError
from rise_engine.kernel.behaviors import (
    BehaviorError,
    read_event_raise,
    read_release,
    read_rule_start,
    read_step_back,
)
from rise_engine.kernel.commands import CancelOpenGoals, ReleaseOpenGoals
from rise_engine.kernel.core import Core, EventTopic, Task, parse_task_id
from rise_engine.kernel.failures import FailedActs
from rise_engine.kernel.history import ValueBefore, step_before
from rise_engine.kernel.inputs import EstopReport, Submit
from rise_engine.kernel.records import ENGINE, TaskRecord, TaskStatus
from rise_engine.kernel.rule_stack import RuleRun
from rise_engine.kernel.rules import RuleMachine
from rise_engine.kernel.scheduler import FULL, Scheduler
from rise_engine.kernel.session_keys import SessionKeys
from rise_engine.kernel.speech import why_not_speak
from rise_engine.kernel.stop import StopLatch, StoppedRule
from rise_engine.kernel.wizard_marks import LONGEST_SPEECH, WizardMarks
from rise_engine.scenario.model import CUE_TOPICS, normal_topic, rule_start_behavior

ACT_CALLING_TYPES = ("", "None", "Blocking", "Interrupt")
STOPPED = "everything is stopped; release the stop first"
_parse_assignments = lru_cache(maxsize=256)(Assignment.parse_all)
"""Cached, because keys often set the same values, and exploring presses them a hundred thousand times."""


class TaskHandlers:
    """Executes submitted tasks."""

    def __init__(
        self, core: Core, scheduler: Scheduler, stop: StopLatch, wizard: WizardMarks, failures: FailedActs
    ) -> None:
        self._core = core
        self._scenario = core.scenario
        self._scheduler = scheduler
        self._stop = stop
        self._wizard = wizard
        self._failures = failures
        self.rules = RuleMachine(core, self._submit_from_rule)
        self.session_keys = SessionKeys(core, self.rules.memory, scheduler.runner, stop)
        scheduler.on_ended = self.rules.own_acts.note_ended
        failures.note_repeated = self.rules.own_acts.note_repeated
        self.rules.on_stopped = self._forget_questions
        self.rules.on_loop_ended = self.session_keys.update
        self.by_name: dict[str, Callable[[Submit], None]] = {
            "startCommunicationRobotAct": self._start_act,
            "stopCommunicationRobotAct": self._stop_act,
            "startInteractionRule": self._start_rule,
            "stopInteractionRule": self._stop_rule,
            "stepBack": self._step_back,
            "raiseEventTopic": self._raise_event,
            "assignValue": self._assign,
            "deleteValue": self._delete,
            "cancelTask": self._cancel_task,
            "moveTask": self._move_task,
            "stopAll": self._stop_all,
            "releaseStop": self._release_stop,
            "cancelOpenGoals": self._cancel_open_goals,
            "releaseOpenGoals": self._release_open_goals,
            "say": self._speak,
            "markCue": self._mark_cue,
            "undoCue": self._undo_cue,
            "nextFiller": self._next_filler,
            "markMistake": self._mark_mistake,
            "goOn": self._go_on,
            "repeatAct": self._repeat_act,
            "stopRuleOfAct": self._stop_rule_of_act,
        }

    def reject_unknown(self, task: Submit) -> None:
        self._reject(task, f"there is no function {task.function!r}" + _did_you_mean(task.function, self.by_name))

    def _submit_from_rule(self, function: str, behavior: str, source: str) -> None:
        self.by_name[function](Submit(function=function, behavior=behavior, source=source))
        self.session_keys.update()

    # --- acts ---

    def _start_act(self, task: Submit, cause: int | None = None) -> None:
        """`cause`: the task that this one follows from, if no rule requests it."""
        name = task.behavior
        if name not in self._scenario.acts:
            self._reject(task, f"there is no act {name!r}" + _did_you_mean(name, self._scenario.acts))
        elif task.calling_type not in ACT_CALLING_TYPES:
            self._reject(task, f"the calling type is `None`, `Blocking` or `Interrupt`, not {task.calling_type!r}")
        elif reason := self._why_not_start_acts():
            self._reject(task, reason)
        else:
            started = self._core.new_task(task, self._calling_type(task))
            started.cause = started.cause if cause is None else cause
            self.rules.own_acts.note_started(started)
            self._scheduler.add(started)

    def _why_not_start_acts(self) -> str:
        return STOPPED if self._stop.latched else FULL if self._scheduler.is_full else ""

    def _stop_act(self, task: Submit) -> None:
        name = task.behavior
        if name not in self._scenario.acts:
            self._reject(task, f"there is no act {name!r}" + _did_you_mean(name, self._scenario.acts))
            return
        failed = [each for each in self._failures.waiting if each.behavior == name]
        if not (failed or self._scheduler.has_task_of(name)):
            self._reject(task, f"{name} is neither running nor waiting")
        else:
            self._succeed(task)
            self._scheduler.stop(f"stopped by {task.source}", name)
            self._failures.stop(failed, task.source)

    def _calling_type(self, task: Submit) -> str:
        if task.function != "startCommunicationRobotAct":
            return task.calling_type or "None"
        return task.calling_type or self._scenario.settings_of(task.behavior).calling_type

    # --- rules ---

    def _start_rule(self, task: Submit) -> None:
        core, rules = self._core, self._scenario.rules
        try:
            start = read_rule_start(task.behavior)
        except BehaviorError as problem:
            self._reject(task, str(problem))
            return
        name, state = start.rule, start.state
        if name not in rules:
            self._reject(task, f"there is no rule {name!r}" + _did_you_mean(name, rules))
        elif state is not None and state not in rules[name].states:
            near = _did_you_mean(state, rules[name].states)
            self._reject(task, f"the rule {name!r} has no state {state!r}{near}")
        elif name in self.rules.stack:
            self._reject(task, f"rule {name!r} is already running")
        elif self.rules.was_stopped_for_loop(name):
            self._reject(task, f"rule {name!r} was just stopped as part of a loop, so it cannot start again at once")
        elif self._stop.latched:
            self._reject(task, STOPPED)
        else:
            started = core.new_task(task, self._calling_type(task))
            core.record_task(started)
            started.status = "ACTIVE"
            core.record_task(started)
            self.rules.start(name, started, on_top=task.source.startswith("rule:"), state=state, enter=start.enter)

    def _stop_rule(self, task: Submit) -> None:
        name = task.behavior
        if name not in self._scenario.rules:
            self._reject(task, f"there is no rule {name!r}" + _did_you_mean(name, self._scenario.rules))
        elif name not in self.rules.stack:
            self._reject(task, f"rule {name!r} is not running")
        else:
            self._succeed(task)
            self.rules.stop(name, f"stopped by {task.source}")

    def _step_back(self, task: Submit) -> None:
        try:
            step = read_step_back(task.behavior)
        except BehaviorError as problem:
            self._reject(task, str(problem))
            return
        run = self.rules.stack.get(step.rule)
        if run is None:
            known = step.rule in self._scenario.rules
            missing = f"there is no rule {step.rule!r}{_did_you_mean(step.rule, self._scenario.rules)}"
            self._reject(task, f"rule {step.rule!r} is not running" if known else missing)
            return
        changed = self.rules.changed_since_step(run)
        unknown = next((key for key in step.take_back if key not in changed), None)
        if step_before(run.steps) is None:
            self._reject(task, f"no state is known in which rule {step.rule!r} was before")
        elif unknown is not None:
            near = _did_you_mean(unknown, changed)
            self._reject(task, f"the memory key {unknown!r} has not changed since the state before was entered{near}")
        else:
            self._succeed(task)
            for key in dict.fromkeys(step.take_back):
                self._take_back(key, changed[key], task.source)
            if step.stop_acts:
                self._failures.drop(f"rule:{run.name}", f"rule {run.name} went a step back", run.task.id)
                self._scheduler.stop_started_by(f"rule:{run.name}", f"stopped by {task.source}, a step back")
            self.rules.step_back(run, step.enter)

    def _take_back(self, key: str, before: ValueBefore, source: str) -> None:
        if before.existed:
            self.rules.memory.write(key, before.value, source)
        else:
            self.rules.memory.delete(key, source)

    # --- events and memory ---

    def _raise_event(self, task: Submit) -> None:
        core = self._core
        topic = core.topics.get(task.behavior)
        if topic is None:
            try:
                asked = read_event_raise(task.behavior)
                keep = asked.seconds
            except BehaviorError as problem:
                self._reject(task, str(problem))
                return
            name = normal_topic(asked.event)
            if name and keep is not None:
                kept = core.new_task(task, self._calling_type(task))
                kept.behavior = asked.event
                self.rules.kept.keep(kept, name, keep)
                return
            if not name:
                self._reject(task, "the event has no name")
                return
            topic = core.topics.get(name) or EventTopic(name)
        id = core.next_task
        core.next_task = id + 1
        source = task.source
        calling_type = task.calling_type or "None"
        core.records.append(
            TaskRecord(
                next(core.numbers),
                core.t,
                "",
                id,
                "raiseEventTopic",
                task.behavior,
                calling_type,
                source,
                "SUCCEEDED",
                "",
                None,
                task.ref,
                key_at=core.key_of(id),
            )
        )
        core.events.append((topic, source, None))

    def _assign(self, task: Submit) -> None:
        memory = self.rules.memory
        try:
            assignments = _parse_assignments(task.behavior)
            if problem := next(filter(None, (memory.why_not_write(each.key) for each in assignments)), ""):
                self._reject(task, problem)
                return
            written = memory.compute(assignments)
        except ExpressionError as error:
            self._reject(task, str(error))
            return
        except EvaluationError as error:
            self._record_finished(task, "ABORTED", str(error))
            return
        self._succeed(task)
        for assignment in assignments:
            word = assignment.bare_word
            if word is not None and not memory.is_key(word):
                self._core.record_note(
                    f"`{word}` is not a memory key and was taken as a text; put it in quotation marks"
                )
        memory.assign(written, task.source)

    def _delete(self, task: Submit) -> None:
        memory = self._core.memory
        if problem := self.rules.memory.why_not_write(task.behavior):
            self._reject(task, problem)
        elif task.behavior not in memory:
            self._reject(task, f"the memory has no key {task.behavior!r}" + _did_you_mean(task.behavior, memory))
        else:
            self._succeed(task)
            self.rules.memory.delete(task.behavior, task.source)

    # --- tasks ---

    def _cancel_task(self, task: Submit) -> None:
        reason = f"cancelled by {task.source}"
        waiting = self._find_waiting(task.behavior)
        if waiting is not None:
            self._succeed(task)
            self._scheduler.remove(waiting, reason)
            return
        for run in self._scheduler.runner.runs.values():
            if str(run.task.id) == task.behavior:
                self._succeed(task)
                self._scheduler.runner.cancel(run, reason)
                return
        if (kept := self.rules.kept.get(parse_task_id(task.behavior))) is not None:
            self._succeed(task)
            self.rules.kept.take_back(kept, reason)
            return
        if failed := [each for each in self._failures.waiting if str(each.id) == task.behavior]:
            self._succeed(task)
            self._failures.stop(failed, task.source)
            return
        for rule in self.rules.stack.values():
            if str(rule.task.id) == task.behavior:
                self._succeed(task)
                self.rules.stop(rule.name, reason)
                return
        self._reject(task, f"no task {task.behavior} is running or waiting")

    def _move_task(self, task: Submit) -> None:
        number, _, position = task.behavior.partition(" ")
        waiting = self._find_waiting(number)
        position = position.strip()
        if not (position.isascii() and position.isdigit() and len(position) < 10):
            self._reject(task, "write the task's id and its new place, as in `17 0`")
        elif waiting is None:
            self._reject(task, f"no task {number} is waiting")
        else:
            self._succeed(task)
            self._scheduler.move(waiting, int(position))

    def _find_waiting(self, number: str) -> Task | None:
        return next((task for task in self._scheduler.waiting if str(task.id) == number), None)

    # --- tasks of the wizard ---

    def _speak(self, task: Submit) -> None:
        text = task.behavior.strip()
        if not text:
            self._reject(task, "there is nothing to say")
        elif len(text) > LONGEST_SPEECH:
            self._reject(task, f"free speech has at most {LONGEST_SPEECH} characters, and this has {len(text)}")
        elif task.calling_type not in ("", "Blocking", "Interrupt"):
            self._reject(task, f"free speech is `Blocking` or `Interrupt`, not {task.calling_type!r}")
        elif (reason := why_not_speak(self._scenario)) or (reason := self._why_not_start_acts()):
            self._reject(task, reason)
        else:
            speech = self._core.new_task(task, task.calling_type or "Blocking")
            speech.behavior = text
            self._scheduler.add(speech)

    def _mark_cue(self, task: Submit) -> None:
        core, (topic, _), keep = self._core, CUE_TOPICS, self._scenario.cue_keep
        marked = core.next_task
        self._succeed(task)
        self._wizard.mark_cue(task.source, task.behavior.strip())
        if keep is None or topic not in self._scenario.topics:
            core.raise_event_if_named(topic)
            return
        kept = core.new_task(Submit(function="raiseEventTopic", behavior=f"/{topic}", source=ENGINE), "None")
        kept.cause = marked
        self.rules.kept.keep(kept, topic, keep)

    def _undo_cue(self, task: Submit) -> None:
        if self._succeed_unless(task, self._wizard.why_not_undo_cue()):
            self._wizard.undo_cue(task.source)
            for kept in [kept for kept in self.rules.kept.values() if kept.topic == CUE_TOPICS[0]]:
                self.rules.kept.take_back(kept, "the cue was taken back")

    def _next_filler(self, task: Submit) -> None:
        name = self._wizard.next_filler()
        if name is None:
            self._reject(task, "this scenario has no filler: `filler = true` under [act.NAME] makes one")
        elif reason := self._why_not_start_acts():
            self._reject(task, reason)
        else:
            asked = self._core.next_task
            self._record_finished(task, "SUCCEEDED", name)
            self.start_filler(name, task.source, asked)

    def start_filler(self, name: str, source: str, cause: int | None = None) -> None:
        self._start_act(Submit(function="startCommunicationRobotAct", behavior=name, source=source), cause)

    def _mark_mistake(self, task: Submit) -> None:
        if self._succeed_unless(task, self._wizard.why_not_mark(task.behavior)):
            self._wizard.mark_mistake(task.behavior, task.source)

    def _go_on(self, task: Submit) -> None:
        if self._failures.find(task.behavior) is not None:
            self._succeed(task)
            self._failures.go_on(task.behavior, task.source)
        elif self._succeed_unless(task, self._wizard.why_not_go_on(task.behavior)):
            self._wizard.go_on(task.behavior)

    # --- failed acts that need an answer ---

    def _repeat_act(self, task: Submit) -> None:
        if self._succeed_unless(task, self._failures.why_not_answer(task.behavior)):
            self._failures.repeat(task.behavior, task.source)

    def _stop_rule_of_act(self, task: Submit) -> None:
        failed = self._failures.find(task.behavior)
        rule = self.rules.own_acts.find_rule(failed) if failed is not None else None
        if failed is None:
            self._reject(task, self._failures.why_not_answer(task.behavior))
        elif rule is None:
            self._reject(task, f"no rule that runs has started {failed.behavior}")
        else:
            self._succeed(task)
            self.rules.stop(rule.name, f"stopped by {task.source}, because {failed.behavior} failed")

    def _forget_questions(self, rule: RuleRun) -> None:
        if self._failures.drop(f"rule:{rule.name}", f"rule {rule.name} was stopped", rule.task.id):
            self._scheduler.advance()

    # --- stop-all ---

    def _stop_all(self, task: Submit) -> None:
        """Stop immediately without confirmation, also when it is pressed again (console.md 1.1)."""
        reason = f"stop-all by {task.source}"
        self._succeed(task)
        if not self._stop.latched:  # a second stop must not overwrite the rules that the first one ended
            self._stop.stopped_rules = self.rules.rule_states()
        self._stop.request(task.source)
        self._wizard.cancel_filler()
        self._failures.drop("", reason)
        self.rules.stop_all(reason)
        self._scheduler.stop(reason)
        self._stop.ask_robot()

    def take_estop(self, report: EstopReport) -> None:
        """Handle an emergency stop: pressing it stops everything, as a person can. Repeated reports have no effect."""
        if report.pressed == (report.source in self._stop.held_by):
            return
        if report.pressed:
            self._stop.held_by.append(report.source)
            self._stop_all(Submit(function="stopAll", source=report.source))
        else:
            self._stop.note_released(report.source)

    def _release_stop(self, task: Submit) -> None:
        stopped_rules = self._stop.stopped_rules
        try:
            release = read_release(task.behavior)
            chosen = release.rules
            problem = self._stop.why_not_release(release.stop) or _why_not_resume(chosen, stopped_rules)
        except BehaviorError as unreadable:
            chosen, problem = {}, str(unreadable)
        asked = self._core.next_task
        if not self._succeed_unless(task, problem):
            return
        self._stop.release(task.source)
        for rule in stopped_rules:
            if (how := chosen.get(rule.name, "leave")) != "leave":
                self._resume_rule(rule, how == "enter", task.source, asked)

    def _resume_rule(self, rule: StoppedRule, enter: bool, source: str, cause: int) -> None:
        behavior = rule_start_behavior(rule.name, rule.state, enter)
        started = self._core.new_task(Submit(function="startInteractionRule", behavior=behavior, source=source), "None")
        started.cause = cause
        self._core.record_task(started)
        started.status = "ACTIVE"
        self._core.record_task(started)
        self.rules.resume(rule, started, enter)

    # --- what the robot may still be doing ---

    def _cancel_open_goals(self, task: Submit) -> None:
        if self._succeed_unless(task, self._why_nothing_open(task.behavior)):
            self._core.commands.append(CancelOpenGoals(task.behavior))

    def _release_open_goals(self, task: Submit) -> None:
        if self._succeed_unless(task, self._why_nothing_open(task.behavior)):
            self._core.commands.append(ReleaseOpenGoals(task.behavior))

    def _why_nothing_open(self, part: str) -> str:
        """Why this part of the robot (empty: any part) holds no goal; empty: it does."""
        parts = sorted({goal.part for goal in self._core.open_goals if goal.holds})
        if not parts:
            return "the robot has ended everything that it was given"
        if part and part not in parts:
            return f"{part} has ended everything that it was given{_did_you_mean(part, parts)}"
        return ""

    # --- answers ---

    def _succeed(self, task: Submit) -> None:
        self._record_finished(task, "SUCCEEDED")

    def _reject(self, task: Submit, reason: str) -> None:
        self._record_finished(task, "REJECTED", reason)

    def _succeed_unless(self, task: Submit, problem: str) -> bool:
        """Record success, or rejection because of `problem`. Returns whether it succeeded."""
        self._record_finished(task, "REJECTED" if problem else "SUCCEEDED", problem)
        return not problem

    def _record_finished(self, task: Submit, status: TaskStatus, reason: str = "") -> None:
        self._core.record_finished_task(
            task.function, task.behavior, task.source, status, reason, self._calling_type(task), task.ref
        )


def _why_not_resume(chosen: Iterable[str], stopped_rules: list[StoppedRule]) -> str:
    """Why some of these rules cannot be resumed; empty: they can."""
    names = [rule.name for rule in stopped_rules]
    unknown = next((name for name in chosen if name not in names), None)
    if unknown is None:
        return ""
    return f"the stop has ended no rule {unknown!r}" + _did_you_mean(unknown, names)


def _did_you_mean(name: str, known: Iterable[str]) -> str:
    near = nearest_name(name, known)
    return f"; did you mean {near!r}?" if near is not None else ""
