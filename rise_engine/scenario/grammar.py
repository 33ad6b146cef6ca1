"""The grammar of acts and rules: the places of elements, and the values of their attributes.

The readers, the search for uses, completion, edits and the list of extensions of RISE use it. The schemas for XML
editors are equivalent RELAX NG (`schema/`); `tests/scenario/test_editor_schemas.py` compares them. Sources: paper,
sections 4.2.1 and 4.2.2; docs/reference/cra.md and docs/reference/rules.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypeAlias, get_args

from msgspec import Struct

from rise_engine.scenario.model import ActOutcome, FunctionName
from rise_engine.syntax.xml_writing import ACT_WRAPPERS, RULE_WRAPPERS

ValueKind: TypeAlias = Literal[
    "text", "act", "rule", "state", "states", "event", "expression", "assignment", "delay", "choice", "choices"
]
"""The kind of an attribute's value. A delay is a time or an expression in braces; `states` and `choices` have `|`
between them."""


class AttributeForm(Struct, frozen=True):
    """An attribute that an element may have."""

    holds: ValueKind = "text"
    defines: bool = False
    """Whether the value is the name of the element itself."""
    choices: tuple[str, ...] = ()
    of: str = ""
    """The function's attribute that it supplements; empty: it can be used alone."""
    in_rise: bool = True
    """Whether RISE knows it."""


class ElementForm(Struct, frozen=True):
    """An element of a file of acts or rules."""

    place: str = ""
    """Its place, as the end of a sentence."""
    children: tuple[str, ...] = ()
    attributes: Mapping[str, AttributeForm] = {}
    """In the order of writing."""
    foreign: Mapping[str, str] = {}
    """Attributes of SCXML that it lacks, and the replacements."""
    in_rise: bool = True


FUNCTIONS: tuple[FunctionName, ...] = get_args(FunctionName)
STATEMENTS = ("function", "if", "oneOf")
COMMON = ("actionID", "waitForActions", "onFailure")
"""Children that every action may have, besides its parameters."""

_ACT, _RULE, _STATE = AttributeForm("act"), AttributeForm("rule"), AttributeForm("state")
_CONDITION = {"cond": AttributeForm("expression")}
_FUNCTIONS: dict[str, AttributeForm] = {
    "startCommunicationRobotAct": _ACT,
    "stopCommunicationRobotAct": _ACT,
    "startInteractionRule": _RULE,
    "stopInteractionRule": _RULE,
    "raiseEventTopic": AttributeForm("event"),
    "assignValue": AttributeForm("assignment"),
}
ELEMENTS: dict[str, ElementForm] = {
    **dict.fromkeys(ACT_WRAPPERS, ElementForm(children=("Dialog",))),
    "Dialog": ElementForm(children=("Variants",), attributes={"name": AttributeForm("act", defines=True)}),
    "Variants": ElementForm(children=COMMON, in_rise=False),
    "actionID": ElementForm(),
    "waitForActions": ElementForm(),
    "onFailure": ElementForm(in_rise=False),
    **dict.fromkeys(RULE_WRAPPERS, ElementForm(children=("InteractionRule",))),
    "InteractionRule": ElementForm(
        "is the outermost element",
        ("State", "transitions"),
        {"name": AttributeForm("rule", defines=True), "initial": _STATE, "priority": AttributeForm()},
    ),
    "State": ElementForm(
        "belongs in <InteractionRule>",
        ("onEntry", "onExit", "transition"),
        {"id": AttributeForm("state", defines=True)},
        {
            "final": "a state without transitions ends its rule",
            "initial": "the first state is named by its rule: <InteractionRule initial=...>",
        },
    ),
    "transitions": ElementForm(
        "belongs in <InteractionRule>", ("transition",), {"in": AttributeForm("states")}, in_rise=False
    ),
    "transition": ElementForm(
        "belongs in <State> or <transitions>",
        STATEMENTS,
        {
            "eventTopic": AttributeForm("event"),
            "ended": AttributeForm("act", in_rise=False),
            "outcome": AttributeForm("choices", choices=get_args(ActOutcome), of="ended", in_rise=False),
            "while": AttributeForm("expression", of="after", in_rise=False),
            "after": AttributeForm("delay", in_rise=False),
            "cond": AttributeForm("expression", in_rise=False),
            "target": _STATE,
        },
    ),
    "onEntry": ElementForm("belongs in <State>", STATEMENTS),
    "onExit": ElementForm("belongs in <State>", STATEMENTS, in_rise=False),
    "function": ElementForm(
        "belongs in <onEntry>, <onExit>, <if>, <else>, <oneOf> or <transition>",
        attributes={
            **_FUNCTIONS,
            "state": AttributeForm("state", of="startInteractionRule", in_rise=False),
            "enter": AttributeForm("choice", choices=("yes", "no"), of="startInteractionRule", in_rise=False),
            "keep": AttributeForm(of="raiseEventTopic", in_rise=False),
        },
    ),
    "if": ElementForm(
        "belongs in <onEntry>, <onExit>, <else>, <oneOf> or <transition>",
        (*STATEMENTS, "elseif", "else"),
        _CONDITION,
    ),
    "oneOf": ElementForm("belongs in <onEntry>, <onExit>, <if>, <else> or <transition>", STATEMENTS, in_rise=False),
    "else": ElementForm("belongs at the end of its <if>, or directly after it", STATEMENTS),
    "elseif": ElementForm(
        "belongs in its <if> before <else>, or directly after it", STATEMENTS, _CONDITION, in_rise=False
    ),
}


_UNKNOWN = ElementForm()


def form_of(tag: str) -> ElementForm:
    """The form of an element; an unknown one has no children and attributes."""
    return ELEMENTS.get(tag, _UNKNOWN)
