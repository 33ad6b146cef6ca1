"""The parts that an edit addresses, found in the outline: files, acts, actions, rules, states and statements."""

from __future__ import annotations

from typing import NoReturn

from rise_engine.author.edit.edits import StatementAddress
from rise_engine.author.edit.outline import (
    Written,
    WrittenAct,
    WrittenAction,
    WrittenRule,
    WrittenState,
    WrittenStatement,
)
from rise_engine.author.edit.plan import EditRefused, StudyState
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.checking.uses import UsedKind
from rise_engine.scenario.files.xml import XmlFile, count_places
from rise_engine.syntax.xml import Element

_SHOWN = 5
"""Maximum number of places in a sentence."""


def xml_of(study: StudyState, file: str) -> XmlFile:
    """Return a file of acts or rules. :raises EditRefused: it does not exist, or is not XML."""
    if file not in study.files:
        raise EditRefused(f"there is no file `{file}`{did_you_mean(file, list(study.files))}")
    parts = study.checked.parts
    for each in (*parts.acts, *parts.rules):
        if each.source.name == file:
            return each
    problem = parts.unreadable.get(file, "it is not one of those that hold acts or rules")
    raise EditRefused(f"{file} cannot be changed here while it is not XML: {problem}")


def places_of_parameter(study: StudyState, use: Written, parameter: str) -> int:
    """Count the places where a parameter of a `<use>` appears in the result of the template."""
    return count_places(xml_of(study, use.file).brought.get(use.node, ()), parameter)


def act_of(study: StudyState, name: str) -> WrittenAct:
    """Return an act by its name. :raises EditRefused: there is none."""
    act = study.outline.act(name)
    if act is None:
        refuse_unknown(study, "act", name, [each.name for each in study.outline.acts])
    return act


def rule_of(study: StudyState, name: str) -> WrittenRule:
    """Return a rule by its name. :raises EditRefused: there is none."""
    rule = study.outline.rule(name)
    if rule is None:
        refuse_unknown(study, "rule", name, [each.name for each in study.outline.rules])
    return rule


def refuse_unknown(study: StudyState, kind: str, name: str, known: list[str]) -> NoReturn:
    """:raises EditRefused: always, with the unreadable files: the unknown name may be in one of them."""
    unread = "".join(f"; {file} cannot be read now" for file in study.outline.unreadable)
    raise EditRefused(f"there is no {kind} `{name}`{did_you_mean(name, known)}{unread}")


def state_of(study: StudyState, rule: str, name: str) -> tuple[WrittenRule, WrittenState]:
    """Return a rule and the first of its states with a name. :raises EditRefused: there is none."""
    found = rule_of(study, rule)
    state = next((each for each in found.states if each.id == name), None)
    if state is None:
        known = [each.id for each in found.states]
        raise EditRefused(f"there is no state `{name}` in the rule `{rule}`{did_you_mean(name, known)}")
    return found, state


def action_of(study: StudyState, act: str, name: str) -> tuple[WrittenAct, WrittenAction]:
    """Return an act and its action with an actionID. :raises EditRefused: there is none."""
    found = act_of(study, act)
    action = next((each for each in found.actions if each.id == name), None)
    if action is None:
        known = [each.id for each in found.actions if each.id]
        raise EditRefused(f"there is no action `{name}` in the act `{act}`{did_you_mean(name, known)}")
    return found, action


def check_changeable(what: str, reason: str, file: str = "", line: int = 0) -> None:
    """:raises EditRefused: a form cannot change it, with the `reason` and, if given, the file and line."""
    if reason:
        where = f" ({file}, line {line})" if file else ""
        raise EditRefused(f"{what} cannot be changed: {reason}{where}")


def check_name(kind: str, name: str) -> str:
    """Strip the blanks around a new name. :raises EditRefused: it is empty, or cannot be shown."""
    name = name.strip()
    if not name:
        raise EditRefused(f"the {kind} needs a name")
    if not name.isprintable():
        raise EditRefused(f"the name of the {kind} holds a character that cannot be shown; leave it out")
    return name


def remaining_mentions(study: StudyState, kind: UsedKind, name: str, *, within: str = "") -> tuple[str, ...]:
    """Return sentences on places that still name a removed part; empty: there are none.

    :param within: the act or rule that is removed or contains the part; uses in it do not count.
    """
    uses = study.checked.uses.of(kind, name)
    places = [
        f"{use.where} ({use.location.file}, line {use.location.line})"
        for use in uses
        if not use.defines and use.of != within
    ]
    if not places:
        return ()
    more = f" and {len(places) - _SHOWN} more" if len(places) > _SHOWN else ""
    return (f"`{name}` is still named in {'; '.join(places[:_SHOWN])}{more}",)


# --- statements ------------------------------------------------------------------------------------------------------


class StatementList:
    """A list of statements in a block, a branch or a `oneOf`."""

    def __init__(
        self, rule: WrittenRule, where: str, statements: tuple[WrittenStatement, ...], holder: Element | None
    ) -> None:
        self.file = rule.file
        self.where = where
        """The place in words."""
        self.statements = statements
        self.holder = holder
        """The element that contains them; None: the state has no such element yet."""
        self.tag = ""
        """The tag of the element to make if it does not exist."""
        self.state_node: Element
        """The state, for a block of a state."""


class BranchPlace:
    """A branch of an `if`, which may not exist yet."""

    def __init__(self, place: StatementList, statement: WrittenStatement, number: int) -> None:
        self.place = place
        self.statement = statement
        self.number = number


def list_at(address: StatementAddress, study: StudyState) -> StatementList:
    """Return the list of statements that contains an address. :raises EditRefused: a form cannot reach or change it."""
    found = _walk(address, study, address.path[:-1])
    if isinstance(found, BranchPlace):
        raise EditRefused(f"{found.place.where}: the address ends with a branch; say which statement of it")
    return found


def statement_at(address: StatementAddress, study: StudyState) -> tuple[StatementList, WrittenStatement]:
    """Return a statement and the list that contains it. :raises EditRefused: there is none."""
    if not address.path:
        raise EditRefused("the address says no statement")
    place = list_at(address, study)
    number = address.path[-1]
    if not 0 <= number < len(place.statements):
        raise EditRefused(f"{place.where}: there are {len(place.statements)} statements, and none has number {number}")
    return place, place.statements[number]


def branch_at(address: StatementAddress, study: StudyState) -> BranchPlace | None:
    """Return the branch that an address ends with; None: it ends with a statement."""
    found = _walk(address, study, address.path[:-1])
    if isinstance(found, BranchPlace):
        return BranchPlace(found.place, found.statement, address.path[-1])
    return None


def _walk(address: StatementAddress, study: StudyState, path: tuple[int, ...]) -> StatementList | BranchPlace:
    """Follow the path to the list or the `if` that contains its last index."""
    rule, state = state_of(study, address.rule, address.state)
    place = _block(address, study, rule, state)
    rest = list(path)
    while rest:
        number = rest.pop(0)
        if not 0 <= number < len(place.statements):
            raise EditRefused(f"{place.where}: there is no statement number {number}")
        statement = place.statements[number]
        check_changeable(place.where, "" if statement.call is not None else statement.reason)
        if statement.branches:
            if not rest:
                return BranchPlace(place, statement, -1)
            branch_number = rest.pop(0)
            if not 0 <= branch_number < len(statement.branches):
                raise EditRefused(f"{place.where}: this `if` has no branch number {branch_number}")
            branch = statement.branches[branch_number]
            check_changeable(place.where, branch.reason)
            words = "else" if branch.condition is None else f"if {branch.condition}"
            place = StatementList(rule, f"{place.where}, {words}", branch.statements, branch.node)
        elif statement.choices or statement.call is None:
            place = StatementList(rule, f"{place.where}, one of", statement.choices, statement.node)
        else:
            raise EditRefused(f"{place.where}: number {number} is a function, and nothing is in it")
    return place


def _block(address: StatementAddress, study: StudyState, rule: WrittenRule, state: WrittenState) -> StatementList:
    where = f"rule {rule.name}, state {state.id}"
    if address.place == "transition":
        if not 0 <= address.transition < len(state.transitions):
            raise EditRefused(f"{where}: there is no transition number {address.transition}")
        transition = state.transitions[address.transition]
        where += f", transition {address.transition + 1}"
        check_changeable(where, transition.reason, rule.file, transition.line)
        return StatementList(rule, where, transition.statements, transition.node)
    check_changeable(where, state.reason, rule.file, state.line)
    statements = state.on_entry if address.place == "onEntry" else state.on_exit
    holders = [child for child in state.node if child.tag == address.place]
    words = "on entry" if address.place == "onEntry" else "on exit"
    if statements and not holders:
        check_changeable(f"{where}, {words}", statements[0].reason)
    place = StatementList(rule, f"{where}, {words}", statements, holders[-1] if holders else None)
    place.tag, place.state_node = address.place, state.node
    return place
