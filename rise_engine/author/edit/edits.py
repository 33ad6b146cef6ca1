"""What can be changed in a study: one value for each change that a form, a command or a program makes.

Plain data, JSON both ways: `{"edit": "set_parameter", "act": "R_Greeting", "action": "2", ...}`
(docs/reference/edits.md). Everything is addressed by its name, so that an edit can be made again on files that have
changed meanwhile; a way out of a state, which has none, by its number in the state and by what it waits for.
"""

from __future__ import annotations

import re
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.scenario.model import FunctionName, Json

NameKind: TypeAlias = Literal["act", "rule", "state", "event", "key", "action"]
"""What can be renamed: an act, a rule, a state (`RULE/STATE`), an event, a memory key, an actionID (`ACT/ID`)."""
StatementPlace: TypeAlias = Literal["onEntry", "onExit", "transition"]

_UPPER = re.compile(r"(?<!^)(?=[A-Z])")


def edit_name(class_name: str) -> str:
    """What JSON calls an edit: "set_parameter" is SetParameter."""
    return _UPPER.sub("_", class_name).lower()


class Edit(Struct, frozen=True, forbid_unknown_fields=True, tag_field="edit", tag=edit_name):
    """One change. Its subclasses are all that there are (`AnyEdit`)."""


# --- what is written in a form --------------------------------------------------------------------------------------


class TransitionForm(Struct, frozen=True, forbid_unknown_fields=True):
    """A way out of a state, as its form has it: every field as the author types it, None: not there.

    At most one of `event`, `ended` and `after` is the trigger; with none of them `condition` alone is.
    """

    event: str | None = None
    """With or without its slash; written with it."""
    ended: str | None = None
    """The act whose end is waited for."""
    outcomes: tuple[str, ...] = ()
    """With `ended`."""
    after: str | None = None
    """`2s`, `{pause}ms`."""
    held: str | None = None
    """With `after`: what must hold all that time (`while`)."""
    condition: str | None = None
    """An expression, unescaped: `score < 3`."""
    target: str | None = None


class CallForm(Struct, frozen=True, forbid_unknown_fields=True, tag_field="statement", tag="call"):
    """A function of a rule, as its form has it."""

    function: FunctionName
    argument: str
    """A name, an event, or `key = expression`; unescaped."""
    state: str | None = None
    enter: bool = True
    keep: str | None = None


class BranchForm(Struct, frozen=True, forbid_unknown_fields=True):
    """An arm of an `if`."""

    condition: str | None
    """None: `else`, the last one."""
    statements: tuple[StatementForm, ...] = ()


class IfForm(Struct, frozen=True, forbid_unknown_fields=True, tag_field="statement", tag="if"):
    branches: tuple[BranchForm, ...]


class OneOfForm(Struct, frozen=True, forbid_unknown_fields=True, tag_field="statement", tag="oneOf"):
    choices: tuple[StatementForm, ...]


StatementForm: TypeAlias = CallForm | IfForm | OneOfForm


class StatementAddress(Struct, frozen=True, forbid_unknown_fields=True):
    """Where a statement stands.

    `path` leads down the statements as they are written (`outline.WrittenStatement`): the number of a statement; of an
    `if`, then the number of its branch and that of a statement in it; of a `oneOf`, then the number of its choice.
    """

    rule: str
    state: str
    place: StatementPlace
    transition: int = 0
    """Its number in the state, from 0, when `place` is "transition"."""
    path: tuple[int, ...] = ()


# --- acts -----------------------------------------------------------------------------------------------------------


class AddAct(Edit, frozen=True):
    """A new act. It is empty but for what `text` says: one `Speech` with this message."""

    name: str
    text: str = ""
    after: str = ""
    """The act behind which it stands, in the same file."""
    file: str = ""
    """Instead: the file at whose end it stands, which may be new. With neither: the last file of acts."""


class CopyAct(Edit, frozen=True):
    act: str
    name: str
    """Of the copy, which stands behind the act."""


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
    """The action behind which it stands in the file; empty: at the end."""


class RemoveAction(Edit, frozen=True):
    """Its successors then wait for what it has waited for."""

    act: str
    action: str


class SetActionType(Edit, frozen=True):
    """Another action in its place; parameters of the same name stay, those that the new one does not have go."""

    act: str
    action: str
    type: str


class SetParameter(Edit, frozen=True):
    act: str
    action: str
    parameter: str
    value: str | None
    """As it is to be read, unescaped; None: not given."""
    variant: int = 0
    """Of several wordings, the number of this one, from 0."""


class SetWaits(Edit, frozen=True):
    act: str
    action: str
    wait_for: tuple[str, ...]
    """Ids of actions; empty: it starts at once."""


class SetActionFailure(Edit, frozen=True):
    act: str
    action: str
    continues: bool
    """Whether its successors start although it has failed (`<onFailure>continue</onFailure>`)."""


class AddVariant(Edit, frozen=True):
    """Another wording, picked by chance. A single action becomes `<Variants>`."""

    act: str
    action: str
    parameters: dict[str, str]


class RemoveVariant(Edit, frozen=True):
    """With one left, it is a single action again."""

    act: str
    action: str
    variant: int


# --- rules ----------------------------------------------------------------------------------------------------------


class AddRule(Edit, frozen=True):
    name: str
    initial: str
    """Its first state, which is made with it."""
    after: str = ""
    """The rule behind which it stands, in the same file."""
    file: str = ""
    """Instead: the file in which it stands. With neither: a new file that is called as the rule."""


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
    """The state behind which it stands; empty: at the end."""


class RemoveState(Edit, frozen=True):
    """Refused while a way leads to it; the ways out of it go with it."""

    rule: str
    state: str


class AddTransition(Edit, frozen=True):
    rule: str
    state: str
    transition: TransitionForm
    at: int | None = None
    """Its number among the ways out; None: the last."""


class SetTransition(Edit, frozen=True):
    """What its functions are stays."""

    rule: str
    state: str
    index: int
    was: TransitionForm
    """What stands there now: found again by it when the number has changed meanwhile."""
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
    """Its new number."""


class AddStatement(Edit, frozen=True):
    at: StatementAddress
    """The statement before which it stands; a number behind the last: at the end."""
    statement: StatementForm


class SetCall(Edit, frozen=True):
    at: StatementAddress
    call: CallForm


class RemoveStatement(Edit, frozen=True):
    """Also a branch of an `if`, and an `if` with all that is in it."""

    at: StatementAddress


class MoveStatement(Edit, frozen=True):
    at: StatementAddress
    to: int
    """Its new number among those it stands with."""


class AddBranch(Edit, frozen=True):
    at: StatementAddress
    """The `if`, and the number that the branch gets."""
    condition: str | None
    """None: `else`."""


class SetBranchCondition(Edit, frozen=True):
    at: StatementAddress
    """The branch."""
    condition: str


# --- memory, settings, tables, templates ----------------------------------------------------------------------------


class SetStartValue(Edit, frozen=True):
    """A memory key's start value; a key that is not there is added."""

    key: str
    value: Json


class RemoveStartValue(Edit, frozen=True):
    key: str


class SetSetting(Edit, frozen=True):
    """A value in `scenario.toml`, `study.toml` or another TOML file of the study."""

    path: tuple[str, ...]
    """`("keys", "n")`, `("act", "R_Nod", "filler")`, `("title",)`; a number for an element of a list."""
    value: Json
    """None: the entry goes, and a table's header with its last entry."""
    file: str = "scenario.toml"


class RenameSetting(Edit, frozen=True):
    """An entry under another name, in its place: a key of the keyboard that is to be another one."""

    path: tuple[str, ...]
    name: str
    file: str = "scenario.toml"


class SetCell(Edit, frozen=True):
    """A value of a table."""

    table: str
    row: int
    """From 0, the header not counted."""
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
    """A column of a table, which is empty in all rows."""

    table: str
    column: str
    at: int | None = None
    """From 0; None: the last."""


class SetUseParameter(Edit, frozen=True):
    """A parameter of a `<use>`, by which acts and states of a template differ."""

    file: str
    line: int
    """Where the `<use>` begins."""
    template: str
    parameter: str
    value: str | None


class SetTranslation(Edit, frozen=True):
    """What an act says in another language of the study (`texts/LANGUAGE.toml`)."""

    language: str
    act: str
    text: str
    """Which text: `ID` or `ID/VARIANT`, with `/PARAMETER` behind it where that is not `message`."""
    value: str | None


class AddLanguage(Edit, frozen=True):
    """Another language that the texts are to be translated into (`also`, in scenario.toml)."""

    language: str
    """Its tag: `de`, `pt-BR`, `de-x-sie`."""


# --- names and whole files ------------------------------------------------------------------------------------------


class Rename(Edit, frozen=True):
    """A name everywhere: files of acts and rules, conditions, templates, keys, settings, task files, translations."""

    kind: NameKind
    old: str
    new: str
    """For a state and an actionID the new name alone, without the rule or act."""


class ReplaceFile(Edit, frozen=True):
    """A whole file as an editor, an import or a person has written it."""

    file: str
    text: str | None
    """None: it goes."""


AnyEdit: TypeAlias = (
    AddAct | CopyAct | RemoveAct | AddAction | RemoveAction | SetActionType | SetParameter | SetWaits | SetActionFailure
    | AddVariant | RemoveVariant | AddRule | CopyRule | RemoveRule | SetInitial | SetPriority | AddState | RemoveState
    | AddTransition | SetTransition | RemoveTransition | MoveTransition | AddStatement | SetCall | RemoveStatement
    | MoveStatement | AddBranch | SetBranchCondition | SetStartValue | RemoveStartValue | SetSetting | RenameSetting
    | SetCell | AddRow | RemoveRow | AddColumn | SetUseParameter | SetTranslation | AddLanguage
    | Rename | ReplaceFile
)  # fmt: skip
"""Every edit that there is."""
