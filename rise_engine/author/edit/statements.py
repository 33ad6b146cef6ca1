"""Edits of a rule's statements: functions, `if` with its branches, `oneOf`.

A statement is one element, except for an `if` with an `else` after it, which is several. Branches may be inside their
`if` or after it (docs/reference/rules.md); both forms stay.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rise_engine.author.edit.addresses import (
    BranchPlace,
    StatementList,
    branch_at,
    check_changeable,
    list_at,
    statement_at,
)
from rise_engine.author.edit.edits import (
    AddBranch,
    AddStatement,
    BranchForm,
    CallForm,
    Edit,
    IfForm,
    MoveStatement,
    RemoveStatement,
    SetBranchCondition,
    SetCall,
    StatementForm,
)
from rise_engine.author.edit.outline import ONE_OF, WrittenStatement, call_words, statement_words
from rise_engine.author.edit.plan import EditRefused, Plan, Splice, StudyState
from rise_engine.scenario.grammar import form_of
from rise_engine.scenario.model import normal_topic
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_layout import (
    WritingGap,
    collapse,
    gap_before,
    gap_behind,
    gap_in,
    move_siblings,
    removal_or_collapse,
)
from rise_engine.syntax.xml_writing import NewElement, one_line, set_attributes

_ORDER = tuple(form_of("function").attributes)
_BRANCHES = ("else", "elseif")


# --- forms --------------------------------------------------------------------------------------------------------


def call_attributes(call: CallForm) -> dict[str, str | None]:
    """Return the attributes of a function. :raises EditRefused: one does not fit the function, or is missing."""
    argument = call.argument.strip()
    if not argument or (call.function == "raiseEventTopic" and not normal_topic(argument)):
        raise EditRefused(f"`{call.function}` needs to know what; name it")
    if call.function == "raiseEventTopic":
        argument = f"/{normal_topic(argument)}"
    starts = call.function == "startInteractionRule"
    if not starts and (call.state is not None or not call.enter):
        raise EditRefused("a state to begin in goes with startInteractionRule")
    if call.keep is not None and call.function != "raiseEventTopic":
        raise EditRefused("how long it is kept goes with raiseEventTopic")
    values: dict[str, str | None] = dict.fromkeys(_ORDER)
    values[call.function] = argument
    values["state"] = call.state or None
    values["enter"] = None if call.enter else "no"
    values["keep"] = call.keep or None
    return values


def _element(form: StatementForm) -> NewElement:
    if isinstance(form, CallForm):
        values = call_attributes(form)
        return NewElement("function", {name: value for name, value in values.items() if value is not None})
    if isinstance(form, IfForm):
        _check_branches(form.branches)
        first, *others = form.branches
        inner = (*map(_element, first.statements), *map(_branch_element, others))
        return NewElement("if", {"cond": str(first.condition).strip()}, children=inner)
    if not form.choices:
        raise EditRefused("`oneOf` needs functions to pick one of")
    return NewElement("oneOf", children=tuple(map(_element, form.choices)))


def _check_branches(branches: tuple[BranchForm, ...]) -> None:
    if not branches or branches[0].condition is None:
        raise EditRefused("an `if` begins with a condition")
    if any(branch.condition is None for branch in branches[:-1]):
        raise EditRefused("`else` comes last, and once")


def _branch_element(branch: BranchForm) -> NewElement:
    statements = tuple(map(_element, branch.statements))
    if branch.condition is None:
        return NewElement("else", children=statements)
    return NewElement("elseif", {"cond": branch.condition.strip()}, children=statements)


def _form_in_words(form: StatementForm) -> str:
    if isinstance(form, CallForm):
        return call_words(form)
    if isinstance(form, IfForm):
        return f"if {one_line(form.branches[0].condition or '')}"
    return ONE_OF


# --- statements ---------------------------------------------------------------------------------------------------


def plan_add_statement(edit: AddStatement, study: StudyState) -> Plan:
    """Plan a new function, `if` or `oneOf`, with its block if necessary."""
    place = list_at(edit.at, study)
    element = _element(edit.statement)
    at = min(max(edit.at.path[-1] if edit.at.path else len(place.statements), 0), len(place.statements))
    says = (f"{place.where}: new, {_form_in_words(edit.statement)}",)
    if place.holder is None:
        gap, element = _new_block(place, element)
    else:
        gap = _gap_at(place, at)
    return Plan((gap.insert(element),), says=says)


def _new_block(place: StatementList, element: NewElement) -> tuple[WritingGap, NewElement]:
    """Make a block: `<onEntry>` comes first in its state, `<onExit>` after it."""
    state = place.state_node
    block = NewElement(place.tag, children=(element,))
    entries = [child for child in state if child.tag == "onEntry"]
    if place.tag == "onExit" and entries:
        return gap_behind(entries[-1]), block
    return (gap_before(state[0]) if state else gap_in(state)), block


def _gap_at(place: StatementList, at: int) -> WritingGap:
    holder = place.holder
    assert holder is not None, "it has been made where it was missing"
    if at < len(place.statements):
        return gap_before(place.statements[at].node)
    if place.statements:
        return gap_behind(place.statements[-1].last)
    branches = [child for child in holder if child.tag in _BRANCHES]
    if branches:
        return gap_before(branches[0])
    return gap_behind(holder[-1]) if holder else gap_in(holder)


def plan_set_call(edit: SetCall, study: StudyState) -> Plan:
    """Plan another function in the place of one."""
    place, statement = statement_at(edit.at, study)
    if statement.call is None:
        raise EditRefused(f"{place.where}: there is no function there, but {statement_words(statement)}")
    check_changeable(place.where, statement.reason)
    if same_call(statement.call, edit.call):
        return Plan()
    values, old = call_attributes(edit.call), call_attributes_of(statement.node)
    changed = {name: value for name, value in values.items() if value != old[name]}
    says = f"{place.where}: {call_words(edit.call)} (was: {call_words(statement.call)})"
    return Plan(tuple(set_attributes(statement.node, changed, _ORDER)), says=(says,))


def same_call(one: CallForm, other: CallForm) -> bool:
    """Return whether two functions are the same."""
    return _normal_call(one) == _normal_call(other)


def _normal_call(call: CallForm) -> tuple[object, ...]:
    is_event = call.function == "raiseEventTopic"
    argument = normal_topic(call.argument) if is_event else call.argument.strip()
    return call.function, argument, call.state or None, call.enter, call.keep or None


def call_attributes_of(node: Element) -> dict[str, str | None]:
    """Return the attributes as `call_attributes` writes them, so that only those with another meaning change."""
    values: dict[str, str | None] = {name: node.attributes.get(name, "").strip() or None for name in _ORDER}
    if values["raiseEventTopic"]:
        values["raiseEventTopic"] = f"/{normal_topic(values['raiseEventTopic'])}"
    if values["enter"] == "yes":
        values["enter"] = None
    return values


def plan_remove_statement(edit: RemoveStatement, study: StudyState) -> Plan:
    """Plan the removal of a statement with its contents, or of a branch of an `if`."""
    if branch := branch_at(edit.at, study):
        return _remove_branch(branch)
    place, statement = statement_at(edit.at, study)
    if statement.template == "":
        check_changeable(place.where, statement.reason if statement.call is None else "")
    says = (f"{place.where}: {statement_words(statement)} is removed",)
    return Plan((_removal(statement),), says=says)


def _removal(statement: WrittenStatement) -> Splice:
    """Remove a statement; the last one of a state's block removes the block, too."""
    block = statement.node.parent
    assert block is not None, "a statement stands in something"
    is_all = statement.node is block[0] and statement.last is block[-1]
    if is_all and block.tag in ("onEntry", "onExit") and collapse(block) is not None:
        return removal_or_collapse(block)
    return removal_or_collapse(statement.node, statement.last)


def plan_move_statement(edit: MoveStatement, study: StudyState) -> Plan:
    """Plan to run a statement earlier or later, or to move a choice of a `oneOf`."""
    if branch_at(edit.at, study):
        raise EditRefused("the branches of an `if` keep their order; change their conditions")
    place, statement = statement_at(edit.at, study)
    at, to = edit.at.path[-1], min(max(edit.to, 0), len(place.statements) - 1)
    if at == to:
        return Plan()
    check_changeable(place.where, "" if statement.template or statement.call else statement.reason)
    target = place.statements[to]
    if statement.node.parent is not target.node.parent:
        raise EditRefused(f"{place.where}: these are not in one element; move it by hand")
    splices = move_siblings(statement.node, statement.last, target.node, target.last, behind=to > at)
    return Plan(splices, says=(f"{place.where}: {statement_words(statement)} is number {to + 1} now",))


# --- branches -----------------------------------------------------------------------------------------------------


def plan_add_branch(edit: AddBranch, study: StudyState) -> Plan:
    """Plan another branch of an `if`; an `else` is the last one."""
    branch = branch_at(edit.at, study)
    if branch is None:
        raise EditRefused("a branch is added to an `if`; the address ends with the number that the branch gets")
    branches = branch.statement.branches
    check_changeable(branch.place.where, branch.statement.reason)
    has_else = branches[-1].condition is None
    if edit.condition is None and has_else:
        raise EditRefused(f"{branch.place.where}: this `if` has an `else` already")
    if branch.number <= 0:
        raise EditRefused("the first branch is the `if` itself; change its condition, or make a new `if`")
    last = len(branches) - 1 if has_else else len(branches)
    at = last if edit.condition is None else min(branch.number, last)
    element = _branch_element(BranchForm(edit.condition))
    last_node = branches[-1].node
    if at < len(branches):
        gap = gap_before(branches[at].node)
    elif last_node.tag == "if":
        gap = gap_behind(last_node[-1]) if last_node else gap_in(last_node)
    else:
        gap = gap_behind(last_node)
    words = "else" if edit.condition is None else f"if {edit.condition.strip()}"
    return Plan((gap.insert(element),), says=(f"{branch.place.where}: another branch, {words}",))


def plan_set_condition(edit: SetBranchCondition, study: StudyState) -> Plan:
    """Plan the condition of a branch."""
    branch = branch_at(edit.at, study)
    if branch is None or not 0 <= branch.number < len(branch.statement.branches):
        raise EditRefused("there is no such branch of an `if`")
    written = branch.statement.branches[branch.number]
    check_changeable(branch.place.where, written.reason)
    if written.condition is None:
        raise EditRefused("an `else` has no condition; add a branch before it")
    condition = edit.condition.strip()
    if condition == written.condition:
        return Plan()
    splices = set_attributes(written.node, {"cond": condition}, ("cond",))
    return Plan(tuple(splices), says=(f"{branch.place.where}: if {condition} (was: if {written.condition})",))


def _remove_branch(branch: BranchPlace) -> Plan:
    branches = branch.statement.branches
    if not 0 <= branch.number < len(branches):
        raise EditRefused("there is no such branch of this `if`")
    written = branches[branch.number]
    check_changeable(branch.place.where, written.reason or branch.statement.reason)
    words = "else" if written.condition is None else f"if {written.condition}"
    says = (f"{branch.place.where}: the branch {words} is removed",)
    if len(branches) == 1:
        return Plan((_removal(branch.statement),), says=says)
    if branch.number == 0:
        raise EditRefused("the first branch holds the others; change its condition, or remove the whole `if`")
    if any(child.tag in _BRANCHES for child in written.node):
        raise EditRefused("other branches are in this one; remove them first")
    return Plan((removal_or_collapse(written.node),), says=says)


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {
    AddStatement: plan_add_statement,
    SetCall: plan_set_call,
    RemoveStatement: plan_remove_statement,
    MoveStatement: plan_move_statement,
    AddBranch: plan_add_branch,
    SetBranchCondition: plan_set_condition,
}
