"""From the address of a statement to the place in the file: who holds it, and who stands with it."""

from __future__ import annotations

from rise_engine.author.edit.edits import StatementAddress
from rise_engine.author.edit.finding import check_changeable, state_of
from rise_engine.author.edit.outline import WrittenRule, WrittenState, WrittenStatement
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.study_state import StudyState
from rise_engine.syntax.xml import Element


class StatementList:
    """Statements that stand with each other."""

    def __init__(
        self, rule: WrittenRule, where: str, statements: tuple[WrittenStatement, ...], holder: Element | None
    ) -> None:
        self.file = rule.file
        self.where = where
        """For people."""
        self.statements = statements
        self.holder = holder
        """The element that they stand in; None: the state has no such element yet."""
        self.tag = ""
        """What the element is to be, when it is not there."""
        self.state_node: Element
        """Of a block of a state: the state."""


class BranchPlace:
    """A branch of an `if`, there or not yet."""

    def __init__(self, place: StatementList, statement: WrittenStatement, number: int) -> None:
        self.place = place
        self.statement = statement
        self.number = number


def list_at(address: StatementAddress, study: StudyState) -> StatementList:
    """The statements among which an address ends. :raises EditRefused: there are none, or nobody can change them."""
    found = _walk(address, study, address.path[:-1])
    if isinstance(found, BranchPlace):
        raise EditRefused(f"{found.place.where}: the address ends with a branch; say which statement of it")
    return found


def statement_at(address: StatementAddress, study: StudyState) -> tuple[StatementList, WrittenStatement]:
    """A statement and those that it stands with. :raises EditRefused: there is none."""
    if not address.path:
        raise EditRefused("the address says no statement")
    place = list_at(address, study)
    number = address.path[-1]
    if not 0 <= number < len(place.statements):
        raise EditRefused(f"{place.where}: there are {len(place.statements)} statements, and none has number {number}")
    return place, place.statements[number]


def branch_at(address: StatementAddress, study: StudyState) -> BranchPlace | None:
    """The branch that an address ends with; None: it ends with a statement."""
    found = _walk(address, study, address.path[:-1])
    if isinstance(found, BranchPlace):
        return BranchPlace(found.place, found.statement, address.path[-1])
    return None


def _walk(address: StatementAddress, study: StudyState, path: tuple[int, ...]) -> StatementList | BranchPlace:
    """Down the path: the list, or the `if`, in which its last number counts."""
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
            raise EditRefused(f"{place.where}: number {number} is a function, and nothing stands in it")
    return place


def _block(address: StatementAddress, study: StudyState, rule: WrittenRule, state: WrittenState) -> StatementList:
    where = f"rule {rule.name}, state {state.id}"
    if address.place == "transition":
        if not 0 <= address.transition < len(state.transitions):
            raise EditRefused(f"{where}: there is no way out number {address.transition}")
        way = state.transitions[address.transition]
        where += f", way {address.transition + 1}"
        check_changeable(where, way.reason, rule.file, way.line)
        return StatementList(rule, where, way.statements, way.node)
    check_changeable(where, state.reason, rule.file, state.line)
    statements = state.on_entry if address.place == "onEntry" else state.on_exit
    holders = [child for child in state.node if child.tag == address.place]
    words = "on entry" if address.place == "onEntry" else "on exit"
    if statements and not holders:
        check_changeable(f"{where}, {words}", statements[0].reason)
    place = StatementList(rule, f"{where}, {words}", statements, holders[-1] if holders else None)
    place.tag, place.state_node = address.place, state.node
    return place
