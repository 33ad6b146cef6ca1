"""A rule in the editor: what its keys do, and the forms of what is changed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual import on
from textual.binding import Binding, BindingType

from rise_engine.edit.edits import (
    AddStatement,
    AnyEdit,
    CallForm,
    OneOfForm,
    RemoveState,
    RemoveStatement,
    StatementAddress,
)
from rise_engine.edit.outline import WrittenRule, WrittenState
from rise_tui.editing.model.call_draft import CallDraft
from rise_tui.editing.model.form import RuleForm
from rise_tui.editing.model.name_forms import EventKeyForm, NameForm, TemplateValueForm, make_first
from rise_tui.editing.model.rule_forms import CallRuleForm, ConditionRuleForm, TransitionRuleForm
from rise_tui.editing.model.rule_graph import (
    GraphSpot,
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
from rise_tui.editing.model.transition_draft import TransitionDraft, why_not_editable
from rise_tui.editing.rules.form_panel import FormPanel
from rise_tui.editing.rules.rule_view import RuleView

GRAPH_HINTS = (
    ("enter", "what it does"), ("a", "way out"), ("n", "new state"), ("r", "rename"), ("del", "remove"), ("t", "try"),
    ("i", "begins here"),
)  # fmt: skip
WAY_HINTS = (("enter", "change"), ("a", "another way"), ("del", "remove"), ("[ ]", "earlier, later"), ("t", "try"))
PART_HINTS = (
    ("enter", "change"), ("a", "add"), ("f", "only if"), ("l", "otherwise"), ("o", "by chance"), ("w", "way out"),
    ("del", "remove"), ("[ ]", "move"), ("A", "add behind the block"),
)  # fmt: skip
"""What the hint line says: in the graph on a state and on a way, and in the list."""


class RulePage(RuleView):
    """One rule, and its keys: enter opens the form of what is under the cursor."""

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
        Binding("t", "try_rule", show=False),
        Binding("tab,shift+tab", "other_list", show=False),
    ]

    def action_try_rule(self) -> None:
        self.post_message(self.TryRule(self._rule_name, self.spot.state if self.spot is not None else ""))

    def hints(self) -> Sequence[tuple[str, str]]:
        """The keys that matter here and now, the most important first."""
        if self.panel.is_open:
            extra = (("F5", "a key for it"),) if _wants_key(self.panel.form) else ()
            return (("enter", "done"), ("esc", "as it was"), ("tab", "next field"), ("F2", "list"), *extra)
        if self.parts.has_focus:
            return PART_HINTS
        return GRAPH_HINTS if self.spot is None or self.spot.way < 0 else WAY_HINTS

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


def _arm(part: PartRow) -> StatementAddress:
    """The arm of an `if` whose condition a row shows."""
    assert part.at is not None
    path = (*part.at.path, 0) if part.kind == "if" else part.at.path
    return StatementAddress(part.at.rule, part.at.state, part.at.place, part.at.transition, path)


def _wants_key(form: RuleForm | None) -> bool:
    """Whether a form waits for an event that nobody raises."""
    return isinstance(form, TransitionRuleForm) and bool(form.event_without_key)
