"""Who goes round in circles: which rule is stopped when what one input sets off does not end (semantics.md 6.4).

Pure functions: `RuleMachine` asks, and does what comes of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable

from msgspec import Struct

from rise_engine.kernel.core import Cause, QueuedEvent

STEP_LIMIT = 1_000
"""Steps (starts and transitions) that one rule may take in one macrostep before it is looked for who keeps it going."""
MAX_VAIN_SEARCHES = 100
"""How often that is looked for in one macrostep, in vain, before it counts as one without an end."""

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
    """The other rules that stand in the chain more than once."""

    def reason(self, steps: int) -> str:
        """Why it was stopped, after it had taken so many steps; a sentence for a person."""
        if not self.others:
            probably = "probably two of its states lead to each other by events that they raise themselves"
        else:
            known = ", ".join(self.others[:3]) + (" and others" if len(self.others) > 3 else "")
            probably = f"it and {known} lead to each other by events that they raise"
        return f"took {steps} steps in one go, each of which led to the next, without waiting for anything; {probably}"


def find_culprit(chain: Cause, running: Container[str], fallback: tuple[str, int] | None) -> Culprit | None:
    """The running rule that has the most steps in a chain of causes, and at least two; of equals the one whose first
    step is the earliest.

    When there is no such rule, nothing goes round as far as is known: None, or `fallback` (a rule and its steps).
    """
    steps: dict[str, int] = {}
    while chain is not None:
        name, chain = chain
        if isinstance(name, int):
            continue
        steps[name] = steps.pop(name, 0) + 1  # in the end, the first of the chain is the last here
    repeated = [name for name, number in steps.items() if number > 1]
    most = max((steps[name] for name in repeated if name in running), default=0)
    if most:
        fallback = next(name for name in reversed(repeated) if name in running and steps[name] == most), most
    if fallback is None:
        return None
    return Culprit(*fallback, tuple(name for name in repeated if name != fallback[0]))


def find_multiplier(events: Iterable[QueuedEvent], running: Container[str]) -> str | None:
    """The running rule that has raised most of the events that wait, if any of them comes of a running rule."""
    raised = Counter(cause[0] for _, _, cause in events if cause is not None and cause[0] in running)
    most = raised.most_common(1)
    return str(most[0][0]) if most else None
