"""Finds the rule to stop when the consequences of one input do not end (semantics.md 6.4).

These are pure functions that `RuleMachine` uses.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable

from msgspec import Struct

from rise_engine.kernel.core import Cause, QueuedEvent

STEP_LIMIT = 1_000
"""Steps (starts and transitions) of one rule in one macrostep before the rule that keeps it going is searched for."""
MAX_VAIN_SEARCHES = 100
"""How often that search may fail in one macrostep before the macrostep counts as endless."""

MULTIPLIED = (
    f"what one input set off took more than {STEP_LIMIT * MAX_VAIN_SEARCHES:,} steps, and this rule went on adding to "
    "them; probably it answers each event with several, and so do others before it"
)


class Culprit(Struct, frozen=True):
    """The rule that keeps a chain of causes going."""

    name: str
    steps: int
    """How many steps of the chain are its own."""
    others: tuple[str, ...]
    """The other rules that occur in the chain more than once."""

    def reason(self, steps: int) -> str:
        """Why it was stopped after this many steps; a sentence for people."""
        if not self.others:
            probably = "probably two of its states lead to each other by events that they raise themselves"
        else:
            known = ", ".join(self.others[:3]) + (" and others" if len(self.others) > 3 else "")
            probably = f"it and {known} lead to each other by events that they raise"
        return f"took {steps} steps in one go, each of which led to the next, without waiting for anything; {probably}"


def find_culprit(chain: Cause, running: Container[str], fallback: tuple[str, int] | None) -> Culprit | None:
    """The running rule with the most steps in a chain of causes, at least two; of equals, the one that stepped first.

    Without such a rule, there is no known loop: None, or `fallback` (a rule and its steps).
    """
    steps: dict[str, int] = {}
    while chain is not None:
        name, chain = chain
        if isinstance(name, int):
            continue
        steps[name] = steps.pop(name, 0) + 1  # at the end, the first rule of the chain is the last here
    repeated = [name for name, number in steps.items() if number > 1]
    most = max((steps[name] for name in repeated if name in running), default=0)
    if most:
        fallback = next(name for name in reversed(repeated) if name in running and steps[name] == most), most
    if fallback is None:
        return None
    return Culprit(*fallback, tuple(name for name in repeated if name != fallback[0]))


def find_multiplier(events: Iterable[QueuedEvent], running: Container[str]) -> str | None:
    """The running rule that has raised most of the waiting events, if a running rule has raised any."""
    raised = Counter(cause[0] for _, _, cause in events if cause is not None and cause[0] in running)
    most = raised.most_common(1)
    return str(most[0][0]) if most else None
