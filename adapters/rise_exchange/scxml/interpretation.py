"""One microstep of a chart, computed in advance: SCXML 1.0, appendix D, for a known configuration and history.

The taken transitions determine the effect of a step, so each step of a chart becomes one transition of a rule
(`rise_exchange.scxml.flattening`). Function names follow the appendix.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from msgspec import Struct

from rise_exchange.scxml.chart import (
    AssignNode,
    ChartState,
    ChartTransition,
    Content,
    ForEachNode,
    IfNode,
    Node,
    RaiseNode,
)
from rise_exchange.scxml.script import ArrayNode, Constant, InState, Operation, Script, ScriptNode

Configuration = frozenset[ChartState]
"""The active states, without the root."""
History = dict[ChartState, tuple[ChartState, ...]]
"""The states that each history state remembers."""


class Microstep(Struct, frozen=True):
    """The effect of taking some transitions."""

    configuration: Configuration
    history: History
    leaving: tuple[Content, ...]
    """The content for leaving states and of the transitions, in order. An error in a block does not affect others."""
    entering: tuple[Content, ...]
    """The content for entering states, which follows."""
    last: ChartState | None
    """The entered final state of the chart itself, after which everything was left again; None: none was entered."""


def first_step(root: ChartState) -> Microstep:
    """The step that enters the chart."""
    assert root.initial is not None
    return _Step(root, frozenset(), {}).take([root.initial])


def take(
    root: ChartState, configuration: Configuration, history: History, transitions: Sequence[ChartTransition]
) -> Microstep:
    """The step that takes these transitions, which do not conflict, in a configuration."""
    return _Step(root, configuration, history).take(transitions)


def without_conflicts(
    enabled: Iterable[ChartTransition], root: ChartState, configuration: Configuration, history: History
) -> tuple[ChartTransition, ...]:
    """removeConflictingTransitions: of two that leave the same state, the inner one is taken, or else the first."""
    step = _Step(root, configuration, history)
    filtered: list[ChartTransition] = []
    for one in dict.fromkeys(enabled):
        preempted: list[ChartTransition] = []
        for other in filtered:
            if step.exit_set([one]) & step.exit_set([other]):
                if not one.source.is_inside(other.source):
                    break
                preempted.append(other)
        else:
            filtered = [each for each in filtered if each not in preempted] + [one]
    return tuple(filtered)


def candidates(atomic: ChartState, event: str | None) -> list[ChartTransition]:
    """Return the transitions that an atomic state can select for an event (None: without), in order of precedence."""
    return [
        transition
        for state in (atomic, *atomic.ancestors())
        for transition in state.transitions
        if matches(transition, event)
    ]


def matches(transition: ChartTransition, event: str | None) -> bool:
    """Whether a transition waits for an event (3.12.1) or, for None, for no event."""
    if transition.events is None or event is None:
        return transition.events is None and event is None
    return any(descriptor == "*" or f"{event}.".startswith(f"{descriptor}.") for descriptor in transition.events)


def atomic_states(configuration: Configuration) -> list[ChartState]:
    """The atomic states of a configuration in document order."""
    return [state for state in in_order(configuration) if state.is_atomic]


def in_order(states: Iterable[ChartState]) -> list[ChartState]:
    """States in document order."""
    return sorted(states, key=lambda state: state.order)


def is_legal(configuration: Configuration, root: ChartState) -> bool:
    """Whether a configuration is legal (3.11): one child of each compound state, all children of each parallel one."""
    return all(
        (sum(child in configuration for child in state.children) == 1)
        if state.is_compound
        else all(child in configuration for child in state.children)
        for state in (root, *configuration)
        if state.children
    ) and all(state.parent is root or state.parent in configuration for state in configuration)


class _Step:
    def __init__(self, root: ChartState, configuration: Configuration, history: History) -> None:
        self.root = root
        self.configuration = set(configuration)
        self.history = dict(history)
        self.blocks: list[Content] = []
        self.to_enter: set[ChartState] = set()
        self.default_entry: set[ChartState] = set()
        self.default_history: dict[ChartState, Content] = {}
        self.last: ChartState | None = None

    def take(self, transitions: Sequence[ChartTransition]) -> Microstep:
        """microstep: leave states, run the transitions, enter states, in document order (3.13)."""
        self.exit_states(transitions)
        for transition in sorted(transitions, key=lambda each: each.order):
            self.run(transition.content)
        leaving, self.blocks = tuple(self.blocks), []
        self.enter_states(transitions)
        if self.last is not None:
            self.exit_interpreter()
        return Microstep(frozenset(self.configuration), self.history, leaving, tuple(self.blocks), self.last)

    def run(self, content: Content) -> None:
        if content:
            self.blocks.append(resolve_content(content, {state.id for state in self.configuration}))

    # --- leaving ---

    def exit_states(self, transitions: Sequence[ChartTransition]) -> None:
        leaving = list(reversed(in_order(self.exit_set(transitions))))
        for state in leaving:
            for history in state.histories:
                self.history[history] = tuple(
                    each
                    for each in in_order(self.configuration)
                    if (each.is_atomic and each.is_inside(state) if history.is_deep else each.parent is state)
                )
        self.leave(leaving)

    def leave(self, leaving: list[ChartState]) -> None:
        for state in leaving:
            for content in state.on_exit:
                self.run(content)
            self.configuration.discard(state)

    def exit_set(self, transitions: Iterable[ChartTransition]) -> set[ChartState]:
        """computeExitSet."""
        return {
            state
            for transition in transitions
            if transition.targets and (domain := self.domain(transition)) is not None
            for state in self.configuration
            if state.is_inside(domain)
        }

    def domain(self, transition: ChartTransition) -> ChartState | None:
        """getTransitionDomain: the state within which a transition happens."""
        targets = self.effective_targets(transition)
        source = transition.source
        if not targets:
            return None
        if source is self.root:
            return source
        if transition.internal and source.is_compound and all(target.is_inside(source) for target in targets):
            return source
        return next(  # findLCCA
            ancestor
            for ancestor in source.ancestors()
            if ancestor.is_compound and all(target.is_inside(ancestor) for target in targets)
        )

    def effective_targets(self, transition: ChartTransition) -> list[ChartState]:
        """getEffectiveTargetStates: with the states that histories stand for."""
        found: dict[ChartState, None] = {}
        for target in transition.targets:
            if target.kind != "history":
                found[target] = None
            elif target in self.history:
                found.update(dict.fromkeys(self.history[target]))
            else:
                assert target.initial is not None
                found.update(dict.fromkeys(self.effective_targets(target.initial)))
        return list(found)

    def exit_interpreter(self) -> None:
        """exitInterpreter: the chart has reached its end."""
        self.leave(list(reversed(in_order(self.configuration))))

    # --- entering ---

    def enter_states(self, transitions: Sequence[ChartTransition]) -> None:
        for transition in transitions:  # computeEntrySet
            for target in transition.targets:
                self.add_descendants(target)
            domain = self.domain(transition)
            for target in self.effective_targets(transition):
                self.add_ancestors(target, domain)
        for state in in_order(self.to_enter):
            self.configuration.add(state)
            for content in state.on_entry:
                self.run(content)
            if state in self.default_entry and state.initial is not None:
                self.run(state.initial.content)
            self.run(self.default_history.get(state, ()))
            if state.kind == "final":
                self.enter_final(state)

    def enter_final(self, state: ChartState) -> None:
        parent = state.parent
        if parent is None or parent is self.root:
            self.last = state
            return
        self.blocks.append((RaiseNode(f"done.state.{parent.id}"),))
        grandparent = parent.parent
        is_parallel = grandparent is not None and grandparent.kind == "parallel"
        if grandparent is not None and is_parallel and all(map(self.is_in_final_state, grandparent.children)):
            self.blocks.append((RaiseNode(f"done.state.{grandparent.id}"),))

    def is_in_final_state(self, state: ChartState) -> bool:
        if state.is_compound:
            return any(child.kind == "final" and child in self.configuration for child in state.children)
        return state.kind == "parallel" and all(self.is_in_final_state(child) for child in state.children)

    def add_descendants(self, state: ChartState) -> None:
        """addDescendantStatesToEnter."""
        if state.kind == "history":
            self.add_history(state)
            return
        self.to_enter.add(state)
        if state.is_compound:
            self.default_entry.add(state)
            assert state.initial is not None
            self.add_all(state.initial.targets, state)
        elif state.kind == "parallel":
            self.add_children(state)

    def add_history(self, history: ChartState) -> None:
        assert history.parent is not None
        remembered = self.history.get(history)
        if remembered is None:
            assert history.initial is not None
            self.default_history[history.parent] = history.initial.content
            remembered = history.initial.targets
        self.add_all(remembered, history.parent)

    def add_all(self, states: Iterable[ChartState], within: ChartState) -> None:
        states = tuple(states)
        for state in states:
            self.add_descendants(state)
        for state in states:
            self.add_ancestors(state, within)

    def add_ancestors(self, state: ChartState, within: ChartState | None) -> None:
        """addAncestorStatesToEnter."""
        for ancestor in state.ancestors(within):
            if ancestor is self.root:
                return
            self.to_enter.add(ancestor)
            if ancestor.kind == "parallel":
                self.add_children(ancestor)

    def add_children(self, parallel: ChartState) -> None:
        for child in parallel.children:
            if not any(state is child or state.is_inside(child) for state in self.to_enter):
                self.add_descendants(child)


# --- In() ---


def resolve_content(content: Content, active: set[str]) -> Content:
    """Return content with the answers of `In` for these active states."""
    return tuple(_resolve_node(node, active) for node in content)


def resolve_script(script: Script, active: set[str]) -> Script:
    """Return a script with the answers of `In`."""
    return script if script.root is None else Script(script.text, _resolve(script.root, active), script.location)


def _resolve_node(node: Node, active: set[str]) -> Node:
    match node:
        case AssignNode(name, value, location, declares):
            return AssignNode(name, resolve_script(value, active), location, declares)
        case IfNode(branches, location):
            resolved = (
                (script and resolve_script(script, active), resolve_content(inner, active))
                for script, inner in branches
            )
            return IfNode(tuple(resolved), location)
        case ForEachNode(array, item, index, body, location):
            return ForEachNode(array, item, index, resolve_content(body, active), location)
    return node


def _resolve(node: ScriptNode, active: set[str]) -> ScriptNode:
    match node:
        case InState(id):
            return Constant(id in active)
        case Operation(operator, operands):
            return Operation(operator, tuple(_resolve(operand, active) for operand in operands))
        case ArrayNode(entries):
            return ArrayNode(tuple(_resolve(entry, active) for entry in entries))
    return node
