"""A study as it is written: what forms show and edits find their places by.

Unlike `Scenario`, it is there when something is wrong: values are the texts that stand in the file, right or not. What
a form cannot change is there too, with the reason.
"""

from __future__ import annotations

from msgspec import Struct, field

from rise_engine.author.edit.edits import CallForm, TransitionForm
from rise_engine.syntax.xml import Element


class Written(Struct, frozen=True, kw_only=True):
    """Something that is written in a file of acts or rules."""

    node: Element
    """Its element; of what comes from a template, the `<use>` in the file."""
    reason: str = ""
    """Why a form cannot change it ("it comes from the template `Instruction`, used here"); empty: it can."""

    @property
    def file(self) -> str:
        return self.node.tree.name

    @property
    def last(self) -> Element:
        """The last of its elements."""
        return self.node

    @property
    def line(self) -> int:
        """The number of the line in which it begins, from 1."""
        return self.node.line

    @property
    def last_line(self) -> int:
        """The number of the line in which it ends."""
        return self.node.tree.line(self.last.end)

    def has_line(self, line: int) -> bool:
        """Whether it stands in a line, in part at least."""
        return self.line <= line <= self.last_line

    def holds(self, offset: int) -> bool:
        """Whether a character of the file stands in it."""
        return self.node.start <= offset < self.last.end


class WrittenValue(Written, frozen=True):
    """An attribute's value or an element's text. `node` is the element that has it."""

    text: str
    """As it is read: without entities, CDATA and the blanks around it."""
    parameter: str = ""
    """Of what comes from a template: the parameter of the `<use>` whose value it is, whole and as it stands;
    `SetUseParameter` changes it. Empty: it is none."""


class WrittenCall(Written, frozen=True):
    """An action with its parameters; one wording of `<Variants>`."""

    type: str
    parameters: dict[str, WrittenValue]
    """In file order, without actionID, waitForActions and onFailure."""


class WrittenAction(Written, frozen=True):
    id: str
    """Empty: it has none, which is an error."""
    calls: tuple[WrittenCall, ...]
    """One, or the wordings of `<Variants>`."""
    wait_for: tuple[str, ...]
    continues: bool
    """Whether its successors start although it has failed."""
    is_variants: bool = False


class WrittenAct(Written, frozen=True):
    name: str
    actions: tuple[WrittenAction, ...]
    template: str = ""
    """The template that it comes from."""
    name_parameter: str = ""
    """With `template`: the parameter of the `<use>` that its name is, alone; empty: none is."""


class WrittenStatement(Written, frozen=True):
    """A function, an `if` with its branches, a `oneOf` with its choices, or a `<use>`.

    One without `call`, `branches`, `choices` and `template` is no statement that is known; its reason says so.
    """

    call: CallForm | None = None
    branches: tuple[WrittenBranch, ...] = ()
    """Of an `if`, wherever its `else` stands."""
    choices: tuple[WrittenStatement, ...] = ()
    """Of a `oneOf`."""
    template: str = ""
    """Of a `<use>`: its template."""
    brings: tuple[WrittenStatement, ...] = ()
    """Of a `<use>`: what comes of it. No address leads to these."""
    behind: Element | None = None
    """The last `else` or `elseif` of an `if` that stands behind it."""

    @property
    def last(self) -> Element:
        return self.behind if self.behind is not None else self.node


class WrittenBranch(Written, frozen=True):
    """`node` is the `if`, `elseif` or `else` that it begins with."""

    condition: str | None
    """None: `else`."""
    statements: tuple[WrittenStatement, ...]


class WrittenTransition(Written, frozen=True):
    form: TransitionForm
    statements: tuple[WrittenStatement, ...]
    shared_by: tuple[str, ...] = ()
    """Of a way that stands in `<transitions in="A | B">`: those states."""


class WrittenState(Written, frozen=True):
    id: str
    on_entry: tuple[WrittenStatement, ...]
    on_exit: tuple[WrittenStatement, ...]
    transitions: tuple[WrittenTransition, ...]
    """Its own, then those that it shares, as the engine tries them."""
    template: str = ""


class WrittenRule(Written, frozen=True):
    name: str
    initial: str
    priority: str | None
    states: tuple[WrittenState, ...]
    template: str = ""
    name_parameter: str = ""
    """As an act's."""


class WrittenUse(Written, frozen=True):
    """A `<use template="...">` outside of templates."""

    template: str
    values: dict[str, WrittenValue]
    parameters: dict[str, str | None]
    """The template's, each with its default; None: it must be given. Empty for a template that there is not."""


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
