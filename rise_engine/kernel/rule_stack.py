"""The stack: which rules run, who is above whom, and who waits for what (semantics.md 6).

Costs follow the takers, not the number of running rules. The rule on top is asked first: it is the one that moved last,
and mostly the one that moves next. Each topic has a list of the others that wait for it, in stack order: a rule joins
when another one takes the top from it, so that joining at the end keeps the list sorted; only a start below the top has
to sort.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial

from rise_engine.kernel.compiled_rules import CompiledState, CompiledTransition
from rise_engine.kernel.core import RuleList, Task
from rise_engine.kernel.history import MAX_STEPS, Steps
from rise_engine.kernel.records import RuleRecord


@dataclass(slots=True, eq=False)
class RuleRun:
    """A running rule."""

    name: str
    state: CompiledState
    task: Task
    priority: float
    recency: int = 0
    """Larger than that of every rule that came to the top earlier."""
    alive: bool = True
    timers: dict[int, CompiledTransition] = field(default_factory=dict)
    own_acts: dict[str, int] = field(default_factory=dict)
    """Of the acts whose end it may wait for with `ended`: the task that it has started last under each name."""
    latched: set[int] = field(default_factory=set)
    """Indexes of the state's transitions without event that were taken and whose condition has been true since."""
    entries: deque[RuleRecord] = field(default_factory=partial(deque, maxlen=MAX_STEPS))
    """The records of the states that it came through, the present one last: nothing new has to be made for each."""
    macrostep: int = -1
    """The macrostep (`Core.macrostep`) during which it last took a step."""
    step_count: int = 0
    """How many it has taken during that macrostep."""

    @property
    def steps(self) -> Steps:
        """The states that it came through, the present one last."""
        return [(record.state or "", record.seq) for record in self.entries]

    def remember(self, steps: Steps) -> None:
        """It came through these states, before those that it will enter."""
        self.entries.extend(RuleRecord(seq, 0.0, "", self.name, "entered", state) for state, seq in steps)


def rank(run: RuleRun) -> tuple[float, int]:
    """Priority and recency: larger is nearer the top of the stack. No two rules have the same."""
    return (run.priority, run.recency)


class RuleStack(dict[str, RuleRun]):
    """The running rules by name, bottom first."""

    __slots__ = ("recency", "top")  # without, an event costs a twentieth more (benchmarks/kernel_events)

    def __init__(self) -> None:
        super().__init__()
        self.top: RuleRun | None = None
        """The last of them; the one rule that is in no wait list."""
        self.recency = 0
        """The highest that any rule has had."""

    def start(self, run: RuleRun, on_top: bool) -> None:
        """Add a rule above all others of its priority; `on_top`: above all others."""
        if on_top and self.top is not None:
            run.priority = max(run.priority, self.top.priority)
        self.recency = run.recency = self.recency + 1
        self.add(run)

    def add(self, run: RuleRun) -> None:
        """Add a rule where its rank places it."""
        self[run.name] = run
        if self.top is None or rank(run) > rank(self.top):
            if self.top is not None:
                append_to_lists(self.top, self.top.state.wait_lists)
            self.top = run
        else:
            sorted_runs = sorted(self.values(), key=rank)
            self.clear()
            self.update((other.name, other) for other in sorted_runs)
            for wait_list in run.state.wait_lists:
                waiting = sorted((*wait_list, run), key=rank)
                wait_list.clear()  # in place: states hold on to it
                wait_list.update(dict.fromkeys(waiting))

    def remove(self, run: RuleRun) -> None:
        """Take out a rule that ends."""
        del self[run.name]
        if self.top is not run:
            remove_from_lists(run, run.state.wait_lists)
            return
        self.top = next(reversed(self.values()), None)
        if self.top is not None:
            remove_from_lists(self.top, self.top.state.wait_lists)

    def promote(self, run: RuleRun) -> None:
        """The most recent rule is the most relevant: it takes the highest priority on the stack (paper, 4.2.2)."""
        top = self.top
        if top is None or top is run:
            return
        run.priority = top.priority
        self.recency = run.recency = self.recency + 1
        for wait_list in run.state.wait_lists:
            del wait_list[run]
        for wait_list in top.state.wait_lists:
            wait_list[top] = None
        del self[run.name]
        self[run.name] = self.top = run


def append_to_lists(run: RuleRun, lists: Iterable[RuleList]) -> None:
    """Put a rule into lists, last."""
    for rules in lists:
        rules[run] = None


def remove_from_lists(run: RuleRun, lists: Iterable[RuleList]) -> None:
    """Take a rule out of lists."""
    for rules in lists:
        del rules[run]
