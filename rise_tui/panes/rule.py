"""One rule: where it stands, why it stays there, and its states with their transitions."""

from __future__ import annotations

from collections.abc import Sequence

from textual.widget import Widget

from rise_engine.scenario.model import Rule, State, Transition
from rise_engine.view import RuleView
from rise_tui.actions import bindings
from rise_tui.explain import Raisers, label_of, raised_by_engine, truth_of, waits_for
from rise_tui.gate import Trigger
from rise_tui.messages import StartAsked, Told
from rise_tui.panes.pane import ListPane
from rise_tui.states import rule_state
from rise_tui.store import Store
from rise_tui.text import Line, Row, Span, cell, clock, crop, headed, spread, width_of
from rise_tui.widgets.rows import RowList

HERE = "here"
"""The id of the row of the present state."""


class RulePane(ListPane):
    """The rule that the wizard selected, or the top one of the stack."""

    PLACE = "rule"
    BINDINGS = bindings("rule")
    TITLE = "Rule"
    TOPICS = frozenset({"rules", "memory"})
    EMPTY = "select a rule in the list of rules"
    DEFAULT_CSS = """
    RulePane > #rule-rows { height: 1fr; }
    RulePane > #rule-graph { height: 2fr; margin-top: 1; }
    """

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self._raisers = Raisers(store.scenario)
        self.graph = RowList(id="rule-graph")
        self.graph.can_focus = False
        self.list.beyond = self.graph
        self._brought: tuple[str, str | None] | None = None
        """The rule and state that was last brought into view; after that the wizard may scroll."""

    @property
    def _rule(self) -> Rule | None:
        name = self.store.rule_shown or next(iter(self.store.view.stack()), "")
        return self.store.scenario.rules.get(name) or next(iter(self.store.scenario.rules.values()), None)

    def body(self) -> Sequence[Widget]:
        return [self.list, self.graph]

    def make_rows(self, width: int) -> list[Row]:
        """What must always be in view: where the rule stands, and why it stays there."""
        rule = self._rule
        if rule is None:
            return []
        view = self.store.rule(rule.name)
        rows = [*self._head(rule, view, width)]
        if view.running and view.state in rule.states:
            rows += self._why(rule.states[view.state], width)
        return rows

    def repaint(self) -> None:
        super().repaint()
        rule = self._rule
        if rule is None or self.list.row_width <= 0:
            return
        self.list.styles.max_height = self.list.count
        view = self.store.rule(rule.name)
        self.graph.show([row for state in rule.states.values() for row in self._state(rule, state, view)])
        stands = (rule.name, view.state if view.running else None)
        if stands != self._brought and self.graph.size.height:
            self._brought = stands
            self.graph.bring_to_middle(HERE)

    def _head(self, rule: Rule, view: RuleView, width: int) -> list[Row]:
        state = rule_state(self.store, rule.name)
        when: Line = ((f"since {clock(view.since)} ", "muted"),) if view.status else ()
        rows = [Row("", headed(rule.name, (f"{state.glyph} {state.word}", state.tone), when, width), selectable=False)]
        if view.running:
            line: Line = ((" in ", "muted"), (view.state or "", "accent"))
            if view.previous:
                line = (*line, ("  from ", "muted"), (view.previous, "plain"))
            if view.trigger:
                line = (*line, ("  by ", "muted"), (view.trigger, "plain"))
            rows.append(Row("", crop(line, width), selectable=False))
        elif view.reason:
            rows.append(
                Row("", crop(((f" {view.reason}", "fault" if view.status == "faulted" else "muted"),), width), False)
            )
        return rows

    def _why(self, state: State, width: int) -> list[Row]:
        """Each way out of the present state: what it waits for, its condition now, and the wizard's keys for it."""
        if not state.transitions:
            return [Row("", ((" a state without transitions: the rule ends here", "muted"),), False)]
        rows = []
        for index, transition in enumerate(state.transitions):
            target = f"→ {transition.target}" if transition.target else "stays"
            waits: Line = ((" waits for ", "muted"), (waits_for(self.store.scenario, transition), "wait"))
            keys = self._raisers.keys(transition.event)
            you: Line = (("  you: ", "muted"), (" ".join(keys), "key")) if keys else ()
            way: Line = ((f"{target} ", "plain"),)
            if width_of((*waits, *you, *way)) < width:
                rows.append(Row(f"now:{index}", spread((*waits, *you), way, width)))
            else:
                rows.append(Row(f"now:{index}", crop((*waits, *you), width)))
                rows.append(Row(f"to:{index}", crop((("   ", "plain"), *way), width), selectable=False))
            if transition.condition is not None:
                rows.append(Row(f"if:{index}", self._condition(transition, width), selectable=False))
        return rows

    def _condition(self, transition: Transition, width: int) -> Line:
        assert transition.condition is not None
        truth = truth_of(transition.condition, self.store.memory)
        verdict: Span = (
            (f"error: {truth.error} ", "fault") if truth.error
            else ("true ", "accent") if truth.holds
            else ("false ", "wait")
        )  # fmt: skip
        left: Line = (("   and " if transition.event or transition.after else "   if ", "muted"), (truth.text, "plain"))
        if truth.values:
            left = (*left, (f"   {truth.values}", "muted"))
        return spread(left, (verdict,), width)

    def _state(self, rule: Rule, state: State, view: RuleView) -> list[Row]:
        width = self.graph.row_width or self.list.row_width
        here = view.running and state.id == view.state
        marks = [word for word, true in (("start", state.id == rule.initial), ("end", not state.transitions)) if true]
        line: Line = (
            (" ● " if here else " ○ ", "accent" if here else "muted"),
            (state.id, "accent" if here else "plain"),
            (f"  {', '.join(marks)}" if marks else "", "muted"),
        )
        rows = [Row(HERE if here else "", crop(line, width), selectable=False)]
        labels = min(width // 2, max((len(label_of(one)) for one in state.transitions), default=0) + 1)
        for index, transition in enumerate(state.transitions):
            last = view.transition == index and view.previous == state.id and view.status != ""
            lead = "   └ " if index == len(state.transitions) - 1 else "   ├ "
            guard = f" [{transition.condition.text}]" if transition.condition is not None and transition.event else ""
            arrow: Line = (
                (lead, "muted"),
                cell(label_of(transition), labels, "accent" if last else "plain"),
                (f"→ {transition.target or 'stays'}", "plain" if transition.target else "muted"),
                (guard, "muted"),
            )
            taken: Line = (("  taken last ", "accent"),) if last else ()
            full = (*arrow, *taken)
            rows.append(Row("", full if width_of(full) <= width else spread(arrow, taken, width), selectable=False))
        return rows

    def do(self, action: str) -> None:
        kind, _, index = self.list.current.partition(":")
        rule = self._rule
        if rule is None or kind != "now":
            self.post_message(Told("no transition is selected"))
            return
        view = self.store.rule(rule.name)
        transitions = rule.states[view.state].transitions if view.state in rule.states else ()
        event = transitions[int(index)].event if int(index) < len(transitions) else None
        if event is None:
            self.post_message(Told("this transition waits for no event"))
        elif by_engine := raised_by_engine(self.store.scenario, event):
            self.post_message(Told(by_engine))
        else:
            self.post_message(StartAsked(Trigger("raiseEventTopic", event)))
