"""A rule's beginning, its priority, its states."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rise_engine.author.edit.edits import AddState, Edit, RemoveState, SetInitial, SetPriority
from rise_engine.author.edit.finding import check_changeable, check_name, rule_of, state_of, still_named
from rise_engine.author.edit.outline import WrittenRule
from rise_engine.author.edit.plan import EditRefused, Plan, Splice
from rise_engine.author.edit.study_state import StudyState
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_layout import collapse, gap_behind, gap_in, removal
from rise_engine.syntax.xml_writing import NewElement, set_attributes, set_value

_ORDER = ("name", "initial", "priority")


def _changeable_rule(study: StudyState, name: str) -> WrittenRule:
    rule = rule_of(study, name)
    check_changeable(f"the rule {name}", rule.reason, rule.file, rule.line)
    return rule


def plan_set_initial(edit: SetInitial, study: StudyState) -> Plan:
    """The state in which a rule begins."""
    rule = _changeable_rule(study, edit.rule)
    known = [state.id for state in rule.states]
    if edit.state not in known:
        raise EditRefused(f"there is no state `{edit.state}` in {edit.rule}{did_you_mean(edit.state, known)}")
    if edit.state == rule.initial:
        return Plan()
    splices = set_attributes(rule.node, {"initial": edit.state}, _ORDER)
    return Plan(tuple(splices), says=(f"{edit.rule} begins in {edit.state} (was {rule.initial or 'nowhere'})",))


def plan_set_priority(edit: SetPriority, study: StudyState) -> Plan:
    """How high a rule starts among the others."""
    rule = _changeable_rule(study, edit.rule)
    value = None if edit.priority is None else edit.priority.strip()
    if value == rule.priority:
        return Plan()
    splices = set_attributes(rule.node, {"priority": value}, _ORDER)
    words = "no priority any more" if value is None else f"priority {value}"
    return Plan(tuple(splices), says=(f"{edit.rule} has {words} (was {rule.priority or '0'})",))


def plan_add_state(edit: AddState, study: StudyState) -> Plan:
    """A new state, from which no way leads yet."""
    rule = _changeable_rule(study, edit.rule)
    name = check_name("state", edit.state)
    taken = next((state for state in rule.states if state.id == name), None)
    if taken is not None:
        raise EditRefused(f"there is a state `{name}` in {edit.rule} already (line {taken.line}); choose another name")
    if edit.after:
        behind: Element | None = state_of(study, edit.rule, edit.after)[1].node
    else:
        behind = rule.states[-1].node if rule.states else rule.node[-1] if rule.node else None
    gap = gap_in(rule.node) if behind is None else gap_behind(behind)
    return Plan((gap.insert(NewElement("State", {"id": name})),), says=(f"{edit.rule} gets the state {name}",))


def plan_remove_state(edit: RemoveState, study: StudyState) -> Plan:
    """A state goes with the ways out of it, also from where ways are shared."""
    rule, state = state_of(study, edit.rule, edit.state)
    check_changeable(f"the rule {edit.rule}", rule.reason)
    if sum(each.node is state.node for each in rule.states) > 1:
        check_changeable(f"the state {edit.state}", f"{state.reason}, together with others")
    _check_not_reached(rule, edit.state)
    splices = [removal(state.node)]
    for shared in [child for child in rule.node if child.tag == "transitions"]:
        splices += _without_state(shared, edit.state)
    if len(rule.node) == 1 and (emptied := collapse(rule.node)) is not None:
        splices = [emptied]
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


def _without_state(shared: Element, name: str) -> list[Splice]:
    """`<transitions in="A | B">` without one of its states; it goes with the last one."""
    names = [each.strip() for each in shared.attributes.get("in", "").split("|")]
    if name not in names:
        return []
    left = [each for each in names if each != name]
    if not left:
        return [removal(shared)]
    return [set_value(shared, "in", " | ".join(left))]


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {
    SetInitial: plan_set_initial,
    SetPriority: plan_set_priority,
    AddState: plan_add_state,
    RemoveState: plan_remove_state,
}
