"""Who speaks when (semantics.md 3)."""

from __future__ import annotations

from rise_engine.scenario.model import Act, Action, ActionCall
from rise_engine.scenario.speech.template import Template

from .acts import Run
from .rules import Run as RuleRun
from .session import Session
from .tasks import STARTS_ACT, Refused, Task, two_words

LONGEST_SPEECH = 2000


class Scheduler:
    """The line of acts that wait, and those that run."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.line: list[tuple[Task, Act]] = []
        self.running: list[Run] = []
        self.arranging = False
        self.most_acts = 1000
        """How many acts are accepted, among them those that have failed and are not answered."""
        self.waits_for_wizard = False
        """Whether nothing begins, after a recovery, until a wizard has control."""

    # --- what is asked ---

    def start_act(self, task: Task) -> None:
        """Start an act, or let it wait."""
        act = self.session.scenario.acts.get(task.behavior.strip())
        if task.calling_type == "":
            task.calling_type = self.session.scenario.settings_of(task.behavior.strip()).calling_type
        self.refuse_if_no_act_may_begin()
        if act is None:
            raise Refused("there is no such act")
        if task.calling_type not in ("Blocking", "None", "Interrupt"):
            raise Refused("there is no such calling type")
        self._add(task, act)

    def say(self, task: Task, asked: str) -> None:
        """Free speech is an act of one sentence."""
        self.refuse_if_no_act_may_begin()
        if not task.behavior.strip() or len(task.behavior) > LONGEST_SPEECH:
            raise Refused("nothing to say, or too much")
        if asked not in ("", "Blocking", "Interrupt"):
            raise Refused("Blocking or Interrupt")
        spec = self.session.scenario.robot.actions.get("Speech")
        if spec is None or not spec.supported:
            raise Refused("the robot cannot speak")
        task.calling_type = asked or "Blocking"
        task.behavior = task.behavior.strip()
        words = Template(task.behavior, (task.behavior,))
        action = Action("say", (ActionCall("Speech", {"message": words}),))
        self._add(task, Act("say", (action,), frozenset(spec.channels)))

    def refuse_if_no_act_may_begin(self) -> None:
        """While all is stopped, or because there are too many."""
        self.session.stop.refuse_if_stopped()
        if len(self.line) + len(self.running) + len(self.session.failures.questions) >= self.most_acts:
            raise Refused("there are too many acts")

    def _add(self, task: Task, act: Act) -> None:
        task.act = act.name
        place = len(self.line)
        if task.calling_type == "Interrupt":
            place = 0
            while place < len(self.line) and self.line[place][0].calling_type == "Interrupt":
                place += 1
        self.line.insert(place, (task, act))
        self.session.rules.remember_act(task, act.name)
        self.session.failures.started(task)
        self.session.marks.act_asked(task)
        self.session.tasks.record(task, "PENDING", position=place)
        if task.calling_type == "Interrupt":
            for run in self._blocking():
                self.session.acts.stop(run, f"interrupted by {act.name}")
            pauses = [each for each in self.session.failures.in_pause() if each.task.calling_type != "None"]
            self.session.failures.stop(pauses, "engine", f"interrupted by {act.name}")
        self.arrange()

    def add_repetition(self, task: Task, failed: Task) -> None:
        """An act is started again: it goes before all that wait."""
        act = self.session.scenario.acts[failed.act]
        task.act = act.name
        place = 0
        while place < len(self.line) and self.line[place][0].again:
            place += 1
        task.again = True
        self.line.insert(place, (task, act))
        self.session.marks.act_asked(task)
        self.session.tasks.record(task, "PENDING", f"repeats task {failed.id}", position=place)

    def stop_act(self, task: Task) -> None:
        """Stop all that runs or waits under a name."""
        name, why = task.behavior.strip(), f"stopped by {task.source}"
        waiting = [each for each, act in self.line if act.name == name and each.function == STARTS_ACT]
        running = [run.task for run in self.running if run.act.name == name and run.task.function == STARTS_ACT]
        failed = self.session.failures.that_wait(name, by_name=True)
        if not waiting and not running and not failed:
            raise Refused("it is neither running nor waiting")
        self.session.tasks.record(task, "SUCCEEDED")
        for other in waiting + running:
            self._take_out(other, why)
        self.arrange()
        self.session.failures.stop(failed, task.source)

    def move(self, task: Task) -> None:
        """Another place in the line."""
        words = two_words(task.behavior)
        if not words or not two_words(f"{words[1]} x"):
            raise Refused("write a task and a place")
        found = [each for each in self.line if each[0].id == words[0]]
        if not found:
            raise Refused("no such task is waiting")
        self.session.tasks.record(task, "SUCCEEDED")
        self.line.remove(found[0])
        self.line.insert(int(words[1]), found[0])
        self.session.tasks.record(found[0][0], "PENDING", "moved", self.line.index(found[0]))
        self.arrange()

    def stop_acts_of(self, run: RuleRun, why: str) -> None:
        """Stop all acts that a rule has started."""
        tasks = [task for task, _ in self.line] + [each.task for each in self.running]
        for task in tasks:
            if task.source == f"rule:{run.name}":
                self._take_out(task, why)
        self.arrange()

    def is_there(self, task: Task) -> bool:
        """Whether a task's act runs or waits."""
        return any(each is task for each, _ in self.line) or any(run.task is task for run in self.running)

    def cancel(self, task: Task, why: str) -> None:
        """Stop one act, or take it out of the line."""
        self._take_out(task, why)
        self.arrange()

    def _take_out(self, task: Task, why: str) -> None:
        for entry in list(self.line):
            if entry[0] is task:
                self.line.remove(entry)
                self.session.acts.tell_end(task, entry[1], "CANCELED", why)
        for run in list(self.running):
            if run.task is task:
                self.session.acts.stop(run, why)

    def stop_all(self, why: str) -> None:
        """Empty the line, stop all that runs."""
        line, self.line = self.line, []
        for task, act in line:
            self.session.acts.tell_end(task, act, "CANCELED", why)
        for run in list(self.running):
            self.session.acts.stop(run, why)

    # --- who may start ---

    def arrange(self) -> None:
        """Start what may start, until nothing more may."""
        if self.arranging:
            return
        self.arranging = True
        before: object = None
        while before != (before := [task.id for task, _ in self.line] + [run.task.id for run in self.running]):
            self._look_along_the_line()
        self.arranging = False

    def _look_along_the_line(self) -> None:
        """One Blocking act holds its channels: the one that runs, or else the first in the line, which starts if it
        may. The None acts that need none of them start."""
        if self.waits_for_wizard:
            return
        running = self._blocking()
        waiting = [(task, act) for task, act in self.line if task.calling_type != "None"]
        paused = [each for each in self.session.failures.in_pause() if each.task.calling_type != "None"]
        held: frozenset[str] = frozenset()
        if running:
            held = running[0].act.channels
        elif paused:
            held = self.session.scenario.acts[paused[0].act].channels
        elif waiting:
            held = waiting[0][1].channels
            if self._interrupted(held, waiting[0][1].name):
                self._start(*waiting[0])
        for task, act in list(self.line):
            if task.calling_type == "None" and not act.channels & held:
                self._start(task, act)

    def somebody_has_control(self) -> None:
        """What has waited for a wizard begins: first the actions of all acts that run, then the line."""
        if self.waits_for_wizard:
            self.waits_for_wizard = False
            self.arranging = True
            for run in list(self.running):
                self.session.acts.go_on(run)
            self.arranging = False
            self.arrange()

    def _interrupted(self, channels: frozenset[str], name: str) -> bool:
        """Stop what uses these channels; says whether nothing uses them now."""
        for run in list(self.running):
            if run.act.channels & channels:
                self.session.acts.stop(run, f"interrupted by {name}")
        acts, failures = self.session.scenario.acts, self.session.failures
        failures.stop([each for each in failures.in_pause() if acts[each.act].channels & channels], "engine", name)
        return not any(run.act.channels & channels for run in self.running)

    def _blocking(self) -> list[Run]:
        return [run for run in self.running if run.task.calling_type != "None"]

    def _start(self, task: Task, act: Act) -> None:
        self.line.remove((task, act))
        task.started_at = self.session.now
        run = Run(task, act)
        self.running.append(run)
        self.session.tasks.record(task, "ACTIVE")
        self.session.marks.act_starts(task)
        self.session.acts.begin(run)
