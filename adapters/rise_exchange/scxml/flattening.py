"""Flattens a chart with hierarchy, parallel regions and histories into one machine.

A flat state is a configuration with the memory of the histories. Its transitions have the effect of the standard's
microstep (`rise_exchange.scxml.interpretation`), computed in advance. Parallel regions become their product.
"""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import Struct

from rise_engine.scenario.model import SourceLocation
from rise_exchange.scxml.chart import (
    ERROR,
    Chart,
    ChartState,
    ChartTransition,
    Content,
    FailNode,
    ForEachNode,
    IfNode,
    Node,
    RaiseNode,
)
from rise_exchange.scxml.interpretation import (
    Configuration,
    History,
    Microstep,
    atomic_states,
    candidates,
    first_step,
    in_order,
    is_legal,
    matches,
    resolve_script,
    take,
    without_conflicts,
)
from rise_exchange.scxml.script import ChartRefusedError, Constant, Script

MAX_STATES = 200
"""Maximum number of flat states. Charts drawn by people have tens, and larger rules are unreadable."""
MAX_TRANSITIONS = 2_000
_PLATFORM = ("done.", "error.", "done", "error")


class FlatTransition(Struct, eq=False):
    """A transition of a flat state."""

    event: str | None
    """None: without event."""
    conditions: tuple[Script, ...]
    """All of them must hold."""
    leaving: tuple[Content, ...]
    """The content up to the transition's own, included."""
    entering: tuple[Content, ...]
    """The content for entering states."""
    target: FlatState
    location: SourceLocation
    """The location of the first of the taken transitions of the chart."""


class FlatState(Struct, eq=False):
    """A configuration of the chart, and the memory of its histories."""

    name: str
    configuration: Configuration
    history: History
    is_over: bool
    transitions: list[FlatTransition] = []


class FlatChart(Struct):
    """The flat machine."""

    states: list[FlatState]
    """The initial state comes first."""
    first_blocks: tuple[Content, ...]
    """The content for entering the initial state."""
    events: list[str]
    """Every event that the chart can receive."""
    widened: dict[str, list[str]]
    """Event descriptors for several events, with these events; for `error`, perhaps none."""


def flatten(chart: Chart) -> FlatChart:
    """Flatten a chart. Raises ChartRefusedError."""
    return _Flattener(chart).flatten()


class _Flattener:
    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        self.root = chart.root
        self.events = events_of(chart)
        self.states: dict[tuple[object, ...], FlatState] = {}
        self.names: dict[str, int] = {}
        self.waiting: list[FlatState] = []
        self.transitions = 0

    def flatten(self) -> FlatChart:
        first = first_step(self.root)
        assert self.root.initial is not None
        self.state_after(first, self.root.initial)
        while self.waiting:
            state = self.waiting.pop(0)
            if not state.is_over:
                self.add_transitions(state)
        widened: dict[str, list[str]] = {}
        for transition in all_transitions(self.root):
            for descriptor in transition.events or ():
                found = [event for event in self.events if _fits(descriptor, event)]
                if found != [descriptor]:
                    widened[descriptor] = found
        return FlatChart(list(self.states.values()), first.entering, self.events, widened)

    def state_after(self, step: Microstep, taken: ChartTransition) -> FlatState:
        """Return the flat state at the end of a step, and create it if it is new."""
        last = step.last
        if last is not None:
            key: tuple[object, ...] = ("over", last)
        else:
            if not is_legal(step.configuration, self.root):
                ids = ", ".join(f"`{target.id}`" for target in taken.targets)
                message = f"this leads to states that cannot be active together: {ids}"
                raise ChartRefusedError("chart", message, location=taken.location)
            remembered = (
                (history.order, tuple(each.order for each in saved)) for history, saved in step.history.items()
            )
            key = (step.configuration, tuple(sorted(remembered)))
        if key in self.states:
            return self.states[key]
        name = last.id if last is not None else " + ".join(state.id for state in atomic_states(step.configuration))
        state = FlatState(self.own_name(name), step.configuration, step.history, last is not None, [])
        self.states[key] = state
        self.waiting.append(state)
        if len(self.states) > MAX_STATES:
            message = (
                f"flattened, this chart has more than {MAX_STATES} states: parallel regions multiply, and each history "
                "multiplies with what it can remember; make rules of its regions by hand"
            )
            raise ChartRefusedError("size", message, location=self.root.location)
        return state

    def own_name(self, name: str) -> str:
        """A name that no other flat state has."""
        while True:
            self.names[name] = self.names.get(name, 0) + 1
            if self.names[name] == 1:
                return name
            name = f"{name} ({self.names[name]})"

    # --- transitions ---

    def add_transitions(self, state: FlatState) -> None:
        if self.add_choices(state, None):
            return  # it never waits
        for event in self.events:
            self.add_choices(state, event)

    def add_choices(self, state: FlatState, event: str | None) -> bool:
        """Add the transitions for an event. Returns whether one of them is always taken."""
        active = {each.id for each in state.configuration}
        choices = [
            [
                (transition, condition)
                for transition in candidates(atomic, event)
                if (condition := _condition(transition, active)) is None or not _is_false(condition)
            ]
            for atomic in atomic_states(state.configuration)
        ]
        for chosen, conditions in _combinations(choices):
            if not chosen:
                return False
            taken = without_conflicts(chosen, self.root, state.configuration, state.history)
            step = take(self.root, state.configuration, state.history, taken)
            target = self.state_after(step, taken[0])
            is_idle = target is state and not (step.leaving or step.entering)
            if is_idle and event is None:
                message = (
                    "this transition waits for nothing, leads nowhere and does nothing: it would be taken endlessly"
                )
                raise ChartRefusedError("endless", message, location=taken[0].location)
            if not is_idle or conditions:
                location = taken[0].location
                state.transitions.append(
                    FlatTransition(event, conditions, step.leaving, step.entering, target, location)
                )
                self.count()
            if not conditions:
                return True
        return False

    def count(self) -> None:
        self.transitions += 1
        if self.transitions > MAX_TRANSITIONS:
            message = f"flattened, this chart has more than {MAX_TRANSITIONS:,} transitions"
            raise ChartRefusedError("size", message, location=self.root.location)


_Choice = tuple[ChartTransition, Script | None]


def _combinations(choices: list[list[_Choice]]) -> Iterator[tuple[list[ChartTransition], tuple[Script, ...]]]:
    """Return the possible selections (selectTransitions): for each atomic state one transition or none, with all
    conditions for it. The first selection whose conditions hold is taken. In each region, the first transition that
    holds comes before the others, and before none."""

    def go(
        index: int, chosen: dict[ChartTransition, Script | None], passed: frozenset[ChartTransition]
    ) -> Iterator[tuple[list[ChartTransition], tuple[Script, ...]]]:
        if index == len(choices):
            yield list(chosen), tuple(condition for condition in chosen.values() if condition is not None)
            return
        skipped = passed
        for transition, condition in choices[index]:
            if transition in passed:
                continue  # its condition does not hold
            if transition in chosen or condition is None:
                yield from go(index + 1, {**chosen, transition: condition}, skipped)
                return
            yield from go(index + 1, {**chosen, transition: condition}, skipped)
            skipped |= {transition}
        yield from go(index + 1, chosen, skipped)

    return go(0, {}, frozenset())


def _condition(transition: ChartTransition, active: set[str]) -> Script | None:
    """Return the condition with the answers of `In`; None: there is none."""
    if transition.condition is None:
        return None
    script = resolve_script(transition.condition, active)
    root = script.root
    return None if isinstance(root, Constant) and root.value else script


def _is_false(script: Script) -> bool:
    """Whether a condition can never hold. One that cannot be evaluated counts as false (5.9.1)."""
    return script.root is None or (isinstance(script.root, Constant) and not script.root.value)


# --- events ---


def events_of(chart: Chart) -> list[str]:
    """Return every event that a chart can receive: raised, sent and automatic ones, and those in its transitions."""
    found: dict[str, None] = {}
    for state in _all_states(chart.root):
        for content in (
            *state.on_entry,
            *state.on_exit,
            *(transition.content for transition in _own_transitions(state)),
        ):
            found.update(dict.fromkeys(_raised(content)))
    for place in chart.places:
        found[place.event] = None
    for state in _all_states(chart.root):
        if state.kind == "final" and state.parent is not None and state.parent is not chart.root:
            found[f"done.state.{state.parent.id}"] = None
        if state.kind == "parallel":
            found[f"done.state.{state.id}"] = None
    transitions = list(all_transitions(chart.root))
    for transition in transitions:
        for descriptor in transition.events or ():
            if descriptor != "*" and not descriptor.startswith(_PLATFORM):
                found[descriptor] = None
    found.update(dict.fromkeys(chart.outside))
    if any(matches(transition, ERROR) for transition in transitions):
        found[ERROR] = None
    return list(found)


def external_events(chart: Chart) -> set[str]:
    """Return the events that may come from outside: those in transitions, and others that the user named."""
    named = (name for transition in all_transitions(chart.root) for name in transition.events or ())
    return {name for name in named if name != "*" and not name.startswith(_PLATFORM)} | set(chart.outside)


def _raised(content: Content) -> Iterator[str]:
    for node in content:
        yield from _raised_by(node)


def _raised_by(node: Node) -> Iterator[str]:
    match node:
        case RaiseNode(event):
            yield event
        case FailNode(event):
            yield event
        case IfNode(branches):
            for _, inner in branches:
                yield from _raised(inner)
        case ForEachNode(body=body):
            yield from _raised(body)


def _fits(descriptor: str, event: str) -> bool:
    return descriptor == "*" or f"{event}.".startswith(f"{descriptor}.")


def _all_states(state: ChartState) -> Iterator[ChartState]:
    yield state
    for inner in in_order([*state.children, *state.histories]):
        yield from _all_states(inner)


def _own_transitions(state: ChartState) -> list[ChartTransition]:
    return [*state.transitions, *([state.initial] if state.initial is not None else [])]


def all_transitions(root: ChartState) -> Iterator[ChartTransition]:
    """The transitions of a chart, without those of initial and history states, in document order of their states."""
    for state in _all_states(root):
        yield from state.transitions
