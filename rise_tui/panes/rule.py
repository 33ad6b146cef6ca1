"""One rule: its state, why it stays there, and its states with their transitions as a graph."""

from __future__ import annotations

from collections.abc import Sequence

from textual.widget import Widget

from rise_engine.author.drawing.rule_text import engine_raises_text
from rise_engine.author.drawing.state_graph import GraphLayout, lay_out_graph
from rise_engine.author.drawing.study_keys import RULE
from rise_engine.kernel.record_words import trigger_text
from rise_engine.kernel.view import RuleView
from rise_engine.scenario.model import Rule
from rise_tui.actions import bindings_in
from rise_tui.model.control import KeyAction
from rise_tui.model.states import HERE, GraphPosition, draw_state_graph, rule_state
from rise_tui.model.store import Store
from rise_tui.model.wait_explanations import WaitExplanations, key_owner
from rise_tui.panes.pane import ListPane
from rise_tui.rendering.text import ListRow, StyledLine, crop, format_clock, heading_line
from rise_tui.widgets.lines import RowList

CLOCK_SECONDS = 1.0
"""Seconds between two updates of the parts that change with the clock."""
ROWS_AHEAD = 4
"""Rows below the present state that should be visible with it."""
DEFAULT_SHARE = 0.6
"""The reasons have room for this share of a rule's states. Only the other states move the graph."""
TINY_HEIGHT = 5
"""Rows up to which there is room for reasons only."""
MIN_GRAPH_ROWS = 2
"""Rows that the graph keeps in a small pane, where the reasons come first."""
GAP_HEIGHT = 12
"""Rows of the pane from which an empty row separates the reasons from the graph."""


class StateList(RowList):
    """The rule's states below the reasons. The cursor moves between the last reason and the first state."""

    def __init__(self, above: RowList) -> None:
        super().__init__(id="rule-graph")
        self._above = above

    def background_of(self, index: int) -> str:
        return super().background_of(index) if self.has_focus else ""

    def enter(self) -> None:
        """Take the focus, with the cursor on the present state."""
        here = next((row for row in range(self.count) if self.row_at(row).id.startswith(f"{HERE}:")), 0)
        self.move_cursor(self.cursor if here == 0 and self.cursor >= 0 else here, by_wizard=False)
        self.focus(scroll_visible=False)

    def action_step(self, direction: int) -> None:
        if direction < 0 and self._find_selectable(self.cursor - 1, -1) is None:
            self._above.focus(scroll_visible=False)
        else:
            super().action_step(direction)


class ReasonList(RowList):
    """The rule's state, and why it stays there. After its last transition the cursor goes on to the states."""

    def action_step(self, direction: int) -> None:
        below = self.continuation
        if direction > 0 and isinstance(below, StateList) and self._find_selectable(self.cursor + 1, 1) is None:
            below.enter()
        else:
            super().action_step(direction)


class RulePane(ListPane):
    """The rule that the wizard selected, or the top one of the stack."""

    SCOPE = "rule"
    BINDINGS = bindings_in("rule")
    TITLE = "Rule"
    PARTS = frozenset({"rules", "memory", "acts"})
    EMPTY = "select a rule in the list of rules"
    DEFAULT_CSS = """
    RulePane > #rule-rows { height: 3; }
    RulePane > #rule-graph { height: 1fr; }
    """

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self._reasons = WaitExplanations(store)
        self.row_list = ReasonList(id="rule-rows")
        self.graph = StateList(self.row_list)
        self.row_list.continuation = self.graph
        self._layout_made: tuple[Rule, GraphLayout] | None = None
        self._usual_count: tuple[Rule, int, int] | None = None
        """The rule and the width of the count, and the rows that the reasons of most states need."""
        self._in_view: tuple[str, str | None] | None = None
        """The rule and state that was last scrolled into view. After that, the wizard may scroll."""

    @property
    def _shown_rule(self) -> Rule | None:
        """The shown rule. Without a running or selected one: the one that the study's first key for a rule starts."""
        rules = self.store.scenario.rules
        name = self.store.shown_rule or next(iter(self.store.view.running_rules()), "")
        first = next((key.behavior for key in self.store.scenario.keys.values() if key.function == RULE), "")
        return rules.get(name) or rules.get(first) or next(iter(rules.values()), None)

    def body_widgets(self) -> Sequence[Widget]:
        return [self.row_list, self.graph]

    def on_mount(self) -> None:
        self.set_interval(CLOCK_SECONDS, self._repaint_by_clock)

    def _repaint_by_clock(self) -> None:
        """Repaint the parts that change with the clock, if any is visible."""
        rule = self._shown_rule
        if rule is None or not self.display or not self.size.height or self.store.gone_reason:
            return
        view = self.store.rule(rule.name)
        state = rule.states.get(view.state or "") if view.running else None
        if self.store.view.kept or (state is not None and self._reasons.changes_with_time(state)):
            self.repaint()

    def make_rows(self, width: int) -> list[ListRow]:
        """The rows that must always be visible: the rule's state, and why it stays there."""
        rule = self._shown_rule
        if rule is None:
            return []
        view = self.store.rule(rule.name)
        rows = [*self._head_rows(rule, view, width), *self._reasons.kept_rows(width)]
        if view.running and view.state in rule.states:
            rows += self._reasons.rows(rule, rule.states[view.state], view, width)
        return rows

    def repaint(self) -> None:
        super().repaint()
        rule = self._shown_rule
        width = self.graph.row_width or self.row_list.row_width
        if rule is None or width <= 0:
            return
        self._share_room(rule)
        view = self.store.rule(rule.name)
        self._show_graph(rule, view, width)
        position = (rule.name, view.state if view.running else None)
        if position != self._in_view and self.graph.size.height:
            self._in_view = position
            self._bring_into_view()

    def _head_rows(self, rule: Rule, view: RuleView, width: int) -> list[ListRow]:
        state = rule_state(self.store, rule.name)
        when: StyledLine = ((f"since {format_clock(view.since)} ", "muted"),) if view.status else ()
        rows = [ListRow("", heading_line(rule.name, state.span, when, width), selectable=False)]
        line: StyledLine = ()
        if view.running:
            line = ((" in ", "muted"), (view.state or "", "accent"))
            if view.previous:
                line = (*line, ("  from ", "muted"), (view.previous, "plain"))
            if view.trigger:
                line = (*line, (" ", "muted"), (trigger_text(view.trigger), "plain"))
        else:
            if view.reason:
                line = ((f" {view.reason}", "fault" if view.status == "faulted" else "muted"),)
            key = self.store.key_of("startInteractionRule", rule.name)
            if key is not None and not self.store.gone_reason and self.store.key_state != "STOPPED":
                line = (*line, (f"  {key_owner(self.store)}: ", "muted"), (key.label, "key"), (" starts it", "muted"))
        return [*rows, ListRow("", crop(line, width), selectable=False)] if line else rows

    # --- the graph --------------------------------------------------------------------------------------------------

    def _show_graph(self, rule: Rule, view: RuleView, width: int) -> None:
        """Lay out the graph again if the rule or the width has changed. Only different rows are repainted."""
        if self._layout_made is None or self._layout_made[0] is not rule or self._layout_made[1].width != width:
            self._layout_made = rule, lay_out_graph(rule, width)
        layout = self._layout_made[1]
        last = (view.previous, view.transition) if view.previous is not None and view.transition is not None else None
        now = GraphPosition(view.state if view.running else None, last if view.status else None)
        self.graph.show(self.mark_matches(draw_state_graph(layout, now)))

    def _bring_into_view(self) -> None:
        """Scroll only if the present state, or its possible next one right below, would be invisible."""
        height, top = self.graph.size.height, self.graph.scroll_offset.y
        index = next((row for row in range(self.graph.count) if self.graph.row_at(row).id.startswith(HERE)), 0)
        ahead = min(ROWS_AHEAD, height // 3)
        if not top <= index < top + height - ahead:
            self.graph.scroll_to(y=0 if index < height - ahead else index - height // 3, animate=False)

    def _share_room(self, rule: Rule) -> None:
        """Give the reasons the rows that most states of this rule need, so that the graph rarely moves."""
        room = self.size.height - 1
        gap = int(room > GAP_HEIGHT)
        need = max(self._usual_rows(rule), self.row_list.count)
        share = (room - gap) * 3 // 5 if gap else room - MIN_GRAPH_ROWS * (room > TINY_HEIGHT)
        rows = max(1, min(need, share))
        if self.row_list.styles.height is None or self.row_list.styles.height.value != rows:
            self.row_list.styles.height = rows
        if self.graph.styles.margin.top != gap:
            self.graph.styles.margin = (gap, 0, 0, 0)

    def _usual_rows(self, rule: Rule) -> int:
        width = self.row_list.row_width
        if self._usual_count is None or self._usual_count[:2] != (rule, width):
            view = RuleView(running=True)
            needs = sorted(len(self._reasons.rows(rule, state, view, width)) for state in rule.states.values())
            self._usual_count = rule, width, 2 + needs[int((len(needs) - 1) * DEFAULT_SHARE)]
        return self._usual_count[2]

    def carry_out(self, action: str) -> None:
        if action == "rule.back":
            shown = self._shown_rule
            self.host.ask_to_step_back(shown.name if shown is not None else "")
            return
        if self.graph.has_focus:
            self._ask_to_start()
            return
        kind, _, index = self.row_list.current_id.partition(":")
        rule = self._shown_rule
        if rule is None or kind != "now":
            self.host.show_notice("no transition is selected")
            return
        view = self.store.rule(rule.name)
        transitions = rule.states[view.state].transitions if view.state in rule.states else ()
        event = transitions[int(index)].event if int(index) < len(transitions) else None
        if event is None:
            self.host.show_notice("this transition waits for no event")
        elif by_engine := engine_raises_text(self.store.scenario, event):
            self.host.show_notice(by_engine)
        else:
            self.host.start(KeyAction("raiseEventTopic", event, hold=True, by_enter=True))

    def _ask_to_start(self) -> None:
        """Ask whether to start the rule in the state under the cursor."""
        rule, state = self._shown_rule, self.graph.current_id.partition(":")[2]
        if rule is None or state not in rule.states:
            self.host.show_notice("no state is selected")
        else:
            self.host.ask_to_start(rule.name, state)
