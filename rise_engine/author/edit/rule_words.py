"""Descriptions of functions, transitions and conditions of a rule. Pure."""

from __future__ import annotations

from rise_engine.author.edit.edits import CallForm, TransitionForm
from rise_engine.author.edit.outline import WrittenBranch, WrittenStatement
from rise_engine.scenario.model import ALWAYS, FunctionName, normal_topic
from rise_engine.syntax.xml_writing import one_line

FUNCTION_WORDS: dict[FunctionName, str] = {
    "startCommunicationRobotAct": "start the act",
    "stopCommunicationRobotAct": "stop the act",
    "startInteractionRule": "start the rule",
    "stopInteractionRule": "stop the rule",
    "raiseEventTopic": "raise the event",
    "assignValue": "set",
}
"""What a function does, followed by a name, an event, or `key = value`."""
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
    """Describe what a transition waits for: `as soon as /next happens`."""
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
