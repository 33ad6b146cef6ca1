"""Edits of the states of rules and of their transitions."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rise_engine.author.edit.addresses import check_changeable, check_name, remaining_mentions, rule_of, state_of
from rise_engine.author.edit.edits import (
    AddState,
    AddTransition,
    Edit,
    MoveTransition,
    RemoveState,
    RemoveTransition,
    SetInitial,
    SetPriority,
    SetTransition,
    TransitionForm,
)
from rise_engine.author.edit.outline import WrittenRule, WrittenState, WrittenTransition, transition_words
from rise_engine.author.edit.plan import EditRefused, Plan, Splice, StudyState
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.grammar import form_of
from rise_engine.scenario.model import normal_topic
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_layout import (
    collapse,
    gap_before,
    gap_behind,
    gap_in,
    move_siblings,
    removal,
    removal_or_collapse,
)
from rise_engine.syntax.xml_writing import NewElement, set_attributes, set_value

_RULE_ORDER = tuple(form_of("InteractionRule").attributes)


def _changeable_rule(study: StudyState, name: str) -> WrittenRule:
    rule = rule_of(study, name)
    check_changeable(f"the rule {name}", rule.reason, rule.file, rule.line)
    return rule


def plan_set_initial(edit: SetInitial, study: StudyState) -> Plan:
    """Plan the state in which a rule begins."""
    rule = _changeable_rule(study, edit.rule)
    known = [state.id for state in rule.states]
    if edit.state not in known:
        raise EditRefused(f"there is no state `{edit.state}` in {edit.rule}{did_you_mean(edit.state, known)}")
    if edit.state == rule.initial:
        return Plan()
    splices = set_attributes(rule.node, {"initial": edit.state}, _RULE_ORDER)
    return Plan(tuple(splices), says=(f"{edit.rule} begins in {edit.state} (was {rule.initial or 'nowhere'})",))


def plan_set_priority(edit: SetPriority, study: StudyState) -> Plan:
    """Plan the priority with which a rule starts."""
    rule = _changeable_rule(study, edit.rule)
    value = None if edit.priority is None else edit.priority.strip()
    if value == rule.priority:
        return Plan()
    splices = set_attributes(rule.node, {"priority": value}, _RULE_ORDER)
    words = "no priority any more" if value is None else f"priority {value}"
    return Plan(tuple(splices), says=(f"{edit.rule} has {words} (was {rule.priority or '0'})",))


def plan_add_state(edit: AddState, study: StudyState) -> Plan:
    """Plan a new state, which has no transitions yet."""
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
    """Plan the removal of a state with its transitions, also from shared ones."""
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
    noticed = remaining_mentions(study, "state", f"{edit.rule}/{edit.state}", within=edit.rule)
    return Plan(tuple(splices), says=(f"{edit.rule} loses the state {edit.state}",), noticed=noticed)


def _check_not_reached(rule: WrittenRule, name: str) -> None:
    """:raises EditRefused: the rule begins in a state, or another state's transition leads to it."""
    if rule.initial == name:
        instead = "let it begin in another state first" if len(rule.states) > 1 else "remove the rule"
        raise EditRefused(f"{rule.name} begins in {name}; {instead}")
    transitions = [
        f"{state.id} (line {transition.line})"
        for state in rule.states
        for transition in state.transitions
        if transition.form.target == name and state.id != name
    ]
    if transitions:
        raise EditRefused(f"transitions lead to {name}: from {', '.join(transitions)}; let them lead elsewhere first")


def _without_state(shared: Element, name: str) -> list[Splice]:
    """Remove a state from `<transitions in="A | B">`; the last state removes the element, too."""
    names = [each.strip() for each in shared.attributes.get("in", "").split("|")]
    if name not in names:
        return []
    left = [each for each in names if each != name]
    if not left:
        return [removal(shared)]
    return [set_value(shared, "in", " | ".join(left))]


# --- transitions -----------------------------------------------------------------------------------------------------


_TRANSITION_ORDER = tuple(form_of("transition").attributes)


def transition_attributes(form: TransitionForm) -> dict[str, str | None]:
    """Return the attributes of a transition; None: it does not have the attribute.

    :raises EditRefused: it has no trigger, or two.
    """
    triggers = [name for name, value in (("event", form.event), ("ended", form.ended), ("after", form.after)) if value]
    if len(triggers) > 1:
        raise EditRefused(
            f"a transition waits for one thing, and this one has {' and '.join(triggers)}; make two transitions"
        )
    if not triggers and not form.condition:
        raise EditRefused("a transition waits for something: an event, the end of an act, a time, or a condition")
    if form.outcomes and not form.ended:
        raise EditRefused("an outcome needs the act whose end the transition waits for; name the act")
    if form.held and not form.after:
        raise EditRefused("a condition that must hold for some time needs that time")
    return {
        "eventTopic": f"/{normal_topic(form.event)}" if form.event else None,
        "ended": form.ended or None,
        "outcome": " | ".join(form.outcomes) or None,
        "while": form.held or None,
        "after": form.after or None,
        "cond": form.condition or None,
        "target": form.target or None,
    }


def same_form(one: TransitionForm, other: TransitionForm) -> bool:
    """Return whether two forms have the same meaning."""
    return _normal(one) == _normal(other)


def _normal(form: TransitionForm) -> tuple[object, ...]:
    texts = (form.ended, form.after, form.held, form.condition, form.target)
    event = normal_topic(form.event) if form.event is not None else ""
    return event, tuple(form.outcomes), *((text or "").strip() for text in texts)


def find_transition(state: WrittenState, index: int, was: TransitionForm) -> int:
    """Return the index of the intended transition: the given one, or the nearest of the same form.

    :raises EditRefused: no transition of the state has this form any more.
    """
    transitions = state.transitions
    if 0 <= index < len(transitions) and same_form(transitions[index].form, was):
        return index
    like = [number for number, transition in enumerate(transitions) if same_form(transition.form, was)]
    if not like:
        raise EditRefused(f"`{state.id}` no longer has a transition that is taken {transition_words(was)}")
    return min(like, key=lambda number: abs(number - index))


def _found(edit: SetTransition | RemoveTransition | MoveTransition, study: StudyState) -> _EditedTransition:
    rule, state = state_of(study, edit.rule, edit.state)
    index = find_transition(state, edit.index, edit.was)
    transition = state.transitions[index]
    check_changeable(f"the transition of {state.id}", transition.reason, rule.file, transition.line)
    return _EditedTransition(state, index, transition)


class _EditedTransition:
    """A transition that an edit changes."""

    def __init__(self, state: WrittenState, index: int, written: WrittenTransition) -> None:
        self.state = state
        self.index = index
        self.written = written
        self.node = written.node
        others = [name for name in written.shared_by if name != state.id]
        self.states_text = state.id + (f" (and {', '.join(others)})" if others else "")


def plan_add(edit: AddTransition, study: StudyState) -> Plan:
    """Plan a new transition of a state, before its shared ones."""
    rule, state = state_of(study, edit.rule, edit.state)
    check_changeable(f"the state {edit.state}", state.reason, rule.file, state.line)
    values = transition_attributes(edit.transition)
    element = NewElement("transition", {name: value for name, value in values.items() if value is not None})
    own = [transition for transition in state.transitions if not transition.shared_by]
    at = len(own) if edit.at is None else min(max(edit.at, 0), len(own))
    if at < len(own):
        if at and own[at - 1].node is own[at].node:
            check_changeable("the place between these transitions", own[at].reason)
        gap = gap_before(own[at].node)
    elif own:
        gap = gap_behind(own[-1].node)
    else:
        gap = gap_behind(state.node[-1]) if state.node else gap_in(state.node)
    says = f"{edit.state} gets a transition: {transition_words(edit.transition)}"
    return Plan((gap.insert(element),), says=(says,))


def plan_set(edit: SetTransition, study: StudyState) -> Plan:
    """Plan the trigger and the target of a transition; its functions stay."""
    transition = _found(edit, study)
    now, values = transition.written.form, transition_attributes(edit.transition)
    if same_form(now, edit.transition):
        return Plan()
    old = {name: (value or "").strip() for name, value in transition_attributes_of(transition.node).items()}
    changed = {name: value for name, value in values.items() if (value or "").strip() != old[name]}
    splices = set_attributes(transition.node, changed, _TRANSITION_ORDER)
    says = f"{transition.states_text}: {transition_words(edit.transition)} (was: {transition_words(now)})"
    return Plan(tuple(splices), says=(says,))


def transition_attributes_of(node: Element) -> dict[str, str]:
    """Return the attributes as `transition_attributes` writes them, so that only those with another meaning change."""
    values = {name: node.attributes.get(name, "").strip() for name in _TRANSITION_ORDER}
    if "eventTopic" in node.attributes:
        values["eventTopic"] = f"/{normal_topic(values['eventTopic'])}"
    if values["outcome"]:
        values["outcome"] = " | ".join(word.strip() for word in values["outcome"].split("|") if word.strip())
    return values


def plan_remove(edit: RemoveTransition, study: StudyState) -> Plan:
    """Plan the removal of a transition with its functions; the last shared one removes their element, too."""
    transition = _found(edit, study)
    says = (f"{transition.states_text} loses the transition: {transition_words(transition.written.form)}",)
    parent = transition.node.parent
    if parent is not None and parent.tag == "transitions" and len(parent) == 1 and collapse(parent) is not None:
        return Plan((removal(parent),), says=says)
    return Plan((removal_or_collapse(transition.node),), says=says)


def plan_move(edit: MoveTransition, study: StudyState) -> Plan:
    """Plan to try a transition earlier or later."""
    transition = _found(edit, study)
    transitions = transition.state.transitions
    to = min(max(edit.to, 0), len(transitions) - 1)
    if to == transition.index:
        return Plan()
    order = [each for each in range(len(transitions)) if each != transition.index]
    order.insert(to, transition.index)
    before = transitions[order[to - 1]] if to else None
    behind = transitions[order[to + 1]] if to + 1 < len(order) else None
    parent = transition.node.parent
    for neighbour, is_behind in ((before, False), (behind, True)):
        if neighbour is None:
            continue
        node = neighbour.node
        if node.parent is parent and node is not transition.node:
            if before is not None and behind is not None and before.node is behind.node:
                break
            splices = move_siblings(transition.node, transition.node, node, node, behind=not is_behind)
            words = transition_words(transition.written.form)
            says = f"{transition.states_text}: the transition {words} is number {to + 1} now"
            return Plan(splices, says=(says,))
    raise EditRefused("a transition cannot move past this place: a state tries its own transitions before shared ones")


PLANNERS: Mapping[type[Edit], Callable[..., Plan]] = {
    SetInitial: plan_set_initial,
    SetPriority: plan_set_priority,
    AddState: plan_add_state,
    RemoveState: plan_remove_state,
    AddTransition: plan_add,
    SetTransition: plan_set,
    RemoveTransition: plan_remove,
    MoveTransition: plan_move,
}
