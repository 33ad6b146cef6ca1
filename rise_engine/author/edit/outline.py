"""The written form of a study, which forms show and in which edits find their places.

Unlike `Scenario`, it also exists for a study with errors: its values are the texts of the file, right or wrong. It also
holds the parts that a form cannot change, with the reason. Functions and transitions can be described in words.
"""

from __future__ import annotations

from msgspec import Struct, field

from rise_engine.author.edit.edits import CallForm, TransitionForm
from rise_engine.scenario.model import ALWAYS, FunctionName, normal_topic
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_writing import one_line


class Written(Struct, frozen=True, kw_only=True):
    """A part of a file of acts or rules."""

    node: Element
    """Its element; for the result of a template, the `<use>` in the file."""
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
        """The number of its first line, from 1."""
        return self.node.line

    @property
    def last_line(self) -> int:
        """The number of its last line."""
        return self.node.tree.line(self.last.end)

    def has_line(self, line: int) -> bool:
        """Return whether it occupies a line, at least in part."""
        return self.line <= line <= self.last_line

    def holds(self, offset: int) -> bool:
        """Return whether it contains a character of the file."""
        return self.node.start <= offset < self.last.end


class WrittenValue(Written, frozen=True):
    """The value of an attribute or the text of an element. `node` is the element that has it."""

    text: str
    """Without entities, CDATA and surrounding blanks."""
    parameter: str = ""
    """In the result of a template: the `<use>` parameter that is the whole value; empty: none (`SetUseParameter`)."""


class WrittenCall(Written, frozen=True):
    """An action with its parameters, or one wording of `<Variants>`."""

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
    """Whether its successors start after its failure."""
    is_variants: bool = False


class WrittenAct(Written, frozen=True):
    name: str
    actions: tuple[WrittenAction, ...]
    template: str = ""
    """The template that it comes from."""
    name_parameter: str = ""
    """With `template`: the parameter of the `<use>` that is its complete name; empty: there is none."""


class WrittenStatement(Written, frozen=True):
    """A function, an `if` with its branches, a `oneOf` with its choices, or a `<use>`.

    A statement without `call`, `branches`, `choices` and `template` is unknown; see its reason.
    """

    call: CallForm | None = None
    branches: tuple[WrittenBranch, ...] = ()
    """For an `if`, wherever its `else` is."""
    choices: tuple[WrittenStatement, ...] = ()
    """For a `oneOf`."""
    template: str = ""
    """The template of a `<use>`."""
    brings: tuple[WrittenStatement, ...] = ()
    """The result of a `<use>`. No address leads to these."""
    behind: Element | None = None
    """The last `else` or `elseif` that follows an `if`."""

    @property
    def last(self) -> Element:
        return self.behind if self.behind is not None else self.node


class WrittenBranch(Written, frozen=True):
    """A branch of an `if`. `node` is its `if`, `elseif` or `else`."""

    condition: str | None
    """None: `else`."""
    statements: tuple[WrittenStatement, ...]


class WrittenTransition(Written, frozen=True):
    form: TransitionForm
    statements: tuple[WrittenStatement, ...]
    shared_by: tuple[str, ...] = ()
    """The states of a transition in `<transitions in="A | B">`."""


class WrittenState(Written, frozen=True):
    id: str
    on_entry: tuple[WrittenStatement, ...]
    on_exit: tuple[WrittenStatement, ...]
    transitions: tuple[WrittenTransition, ...]
    """Its own, then the shared ones, in the order in which the engine tries them."""
    template: str = ""


class WrittenRule(Written, frozen=True):
    name: str
    initial: str
    priority: str | None
    states: tuple[WrittenState, ...]
    template: str = ""
    name_parameter: str = ""
    """As for acts."""


class WrittenUse(Written, frozen=True):
    """A `<use template="...">` outside of templates."""

    template: str
    values: dict[str, WrittenValue]
    parameters: dict[str, str | None]
    """The template's, each with its default; None: it has no default. Empty for an unknown template."""


class Outline(Struct, frozen=True):
    """The contents of a study's acts and rules, in the order of the files."""

    acts: tuple[WrittenAct, ...] = ()
    rules: tuple[WrittenRule, ...] = ()
    uses: tuple[WrittenUse, ...] = ()
    unreadable: dict[str, str] = field(default_factory=dict)
    """Files that are not XML, each with its first error. Their contents are unknown."""

    def act(self, name: str) -> WrittenAct | None:
        """Return the first act of this name."""
        return next((act for act in self.acts if act.name == name), None)

    def rule(self, name: str) -> WrittenRule | None:
        """Return the first rule of this name."""
        return next((rule for rule in self.rules if rule.name == name), None)


# --- in words ---------------------------------------------------------------------------------------------------------


FUNCTION_WORDS: dict[FunctionName, str] = {
    "startCommunicationRobotAct": "start the act",
    "stopCommunicationRobotAct": "stop the act",
    "startInteractionRule": "start the rule",
    "stopInteractionRule": "stop the rule",
    "raiseEventTopic": "raise the event",
    "assignValue": "set",
}
"""Words for each function, followed by a name, an event, or `key = value`."""
OTHERWISE = "otherwise"
ONE_OF = "one of these, by chance"


def call_words(call: CallForm) -> str:
    """Describe a function: `start the act R_Nod`, `raise the event /next, kept for 5s if nobody waits`."""
    argument = one_line(call.argument)
    if call.function == "raiseEventTopic":
        kept = f", kept for {call.keep} if nobody waits" if call.keep is not None else ""
        return f"raise the event /{normal_topic(argument)}{kept}"
    words = f"{FUNCTION_WORDS[call.function]} {argument}".strip()
    if call.function == "startInteractionRule":
        words += f", in the state {call.state}" if call.state is not None else ""
        words += "" if call.enter else ", without what it does on entry"
    return words


def branch_words(branch: WrittenBranch, *, first: bool) -> str:
    """Describe the head of a branch of an `if`."""
    if branch.condition is None:
        return OTHERWISE
    return f"{'if' if first else 'otherwise, if'} {one_line(branch.condition)}"


def statement_words(statement: WrittenStatement) -> str:
    """Describe a statement in one line, without its contents."""
    if statement.call is not None:
        return call_words(statement.call)
    if statement.branches:
        return branch_words(statement.branches[0], first=True)
    if statement.template:
        return f"what the template {statement.template} brings"
    return ONE_OF if statement.choices else "what a form cannot show"


def trigger_words(form: TransitionForm) -> str:
    """Describe the trigger of a transition: `as soon as /next happens`."""
    if form.event is not None:
        return f"as soon as /{normal_topic(form.event)} happens"
    if form.ended is not None:
        return f"as soon as {form.ended.strip()} has {' or '.join(form.outcomes) or 'ended'}"
    if form.after is not None:
        if form.held is not None:
            return f"when this has been true for {form.after.strip()}: {one_line(form.held)}"
        return f"when {form.after.strip()} have passed"
    if form.condition is not None and form.condition.strip() == ALWAYS:
        return "at once"
    return f"as soon as this is true: {one_line(form.condition or '–')}"


def transition_words(form: TransitionForm) -> str:
    """Describe a transition in one line, without its functions."""
    words = trigger_words(form)
    has_trigger = form.event is not None or form.ended is not None or form.after is not None
    if form.condition is not None and has_trigger:
        words += f", but only if {one_line(form.condition)}"
    return f"{words} → {form.target.strip()}" if form.target is not None else f"{words}: stays here"
