"""Converts a block of BML 1.0 to an act, exactly or not at all."""

from __future__ import annotations

import re
from pathlib import PurePath

from msgspec import Struct

from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.model import Act, Action, ActionCall, CallingType, SourceLocation
from rise_engine.scenario.speech.template import Template, parse_template
from rise_exchange.bml.block_file import BmlElement, read_block
from rise_exchange.bml.calls import CallReader
from rise_exchange.bml.core_behavior import CoreBehavior, core_behavior, milliseconds, read_seconds
from rise_exchange.bml.names import FORM, NO_ACTION, TIME, BmlNames, ConversionFindings
from rise_exchange.bml.timing import Beginning, BlockTimes, PlannedBehavior, read_constraint
from rise_exchange.bml.vocabulary import BEHAVIORS, DESCRIPTION_TYPE, END, START

_BETWEEN_IDS = re.compile(r"[,;\s:]")
_BLANKS = re.compile(r"\s+")
_ANY_VALUE = "\ue000"
"""A placeholder for any memory value: a character that no XML text contains."""


class ReadAct(Struct, frozen=True):
    """The act of a block."""

    act: Act
    calling_type: CallingType
    """From its composition: MERGE does not wait for others, APPEND does."""


def read_act(source: SourceFile, names: BmlNames, findings: ConversionFindings) -> ReadAct | None:
    """Read a block; None: a part of it cannot be kept. Reasons to refuse it and losses go to `findings`."""
    before = findings.diagnostics.errors
    root = read_block(source, findings)
    if root is None:
        return None
    read = _BlockReader(root, names, findings).read(PurePath(source.name).stem)
    return read if findings.diagnostics.errors == before else None


def read_actions(source: SourceFile, names: BmlNames) -> dict[str, Action]:
    """Return the readable actions of a block by actionID, even if the block is invalid."""
    findings = ConversionFindings()
    root = read_block(source, findings)
    if root is None:
        return {}
    return {action.id: action for action in _BlockReader(root, names, findings).read("").act.actions}


class _BlockReader:
    def __init__(self, root: BmlElement, names: BmlNames, findings: ConversionFindings) -> None:
        self.root = root
        self.names = names
        self.findings = findings
        self.behaviors: dict[str, PlannedBehavior] = {}
        """By id."""
        self.required: set[str] = set()
        """The ids of behaviours without which the whole block fails."""
        self.constraints: list[BmlElement] = []
        self.actions: dict[str, Action] = {}
        """By actionID."""
        self.waits: dict[Beginning, str] = {}
        """The actionIDs of added waits."""
        self.times = BlockTimes(self.behaviors, root.get("id") or "", findings)
        self.calls = CallReader(names, self.times, findings)

    def read(self, stem: str) -> ReadAct:
        for child in self.root:
            if child.is_bml and child.tag == "required":
                for inner in child:
                    self.plan(inner, required=True)
            else:
                self.plan(child, required=False)
        for constraint in self.constraints:
            read_constraint(constraint, self.behaviors, self.refuse_time)
        for behavior in list(self.behaviors.values()):
            self.read_behavior(behavior)
        name = (self.root.own.get("act") or self.root.get("id") or stem).strip()
        composition = (self.root.get("composition") or "MERGE").upper()
        if composition == "REPLACE":
            message = (
                "REPLACE: whether an act interrupts others is said by the key, the rule or the program that starts it"
            )
            self.findings.lose(self.root.value_location("composition"), message)
        character = self.root.get("characterId")
        if character is not None:
            message = f"`{character}`: a scenario has one robot, and its acts do not name it"
            self.findings.lose(self.root.value_location("characterId"), message)
        act = Act(name, tuple(self.actions.values()), location=self.root.location)
        return ReadAct(act, "None" if composition == "MERGE" else "Blocking")

    # --- the block --------------------------------------------------------------------------------------------------

    def plan(self, element: BmlElement, *, required: bool) -> None:
        """Note a behaviour or a constraint."""
        if element.is_bml and element.tag == "constraint":
            self.constraints.append(element)
            return
        if element.is_bml and element.tag not in BEHAVIORS:
            return  # reported as an error of form
        if not element.is_bml and not element.is_own:
            message = f"`<{element.written.tag}>` is in a namespace of its own; its meaning is unknown here"
            self.findings.diagnostics.error(NO_ACTION, element.location, message)
        id = element.get("id") or f"{element.tag}_{len(self.behaviors) + 1}"
        if id in self.behaviors:
            line = self.behaviors[id].element.location.line
            message = f"the id `{id}` is taken already, in line {line}"
            self.findings.diagnostics.error(FORM, element.value_location("id"), message)
            return
        start, end = element.get(START), element.get(END)
        self.behaviors[id] = PlannedBehavior(
            id, element, start, end, [], element.value_location(START), element.value_location(END)
        )
        if required:
            self.required.add(id)

    def read_behavior(self, behavior: PlannedBehavior) -> None:
        """Make the action of a behaviour, with the waits that it needs."""
        beginnings = self.times.beginnings(behavior.id)
        element = behavior.element
        if element.is_own:
            calls = self.calls.read_own(element)
        elif element.is_bml:
            calls = self.read_calls(behavior)
        else:
            return
        action = self.action_id(behavior)
        if _BETWEEN_IDS.search(action):
            message = f"`{action}` cannot be an actionID: that is one word or number, without a colon"
            self.findings.diagnostics.error(FORM, element.value_location("id"), message)
        elif action in self.actions:
            self.findings.diagnostics.error(FORM, element.location, f"the actionID `{action}` is taken already")
        elif calls and beginnings is not None:
            wait_for = self.wait_for(beginnings, element.location)
            proceeds = behavior.id not in self.required
            self.actions[action] = Action(action, calls, wait_for, proceeds, element.location)

    def read_calls(self, behavior: PlannedBehavior) -> tuple[ActionCall, ...]:
        """Return the calls of a BML behaviour: from our own description if it has one, otherwise from BML's core."""
        described = next(
            (
                child[0]
                for child in behavior.element
                if child.is_bml
                and child.tag == "description"
                and child.get("type") == DESCRIPTION_TYPE
                and len(child) == 1
            ),
            None,
        )
        if described is None:
            call = self.calls.read(behavior)
            return () if call is None else (call,)
        before = self.findings.diagnostics.errors
        calls = self.calls.read_own(described)
        if calls and self.findings.diagnostics.errors == before:
            self.check_description(behavior, calls[0], described.location)
        return calls

    def check_description(self, behavior: PlannedBehavior, call: ActionCall, location: SourceLocation) -> None:
        """Report a behaviour that was changed without its description."""
        core = core_behavior(call, self.names, _any_value)
        differs = _difference(behavior, core, self.times) if core is not None else "what it does"
        if differs:
            message = (
                f"{differs} of `{behavior.id}` is not what its <description> in line {location.line} says; delete the "
                "description, or change it, too"
            )
            self.findings.diagnostics.error(FORM, behavior.element.location, message)

    # --- waits ------------------------------------------------------------------------------------------------------

    def wait_for(self, beginnings: tuple[Beginning, ...], location: SourceLocation) -> tuple[str, ...]:
        """The actionIDs that an action waits for. A wait for a number of seconds is a separate action."""
        found: list[str] = []
        for beginning in beginnings:
            behind = [self.action_id(self.behaviors[id]) for id in beginning.behind]
            if not beginning.seconds:
                found += behind
                continue
            if beginning not in self.waits:
                taken = {self.action_id(each) for each in self.behaviors.values()} | {*self.actions}
                id = next(id for n in range(1, 100_000) if (id := f"wait_{n}") not in taken)
                call = ActionCall("Wait", {"duration": parse_template(milliseconds(beginning.seconds))})
                self.waits[beginning] = id
                self.actions[id] = Action(id, (call,), tuple(behind), location=location)
            found.append(self.waits[beginning])
        return tuple(dict.fromkeys(found))

    def action_id(self, behavior: PlannedBehavior) -> str:
        return behavior.element.own.get("id") or behavior.id

    def refuse_time(self, location: SourceLocation, message: str) -> None:
        self.findings.diagnostics.error(TIME, location, message)


def _any_value(template: Template) -> str:
    """Return a parameter's text with placeholders for memory values."""
    return "".join(part if isinstance(part, str) else _ANY_VALUE for part in template.parts)


def _difference(behavior: PlannedBehavior, core: CoreBehavior, times: BlockTimes) -> str:
    """The difference between a behaviour and its description; empty: none."""
    element = behavior.element
    if element.tag != core.tag:
        return "what it does"
    written = {name: value for name, value in element.attributes.items() if name not in ("id", START, END)}
    for name in {**written, **core.attributes}:
        expected = core.attributes.get(name)
        if expected is None or not _fits(written.get(name), expected):
            return f"`{name}`"
    if core.text is not None:
        text = next((child.all_text() for child in element if child.tag == "text"), "")
        if not _fits(text.strip(), core.text.strip()):
            return "`<text>`"
    length = None if behavior.end is None else times.duration(behavior)
    if core.seconds is not None and length != read_seconds(core.seconds):
        return "`end`"
    return ""


def _fits(written: str | None, expected: str) -> bool:
    """Whether a text is the expected one, with any memory values."""
    if written is None or _ANY_VALUE not in expected:
        return written == expected
    pieces = (r"\s*".join(map(re.escape, _BLANKS.split(piece))) for piece in expected.split(_ANY_VALUE))
    pattern = ".*".join(pieces)  # an empty value leaves adjacent blanks
    return re.fullmatch(pattern, written, re.DOTALL) is not None
