"""The edits of a study: one value for each change that a form, a command or a program makes.

Edits are plain data and read and write JSON: `{"edit": "set_parameter", "act": "R_Greeting", "action": "2", ...}`
(docs/reference/edits.md). They address parts by name, so that they also apply to files that have changed meanwhile. A
transition has no name; its address is its number in the state and its trigger.
"""

from __future__ import annotations

import re
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.scenario.model import FunctionName, Json

NameKind: TypeAlias = Literal["act", "rule", "state", "event", "key", "action"]
"""Kinds of names: an act, a rule, a state (`RULE/STATE`), an event, a memory key, an actionID (`ACT/ID`)."""
StatementPlace: TypeAlias = Literal["onEntry", "onExit", "transition"]

_UPPER = re.compile(r"(?<!^)(?=[A-Z])")


def edit_name(class_name: str) -> str:
    """Return the name of an edit in JSON: "set_parameter" for SetParameter."""
    return _UPPER.sub("_", class_name).lower()


class Edit(Struct, frozen=True, forbid_unknown_fields=True, tag_field="edit", tag=edit_name):
    """One change. `AnyEdit` lists all subclasses."""


# --- forms ----------------------------------------------------------------------------------------------------------


class TransitionForm(Struct, frozen=True, forbid_unknown_fields=True):
    """A transition in its form: every field as the author types it; None: not there.

    At most one of `event`, `ended` and `after` is the trigger. Otherwise `condition` is.
    """

    event: str | None = None
    """With or without slash; the file gets the slash."""
    ended: str | None = None
    """The act whose end it waits for."""
    outcomes: tuple[str, ...] = ()
    """With `ended`."""
    after: str | None = None
    """`2s`, `{pause}ms`."""
    held: str | None = None
    """With `after`: the condition that must hold during the whole time (`while`)."""
    condition: str | None = None
    """An expression, unescaped: `score < 3`."""
    target: str | None = None


class CallForm(Struct, frozen=True, forbid_unknown_fields=True, tag_field="statement", tag="call"):
    """A function of a rule in its form."""

    function: FunctionName
    argument: str
    """A name, an event, or `key = expression`; unescaped."""
    state: str | None = None
    enter: bool = True
    keep: str | None = None


class BranchForm(Struct, frozen=True, forbid_unknown_fields=True):
    """A branch of an `if`."""

    condition: str | None
    """None: `else`, the last one."""
    statements: tuple[StatementForm, ...] = ()


class IfForm(Struct, frozen=True, forbid_unknown_fields=True, tag_field="statement", tag="if"):
    branches: tuple[BranchForm, ...]


class OneOfForm(Struct, frozen=True, forbid_unknown_fields=True, tag_field="statement", tag="oneOf"):
    choices: tuple[StatementForm, ...]


StatementForm: TypeAlias = CallForm | IfForm | OneOfForm


class StatementAddress(Struct, frozen=True, forbid_unknown_fields=True):
    """The place of a statement.

    `path` leads down the statements in the file's order (`outline.WrittenStatement`): the number of a statement; in an
    `if`, then the numbers of a branch and of a statement in it; in a `oneOf`, then the number of a choice.
    """

    rule: str
    state: str
    place: StatementPlace
    transition: int = 0
    """Index in the state, from 0, when `place` is "transition"."""
    path: tuple[int, ...] = ()


# --- acts -----------------------------------------------------------------------------------------------------------


class AddAct(Edit, frozen=True):
    """A new act. It is empty, or has one `Speech` with `text` as its message."""

    name: str
    text: str = ""
    after: str = ""
    """The act after which it is inserted, in the same file."""
    file: str = ""
    """The file to which it is appended instead, which may be new. Without `after` and `file`: the last file of acts."""


class CopyAct(Edit, frozen=True):
    act: str
    name: str
    """The name of the copy, which follows the act."""


class RemoveAct(Edit, frozen=True):
    act: str


class AddAction(Edit, frozen=True):
    act: str
    type: str
    parameters: dict[str, str] = {}
    wait_for: tuple[str, ...] = ()
    id: str = ""
    """Empty: the next free number."""
    after: str = ""
    """The action after which it is inserted in the file; empty: at the end."""


class RemoveAction(Edit, frozen=True):
    """An action's removal; its successors then wait for its predecessors."""

    act: str
    action: str


class SetActionType(Edit, frozen=True):
    """Another type for an action. Parameters that the new type also has stay; others are removed."""

    act: str
    action: str
    type: str


class SetParameter(Edit, frozen=True):
    act: str
    action: str
    parameter: str
    value: str | None
    """The unescaped value; None: remove it."""
    variant: int = 0
    """The index of the wording, from 0, if there are several."""


class SetWaits(Edit, frozen=True):
    act: str
    action: str
    wait_for: tuple[str, ...]
    """Ids of actions; empty: it starts immediately."""


class SetActionFailure(Edit, frozen=True):
    act: str
    action: str
    continues: bool
    """Whether its successors start after its failure (`<onFailure>continue</onFailure>`)."""


class AddVariant(Edit, frozen=True):
    """Another wording, picked at random. A single action becomes `<Variants>`."""

    act: str
    action: str
    parameters: dict[str, str]


class RemoveVariant(Edit, frozen=True):
    """The removal of a wording. If one is left, it is a single action again."""

    act: str
    action: str
    variant: int


# --- rules ----------------------------------------------------------------------------------------------------------


class AddRule(Edit, frozen=True):
    name: str
    initial: str
    """Its first state, which is made with it."""
    after: str = ""
    """The rule after which it is inserted, in the same file."""
    file: str = ""
    """The file for it instead. Without `after` and `file`: a new file with the rule's name."""


class CopyRule(Edit, frozen=True):
    rule: str
    name: str


class RemoveRule(Edit, frozen=True):
    rule: str


class SetInitial(Edit, frozen=True):
    rule: str
    state: str


class SetPriority(Edit, frozen=True):
    rule: str
    priority: str | None


class AddState(Edit, frozen=True):
    rule: str
    state: str
    after: str = ""
    """The state after which it is inserted; empty: at the end."""


class RemoveState(Edit, frozen=True):
    """A state's removal, together with its own transitions; refused while a transition leads to it."""

    rule: str
    state: str


class AddTransition(Edit, frozen=True):
    rule: str
    state: str
    transition: TransitionForm
    at: int | None = None
    """Its index among the transitions; None: the last."""


class SetTransition(Edit, frozen=True):
    """Another form of a transition; its functions stay."""

    rule: str
    state: str
    index: int
    was: TransitionForm
    """Its present form, which identifies it if its number has changed meanwhile."""
    transition: TransitionForm


class RemoveTransition(Edit, frozen=True):
    rule: str
    state: str
    index: int
    was: TransitionForm


class MoveTransition(Edit, frozen=True):
    rule: str
    state: str
    index: int
    was: TransitionForm
    to: int
    """Its new index."""


class AddStatement(Edit, frozen=True):
    at: StatementAddress
    """The statement before which it is inserted; a number past the last: at the end."""
    statement: StatementForm


class SetCall(Edit, frozen=True):
    at: StatementAddress
    call: CallForm


class RemoveStatement(Edit, frozen=True):
    """The removal of a function, of a branch of an `if`, or of an `if` with its contents."""

    at: StatementAddress


class MoveStatement(Edit, frozen=True):
    at: StatementAddress
    to: int
    """Its new index in its list."""


class AddBranch(Edit, frozen=True):
    at: StatementAddress
    """The `if`, and the index that the branch gets."""
    condition: str | None
    """None: `else`."""


class SetBranchCondition(Edit, frozen=True):
    at: StatementAddress
    """The branch."""
    condition: str


# --- memory, settings, tables, templates ----------------------------------------------------------------------------


class SetStartValue(Edit, frozen=True):
    """The start value of a memory key; a new key is added."""

    key: str
    value: Json


class RemoveStartValue(Edit, frozen=True):
    key: str


class SetSetting(Edit, frozen=True):
    """A value in `scenario.toml`, `study.toml` or another TOML file of the study."""

    path: tuple[str, ...]
    """`("keys", "n")`, `("act", "R_Nod", "filler")`, `("title",)`; a number for an element of a list."""
    value: Json
    """None: remove the entry, and a table's header with its last entry."""
    file: str = "scenario.toml"


class RenameSetting(Edit, frozen=True):
    """Another name for an entry in its place, for example another key of the keyboard."""

    path: tuple[str, ...]
    name: str
    file: str = "scenario.toml"


class SetCell(Edit, frozen=True):
    """A value of a table."""

    table: str
    row: int
    """From 0, without the header."""
    column: str
    value: str


class AddRow(Edit, frozen=True):
    table: str
    values: dict[str, str]
    at: int | None = None
    """None: the last."""


class RemoveRow(Edit, frozen=True):
    table: str
    row: int


class AddColumn(Edit, frozen=True):
    """A new column of a table, empty in all rows."""

    table: str
    column: str
    at: int | None = None
    """From 0; None: the last."""


class SetUseParameter(Edit, frozen=True):
    """A parameter of a `<use>`, by which acts and states of a template differ."""

    file: str
    line: int
    """The line where the `<use>` begins."""
    template: str
    parameter: str
    value: str | None


class SetTranslation(Edit, frozen=True):
    """A text of an act in another language of the study (`texts/LANGUAGE.toml`)."""

    language: str
    act: str
    text: str
    """The text: `ID` or `ID/VARIANT`, followed by `/PARAMETER` unless that is `message`."""
    value: str | None


class AddLanguage(Edit, frozen=True):
    """Another language for translations (`also`, in scenario.toml)."""

    language: str
    """Its tag: `de`, `pt-BR`, `de-x-sie`."""


# --- names and whole files ------------------------------------------------------------------------------------------


class Rename(Edit, frozen=True):
    """A new name everywhere: in acts, rules, conditions, templates, keys, settings, task files, translations."""

    kind: NameKind
    old: str
    new: str
    """The new name; for a state or an actionID without the rule or act."""


class ReplaceFile(Edit, frozen=True):
    """A complete file from an editor, an import or a person."""

    file: str
    text: str | None
    """None: delete it."""


AnyEdit: TypeAlias = (
    AddAct | CopyAct | RemoveAct | AddAction | RemoveAction | SetActionType | SetParameter | SetWaits | SetActionFailure
    | AddVariant | RemoveVariant | AddRule | CopyRule | RemoveRule | SetInitial | SetPriority | AddState | RemoveState
    | AddTransition | SetTransition | RemoveTransition | MoveTransition | AddStatement | SetCall | RemoveStatement
    | MoveStatement | AddBranch | SetBranchCondition | SetStartValue | RemoveStartValue | SetSetting | RenameSetting
    | SetCell | AddRow | RemoveRow | AddColumn | SetUseParameter | SetTranslation | AddLanguage
    | Rename | ReplaceFile
)  # fmt: skip
