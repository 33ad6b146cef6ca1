"""A state of a rule as one list: its functions on entry, its transitions, its functions on exit. Pure.

Blocks are an indented list with a line for each condition. Each row has its statement, so that a key can add, change,
move or remove it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple, TypeAlias

from rise_engine.author.edit.edits import (
    AnyEdit,
    CallForm,
    MoveStatement,
    MoveTransition,
    RemoveStatement,
    RemoveTransition,
    StatementAddress,
    StatementPlace,
)
from rise_engine.author.edit.outline import (
    ONE_OF,
    Outline,
    WrittenState,
    WrittenStatement,
    WrittenTransition,
    WrittenUse,
    branch_words,
    call_words,
    trigger_words,
)
from rise_engine.syntax.xml_writing import one_line

PartKind: TypeAlias = Literal["heading", "call", "if", "branch", "choice", "transition", "other", "empty", "parameter"]
MAX_LEVELS = 4
"""Maximum number of levels of nested blocks in the list. Deeper ones are changed in the file."""


class PartRow(NamedTuple):
    """One row of the list."""

    kind: PartKind
    text: str
    depth: int = 0
    at: StatementAddress | None = None
    """The address of a statement or a branch. For a heading, transition or empty place: of a new statement in it."""
    transition: int = -1
    """The number of the row's transition."""
    siblings: int = 0
    """The number of statements in its block."""
    reason: str = ""
    """Why no form can change it; empty: a form can."""
    guard: str = ""
    """A transition's guard, a branch's condition, or a parameter's note."""
    target: str | None = None
    """A transition's target, or a parameter's name."""
    new: StatementAddress | None = None
    """The address for a new function at this row: after a function, last in a block, first in a branch."""
    behind: StatementAddress | None = None
    """The address for a new function after the whole block of the row."""
    new_branch: StatementAddress | None = None
    """The address for another branch of the row's `if`, before its `else`."""
    can_be_else: bool = False
    """Whether that branch may be the `else`."""
    line: int = 0
    """Its line in the file; 0: none."""
    call: CallForm | None = None
    """The function in the row."""

    @property
    def id(self) -> str:
        """The row's id. It stays the same until an earlier row is added or removed."""
        named = self.kind not in ("heading", "transition") and self.at is not None
        path = ".".join(map(str, self.at.path)) if named and self.at is not None else ""
        place = self.at.place if self.at is not None else ""
        return f"{self.kind}:{place}:{self.transition}:{path or (self.target if self.kind == 'parameter' else '')}"


def state_parts(rule: str, state: WrittenState, use: WrittenUse | None = None) -> list[PartRow]:
    """The list of a state.

    :param use: the `<use>` that the state comes from.
    """
    rows = [*_parameters(use)] if use is not None else []
    rows += [*_block(rule, state, "onEntry", state.on_entry, "WHEN IT IS ENTERED")]
    rows.append(
        PartRow(
            "heading", "TRANSITIONS" if state.transitions else "TRANSITIONS   none: the rule ends here", transition=-1
        )
    )
    for number, transition in enumerate(state.transitions):
        rows += _transition(rule, state, number, transition)
    rows += _block(rule, state, "onExit", state.on_exit, "WHEN IT IS LEFT")
    return rows


def use_of(outline: Outline, state: WrittenState) -> WrittenUse | None:
    """The `<use>` that a state comes from."""
    if not state.template:
        return None
    place = state.file, state.node.start
    return next((use for use in outline.uses if (use.file, use.node.start) == place), None)


def id_of_call(at: StatementAddress) -> str:
    """The row of the function at an address."""
    return PartRow("call", "", at=at, transition=at.transition if at.place == "transition" else -1).id


def removal(row: PartRow, state: WrittenState, rule: str) -> AnyEdit | None:
    """The edit that removes the row and its contents; None: impossible here."""
    if row.kind == "transition":
        return RemoveTransition(rule, state.id, row.transition, state.transitions[row.transition].form)
    if row.kind in ("call", "if", "branch", "choice", "other") and row.at is not None and not row.reason:
        return RemoveStatement(row.at)
    return None


def movement(row: PartRow, state: WrittenState, rule: str, step: int) -> AnyEdit | None:
    """The edit that moves the row within its block; None: it is at the end, or has no order."""
    if row.reason:
        return None
    if row.kind == "transition":
        to = row.transition + step
        own = len([transition for transition in state.transitions if not transition.shared_by])
        if not 0 <= to < own or state.transitions[row.transition].shared_by:
            return None
        return MoveTransition(rule, state.id, row.transition, state.transitions[row.transition].form, to)
    if row.kind in ("call", "if", "choice", "other") and row.at is not None:
        to = row.at.path[-1] + step
        return MoveStatement(row.at, to) if 0 <= to < row.siblings else None
    return None


def _parameters(use: WrittenUse) -> Iterator[PartRow]:
    """The arguments of a template, in which its states differ."""
    yield PartRow(
        "heading",
        f"FROM THE TEMPLATE {use.template}",
        reason="the name of a template is changed in the file",
        line=use.line,
    )
    for name in dict.fromkeys((*use.parameters, *use.values)):
        value, default = use.values.get(name), use.parameters.get(name)
        text = f"{name} = {value.text}" if value is not None else f"{name} = {default or '–'}"
        known = name in use.parameters or not use.parameters
        note = "" if value is not None else "as the template says" if default is not None else "must be given"
        reason = (value.reason if value is not None else "") if known else "the template has no such parameter"
        yield PartRow("parameter", text, 1, reason=reason, guard=note, target=name, line=use.line)


def _block(
    rule: str, state: WrittenState, place: StatementPlace, statements: tuple[WrittenStatement, ...], title: str
) -> Iterator[PartRow]:
    last = StatementAddress(rule, state.id, place, path=(len(statements),))
    title = title if statements else f"{title}   –"
    yield PartRow("heading", title, at=last, reason=state.reason, new=last, behind=last)
    yield from _statements(statements, StatementAddress(rule, state.id, place), 1, -1, state.reason)


def _transition(rule: str, state: WrittenState, number: int, transition: WrittenTransition) -> Iterator[PartRow]:
    reason, form = transition.reason, transition.form
    has_trigger = form.event is not None or form.ended is not None or form.after is not None
    guard = one_line(form.condition) if form.condition is not None and has_trigger else ""
    place = StatementAddress(rule, state.id, "transition", number, (len(transition.statements),))
    yield PartRow(
        "transition",
        f"{number + 1} {trigger_words(form)}",
        at=place,
        new=place,
        behind=place,
        transition=number,
        siblings=len(state.transitions),
        reason=reason,
        guard=guard,
        target=form.target.strip() if form.target is not None else None,
        line=transition.line,
    )
    yield from _statements(
        transition.statements, StatementAddress(rule, state.id, "transition", number), 2, number, reason
    )


def _statements(
    statements: tuple[WrittenStatement, ...],
    block: StatementAddress,
    depth: int,
    transition: int,
    reason: str,
    around: PartRow | None = None,
) -> Iterator[PartRow]:
    """The rows of a block. `around`: the row of the statement that has it."""
    for number, statement in enumerate(statements):
        at = _with_path(block, (*block.path, number))
        why = reason or statement.reason
        row = PartRow("other", "", depth, at, transition, len(statements), why, line=statement.line)
        if around is not None:
            row = row._replace(new_branch=around.new_branch, can_be_else=around.can_be_else)
        if statement.call is not None:
            behind = around.behind if around is not None else _behind(at)
            row = row._replace(kind="call", text=call_words(statement.call), call=statement.call)
            yield row._replace(new=_behind(at), behind=behind)
        elif statement.branches:
            yield from _branches(statement, row)
        elif statement.template:
            yield row._replace(text=f"from the template {statement.template}")
            yield from _statements(statement.brings, at, depth + 1, transition, why)
        elif statement.choices or not statement.reason:
            row = row._replace(kind="choice", text=ONE_OF, new=_with_path(at, (*at.path, 0)), behind=_behind(at))
            yield row
            if depth <= MAX_LEVELS:
                yield from _statements(statement.choices, at, depth + 1, transition, why, row)
            else:
                yield _too_deep(row)
        else:
            yield row._replace(text=statement.reason)


def _branches(statement: WrittenStatement, row: PartRow) -> Iterator[PartRow]:
    """The branches of an `if`, each with its contents."""
    whole, has_else = row.at, statement.branches[-1].condition is None
    assert whole is not None
    new_branch = _with_path(whole, (*whole.path, len(statement.branches) - has_else))
    row = row._replace(behind=_behind(whole), new_branch=new_branch, can_be_else=not has_else)
    for number, branch in enumerate(statement.branches):
        at = _with_path(whole, (*whole.path, number))
        inside = _with_path(at, (*at.path, 0))
        reason = row.reason or branch.reason
        text = branch_words(branch, first=number == 0)
        head = row._replace(text=text, guard=branch.condition or "", new=inside)
        if number == 0:
            yield head._replace(kind="if")
        else:
            yield head._replace(kind="branch", at=at, reason=reason, line=branch.line)
        if row.depth > MAX_LEVELS:
            yield _too_deep(row)
        elif branch.statements:
            yield from _statements(branch.statements, at, row.depth + 1, row.transition, reason, row)
        else:
            yield head._replace(kind="empty", text="nothing yet", depth=row.depth + 1, at=inside, reason=reason,
                                guard="", siblings=0, line=0)  # fmt: skip


def _too_deep(row: PartRow) -> PartRow:
    return PartRow("other", "… more within: e opens the file", row.depth + 1, None, row.transition, line=row.line)


def _behind(at: StatementAddress) -> StatementAddress:
    return _with_path(at, (*at.path[:-1], at.path[-1] + 1))


def _with_path(at: StatementAddress, path: tuple[int, ...]) -> StatementAddress:
    return StatementAddress(at.rule, at.state, at.place, at.transition, path)
