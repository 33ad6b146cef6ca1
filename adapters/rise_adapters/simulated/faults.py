"""Faults on request: what a rehearsal or a test asks the simulated robot to do wrong.

==========================  ========================================================================================
`Speech=reject`             the robot refuses every Speech
`Speech=fail`               every Speech fails half-way
`Speech=abort`              the robot gives up every Speech half-way by itself, as after a protective stop
`Speech=slow:3`             every Speech takes 3 times as long
`Speech=hang`               Speech never ends and never confirms a cancel; stop-all lists that part as unconfirmed
`Speech=fail@2`             only the second Speech of the session (`@N` goes with every kind)
`*=slow:2`                  every action
`vanish@12.5`               the link is lost at session time 12.5 s
`vanish@12.5-20`            ... and comes back at 20 s
==========================  ========================================================================================
"""

from __future__ import annotations

import re
from math import isfinite
from typing import Literal, TypeAlias, get_args

from msgspec import Struct

from rise_engine.nearest_name import nearest_name
from rise_engine.scenario.model import RobotProfile

FaultKind: TypeAlias = Literal["reject", "fail", "abort", "slow", "hang"]
FAULT_KINDS: tuple[FaultKind, ...] = get_args(FaultKind)

_FORM = (
    "write ACTION=reject, ACTION=fail, ACTION=abort, ACTION=slow:FACTOR or ACTION=hang (each also with @N), "
    "or vanish@SECONDS"
)
_NUMBER = r"\d+(?:\.\d+)?"
_VANISH = re.compile(rf"vanish@(?P<at>{_NUMBER})(?:-(?P<back>{_NUMBER}))?")
_ACTION = re.compile(r"(?P<action>[^=@]+)=(?P<kind>[^:@]*)(?::(?P<factor>[^@]*))?(?:@(?P<nth>.*))?")


class ActionFault(Struct, frozen=True):
    """What goes wrong with one kind of action."""

    action: str
    """The action's name, or `*`."""
    kind: FaultKind
    factor: float = 1.0
    """For `slow`: how many times longer it takes."""
    nth: int | None = None
    """Which goal of that action, counted from 1; null: each."""

    def applies_to(self, action: str, count: int) -> bool:
        """Whether it concerns the `count`-th goal of `action`."""
        return self.action in ("*", action) and self.nth in (None, count)


class LinkFault(Struct, frozen=True):
    """The link to the robot is lost from `at` until `back` (seconds of session time; null: for good)."""

    at: float
    back: float | None = None


Fault: TypeAlias = ActionFault | LinkFault


def parse_fault(text: str, profile: RobotProfile) -> Fault:
    """Read one request. Raises ValueError with a sentence that says what is wrong and what was probably meant."""
    if text.startswith("vanish"):
        return _parse_link_fault(text)
    match = _ACTION.fullmatch(text)
    if match is None:
        raise ValueError(f"the fault {text!r} cannot be read: {_FORM}")
    action, kind = match["action"].strip(), match["kind"]
    _check_action(text, action, profile)
    if kind not in FAULT_KINDS:
        near = nearest_name(kind, FAULT_KINDS)
        hint = f"did you mean {near!r}?" if near is not None else _FORM
        raise ValueError(f"the fault {text!r} has the unknown kind {kind!r}: {hint}")
    factor = 1.0
    if kind == "slow":
        factor = _read_factor(text, match["factor"])
    elif match["factor"] is not None:
        raise ValueError(f"the fault {text!r} cannot be read: only `slow` takes a factor")
    nth = None
    if match["nth"] is not None:
        if not match["nth"].isdecimal() or int(match["nth"]) < 1:
            raise ValueError(f"the fault {text!r} cannot be read: after @ goes which one it is, 1 for the first")
        nth = int(match["nth"])
    return ActionFault(action, kind, factor, nth)


def _parse_link_fault(text: str) -> LinkFault:
    match = _VANISH.fullmatch(text)
    if match is None:
        raise ValueError(
            f"the fault {text!r} cannot be read: write vanish@12.5, or vanish@12.5-20 to come back at 20 s"
        )
    at, back = float(match["at"]), None if match["back"] is None else float(match["back"])
    if back is not None and back <= at:
        raise ValueError(f"the fault {text!r} cannot be read: the robot must come back after it has vanished")
    return LinkFault(at, back)


def _read_factor(text: str, factor: str | None) -> float:
    try:
        value = float(factor or "")
    except ValueError:
        value = 0.0
    if not (isfinite(value) and value > 0):
        raise ValueError(f"the fault {text!r} cannot be read: `slow` needs a factor above 0, as in slow:3")
    return value


def _check_action(text: str, action: str, profile: RobotProfile) -> None:
    if action == "*":
        return
    spec = profile.actions.get(action)
    if spec is None:
        possible = [name for name, spec in profile.actions.items() if spec.supported and not spec.engine]
        near = nearest_name(action, possible)
        hint = f"did you mean {near!r}?" if near is not None else f"it has {', '.join(possible)}"
        raise ValueError(f"the fault {text!r} names an action that {profile.title} does not have: {hint}")
    if spec.engine:
        raise ValueError(f"the fault {text!r} cannot happen: {action} runs in the engine, not on the robot")
    if spec.substitute is not None:
        raise ValueError(
            f"the fault {text!r} cannot happen: {profile.title} does {spec.substitute} instead of {action}; "
            f"write {spec.substitute}={text.partition('=')[2]}"
        )
    if not spec.supported:
        raise ValueError(f"the fault {text!r} cannot happen: {profile.title} cannot do {action}")
