"""A rule in the editor: its graph above, the contents of the selected state below, and the cursor in both."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Vertical

from rise_engine.author.drawing.state_graph import GraphLayout
from rise_engine.author.edit.outline import WrittenRule, WrittenState
from rise_engine.base.text import pluralize
from rise_engine.scenario.diagnostics import Diagnostic, Severity
from rise_tui.editor.form import FormPanel
from rise_tui.editor.model.draft import StudyDraft
from rise_tui.editor.model.fields import NOTE_MARKS
from rise_tui.editor.model.rule_graph import (
    GraphSpot,
    beside,
    draw_rule,
    lay_out_rule,
    parse_spot,
    rule_findings,
    valid_spot,
    worst,
)
from rise_tui.editor.model.state_parts import PartRow, state_parts, use_of
from rise_tui.editor.model.study_names import StudyNames, study_names
from rise_tui.editor.page import TURNS, EditPage
from rise_tui.editor.study import findings_in_rules
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    TextRole,
    align_at_both_ends,
    cell_width,
    crop,
    shorten,
)
from rise_tui.widgets.lines import RowList, RowView, StaticLines

NO_MARK: StyledSpan = ("  ", "plain")


class RuleHost(EditPage):
    """A page that shows a rule, as the rule's editor sees it."""

    _names: tuple[StudyDraft, StudyNames] | None = None

    @property
    def names(self) -> StudyNames:
        """The study's names, made once for each version of the files."""
        draft = self.draft
        if self._names is None or self._names[0] is not draft:
            self._names = (draft, study_names(draft.outline, draft.checked.draft, draft.files))
        return self._names[1]

    @abstractmethod
    def try_rule(self, rule: str, state: str) -> None:
        """Try the rule from this state; empty: from its first state."""

    @property
    def findings(self) -> Sequence[Diagnostic]:
        """The diagnostics of the study, and the findings of exploring in its rules."""
        return [*self.draft.findings, *findings_in_rules(self.frame.explored, self.draft)]


class RuleGraphList(RowList):
    """The drawing, with a cursor over states and transitions."""

    def move_cursor(self, index: int, *, by_wizard: bool = True) -> None:
        """Move the cursor. At the edge the view scrolls by a third, which shows the next rows and saves repaints."""
        top, height = self.scroll_offset.y, self.size.height
        super().move_cursor(index, by_wizard=by_wizard)
        if height and self.cursor >= top + height:
            self.scroll_to(y=self.cursor - 2 * height // 3, animate=False)
        elif height and 0 <= self.cursor < top:
            self.scroll_to(y=self.cursor - height // 3, animate=False)


class PartList(RowList):
    """The functions of a state, and its transitions."""

    def __init__(self) -> None:
        super().__init__(id="rule-parts")
        self._parts: Sequence[PartRow] = ()

    def show_parts(self, parts: Sequence[PartRow], width: int, marks: Sequence[StyledSpan]) -> None:
        """
        :param marks: each part's mark of a diagnostic."""
        self._parts = parts
        self.show([ListRow(part.id, part_line(part, mark, width)) for part, mark in zip(parts, marks, strict=True)])

    @property
    def part(self) -> PartRow | None:
        """The part under the cursor."""
        return self._parts[self.cursor] if 0 <= self.cursor < len(self._parts) else None

    def section_of(self, index: int) -> str:
        """The id of the heading above a row."""
        above = reversed(self._parts[: index + 1])
        return next((part.id for part in above if part.kind == "heading"), "")

    def stay_in(self, section: str, index: int) -> None:
        """Put the cursor on the row of a section that is nearest to an index."""
        rows = [at for at in range(self.count) if self.section_of(at) == section]
        if rows:
            self.move_cursor(min(rows, key=lambda at: abs(at - index)))


class RuleDisplay(Vertical):
    """A rule on the screen, and the cursor in it. Graph and list are two stops of the Tab key."""

    DEFAULT_CSS = """
    RuleDisplay { height: 1fr; }
    RuleDisplay #rule-graph-list { height: 1fr; min-height: 4; }
    RuleDisplay #rule-parts { height: 1fr; min-height: 3; max-height: 12; }
    RuleDisplay FormPanel, RuleDisplay.-form #rule-parts, RuleDisplay.-form #state-heading { display: none; }
    RuleDisplay.-form FormPanel { display: block; }
    """

    def __init__(self, page: RuleHost, rule: str, state: str = "") -> None:
        """`state`: the first state of the cursor; empty: the rule's first state."""
        super().__init__(id="rule-page")
        self._page, self._rule_name = page, rule
        self.spot = GraphSpot(state) if state else None
        self._layout: GraphLayout | None = None
        self._laid_out: tuple[WrittenRule, int] | None = None
        self._findings: dict[GraphSpot, list[Diagnostic]] = {}
        self.heading, self.state_heading = StaticLines(id="rule-heading"), StaticLines(id="state-heading")
        self.graph, self.parts, self.panel = RuleGraphList(id="rule-graph-list"), PartList(), FormPanel(page)
        self._opened_from: RowView = self.graph
        """The list from which the form was opened."""

    def compose(self) -> ComposeResult:
        yield self.heading
        yield self.graph
        yield self.state_heading
        yield self.parts
        yield self.panel

    def on_mount(self) -> None:
        self.graph.focus()
        self.redraw()

    # --- drawing ---

    @property
    def rule(self) -> WrittenRule | None:
        return self._page.draft.outline.rule(self._rule_name)

    @property
    def state(self) -> WrittenState | None:
        """The state under the cursor, or the state of the transition under the cursor."""
        rule, spot = self.rule, self.spot
        if rule is None or spot is None:
            return None
        return next((state for state in rule.states if state.id == spot.state), None)

    def redraw(self) -> None:
        """Show the present rule."""
        rule, width = self.rule, self.graph.row_width
        if width <= 0:
            return
        if rule is None:
            self.graph.show([ListRow("", ((" this rule no longer exists; esc leaves", "muted"),), selectable=False)])
            return
        if self._laid_out != (rule, width):
            self._laid_out, self._layout = (rule, width), lay_out_rule(rule, width)
        self._findings = rule_findings(rule, self._page.findings)
        self.heading.show(self._heading_line(rule))
        if self._layout is None:
            hint = " this rule has no states yet: n adds one"
            self.graph.show([ListRow("", ((hint, "muted"),), selectable=False)])
            self.parts.show([])
            return
        self.spot = valid_spot(self._layout, rule, self.spot)
        self._draw_graph()
        self._draw_parts()

    @property
    def _marks(self) -> dict[GraphSpot, Severity]:
        return {spot: worst(found) for spot, found in self._findings.items()}

    def _draw_graph(self) -> None:
        assert self._layout is not None and self.spot is not None
        self.graph.show(draw_rule(self._layout, self.spot, self._marks))
        self.graph.select(self.spot.id)

    def _draw_parts(self) -> None:
        rule, state = self.rule, self.state
        if rule is None or state is None:
            return
        use = use_of(self._page.draft.outline, state)
        parts = state_parts(rule.name, state, use)
        marks = {spot: NOTE_MARKS[severity] for spot, severity in self._marks.items()}
        of_parts = [
            marks.get(GraphSpot(state.id, part.transition), NO_MARK) if part.kind == "transition" else NO_MARK
            for part in parts
        ]
        width = self.parts.row_width or self.size.width
        self.parts.show_parts(parts, width, of_parts)
        self.state_heading.show(self._state_line(rule, state, width))

    def _heading_line(self, rule: WrittenRule) -> StyledLine:
        transitions = sum(len(state.transitions) for state in rule.states)
        notes = [f"{pluralize(len(rule.states), 'state')} {pluralize(transitions, 'transition')}"]
        keys = [key for key, what in self._page.names.keyboard.items() if _starts(what, rule.name)]
        notes += [f"key {', '.join(keys)}"] if keys else []
        notes += [f"priority {rule.priority}"] if rule.priority is not None else []
        name, right = f" {rule.name}", f"{rule.file}:{rule.line} "
        width = max(20, self.size.width)
        while notes and cell_width(f"{name}   {' · '.join(notes)} {right}") > width:
            notes.pop()  # the last one matters least, and half a word is useless
        left: StyledLine = ((name, "strong"), (f"   {' · '.join(notes)}", "muted"))
        return align_at_both_ends(left, ((right, "muted"),), width)

    def _state_line(self, rule: WrittenRule, state: WrittenState, width: int) -> StyledLine:
        first = "  the rule begins here" if state.id == rule.initial else ""
        template = f"  from the template {state.template}" if state.template else ""
        found = self._findings.get(self.spot or GraphSpot(""), ())
        problem: StyledLine = ()
        if found:
            mark = NOTE_MARKS[found[0].severity]
            problem = (("  ", "plain"), (f"{mark[0]}{found[0].message}", mark[1]))
        title = f"── {state.id} ──{first}{template}"
        return crop(((title, "accent"), *problem), max(1, width))

    def find(self, text: str) -> None:
        """Put the cursor on the first state whose name contains this text."""
        rule = self.rule
        wanted = text.strip().casefold()
        found = next((state.id for state in rule.states if wanted in state.id.casefold()), "") if rule else ""
        if wanted and found:
            self.go_to_state(found)

    def go_to_state(self, state: str) -> None:
        """Put the cursor on a state."""
        self._go_to(GraphSpot(state))
        self._select_part()

    # --- the cursor ---

    @on(RowView.CursorMoved)
    def _cursor_moved(self, event: RowView.CursorMoved) -> None:
        event.stop()
        if event.rows is self.graph:
            self._go_to(parse_spot(self.graph.current_id))
            self._select_part()
        elif (part := self.parts.part) is not None and self.spot is not None:
            self._go_to(GraphSpot(self.spot.state, part.transition))

    def on_key(self, event: events.Key) -> None:
        """Left and right switch between a state and a transition in the same row."""
        if event.key in TURNS and self.graph.has_focus and self._layout is not None and self.spot is not None:
            event.stop()
            event.prevent_default()
            self._go_to(beside(self._layout, self.spot, TURNS[event.key]))
            self._select_part()

    def _go_to(self, spot: GraphSpot | None) -> None:
        if spot is None or self._layout is None or spot == self.spot:
            return
        other_state = self.spot is None or spot.state != self.spot.state
        self.spot = spot
        self._draw_graph()
        rule, state = self.rule, self.state
        if rule is None or state is None:
            return
        if other_state:
            self._draw_parts()
        else:
            self.state_heading.show(self._state_line(rule, state, self.parts.row_width or self.size.width))

    def _select_part(self) -> None:
        """Move the list's cursor to the graph's place."""
        state, spot = self.state, self.spot
        if state is None or spot is None:
            return
        rows = range(self.parts.count)
        wanted = f"transition:transition:{spot.transition}:" if spot.transition >= 0 else ""
        found = next((index for index in rows if self.parts.row_at(index).id.startswith(wanted)), None)
        if found is not None:
            self.parts.move_cursor(found, by_wizard=False)

    @on(RowView.Resized)
    def _resized(self, event: RowView.Resized) -> None:
        event.stop()
        self.redraw()


def _starts(binding: object, rule: str) -> bool:
    """Whether a key of the keyboard starts this rule."""
    return isinstance(binding, dict) and binding.get("rule") == rule


def part_line(part: PartRow, mark: StyledSpan, width: int) -> StyledLine:
    """One row, indented. Its target is at the end, and always visible."""
    indent = " " * (2 * part.depth)
    if part.kind == "heading":
        return (mark, (part.text, "strong"))
    role: TextRole = "muted" if part.reason else "plain"
    if part.kind == "transition":
        target = f" → {part.target}" if part.target is not None else "  stays here"
        end: StyledLine = ((shorten(target, max(8, width // 2)), "muted" if part.target is None else role),)
        guard: StyledLine = ((f" but only if {part.guard}", "muted"),) if part.guard else ()
        return align_at_both_ends((mark, (f" {part.text}", role), *guard), end, width)
    if part.kind == "parameter":
        return (mark, (indent + part.text, role), (f"   {part.guard}" if part.guard else "", "muted"))
    if part.kind in ("if", "branch", "choice"):
        return (mark, (indent + part.text, "muted" if part.reason else "accent"))
    return (mark, (indent + part.text, "muted" if part.kind == "empty" else role))
