"""Reads the statements of rules: functions, `if` with its branches, `oneOf` (semantics.md 5.2)."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial
from typing import Any, TypeVar

from rise_engine.base.nearest_name import suggest
from rise_engine.expression import Assignment, Expression, ExpressionError
from rise_engine.scenario.draft import Mention, StateMention
from rise_engine.scenario.grammar import FUNCTIONS, STATEMENTS, form_of
from rise_engine.scenario.model import Block, Branch, Function, If, OneOf, Statement, normal_topic
from rise_engine.scenario.reading.element_reader import ElementReader, read_seconds
from rise_engine.scenario.reading.expression_checks import (
    UNREADABLE_CONDITION,
    expression_message,
    note_assignment,
    note_expression,
)
from rise_engine.syntax.xml import Element

Code = TypeVar("Code", Expression, Assignment)

MAX_DEPTH = 50
"""Maximum nesting of `if` and `oneOf`."""
_FUNCTIONS = frozenset(FUNCTIONS)
_EXTRAS = {name: form.of for name, form in form_of("function").attributes.items() if form.of}
"""Attributes that supplement one function, and that function's attribute."""
_STARTING = "startInteractionRule"
_ELSE = ("else", "elseif")


class BlockReader(ElementReader):
    """Reads the statements of one rule."""

    def report_misplaced(self, element: Element, parent: Element, known: tuple[str, ...]) -> None:
        """Report an element that is not allowed in its parent."""
        name = element.tag
        if place := form_of(name).place:
            message = f"`<{name}>` is not allowed in `<{parent.tag}>`; it {place}"
        else:
            message = f"unknown element `<{name}>` in `<{parent.tag}>`{suggest(name, known).words}"
        self.report_error("unknown-element", element, message)

    def read_block(self, parent: Element) -> Block:
        """The statements inside `onEntry`, `onExit` or `transition`."""
        if not parent and not self.file.has_text:
            return ()
        return self.read_statements(parent, 0, chain=False)[0]

    def read_statements(self, parent: Element, depth: int, *, chain: bool) -> tuple[Block, list[Branch]]:
        """The statements inside an element, in document order.

        With `chain`, the element is an `if` or `elseif`: any `else` and `elseif` in it are further branches of the same
        `if` (as in the paper's listing 2) and are returned separately. Otherwise they continue the `if` before them.
        """
        self.check_no_text(parent)
        statements: list[Statement] = []
        later: list[Branch] = []
        before: list[Branch] | None = None  # the branches of the `if` directly before the current element
        open_ifs: list[tuple[int, list[Branch]]] = []  # each `if` whose branches may continue after it
        if depth > MAX_DEPTH:
            self.report_error("too-deep", parent, f"`if` and `oneOf` are nested more than {MAX_DEPTH} deep")
            return (), []
        for child in parent:
            tag = child.tag
            if tag in _ELSE:
                if chain:
                    if before is not None:
                        self.report_warning(
                            "ambiguous-else",
                            child,
                            f"this `<{tag}>` belongs to the outer `if`, "
                            f"in line {self.file.element_location(parent).line}; "
                            "if the inner one is meant, move it inside that",
                        )
                        before = None
                    self.add_branches(later, child, depth)
                elif before is not None:
                    self.add_branches(before, child, depth)
                else:
                    self.report_error("misplaced", child, f"`<{tag}>` has no `<if>` before it; it {form_of(tag).place}")
                continue
            if later and tag in STATEMENTS:
                self.report_error(
                    "misplaced",
                    child,
                    f"no `<{tag}>` can follow the first `else` or `elseif` of an `<if>`; "
                    "move it inside <else>...</else>, or before",
                )
            before = None
            if tag == "function":
                function = self.read_function(child)
                if function is not None:
                    statements.append(function)
            elif tag == "if":
                before = self.read_branches(child, depth)
                open_ifs.append((len(statements), before))
                statements.append(If((), self.file.element_location(child)))
            elif tag == "oneOf":
                self.check_attributes(child)
                choices = self.read_statements(child, depth + 1, chain=False)[0]
                if choices:
                    statements.append(OneOf(choices, self.file.element_location(child)))
                elif not child:
                    self.report_error(
                        "no-choice", child, "`<oneOf>` holds functions and picks one of them; it has none"
                    )
            else:
                self.report_misplaced(child, parent, STATEMENTS)
        for index, branches in open_ifs:
            statements[index] = If(tuple(branches), statements[index].location)
        return tuple(statements), later

    def read_branches(self, element: Element, depth: int) -> list[Branch]:
        """The branches of an `if` or `elseif`, including those nested inside it."""
        if "cond" not in self.check_attributes(element):
            message = f'`<{element.tag}>` needs a condition: <{element.tag} cond="...">'
            self.report_missing(["cond"], element, message)
        condition = self.read_condition(element, "cond") or UNREADABLE_CONDITION
        block, later = self.read_statements(element, depth + 1, chain=True)
        return [Branch(condition, block), *later]

    def add_branches(self, branches: list[Branch], element: Element, depth: int) -> None:
        """Add the branches of an `else` or `elseif` to its `if`."""
        if branches and branches[-1].condition is None:
            self.report_error("misplaced", element, f"`<{element.tag}>` after `<else>`; `<else>` comes last, and once")
        if element.tag == "elseif":
            branches += self.read_branches(element, depth)
        else:
            self.check_attributes(element)
            branches.append(Branch(None, self.read_statements(element, depth + 1, chain=False)[0]))

    def read_function(self, element: Element) -> Function | None:
        """Read one call, and note its names for the checks across files."""
        given = element.attributes
        name: Any = next((name for name in given if name in _FUNCTIONS), None)
        if name is None or len(given) != 1 or element or self.file.has_text:
            self.check_function(element, given)
            if name is None:
                return None
        argument = given[name].strip()
        locate = partial(self.file.value_location, element, name)
        assignment: Assignment | None = None
        if not argument or (name == "raiseEventTopic" and not normal_topic(argument)):
            self.report_value("missing-value", element, name, f"`{name}` is empty")
        elif name == "assignValue":
            assignment = self.read_assignment(element)
        elif name == "raiseEventTopic":
            self.draft.raised_topics.append(Mention(normal_topic(argument), locate))
        elif name in ("startCommunicationRobotAct", "stopCommunicationRobotAct"):
            self.draft.act_mentions.append(Mention(argument, locate))
        else:
            self.draft.rule_mentions.append(Mention(argument, locate))
        state, enter = self.read_start(element, argument) if name == _STARTING and len(given) > 1 else (None, True)
        keep = read_seconds(self, element, "keep") if name == "raiseEventTopic" and "keep" in given else None
        return Function(name, argument, assignment, self.file.element_location(element), state, enter, keep)

    def read_start(self, element: Element, rule: str) -> tuple[str | None, bool]:
        """Read the state in which a rule begins (`state`), and whether it runs `onEntry` there (`enter`)."""
        given = element.attributes
        enter = given.get("enter", "yes").strip()
        if enter not in ("yes", "no"):
            message = f"`enter` is `yes` or `no`, not `{enter}`; with `no` the rule waits there without running onEntry"
            self.report_value("wrong-value", element, "enter", message)
        if "state" not in given:
            return None, enter != "no"
        state = given["state"].strip()
        if state:
            locate = partial(self.file.value_location, element, "state")
            self.draft.state_mentions.append(StateMention(state, locate, rule))
        else:
            self.report_value("missing-value", element, "state", "`state` is empty; name a state, or leave it out")
        return state or None, enter != "no"

    def check_function(self, element: Element, given: Collection[str]) -> None:
        """Report errors in the form of a `<function>`."""
        for child in element:
            self.report_error(
                "unknown-element", child, f"nothing is allowed inside `<function>`; delete `<{child.tag}>`"
            )
        self.check_no_text(element)
        known = [name for name in given if name in _FUNCTIONS]
        extras = [name for name, function in _EXTRAS.items() if function in known[:1]]
        for name in given:
            if name in _EXTRAS:
                if name not in extras:
                    message = f"`{name}` goes with {_EXTRAS[name]}"
                    self.report_attribute("unknown-attribute", element, name, message)
            elif name not in _FUNCTIONS:
                near = suggest(name, (*FUNCTIONS, *sorted(extras)))
                self.report_attribute("unknown-attribute", element, name, f"there is no function `{name}`", near)
        if len(known) > 1:
            message = f"a `<function>` does one thing; write another one for `{known[1]}`"
            self.report_attribute("one-function", element, known[1], message)
        elif not given:
            self.report_error("one-function", element, f"`<function>` says what to do: one of {', '.join(FUNCTIONS)}")

    def read_condition(self, element: Element, attribute: str) -> Expression | None:
        """The condition in an attribute; None: there is none, or it cannot be read."""
        if attribute not in element.attributes:
            return None
        expression = self.parse_attribute("condition", element, attribute, Expression.parse, self.draft.expressions)
        if expression is not None:
            locate = partial(self.file.value_location, element, attribute)
            note_expression(expression, locate, self.draft, self.diagnostics)
        return expression

    def read_assignment(self, element: Element) -> Assignment | None:
        parse, known = Assignment.parse, self.draft.assignments
        assignment = self.parse_attribute("assignment", element, "assignValue", parse, known)
        if assignment is not None:
            note_assignment(assignment, partial(self.file.value_location, element, "assignValue"), self.draft)
        return assignment

    def parse_attribute(
        self, code: str, element: Element, attribute: str, parse: Callable[[str], Code], known: dict[str, Code]
    ) -> Code | None:
        """Parse an attribute in the expression language; None, after a diagnostic, if it cannot be read."""
        text = element.attributes[attribute]
        try:
            return known.get(text) or known.setdefault(text, parse(text))
        except ExpressionError as error:
            location = self.file.value_location(element, attribute, error.column - 1)
            self.diagnostics.error(code, location, expression_message(error), error.suggestion)
            return None
