"""A rule in the editor: its graph above, what the chosen state does below, and the form of what is changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Protocol

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.message import Message

from rise_engine.drawing.state_graph import GraphLayout
from rise_engine.edit.edits import (
    AddStatement,
    AnyEdit,
    CallForm,
    OneOfForm,
    RemoveState,
    RemoveStatement,
    StatementAddress,
)
from rise_engine.edit.outline import Outline, WrittenRule, WrittenState
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.text import pluralize
from rise_tui.editing.model.call_draft import CallDraft
from rise_tui.editing.model.form import RuleForm
from rise_tui.editing.model.name_forms import EventKeyForm, NameForm, TemplateValueForm, make_first
from rise_tui.editing.model.rule_findings import NO_FINDINGS, rule_findings
from rise_tui.editing.model.rule_forms import CallRuleForm, ConditionRuleForm, TransitionRuleForm
from rise_tui.editing.model.rule_graph import (
    SEVERITY_MARKS,
    GraphSpot,
    beside,
    draw_rule,
    lay_out_rule,
    parse_spot,
    valid_spot,
)
from rise_tui.editing.model.state_parts import (
    PartRow,
    add_branch,
    add_statement,
    call_at,
    movement,
    removal,
    state_parts,
    use_of,
)
from rise_tui.editing.model.study_names import StudyNames
from rise_tui.editing.model.transition_draft import TransitionDraft, why_not_editable
from rise_tui.editing.rules.form_panel import FormPanel
from rise_tui.editing.rules.rule_lists import PartList, RuleGraphList
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, align_at_both_ends, crop
from rise_tui.widgets.row_list import RowView
from rise_tui.widgets.static_lines import StaticLines

NO_MARK: StyledSpan = ("  ", "plain")


class RuleStudy(Protocol):
    """The study that is changed, as the page needs it."""

    @property
    def outline(self) -> Outline: ...

    @property
    def names(self) -> StudyNames: ...

    @property
    def findings(self) -> Sequence[Diagnostic]: ...

    @property
    def files(self) -> Mapping[str, bytes]: ...

    def change(self, *edits: AnyEdit) -> str:
        """Make edits as one step; why they cannot be made, or empty."""


class RulePage(Vertical):
    """One rule. Graph and list are two stops of the tab key; enter opens the form of what is under the cursor."""

    DEFAULT_CSS = """
    RulePage { height: 1fr; }
    RulePage #rule-graph-list { height: 1fr; min-height: 4; }
    RulePage #rule-parts { height: 1fr; min-height: 3; }
    RulePage.-form #rule-parts, RulePage.-form #state-heading { display: none; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "open", show=False),
        Binding("a,insert", "add", show=False),
        Binding("A", "add_behind", show=False),
        Binding("w", "add_way", show=False),
        Binding("n", "new_state", show=False),
        Binding("r", "rename", show=False),
        Binding("i", "make_first", show=False),
        Binding("f", "only_if", show=False),
        Binding("l", "otherwise", show=False),
        Binding("o", "by_chance", show=False),
        Binding("delete", "remove", show=False),
        Binding("left_square_bracket,shift+up", "move(-1)", show=False),
        Binding("right_square_bracket,shift+down", "move(1)", show=False),
        Binding("tab,shift+tab", "other_list", show=False),
    ]

    @dataclass
    class Refused(Message):
        """Why something cannot be done, for the line of notices."""

        sentence: str

    @dataclass
    class SpotMoved(Message):
        """The cursor is elsewhere: the file's lines beside it follow."""

        file: str
        line: int

    def __init__(self, study: RuleStudy, rule: str) -> None:
        super().__init__(id="rule-page")
        self._study, self._rule_name = study, rule
        self.spot: GraphSpot | None = None
        self._layout: GraphLayout | None = None
        self._laid_out: tuple[WrittenRule, int] | None = None
        self._findings = NO_FINDINGS
        self.heading, self.state_heading = StaticLines(id="rule-heading"), StaticLines(id="state-heading")
        self.graph, self.parts, self.panel = RuleGraphList(id="rule-graph-list"), PartList(), FormPanel()
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

    # --- what is shown ---

    @property
    def rule(self) -> WrittenRule | None:
        return self._study.outline.rule(self._rule_name)

    @property
    def state(self) -> WrittenState | None:
        """The state under the cursor, or the one whose way is."""
        rule, spot = self.rule, self.spot
        if rule is None or spot is None:
            return None
        return next((state for state in rule.states if state.id == spot.state), None)

    def show_rule(self, rule: str, state: str = "") -> None:
        """Show another rule, from its beginning or from a state on."""
        self._rule_name, self.spot = rule, GraphSpot(state) if state else None
        self.redraw()

    def redraw(self) -> None:
        """Show the rule as it is now."""
        rule, width = self.rule, self.graph.row_width
        if width <= 0:
            return
        if rule is None:
            self.graph.show(
                [ListRow("", ((" this rule is not there any more; esc leaves", "muted"),), selectable=False)]
            )
            return
        if self._laid_out != (rule, width):
            self._laid_out, self._layout = (rule, width), lay_out_rule(rule, width)
        self._findings = rule_findings(rule, self._study.findings, self._study.files.get(rule.file, b""))
        self.heading.show(self._heading_line(rule))
        if self._layout is None:
            hint = " it has no state yet: n makes one"
            self.graph.show([ListRow("", ((hint, "muted"),), selectable=False)])
            self.parts.show([])
            return
        self.spot = valid_spot(self._layout, rule, self.spot)
        self._draw_graph()
        self._draw_parts()

    def _draw_graph(self) -> None:
        assert self._layout is not None and self.spot is not None
        self.graph.show(draw_rule(self._layout, self.spot, self._findings.marks))
        self.graph.select(self.spot.id)

    def _draw_parts(self) -> None:
        rule, state = self.rule, self.state
        if rule is None or state is None:
            return
        use = use_of(self._study.outline, rule, state)
        parts = state_parts(rule.name, state, use)
        marks = self._findings.marks
        of_parts = [
            SEVERITY_MARKS[marks[spot]] if (spot := _spot_of(state, part)) in marks else NO_MARK for part in parts
        ]
        width = self.parts.row_width or self.size.width
        self.parts.show_parts(parts, width, of_parts)
        self.state_heading.show(self._state_line(rule, state, width))

    def _heading_line(self, rule: WrittenRule) -> StyledLine:
        ways = sum(len(state.transitions) for state in rule.states)
        priority = f"priority {rule.priority} · " if rule.priority is not None else ""
        keys = [key for key, what in self._study.names.keyboard.items() if _starts(what, rule.name)]
        key = f"key {', '.join(keys)} · " if keys else ""
        middle = f"   {key}{priority}{pluralize(len(rule.states), 'state')} {pluralize(ways, 'way')}"
        right: StyledLine = ((f"{rule.file}:{rule.line} ", "muted"),)
        return align_at_both_ends(((f" {rule.name}", "strong"), (middle, "muted")), right, max(20, self.size.width))

    def _state_line(self, rule: WrittenRule, state: WrittenState, width: int) -> StyledLine:
        first = "  it begins here" if state.id == rule.initial else ""
        template = f"  from the template {state.template}" if state.template else ""
        found = self._findings.of_spot.get(self.spot or GraphSpot(""), ())
        problem: StyledLine = ()
        if found:
            mark = SEVERITY_MARKS[found[0].severity]
            problem = (("  ", "plain"), (f"{mark[0]}{found[0].message}", mark[1]))
        title = f"── {state.id} ──{first}{template}"
        return crop(((title, "accent"), *problem), max(1, width))

    # --- the cursor ---

    @on(RowView.CursorMoved)
    def _cursor_moved(self, event: RowView.CursorMoved) -> None:
        event.stop()
        if event.rows is self.graph:
            self._go_to(parse_spot(self.graph.current_id))
            self._select_part()
        elif (part := self.parts.part) is not None and self.spot is not None:
            self._go_to(GraphSpot(self.spot.state, part.way))

    @on(RuleGraphList.GoBeside)
    def _go_beside(self, event: RuleGraphList.GoBeside) -> None:
        event.stop()
        if self._layout is not None and self.spot is not None:
            self._go_to(beside(self._layout, self.spot, event.step))
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
        line = state.transitions[spot.way].line if spot.way >= 0 else state.line
        self.post_message(self.SpotMoved(rule.file, line))

    def _select_part(self) -> None:
        """The list's cursor follows the graph's."""
        state, spot = self.state, self.spot
        if state is None or spot is None:
            return
        rows = range(self.parts.count)
        wanted = (lambda row: row.startswith(f"way:transition:{spot.way}:")) if spot.way >= 0 else (lambda row: True)
        found = next((index for index in rows if wanted(self.parts.row_at(index).id)), None)
        if found is not None:
            self.parts.move_cursor(found, by_wizard=False)

    def action_other_list(self) -> None:
        (self.parts if self.graph.has_focus else self.graph).focus()

    @on(RowView.Resized)
    def _resized(self, event: RowView.Resized) -> None:
        event.stop()
        self.redraw()

    # --- forms ---

    async def action_open(self) -> None:
        rule, state, spot = self.rule, self.state, self.spot
        if rule is None or state is None or spot is None:
            return
        if self.graph.has_focus:
            if spot.way >= 0:
                await self._open_way(rule, state, spot.way)
            else:
                self.parts.focus()
            return
        part = self.parts.part
        if part is not None:
            await self._open_part(rule, state, part)

    async def _open_part(self, rule: WrittenRule, state: WrittenState, part: PartRow) -> None:
        names = self._study.names
        if part.kind == "heading" and part.at is None and not part.reason:
            await self.action_add_way()
        elif part.reason:
            self._refuse(f"{part.reason}; e opens the file there")
        elif part.kind == "way":
            await self._open_way(rule, state, part.way)
        elif part.kind == "call" and part.at is not None and (call := call_at(state, part)) is not None:
            await self._open(CallRuleForm(names, CallDraft.of(call), part.at, call))
        elif part.kind in ("if", "branch") and part.at is not None and part.guard:
            at = _arm(part)
            await self._open(ConditionRuleForm(names, at, "change", part.guard, part.guard))
        elif part.kind == "parameter" and (use := use_of(self._study.outline, rule, state)) is not None:
            name = part.target or ""
            given = use.values.get(name)
            await self._open(TemplateValueForm(use, name, given.text if given is not None else ""))
        else:
            await self.action_add()

    async def _open_way(self, rule: WrittenRule, state: WrittenState, number: int) -> None:
        way = state.transitions[number]
        if reason := way.reason or why_not_editable(way.form):
            self._refuse(f"{reason}; e opens the file there")
            return
        await self._open(
            TransitionRuleForm(
                self._study.names,
                rule,
                state.id,
                TransitionDraft.of(way.form),
                number,
                way.form,
                bool(way.statements),
                len(state.transitions),
            )
        )

    async def _open(self, form: RuleForm, focus: str = "") -> None:
        if not self.panel.is_open:
            self._opened_from = self.parts if self.parts.has_focus else self.graph
        self.add_class("-form")
        await self.panel.open(form, focus)

    def close_form(self) -> None:
        """Back to the list, or the graph, where the form was opened."""
        self.panel.close()
        self.remove_class("-form")
        self._opened_from.focus()

    async def action_add(self) -> None:
        await self._add(behind=False)

    async def action_add_behind(self) -> None:
        await self._add(behind=True)

    async def _add(self, *, behind: bool) -> None:
        """A function at the cursor of the list; in the graph, a way out of the state."""
        part = self.parts.part
        if self.graph.has_focus or part is None or (part.kind == "heading" and part.at is None):
            await self.action_add_way()
            return
        edit = add_statement(part, CallForm("startCommunicationRobotAct", ""), behind=behind)
        if edit is None:
            self._refuse(part.reason or "nothing can stand here")
            return
        await self._open(CallRuleForm(self._study.names, CallDraft(), edit.at))

    async def action_add_way(self) -> None:
        rule, state = self.rule, self.state
        if rule is not None and state is not None:
            form = TransitionRuleForm(self._study.names, rule, state.id, TransitionDraft(), ways=len(state.transitions))
            await self._open(form, "trigger")

    async def action_new_state(self) -> None:
        rule = self.rule
        if rule is not None:
            behind = self.spot.state if self.spot is not None else ""
            await self._open(NameForm(self._study.names, rule, "new state", "", behind))

    async def action_rename(self) -> None:
        rule, state = self.rule, self.state
        if rule is not None and state is not None:
            await self._open(NameForm(self._study.names, rule, "rename state", state.id, state.id))

    async def action_only_if(self) -> None:
        """The function at the cursor is to be done only if something is true."""
        state, part = self.state, self.parts.part
        call = call_at(state, part) if state is not None and part is not None else None
        if not self.parts.has_focus or part is None or part.at is None or call is None:
            self._refuse("f puts a function into a condition: go to one in the list below the graph (tab)")
        elif part.reason:
            self._refuse(f"{part.reason}; e opens the file there")
        else:
            await self._open(ConditionRuleForm(self._study.names, part.at, "wrap", call=call))

    async def action_otherwise(self) -> None:
        part, parts = self.parts.part, self._parts_now()
        if not self.parts.has_focus or part is None:
            self._refuse("l says what happens otherwise: go to a condition in the list below the graph (tab)")
            return
        without, with_condition = add_branch(part, parts, None), add_branch(part, parts, "x")
        edit = without or with_condition
        if edit is None:
            self._refuse("there is no condition here; f puts a function into one")
            return
        form = ConditionRuleForm(self._study.names, edit.at, "otherwise", can_be_else=without is not None)
        await self._open(form)

    def action_by_chance(self) -> None:
        """The function at the cursor becomes one of several, of which one is picked."""
        state, part = self.state, self.parts.part
        call = call_at(state, part) if state is not None and part is not None else None
        if not self.parts.has_focus or part is None or part.at is None or call is None:
            self._refuse("o makes a function one of several: go to one in the list below the graph (tab)")
        elif part.reason:
            self._refuse(f"{part.reason}; e opens the file there")
        else:
            self._change(RemoveStatement(part.at), AddStatement(part.at, OneOfForm((call,))))

    def action_make_first(self) -> None:
        rule, state = self.rule, self.state
        if rule is not None and state is not None:
            self._change(*make_first(rule, state.id))

    def action_remove(self) -> None:
        rule, state, spot = self.rule, self.state, self.spot
        if rule is None or state is None or spot is None:
            return
        if self.graph.has_focus and spot.way < 0:
            self._change(RemoveState(rule.name, state.id))
            return
        part = self.parts.part if self.parts.has_focus else self._way_part(spot.way)
        edit = removal(part, state, rule.name) if part is not None else None
        if edit is None or (part is not None and part.reason):
            reason = part.reason if part is not None else ""
            self._refuse(f"{reason}; e opens the file there" if reason else "there is nothing to take away here")
        else:
            self._change(edit)

    def action_move(self, step: int) -> None:
        rule, state, spot = self.rule, self.state, self.spot
        if rule is None or state is None or spot is None:
            return
        part = self.parts.part if self.parts.has_focus else self._way_part(spot.way)
        edit = movement(part, state, rule.name, step) if part is not None else None
        if part is None or edit is None:
            self._refuse((part.reason if part is not None else "") or "it cannot be moved further")
            return
        if not self._change(edit):
            return
        if part.kind == "way":
            self._go_to(GraphSpot(spot.state, part.way + step))
            self._select_part()
        elif part.at is not None:
            moved = (*part.at.path[:-1], part.at.path[-1] + step)
            at = StatementAddress(part.at.rule, part.at.state, part.at.place, part.at.transition, moved)
            self.parts.select(part._replace(at=at).id)

    def _parts_now(self) -> list[PartRow]:
        rule, state = self.rule, self.state
        return state_parts(rule.name, state) if rule is not None and state is not None else []

    def _way_part(self, number: int) -> PartRow | None:
        return next((part for part in self._parts_now() if part.kind == "way" and part.way == number), None)

    # --- changes ---

    @on(FormPanel.Left)
    def _form_left(self, event: FormPanel.Left) -> None:
        event.stop()
        self.close_form()

    @on(FormPanel.Finished)
    def _form_finished(self, event: FormPanel.Finished) -> None:
        event.stop()
        form = event.form
        edits = form.edits()
        if edits and (problem := self._study.change(*edits)):
            self.panel.say(problem)
            return
        if isinstance(form, NameForm) and self.spot is not None and form.purpose != "rename rule":
            self.spot = GraphSpot(form.name.strip(), -1)
        if isinstance(form, TransitionRuleForm) and form.index is None:
            self.spot = GraphSpot(form.state, form.ways)
        self.close_form()
        self.redraw()
        self._select_part()

    @on(FormPanel.ExtraAsked)
    async def _give_key(self, event: FormPanel.ExtraAsked) -> None:
        event.stop()
        form = event.form
        if isinstance(form, TransitionRuleForm) and form.event_without_key:
            if form.edits() and (problem := self._study.change(*form.edits())):
                self.panel.say(problem)
                return
            self.redraw()
            await self._open(EventKeyForm(self._study.names, form.event_without_key))

    def _change(self, *edits: AnyEdit) -> bool:
        """Make edits; what is in the way is said. Whether something was changed."""
        if not edits:
            return False
        if problem := self._study.change(*edits):
            self._refuse(problem)
            return False
        self.redraw()
        return True

    def _refuse(self, sentence: str) -> None:
        self.post_message(self.Refused(sentence))


def _spot_of(state: WrittenState, part: PartRow) -> GraphSpot | None:
    """The place of the graph whose findings belong to a row of the list."""
    return GraphSpot(state.id, part.way) if part.kind == "way" else None


def _arm(part: PartRow) -> StatementAddress:
    """The arm of an `if` whose condition a row shows."""
    assert part.at is not None
    path = (*part.at.path, 0) if part.kind == "if" else part.at.path
    return StatementAddress(part.at.rule, part.at.state, part.at.place, part.at.transition, path)


def _starts(binding: object, rule: str) -> bool:
    """Whether a key of the keyboard starts this rule."""
    return isinstance(binding, dict) and binding.get("rule") == rule
