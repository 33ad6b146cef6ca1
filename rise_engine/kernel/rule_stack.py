"""The stack: the running rules in their order, and the events that each waits for (semantics.md 6).

Costs depend on the takers, not on the number of running rules. The top rule is asked first, because it moved last and
usually moves next. Each topic has a list of the other rules that wait for it, in stack order. A rule joins the list
when another one takes the top from it, so appending keeps the list sorted. Only a start below the top requires sorting.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Container, Iterable
from dataclasses import dataclass, field
from functools import partial

from msgspec import Struct

from rise_engine.kernel.compiled_rules import CompiledState, CompiledTransition
from rise_engine.kernel.core import Cause, QueuedEvent, RuleList, Task
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
    """The latest task of each act that the rule has started and may wait for with `ended`, by name."""
    latched: set[int] = field(default_factory=set)
    """Indexes of the state's eventless transitions that were taken and whose condition has been true since."""
    entries: deque[RuleRecord] = field(default_factory=partial(deque, maxlen=MAX_STEPS))
    """The records of its latest states, the present one last. Keeping records avoids new objects."""
    macrostep: int = -1
    """The macrostep (`Core.macrostep`) of its last step."""
    step_count: int = 0
    """The number of its steps in that macrostep."""

    @property
    def steps(self) -> Steps:
        """Its latest states, the present one last."""
        return [(record.state or "", record.seq) for record in self.entries]

    def remember(self, steps: Steps) -> None:
        """Add states from before the next one."""
        self.entries.extend(RuleRecord(seq, 0.0, "", self.name, "entered", state) for state, seq in steps)


def rank(run: RuleRun) -> tuple[float, int]:
    """Priority and recency: larger is nearer the top of the stack. No two rules have the same rank."""
    return (run.priority, run.recency)


class RuleStack(dict[str, RuleRun]):
    """The running rules by name, bottom first."""

    __slots__ = ("recency", "top")  # without slots, an event costs 5 % more (benchmarks/kernel_events)

    def __init__(self) -> None:
        super().__init__()
        self.top: RuleRun | None = None
        """The highest rule, and the only one in no wait list."""
        self.recency = 0
        """The highest recency of any rule so far."""

    def start(self, run: RuleRun, on_top: bool) -> None:
        """Add a rule above all others of its priority, or with `on_top`, above all others."""
        if on_top and self.top is not None:
            run.priority = max(run.priority, self.top.priority)
        self.recency = run.recency = self.recency + 1
        self.add(run)

    def add(self, run: RuleRun) -> None:
        """Insert a rule by its rank."""
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
                wait_list.clear()  # in place, because states refer to it
                wait_list.update(dict.fromkeys(waiting))

    def remove(self, run: RuleRun) -> None:
        """Remove a rule that ends."""
        del self[run.name]
        if self.top is not run:
            remove_from_lists(run, run.state.wait_lists)
            return
        self.top = next(reversed(self.values()), None)
        if self.top is not None:
            remove_from_lists(self.top, self.top.state.wait_lists)

    def promote(self, run: RuleRun) -> None:
        """Move a rule to the top, with the highest priority: the latest rule is the most relevant (paper, 4.2.2)."""
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
    for rules in lists:
        rules[run] = None


def remove_from_lists(run: RuleRun, lists: Iterable[RuleList]) -> None:
    for rules in lists:
        del rules[run]


# --- consequences without an end --------------------------------------------------------------------------------------


STEP_LIMIT = 1_000
"""The number of steps (starts and transitions) of one rule in one macrostep before the runaway rule is searched for."""
STOPPED_FOR_LOOP = -1
"""In place of the number of steps: the rule was stopped as a runaway."""
MAX_VAIN_SEARCHES = 100
"""The number of failed searches in one macrostep before the macrostep counts as endless."""

MULTIPLIED = (
    f"one input caused more than {STEP_LIMIT * MAX_VAIN_SEARCHES:,} steps, and this rule kept adding to them; probably "
    "it answers each event with several events, and so do rules before it"
)


class RunawayRule(Struct, frozen=True):
    """The rule that keeps a chain of causes going."""

    name: str
    steps: int
    """The number of its own steps in the chain."""
    others: tuple[str, ...]
    """The other rules that occur in the chain more than once."""

    def reason(self, steps: int) -> str:
        """Why it was stopped after this many steps, in a sentence for people."""
        if not self.others:
            probably = "probably two of its states lead to each other by events that they raise themselves"
        else:
            known = ", ".join(self.others[:3]) + (" and others" if len(self.others) > 3 else "")
            probably = f"it and {known} lead to each other by events that they raise"
        return f"took {steps} steps in one go, each of which led to the next, without waiting for anything; {probably}"


def find_runaway_rule(chain: Cause, running: Container[str], fallback: tuple[str, int] | None) -> RunawayRule | None:
    """The running rule with the most steps in a chain of causes, at least two; of equals, the first.

    Without such a rule there is no known loop: None, or `fallback` (a rule and its steps).
    """
    steps: dict[str, int] = {}
    while chain is not None:
        name, chain = chain
        if isinstance(name, int):
            continue
        steps[name] = steps.pop(name, 0) + 1  # moved to the end, so that the first rule of the chain ends up last
    repeated = [name for name, number in steps.items() if number > 1]
    most = max((steps[name] for name in repeated if name in running), default=0)
    if most:
        fallback = next(name for name in reversed(repeated) if name in running and steps[name] == most), most
    if fallback is None:
        return None
    return RunawayRule(*fallback, tuple(name for name in repeated if name != fallback[0]))


def find_multiplier(events: Iterable[QueuedEvent], running: Container[str]) -> str | None:
    """The running rule that raised most of the waiting events; None: no running rule did."""
    raised = Counter(cause[0] for _, _, cause in events if cause is not None and cause[0] in running)
    most = raised.most_common(1)
    return str(most[0][0]) if most else None
