"""Going on after a stop, and one step back (semantics.md 12.3, 12.4)."""

from __future__ import annotations

import copy
import json
from dataclasses import dataclass
from typing import Any

from rise_engine.scenario.model import Rule, rule_start_behavior

from .rules import Run
from .session import Session
from .tasks import STARTS_RULE, Refused, Task

MAX_STATES = 50
Past = list[tuple[str, dict[str, Any]]]
"""States that a rule has entered, the latest last, and what the memory was then."""


@dataclass
class Remembered:
    """A rule that a stop-all has ended."""

    rule: Rule
    state: str
    priority: float
    held: set[int]
    past: Past


class GoingOn:
    """Remembers where rules stood."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.stopped: list[Remembered] = []
        """The highest first."""
        self.pasts: dict[Run, Past] = {}

    def entered(self, run: Run) -> None:
        """A rule has entered a state."""
        past = self.pasts.setdefault(run, [])
        past.append((run.state.id, copy.deepcopy(self.session.memory.values)))
        del past[:-MAX_STATES]

    # --- after a stop ---

    def stop_all(self) -> None:
        """Every rule is about to end."""
        for run in self.session.rules.stack:
            held = {index for index in run.held if index not in run.clocks}
            past = list(self.pasts.get(run, []))
            self.stopped.append(Remembered(run.rule, run.state.id, run.priority, held, past))

    def read_release(self, behavior: str, stops: int) -> dict[str, str]:
        """What is to become of each rule. `stops`: how often everything was stopped."""
        if not behavior.strip():
            return {}
        try:
            words = json.loads(behavior)
        except ValueError:
            raise Refused("this is no JSON") from None
        if isinstance(words, dict) and type(words.get("stop")) is int and words.pop("stop") != stops:
            raise Refused("it was stopped again")
        known = {each.rule.name for each in self.stopped}
        if not isinstance(words, dict) or set(words) - known:
            raise Refused("there is a rule that was not stopped")
        for word in words.values():
            if word not in ("enter", "wait", "leave"):
                raise Refused("enter, wait or leave")
        return words

    def released(self, words: dict[str, str], asked: Task) -> None:
        """Begin what goes on, the bottom of the stack first; then their functions, the highest first."""
        session, begun = self.session, []
        remembered, self.stopped = self.stopped, []
        for each in reversed(remembered):
            word = words.get(each.rule.name, "leave")
            if word == "leave":
                continue
            enter = word == "enter"
            task = session.tasks.numbered(
                STARTS_RULE, rule_start_behavior(each.rule.name, each.state, enter), "None", asked.source
            )
            task.follows, task.cause = True, asked.id
            run = Run(each.rule, task, each.priority, each.rule.states[each.state])
            self.pasts[run] = each.past[:-1]
            session.rules.resume(run, enter, set() if enter else each.held)
            begun.append((run, enter))
        session.standing.update()
        for run, enter in reversed(begun):
            if run in session.rules.stack:
                session.rules.run_functions(run, enter)

    # --- one step back ---

    def step_back(self, task: Task) -> None:
        """A rule goes back to the state before."""
        session = self.session
        name, take_back, enter, stop_acts = read_step_back(task.behavior)
        run = next((each for each in session.rules.stack if each.name == name), None)
        past = self.pasts.get(run, []) if run is not None else []
        if run is None or len(past) < 2:
            raise Refused("it does not run, or no state before is known")
        state, before = past[-2]
        now = session.memory.values
        for key in take_back:
            if not (key in before or key in now) or (key in before and key in now and before[key] == now[key]):
                raise Refused("a key has not changed")
        session.tasks.record(task, "SUCCEEDED")
        for key in take_back:
            if key in before:
                session.memory.set(key, copy.deepcopy(before[key]), task.source)
            elif key in session.memory.values:
                session.memory.delete(key, task.source)
        if stop_acts:
            session.failures.drop_those_of(run)
            session.scheduler.stop_acts_of(run, f"step back by {task.source}")
        del past[-2:]
        session.rules.go_back(run, state, enter)


def read_step_back(behavior: str) -> tuple[str, list[str], bool, bool]:
    """The rule, the keys that are taken back, whether `onEntry` runs, whether its acts are stopped."""
    if not behavior.strip().startswith("{"):
        return behavior.strip(), [], True, False
    try:
        written = json.loads(behavior)
    except ValueError:
        raise Refused("this is no JSON") from None
    keys, enter, stop_acts = written.get("take_back", []), written.get("enter", True), written.get("stop_acts", False)
    good = isinstance(written.get("rule"), str) and isinstance(keys, list) and all(isinstance(k, str) for k in keys)
    if not good or set(written) - {"rule", "take_back", "enter", "stop_acts"}:
        raise Refused("write rule, take_back, enter and stop_acts")
    if not isinstance(enter, bool) or not isinstance(stop_acts, bool):
        raise Refused("true or false")
    return written["rule"], keys, enter, stop_acts
