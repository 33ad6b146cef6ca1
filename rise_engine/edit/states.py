"""A rule's beginning, its priority, its states."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rise_engine.edit.documents import Node
from rise_engine.edit.edits import AddState, Edit, RemoveState, SetInitial, SetPriority
from rise_engine.edit.finding import check_changeable, check_name, node_of, rule_of, state_of, still_named
from rise_engine.edit.layout import collapse, gap_behind, gap_in, removal
from rise_engine.edit.outline import WrittenRule
from rise_engine.edit.plan import EditRefused, Plan, Splice
from rise_engine.edit.study_state import StudyState
from rise_engine.edit.tags import set_attributes
from rise_engine.edit.writing import NewElement, insert, value_splice
from rise_engine.nearest_name import did_you_mean

_ORDER = ("name", "initial", "priority")


def _changeable_rule(study: StudyState, name: str) -> tuple[WrittenRule, Node]:
    rule = rule_of(study, name)
    check_changeable(f"the rule {name}", rule.reason, rule.file, rule.line)
    return rule, node_of(study, rule.file, rule.span)


def plan_set_initial(edit: SetInitial, study: StudyState) -> Plan:
    """The state in which a rule begins."""
    rule, node = _changeable_rule(study, edit.rule)
    known = [state.id for state in rule.states]
    if edit.state not in known:
        raise EditRefused(f"there is no state `{edit.state}` in {edit.rule}{did_you_mean(edit.state, known)}")
    if edit.state == rule.initial:
        return Plan()
    splices = set_attributes(rule.file, node, {"initial": edit.state}, _ORDER)
    return Plan(tuple(splices), says=(f"{edit.rule} begins in {edit.state} (was {rule.initial or 'nowhere'})",))


def plan_set_priority(edit: SetPriority, study: StudyState) -> Plan:
    """How high a rule starts among the others."""
    rule, node = _changeable_rule(study, edit.rule)
    value = None if edit.priority is None else edit.priority.strip()
    if value == rule.priority:
        return Plan()
    splices = set_attributes(rule.file, node, {"priority": value}, _ORDER)
    words = "no priority any more" if value is None else f"priority {value}"
    return Plan(tuple(splices), says=(f"{edit.rule} has {words} (was {rule.priority or '0'})",))


def plan_add_state(edit: AddState, study: StudyState) -> Plan:
    """A new state, from which no way leads yet."""
    rule, node = _changeable_rule(study, edit.rule)
    name = check_name("state", edit.state)
    taken = next((state for state in rule.states if state.id == name), None)
    if taken is not None:
        raise EditRefused(f"there is a state `{name}` in {edit.rule} already (line {taken.line}); choose another name")
    if edit.after:
        behind: Node | None = node_of(study, rule.file, state_of(study, edit.rule, edit.after)[1].span)
    else:
        behind = node_of(study, rule.file, rule.states[-1].span) if rule.states else None
    if behind is None and node.children:
        behind = node.children[-1]
    gap = gap_in(node) if behind is None else gap_behind(behind)
    splice = insert(rule.file, gap, [NewElement("State", {"id": name})])
    return Plan((splice,), says=(f"{edit.rule} gets the state {name}",))


def plan_remove_state(edit: RemoveState, study: StudyState) -> Plan:
    """A state goes with the ways out of it, also from where ways are shared."""
    rule, state = state_of(study, edit.rule, edit.state)
    check_changeable(f"the rule {edit.rule}", rule.reason)
    if sum(each.span == state.span for each in rule.states) > 1:
        check_changeable(f"the state {edit.state}", f"{state.reason}, together with others")
    _check_not_reached(rule, edit.state)
    node = node_of(study, rule.file, state.span)
    rule_node = node_of(study, rule.file, rule.span)
    splices = [Splice(rule.file, *removal(node), b"")]
    for shared in [child for child in rule_node.children if child.tag == "transitions"]:
        splices += _without_state(rule.file, shared, edit.state)
    if len(rule_node.children) == 1 and (emptied := collapse(rule_node)) is not None:
        splices = [Splice(rule.file, *emptied)]
    noticed = still_named(study, "state", f"{edit.rule}/{edit.state}", within=edit.rule)
    return Plan(tuple(splices), says=(f"{edit.rule} loses the state {edit.state}",), noticed=noticed)


def _check_not_reached(rule: WrittenRule, name: str) -> None:
    """:raises EditRefused: the rule begins in a state, or a way of another one leads to it."""
    if rule.initial == name:
        instead = "let it begin in another state first" if len(rule.states) > 1 else "remove the rule"
        raise EditRefused(f"{rule.name} begins in {name}; {instead}")
    ways = [
        f"{state.id} (line {way.line})"
        for state in rule.states
        for way in state.transitions
        if way.form.target == name and state.id != name
    ]
    if ways:
        raise EditRefused(f"ways lead to {name}: from {', '.join(ways)}; let them lead elsewhere first")


def _without_state(file: str, shared: Node, name: str) -> list[Splice]:
    """`<transitions in="A | B">` without one of its states; it goes with the last one."""
    names = [each.strip() for each in shared.attributes.get("in", "").split("|")]
    if name not in names:
        return []
    left = [each for each in names if each != name]
    if not left:
        return [Splice(file, *removal(shared), b"")]
    return [value_splice(file, shared, "in", " | ".join(left))]


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {
    SetInitial: plan_set_initial,
    SetPriority: plan_set_priority,
    AddState: plan_add_state,
    RemoveState: plan_remove_state,
}
