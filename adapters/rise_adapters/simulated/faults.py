"""Faults on request: mistakes that a rehearsal or a test asks the simulated robot to make.

==========================  ========================================================================================
`Speech=reject`             the robot rejects every Speech
`Speech=fail`               every Speech fails half-way
`Speech=abort`              the robot itself gives up every Speech half-way, as after a protective stop
`Speech=slow:3`             every Speech takes 3 times as long
`Speech=hang`               Speech never ends and never confirms a cancel; its part is unconfirmed, then held
`Speech=slow-accept:2`      the robot accepts a Speech only after 2 s, and begins then
`Speech=slow-reject:2`      ... or rejects it after 2 s
`Speech=lost-accept`        it accepts a Speech and carries it out, but that answer is lost
`Speech=late-begin:2`       it accepts a Speech immediately, and begins 2 s later
`Speech=refuse-cancel`      it refuses to stop, and reports this; its part is held until the Speech has ended
`Speech=ignore-cancel`      ... and reports nothing
`Speech=slow-cancel:2`      it confirms that it stops, and has stopped 2 s later
`Speech=die-on-goal`        its program dies when a Speech arrives (`die-on-goal:5`: for 5 s)
`Speech=die-on-cancel`      ... when a Speech should stop (`die-on-cancel:5`: for 5 s)
`Speech=fail@2`             only the second Speech of the session (`@N` is possible with every kind)
`*=slow:2`                  every action
`vanish@12.5`               the link is lost at session time 12.5 s
`vanish@12.5-20`            ... and returns at 20 s
`inactive@12.5-20`          the robot is there, but accepts nothing from 12.5 s to 20 s, like an inactive lifecycle node
==========================  ========================================================================================
"""

from __future__ import annotations

import re
from math import isfinite
from typing import Literal, TypeAlias, get_args

from msgspec import Struct

from rise_engine.base.nearest_name import nearest_name
from rise_engine.scenario.model import RobotProfile

FaultKind: TypeAlias = Literal[
    "reject",
    "fail",
    "abort",
    "slow",
    "hang",
    "slow-accept",
    "slow-reject",
    "lost-accept",
    "late-begin",
    "refuse-cancel",
    "ignore-cancel",
    "slow-cancel",
    "die-on-goal",
    "die-on-cancel",
]
FAULT_KINDS: tuple[FaultKind, ...] = get_args(FaultKind)
CANCEL_FAULTS: tuple[FaultKind, ...] = ("refuse-cancel", "ignore-cancel", "slow-cancel", "die-on-cancel")
"""Faults that appear only when the action should stop."""
LinkFaultKind: TypeAlias = Literal["vanish", "inactive"]

_AMOUNTS: dict[FaultKind, tuple[str, bool]] = {
    "slow": ("a factor above 0, as in slow:3", True),
    **{
        kind: (f"seconds, as in {kind}:2", True) for kind in ("slow-accept", "slow-reject", "late-begin", "slow-cancel")
    },
    **{kind: (f"seconds, as in {kind}:5", False) for kind in ("die-on-goal", "die-on-cancel")},
}
"""The value after the colon of some kinds, and whether it is required."""
_FORM = (
    "write ACTION=KIND (each also with @N), where KIND is one of "
    f"{', '.join(f'{kind}:N' if _AMOUNTS.get(kind, ('', False))[1] else kind for kind in FAULT_KINDS)}; "
    "or vanish@SECONDS, or inactive@SECONDS"
)
_NUMBER = r"\d+(?:\.\d+)?"
_LINK = re.compile(rf"(?P<kind>vanish|inactive)@(?P<at>{_NUMBER})(?:-(?P<back>{_NUMBER}))?")
_ACTION = re.compile(r"(?P<action>[^=@]+)=(?P<kind>[^:@]*)(?::(?P<amount>[^@]*))?(?:@(?P<nth>.*))?")


class ActionFault(Struct, frozen=True):
    """A fault of one kind of action."""

    action: str
    """The action's name, or `*`."""
    kind: FaultKind
    amount: float | None = None
    """For `slow`: the factor. For other kinds with an amount: seconds."""
    nth: int | None = None
    """Which goal of that action, counted from 1; None: each."""

    def applies_to(self, action: str, count: int) -> bool:
        """Whether it applies to the `count`-th goal of `action`."""
        return self.action in ("*", action) and self.nth in (None, count)


class LinkFault(Struct, frozen=True):
    """The link to the robot is lost from `at` until `back` (seconds of session time; None: permanently)."""

    at: float
    back: float | None = None
    kind: LinkFaultKind = "vanish"
    """inactive: the link works, but the robot accepts nothing."""


Fault: TypeAlias = ActionFault | LinkFault


def parse_fault(text: str, profile: RobotProfile) -> Fault:
    """Read one fault. Raises ValueError with a sentence about the error and the probable intention."""
    if text.startswith(("vanish", "inactive")):
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
    amount = _read_amount(text, kind, match["amount"])
    nth = None
    if match["nth"] is not None:
        if not match["nth"].isdecimal() or int(match["nth"]) < 1:
            raise ValueError(f"the fault {text!r} cannot be read: write its number after @, 1 for the first")
        nth = int(match["nth"])
    return ActionFault(action, kind, amount, nth)


def _parse_link_fault(text: str) -> LinkFault:
    match = _LINK.fullmatch(text)
    if match is None:
        raise ValueError(
            f"the fault {text!r} cannot be read: write vanish@12.5, or vanish@12.5-20 to come back at 20 s "
            "(or inactive@12.5-20)"
        )
    at, back = float(match["at"]), None if match["back"] is None else float(match["back"])
    if back is not None and back <= at:
        raise ValueError(f"the fault {text!r} cannot be read: the robot must come back after it has vanished")
    return LinkFault(at, back, "inactive" if match["kind"] == "inactive" else "vanish")


def _read_amount(text: str, kind: FaultKind, written: str | None) -> float | None:
    if kind not in _AMOUNTS:
        if written is not None:
            takers = ", ".join(f"`{each}`" for each in _AMOUNTS)
            raise ValueError(f"the fault {text!r} cannot be read: only {takers} take a number")
        return None
    what, needed = _AMOUNTS[kind]
    if written is None and not needed:
        return None
    try:
        value = float(written or "")
    except ValueError:
        value = 0.0
    if not (isfinite(value) and value > 0):
        raise ValueError(f"the fault {text!r} cannot be read: `{kind}` needs {what}")
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
