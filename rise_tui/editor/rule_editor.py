"""A rule in the editor: its keys, and the forms for changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from msgspec import structs

from rise_engine.author.edit.edits import (
    AddStatement,
    CallForm,
    OneOfForm,
    RemoveState,
    RemoveStatement,
    SetInitial,
    StatementAddress,
)
from rise_engine.author.edit.outline import WrittenRule, WrittenState
from rise_engine.author.edit.plan import EditRefused
from rise_tui.editor.model.fields import Form
from rise_tui.editor.model.rule_graph import GraphSpot
from rise_tui.editor.model.state_forms import (
    NameForm,
    TransitionRuleForm,
    likely_transition,
    transition_of,
    transition_values,
    why_not_editable,
)
from rise_tui.editor.model.state_parts import PartRow, id_of_call, movement, removal, state_parts, use_of
from rise_tui.editor.model.statement_forms import CallRuleForm, ConditionRuleForm, TemplateValueForm, call_values
from rise_tui.editor.rule_display import RuleDisplay

STATE_HINTS = {
    "edit.open": "what it does", "edit.add": "transition", "edit.new-state": "new state", "edit.rename": "rename",
    "edit.try": "try", "edit.remove": "remove", "edit.first": "begins here",
}  # fmt: skip
TRANSITION_HINTS = {
    "edit.open": "change", "edit.add": "transition", "edit.try": "try", "edit.remove": "remove",
    "edit.earlier": "earlier", "edit.later": "later",
}  # fmt: skip
PART_HINTS = {
    "edit.open": "change", "edit.add": "add", "edit.only-if": "only if", "edit.otherwise": "otherwise",
    "edit.chance": "by chance", "edit.remove": "remove", "edit.earlier": "earlier", "edit.later": "later",
}  # fmt: skip
"""The words of the hint line: in the graph on a state and on a transition, and in the list."""


class RuleEditor(RuleDisplay):
    """One rule and its keys. Enter opens the form of the item under the cursor."""

    def _try_rule(self) -> None:
        self._page.try_rule(self._rule_name, self.spot.state if self.spot is not None else "")

    @property
    def hints(self) -> Mapping[str, str]:
        """The actions for the item under the cursor, the most important first, each with a word."""
        if self.parts.has_focus:
            return PART_HINTS
        return STATE_HINTS if self.spot is None or self.spot.transition < 0 else TRANSITION_HINTS

    @property
    def shown_state(self) -> str:
        """The state under the cursor; empty: none."""
        return self.spot.state if self.spot is not None else ""

    @property
    def is_typing(self) -> bool:
        return self.panel.is_open

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        """The actions of the editor that have a meaning here."""
        calls: dict[str, Callable[[], object]] = {"edit.new-state": self._new_state, "edit.try": self._try_rule}
        rule, state, spot = self.rule, self.state, self.spot
        if rule is None or state is None or spot is None:
            return calls
        return calls | {
            "edit.open": lambda: self._open_here(rule, state, spot),
            "edit.add": lambda: self._add(rule, state),
            "edit.behind": lambda: self._add(rule, state, behind=True),
            "edit.rename": lambda: self._open(NameForm({"name": state.id}, rule.name, state.id)),
            "edit.only-if": self._only_if,
            "edit.otherwise": self._otherwise,
            "edit.chance": self._by_chance,
            "edit.first": lambda: self._make_first(rule, state),
            "edit.remove": lambda: self._remove(rule, state, spot),
            "edit.earlier": lambda: self._move(rule, state, spot, -1),
            "edit.later": lambda: self._move(rule, state, spot, 1),
        }

    # --- forms ---

    def _open_here(self, rule: WrittenRule, state: WrittenState, spot: GraphSpot) -> None:
        part = self.parts.part
        if self.graph.has_focus and spot.transition >= 0:
            self._open_transition(rule, state, spot.transition)
        elif self.graph.has_focus:
            self.parts.focus()
        elif part is not None:
            self._open_part(rule, state, part)

    def _open_part(self, rule: WrittenRule, state: WrittenState, part: PartRow) -> None:
        names = self._page.names
        _check_changeable(part)
        if part.kind == "heading" and part.at is None:
            self._add_transition(rule, state)
        elif part.kind == "transition":
            self._open_transition(rule, state, part.transition)
        elif part.call is not None and part.at is not None:
            self._open(CallRuleForm(call_values(part.call), names, part.at, part.call))
        elif part.kind in ("if", "branch") and part.at is not None and part.guard:
            at = _arm(part)
            self._open(ConditionRuleForm({"condition": part.guard}, names, at, "change", part.guard))
        elif part.kind == "parameter" and (use := use_of(self._page.draft.outline, state)) is not None:
            name = part.target or ""
            given = use.values.get(name)
            self._open(TemplateValueForm({"value": given.text if given is not None else ""}, use, name))
        else:
            self._add(rule, state)

    def _open_transition(self, rule: WrittenRule, state: WrittenState, number: int) -> None:
        transition = state.transitions[number]
        if reason := transition.reason or why_not_editable(transition.form):
            raise EditRefused(f"{reason}; e opens the file there")
        values = transition_values(transition.form)
        self._open(TransitionRuleForm(values, self._page.names, rule, state, number))

    def _open(self, form: Form, focus: str = "") -> None:
        self._opened_from = self.parts if self.parts.has_focus else self.graph
        self.add_class("-form")
        self.panel.open(form, focus, self._form_closed)

    def _form_closed(self, form: Form | None) -> None:
        """Return to the list or the graph, and to the new item; None: the form was left."""
        self.remove_class("-form")
        self._opened_from.focus()
        if form is None:
            return
        if isinstance(form, NameForm):
            self.spot = GraphSpot(form.value("name"))
        if isinstance(form, TransitionRuleForm) and form.index is None and (state := self.state) is not None:
            new = transition_of(form.values)
            same = [number for number, transition in enumerate(state.transitions) if transition.form == new]
            self.spot = GraphSpot(state.id, same[-1] if same else -1)
        self.redraw()
        self._select_part()
        if isinstance(form, CallRuleForm) and form.was is None:
            self.parts.select(id_of_call(form.at))

    def _add(self, rule: WrittenRule, state: WrittenState, *, behind: bool = False) -> None:
        """Add a function at the cursor of the list; in the graph, a transition of the state."""
        part = self.parts.part
        if self.graph.has_focus or part is None or (part.kind == "heading" and part.at is None):
            self._add_transition(rule, state)
            return
        at = part.behind if behind else part.new
        if at is None or part.reason:
            raise EditRefused(part.reason or "nothing can be added here")
        values = call_values(CallForm("startCommunicationRobotAct", ""))
        self._open(CallRuleForm(values, self._page.names, at))

    def _add_transition(self, rule: WrittenRule, state: WrittenState) -> None:
        self._open(TransitionRuleForm(likely_transition(state), self._page.names, rule, state), "trigger")

    def _new_state(self) -> None:
        rule = self.rule
        if rule is not None:
            behind = self.spot.state if self.spot is not None else ""
            self._open(NameForm({}, rule.name, behind, is_new=True))

    def _function_here(self, key: str) -> tuple[StatementAddress, CallForm]:
        """The function at the cursor of the list.

        :param key: the key's effect on it. :raises EditRefused: the cursor is not on one that can be changed.
        """
        part = self.parts.part
        if not self.parts.has_focus or part is None or part.at is None or part.call is None:
            raise EditRefused(f"{key}: go to one in the list below the graph (tab)")
        _check_changeable(part)
        return part.at, part.call

    def _only_if(self) -> None:
        """Make the function at the cursor depend on a condition."""
        at, call = self._function_here("o puts a function into a condition")
        self._open(ConditionRuleForm({}, self._page.names, at, "wrap", call=call))

    def _otherwise(self) -> None:
        part = self.parts.part
        if not self.parts.has_focus or part is None:
            raise EditRefused("l adds what happens otherwise: go to a condition in the list below the graph (tab)")
        at, can_be_else = part.new_branch, part.can_be_else
        if at is None:
            raise EditRefused("there is no condition here; o puts a function into one")
        self._open(ConditionRuleForm({}, self._page.names, at, "otherwise", can_be_else=can_be_else))

    def _by_chance(self) -> None:
        """Make the function at the cursor one of several; a random choice picks one of them."""
        at, call = self._function_here("b makes a function one of several")
        first = structs.replace(at, path=(*at.path, 0))
        edits = (RemoveStatement(at), AddStatement(at, OneOfForm((call,))))
        self._page.make(*edits, then=lambda: self.parts.select(id_of_call(first)))

    def _make_first(self, rule: WrittenRule, state: WrittenState) -> None:
        self._page.make(*(() if rule.initial == state.id else (SetInitial(rule.name, state.id),)))

    def _part_here(self, rule: WrittenRule, state: WrittenState, spot: GraphSpot) -> PartRow | None:
        """The row at the cursor of the list; in the graph, the row of the transition under the cursor."""
        if self.parts.has_focus:
            return self.parts.part
        parts = state_parts(rule.name, state)
        return next((part for part in parts if part.kind == "transition" and part.transition == spot.transition), None)

    def _remove(self, rule: WrittenRule, state: WrittenState, spot: GraphSpot) -> None:
        if self.graph.has_focus and spot.transition < 0:
            self._page.make(RemoveState(rule.name, state.id))
            return
        part = self._part_here(rule, state, spot)
        if part is not None:
            _check_changeable(part)
        edit = removal(part, state, rule.name) if part is not None else None
        if edit is None:
            raise EditRefused("there is nothing to remove here")
        index = self.parts.cursor
        section = self.parts.section_of(index)  # an `a` after this adds the same kind of thing
        self._page.make(edit, then=(lambda: self.parts.stay_in(section, index)) if self.parts.has_focus else None)

    def _move(self, rule: WrittenRule, state: WrittenState, spot: GraphSpot, step: int) -> None:
        part = self._part_here(rule, state, spot)
        edit = movement(part, state, rule.name, step) if part is not None else None
        if part is None or edit is None:
            raise EditRefused((part.reason if part is not None else "") or "it cannot be moved further")
        self._page.make(edit, then=lambda: self._follow_row(part, step))

    def _follow_row(self, part: PartRow, step: int) -> None:
        """Move the cursor with the moved row."""
        if part.kind == "transition" and self.spot is not None:
            self._go_to(GraphSpot(self.spot.state, part.transition + step))
            self._select_part()
        elif part.at is not None:
            moved = (*part.at.path[:-1], part.at.path[-1] + step)
            self.parts.select(part._replace(at=structs.replace(part.at, path=moved)).id)


def _check_changeable(part: PartRow) -> None:
    """:raises EditRefused: a row can only be changed in its file."""
    if part.reason:
        raise EditRefused(f"{part.reason}; e opens the file there")


def _arm(part: PartRow) -> StatementAddress:
    """The branch of an `if` whose condition a row shows."""
    assert part.at is not None
    path = (*part.at.path, 0) if part.kind == "if" else part.at.path
    return structs.replace(part.at, path=path)
