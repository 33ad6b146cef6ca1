"""An interpreter of SCXML charts, written from the standard's prose (sections 3 and 4, appendix D) alone.

It shares no line with `rise_exchange.scxml`: states are their ids, a configuration is a set of them, and everything is
looked up in the document. What it leaves behind is a trace: what was assigned, in order, and where the chart is.
"""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

_NS = "{http://www.w3.org/2005/07/scxml}"
_STATES = ("state", "parallel", "final")


class EndlessError(Exception):
    """A macrostep that does not come to an end."""


def _tag(element: ElementTree.Element) -> str:
    return element.tag.removeprefix(_NS)


class Interpreter:
    """A running chart. Times are in milliseconds."""

    def __init__(self, text: str) -> None:
        self.root = ElementTree.fromstring(text)
        self.parents = {child: parent for parent in self.root.iter() for child in parent}
        self.position = {element: number for number, element in enumerate(self.root.iter())}
        self.by_id = {element.get("id"): element for element in self.root.iter() if _tag(element) != "data"}
        self.configuration: set[ElementTree.Element] = set()
        self.remembered: dict[ElementTree.Element, list[ElementTree.Element]] = {}
        self.internal: list[str] = []
        self.external: list[str] = []
        self.delayed: list[tuple[float, int, str, str | None]] = []
        """What is to be sent: when, its number, the event, its id."""
        self.now = 0.0
        self.sent = 0
        self.running = True
        self.last = ""
        """The final state in which the chart has ended."""
        self.values: dict[str, Any] = {}
        self.trace: list[tuple[str, Any]] = []
        self.closest = 1e9
        """How near to one another two things have come that happened at different times."""
        for data in self.root.iter(f"{_NS}data"):
            self.values[data.get("id", "")] = self.evaluate(data.get("expr", "null"))
            self.trace.append((data.get("id", ""), self.values[data.get("id", "")]))
        self.enter([self.initial_transition(self.root)])
        self.run()

    # --- the world ---

    def event(self, name: str) -> None:
        """An event from outside."""
        for due, *_ in self.delayed:
            self.closest = min(self.closest, due - self.now)
        if self.running:
            self.external.append(name)
            self.run()

    def pass_time(self, milliseconds: float) -> None:
        until = self.now + milliseconds
        while self.running and self.delayed and min(self.delayed)[0] <= until:
            first = min(self.delayed)
            self.delayed.remove(first)
            if self.delayed:
                self.closest = min(self.closest, *(due - first[0] for due, *_ in self.delayed if due > first[0]), 1e9)
            self.now = first[0]
            self.external.append(first[2])
            self.run()
        self.closest = min([self.closest, *(due - until for due, *_ in self.delayed)])
        self.now = until

    @property
    def active(self) -> list[str]:
        return [element.get("id", "") for element in self.in_order(self.configuration)]

    # --- the document ---

    def in_order(self, elements: Any) -> list[ElementTree.Element]:
        return sorted(elements, key=self.position.__getitem__)

    def children(self, state: ElementTree.Element) -> list[ElementTree.Element]:
        return [child for child in state if _tag(child) in _STATES]

    def ancestors(self, state: ElementTree.Element, below: ElementTree.Element | None) -> list[ElementTree.Element]:
        found = []
        while (parent := self.parents.get(state)) is not None and parent is not below:
            found.append(parent)
            state = parent
        return found

    def is_descendant(self, state: ElementTree.Element, other: ElementTree.Element) -> bool:
        return other in self.ancestors(state, None)

    def is_compound(self, state: ElementTree.Element) -> bool:
        return _tag(state) in ("state", "scxml") and bool(self.children(state))

    def is_atomic(self, state: ElementTree.Element) -> bool:
        return _tag(state) in ("state", "final") and not self.children(state)

    def initial_transition(self, state: ElementTree.Element) -> ElementTree.Element:
        written = state.find(f"{_NS}initial")
        if written is not None:
            found = written.find(f"{_NS}transition")
            assert found is not None
            return found
        made = ElementTree.Element("made", target=state.get("initial") or self.children(state)[0].get("id", ""))
        self.parents[made] = state
        return made

    def source(self, transition: ElementTree.Element) -> ElementTree.Element:
        parent = self.parents[transition]
        return self.parents[parent] if _tag(parent) == "initial" else parent

    def targets(self, transition: ElementTree.Element) -> list[ElementTree.Element]:
        return [self.by_id[id] for id in transition.get("target", "").split()]

    # --- appendix D ---

    def run(self) -> None:
        """One macrostep after the other, until nothing is in the queues."""
        steps = 0
        while self.running:
            steps += 1
            if steps > 400:
                raise EndlessError
            enabled = self.select(None)
            if not enabled:
                if self.internal:
                    enabled = self.select(self.internal.pop(0))
                elif self.external:
                    enabled = self.select(self.external.pop(0))
                else:
                    return
            if enabled:
                self.microstep(enabled)
        for state in reversed(self.in_order(self.configuration)):  # exitInterpreter
            self.leave(state)
        self.delayed.clear()

    def select(self, event: str | None) -> list[ElementTree.Element]:
        enabled: list[ElementTree.Element] = []
        for atomic in self.in_order(filter(self.is_atomic, self.configuration)):
            found = next(
                (
                    transition
                    for state in (atomic, *self.ancestors(atomic, None))
                    for transition in state.findall(f"{_NS}transition")
                    if self.is_enabled(transition, event)
                ),
                None,
            )
            if found is not None and found not in enabled:
                enabled.append(found)
        filtered: list[ElementTree.Element] = []
        for one in enabled:
            beaten = []
            for other in filtered:
                if self.exit_set([one]) & self.exit_set([other]):
                    if self.is_descendant(self.source(one), self.source(other)):
                        beaten.append(other)
                    else:
                        break
            else:
                filtered = [each for each in filtered if each not in beaten] + [one]
        return filtered

    def is_enabled(self, transition: ElementTree.Element, event: str | None) -> bool:
        waits = transition.get("event")
        if (waits is None) != (event is None):
            return False
        if waits is not None and event is not None:
            tokens = event.split(".")
            fits = any(
                word == "*" or tokens[: len(word.split("."))] == word.split(".")
                for word in (each.removesuffix(".*") for each in waits.split())
            )
            if not fits:
                return False
        return bool(self.evaluate(transition.get("cond", "true")))

    def microstep(self, transitions: list[ElementTree.Element]) -> None:
        leaving = list(reversed(self.in_order(self.exit_set(transitions))))
        for state in leaving:
            for history in state.findall(f"{_NS}history"):
                self.remembered[history] = [
                    each
                    for each in self.in_order(self.configuration)
                    if (
                        self.is_atomic(each) and self.is_descendant(each, state)
                        if history.get("type") == "deep"
                        else self.parents[each] is state
                    )
                ]
        for state in leaving:
            self.leave(state)
        for transition in self.in_order(transitions):  # 3.13: in document order
            self.carry_out(transition)
        self.enter(transitions)

    def leave(self, state: ElementTree.Element) -> None:
        for block in state.findall(f"{_NS}onexit"):
            self.carry_out(block)
        self.configuration.discard(state)

    def exit_set(self, transitions: list[ElementTree.Element]) -> set[ElementTree.Element]:
        return {
            state
            for transition in transitions
            if transition.get("target")
            for state in self.configuration
            if self.is_descendant(state, self.domain(transition))
        }

    def domain(self, transition: ElementTree.Element) -> ElementTree.Element:
        source, targets = self.source(transition), self.effective(transition)
        if source is self.root:
            return source
        inside = all(self.is_descendant(target, source) for target in targets)
        if transition.get("type") == "internal" and self.is_compound(source) and inside:
            return source
        for ancestor in self.ancestors(source, None):
            if self.is_compound(ancestor) and all(self.is_descendant(target, ancestor) for target in targets):
                return ancestor
        raise AssertionError

    def effective(self, transition: ElementTree.Element) -> list[ElementTree.Element]:
        found = []
        for target in self.targets(transition):
            if _tag(target) != "history":
                found.append(target)
            elif target in self.remembered:
                found += self.remembered[target]
            else:
                found += self.effective(target.find(f"{_NS}transition"))  # type: ignore[arg-type]
        return found

    def enter(self, transitions: list[ElementTree.Element]) -> None:
        entering: set[ElementTree.Element] = set()
        by_default: set[ElementTree.Element] = set()
        history_content: dict[ElementTree.Element, ElementTree.Element] = {}

        def down(state: ElementTree.Element) -> None:
            if _tag(state) == "history":
                if state in self.remembered:
                    reached = self.remembered[state]
                else:
                    way = state.find(f"{_NS}transition")
                    assert way is not None
                    history_content[self.parents[state]] = way
                    reached = self.targets(way)
                both(reached, self.parents[state])
                return
            entering.add(state)
            if self.is_compound(state):
                by_default.add(state)
                both(self.targets(self.initial_transition(state)), state)
            elif _tag(state) == "parallel":
                regions(state)

        def regions(parallel: ElementTree.Element) -> None:
            for child in self.children(parallel):
                if not any(self.is_descendant(state, child) for state in entering):
                    down(child)

        def up(state: ElementTree.Element, below: ElementTree.Element | None) -> None:
            for ancestor in self.ancestors(state, below):
                entering.add(ancestor)
                if _tag(ancestor) == "parallel":
                    regions(ancestor)

        def both(states: list[ElementTree.Element], below: ElementTree.Element | None) -> None:
            for state in states:
                down(state)
            for state in states:
                up(state, below)

        for transition in transitions:
            if transition.get("target"):
                for target in self.targets(transition):
                    down(target)
                for target in self.effective(transition):
                    up(target, self.domain(transition))
        for state in self.in_order(entering):
            self.configuration.add(state)
            for block in state.findall(f"{_NS}onentry"):
                self.carry_out(block)
            if state in by_default:
                self.carry_out(self.initial_transition(state))
            if state in history_content:
                self.carry_out(history_content[state])
            if _tag(state) == "final":
                self.finish(state, self.parents[state])

    def finish(self, state: ElementTree.Element, parent: ElementTree.Element) -> None:
        if parent is self.root:
            self.running = False
            self.last = state.get("id", "")
            return
        self.internal.append(f"done.state.{parent.get('id')}")
        around = self.parents[parent]
        if _tag(around) == "parallel" and all(map(self.is_finished, self.children(around))):
            self.internal.append(f"done.state.{around.get('id')}")

    def is_finished(self, state: ElementTree.Element) -> bool:
        if _tag(state) == "parallel":
            return all(map(self.is_finished, self.children(state)))
        return any(_tag(child) == "final" and child in self.configuration for child in self.children(state))

    # --- content ---

    def carry_out(self, block: ElementTree.Element) -> None:
        for element in block:
            self.execute(element)

    def execute(self, element: ElementTree.Element) -> None:
        match _tag(element):
            case "raise":
                self.internal.append(element.get("event", ""))
            case "assign":
                name = element.get("location", "")
                self.values[name] = self.evaluate(element.get("expr", ""))
                self.trace.append((name, self.values[name]))
            case "send":
                written = element.get("delay", "0ms")
                delay = float(written[:-2]) if written.endswith("ms") else 1000 * float(written[:-1])
                if element.get("target") == "#_internal":
                    self.internal.append(element.get("event", ""))
                    return
                if delay:
                    self.sent += 1
                    self.delayed.append((self.now + delay, self.sent, element.get("event", ""), element.get("id")))
                else:
                    self.external.append(element.get("event", ""))
            case "cancel":
                self.delayed = [each for each in self.delayed if each[3] != element.get("sendid")]
            case "if":
                holds = bool(self.evaluate(element.get("cond", "")))
                done = False
                for child in element:
                    if _tag(child) in ("elseif", "else"):
                        done = done or holds
                        holds = not done and bool(self.evaluate(child.get("cond", "true")))
                    elif holds and not done:
                        self.execute(child)

    def evaluate(self, text: str) -> Any:
        """A script, in Python's words."""
        for theirs, ours in (("&&", " and "), ("||", " or "), ("true", "True"), ("false", "False"), ("null", "None")):
            text = text.replace(theirs, ours)
        text = re.sub(r"!(?!=)", " not ", text)
        active = {state.get("id") for state in self.configuration}
        return eval(text.strip(), {"In": active.__contains__, **self.values})
