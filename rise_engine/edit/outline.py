"""A study as it is written: what forms show and edits find their places by.

Unlike `Scenario`, it is there when something is wrong: values are the texts that stand in the file, right or not. What
a form cannot change is there too, with the reason.
"""

from __future__ import annotations

from msgspec import Struct, field

from rise_engine.edit.edits import CallForm, TransitionForm


class Span(Struct, frozen=True):
    """A stretch of a file, in bytes."""

    start: int
    end: int


class WrittenValue(Struct, frozen=True):
    """An attribute's value or an element's text."""

    text: str
    """As it is read: without entities, CDATA and the blanks around it."""
    span: Span
    """What stands in the file for it."""
    reason: str = ""
    """Why a form cannot change it ("a comment stands in it"); empty: it can."""
    parameter: str = ""
    """Of what comes from a template: the parameter of the `<use>` at `span` whose value it is, whole and as it stands;
    `SetUseParameter` changes it. Empty: it is none."""


class WrittenCall(Struct, frozen=True):
    """An action with its parameters; one wording of `<Variants>`."""

    type: str
    span: Span
    parameters: dict[str, WrittenValue]
    """In file order, without actionID, waitForActions and onFailure."""


class WrittenAction(Struct, frozen=True):
    id: str
    """Empty: it has none, which is an error."""
    calls: tuple[WrittenCall, ...]
    """One, or the wordings of `<Variants>`."""
    wait_for: tuple[str, ...]
    continues: bool
    """Whether its successors start although it has failed."""
    span: Span
    """Of the whole element."""
    line: int
    is_variants: bool = False
    reason: str = ""
    """Why a form cannot change it; empty: it can."""


class WrittenAct(Struct, frozen=True):
    name: str
    actions: tuple[WrittenAction, ...]
    file: str
    span: Span
    line: int
    reason: str = ""
    """Why a form cannot change it ("it comes from the template `Instruction`, used here"); empty: it can."""
    template: str = ""
    """The template that it comes from. `span` and `line` are then those of the `<use>`."""
    name_parameter: str = ""
    """With `template`: the parameter of the `<use>` that its name is, alone; empty: none is."""


class WrittenStatement(Struct, frozen=True):
    """A function, an `if` with its branches, a `oneOf` with its choices, or a `<use>`.

    One without `call`, `branches`, `choices` and `template` is no statement that is known; its reason says so.
    """

    span: Span
    line: int
    call: CallForm | None = None
    branches: tuple[WrittenBranch, ...] = ()
    """Of an `if`, wherever its `else` stands."""
    choices: tuple[WrittenStatement, ...] = ()
    """Of a `oneOf`."""
    reason: str = ""
    """Why a form cannot change it; empty: it can."""
    template: str = ""
    """Of a `<use>`: its template."""
    brings: tuple[WrittenStatement, ...] = ()
    """Of a `<use>`: what comes of it. No address leads to these."""


class WrittenBranch(Struct, frozen=True):
    condition: str | None
    """None: `else`."""
    statements: tuple[WrittenStatement, ...]
    span: Span
    """Of the `if`, `elseif` or `else` that it begins with."""
    line: int
    reason: str = ""


class WrittenTransition(Struct, frozen=True):
    form: TransitionForm
    statements: tuple[WrittenStatement, ...]
    span: Span
    line: int
    shared_by: tuple[str, ...] = ()
    """Of a way that stands in `<transitions in="A | B">`: those states."""
    reason: str = ""


class WrittenState(Struct, frozen=True):
    id: str
    on_entry: tuple[WrittenStatement, ...]
    on_exit: tuple[WrittenStatement, ...]
    transitions: tuple[WrittenTransition, ...]
    """Its own, then those that it shares, as the engine tries them."""
    span: Span
    line: int
    reason: str = ""
    template: str = ""


class WrittenRule(Struct, frozen=True):
    name: str
    initial: str
    priority: str | None
    states: tuple[WrittenState, ...]
    file: str
    span: Span
    line: int
    reason: str = ""
    template: str = ""
    name_parameter: str = ""
    """As an act's."""


class WrittenUse(Struct, frozen=True):
    """A `<use template="...">` outside of templates."""

    template: str
    values: dict[str, WrittenValue]
    parameters: dict[str, str | None]
    """The template's, each with its default; None: it must be given. Empty for a template that there is not."""
    file: str
    span: Span
    line: int


class Outline(Struct, frozen=True):
    """All that is written in a study's acts and rules, in the order of the files."""

    acts: tuple[WrittenAct, ...] = ()
    rules: tuple[WrittenRule, ...] = ()
    uses: tuple[WrittenUse, ...] = ()
    unreadable: dict[str, str] = field(default_factory=dict)
    """Files that are no XML, each with what is wrong with it first: nothing is known of what is in them."""

    def act(self, name: str) -> WrittenAct | None:
        """The first act of this name."""
        return next((act for act in self.acts if act.name == name), None)

    def rule(self, name: str) -> WrittenRule | None:
        """The first rule of this name."""
        return next((rule for rule in self.rules if rule.name == name), None)
