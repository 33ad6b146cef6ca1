"""The present rights: obstacles, the modes of the keyboard, control among several consoles.

Pure. A reason has a code, because the model has no keys of the console (console.md 6.3). A function that names keys
turns it into a sentence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.drawing.rule_text import ENDINGS, is_met, parse_rule_result
from rise_engine.author.drawing.study_keys import ACT, StudyKeys, transitions_of
from rise_engine.kernel.records import ControlRecord
from rise_engine.run.protocol.client import ControlVerb
from rise_engine.scenario.model import CUE_TOPICS, KeyBinding, Scenario
from rise_tui.model.notice import Notice, short_name
from rise_tui.rendering.text import format_clock

HELD_KEY_SECONDS = 0.15
"""Seconds. The same key sooner than this is a held key, not a second press."""


class KeyAction(Struct, frozen=True):
    """A task for the engine, and the protection that its key needs."""

    function: str
    behavior: str
    debounce: float = 0.5
    """Seconds in which a second press counts as the same press."""
    hold: bool = False
    """Whether it needs a second press, or Enter (console.md 2.4)."""
    by_enter: bool = False
    """Whether Enter chose it in a list. Then it needs a second Enter, and any other key drops it."""
    calling_type: str = ""


MARK_CUE = KeyAction("markCue", "")
UNDO_CUE = KeyAction("undoCue", "")
NEXT_FILLER = KeyAction("nextFiller", "")


def start_action(scenario: Scenario, function: str, behavior: str, calling_type: str = "") -> KeyAction:
    """A start with the scenario's settings. Only an act can need two presses."""
    settings = scenario.settings_of(behavior)
    return KeyAction(
        function, behavior, settings.debounce, function == ACT and settings.hold, calling_type=calling_type
    )


def enter_action(scenario: Scenario, function: str, behavior: str) -> KeyAction:
    """The same for Enter on a row, which only arms it: a row is not a decision, as a key of the study is."""
    return replace(start_action(scenario, function, behavior), hold=True, by_enter=True)


def action_of_key(scenario: Scenario, key: KeyBinding) -> KeyAction:
    """The request of a scenario's key."""
    action = start_action(scenario, key.function, key.behavior)
    return replace(action, behavior=key.task_behavior)


class ExpectedInputs(NamedTuple):
    """The inputs of a wizard that have an effect now."""

    acts: frozenset[str] = frozenset()
    rules: frozenset[str] = frozenset()
    events: frozenset[str] = frozenset()
    """Topics without their slash, including those of acts and rules."""


def find_expected_inputs(
    keys: StudyKeys, states: Mapping[str, str | None], memory: Mapping[str, Any]
) -> ExpectedInputs:
    """Find the inputs that the rules wait for. `states`: the state of each running rule. `memory`: the working memory.

    A transition whose condition does not hold now does not count: its event would be lost.
    """
    scenario = keys.scenario
    events = frozenset(
        transition.event
        for name, state in states.items()
        for transition in transitions_of(scenario, name, state)
        if transition.event is not None and is_met(transition.condition, memory)
    )
    acts = {name for name in scenario.acts if any(name + ending in events for ending in ENDINGS)}
    rules = {
        name
        for name in scenario.rules
        if name not in states and (f"{name}_end" in events or keys.events_of_rule[name] & events)
    }
    rules |= {result[0] for event in events if (result := parse_rule_result(scenario, event)) is not None}
    rules -= states.keys()
    return ExpectedInputs(frozenset(acts), frozenset(rules), events)


Intent: TypeAlias = Literal["reach", "remark", "change", "start"]
"""The kinds of requests to the engine. Each intent needs everything that the one before it needs.

reach: any request. remark: a note, a question about control. change: everything that changes the session. start:
everything that makes the robot or a rule act.
"""

KeyNames: TypeAlias = Callable[[str], str]
"""From the id of a console action to its key in a sentence: `ctrl+x`, `F9`."""


MAX_NAMED = 5
"""Maximum number of acts in the question about control."""


class BlockedReason(Struct, frozen=True):
    """A reason why something is impossible now."""

    code: Literal[
        "over", "gone", "cut", "replay", "control", "not-recording", "stopped", "safe", "locked", "paused", "silent"
    ]
    detail: str = ""
    """How the session ended, why the engine has gone, or the disk's fault."""
    holder: str = ""
    """For `control`: the holder."""
    watches: bool = False
    """For `control`: this console only observes, and cannot take it."""


def blocked_text(reason: BlockedReason | None, key_name: KeyNames) -> str:
    """The reason as a sentence, with the key to press if one helps; empty: nothing is blocked."""
    if reason is None:
        return ""
    match reason.code:
        case "over":
            return f"the session is over: {reason.detail}"
        case "gone":
            return f"the engine has gone: {reason.detail}"
        case "cut":
            return "the connection is cut; the console is reconnecting"
        case "silent":
            return "the engine gives no sign of life: nothing was started"
        case "replay":
            return "this is a replay"
        case "control":
            has = f"{reason.holder} has control"
            return f"{has} and this console only watches" if reason.watches else f"{has} ({key_name('control')})"
        case "not-recording":
            return f"NOT RECORDING, the session is paused: {reason.detail}"
        case "stopped":
            return f"STOPPED: {key_name('release')} releases the stop"
        case "safe":
            return f"SAFE: {key_name('safe')} turns keys on"
        case "locked":
            return f"LOCKED: {key_name('lock')} unlocks"
        case "paused":
            return f"paused: {key_name('control')} resumes it"


InputMode: TypeAlias = Literal["LIVE", "SAFE", "LOCKED"]
"""LIVE: keys start acts and rules. SAFE: everything can be viewed, but nothing starts. LOCKED: keys have no effect."""

STARTING_FUNCTIONS = frozenset(
    (
        *("startCommunicationRobotAct", "startInteractionRule", "raiseEventTopic", "assignValue"),
        *("say", "nextFiller", "repeatAct", "stepBack"),
    )
)
"""Functions of keys that start something. Stopping, and marks for the record, are not among them."""

CUE_EVENTS = dict(zip(("markCue", "undoCue"), CUE_TOPICS, strict=True))
"""The event of a cue. If a rule waits for it, marking a cue starts something, too."""

LOCKED_ACTIONS = ("stop", "quit", "lock")
"""Actions of the registry that work while the keyboard is LOCKED."""


def toggle_safe(mode: InputMode) -> InputMode:
    """The mode after the key for LIVE and SAFE. A locked keyboard stays locked."""
    return "SAFE" if mode == "LIVE" else "LIVE" if mode == "SAFE" else mode


def toggle_lock(mode: InputMode) -> InputMode:
    """The mode after the lock key. Unlocking never leads directly to LIVE, which takes the other key."""
    return "SAFE" if mode == "LOCKED" else "LOCKED"


def mode_notice(mode: InputMode, key_name: KeyNames) -> str:
    """The notice for a newly chosen mode."""
    match mode:
        case "LIVE":
            return "LIVE: keys start acts and rules"
        case "SAFE":
            return f"SAFE: keys start nothing; {key_name('safe')} turns them on"
        case "LOCKED":
            return f"LOCKED: every key is ignored except stop, leave and {key_name('lock')}"


class ControlLost(Struct, frozen=True):
    """This console lost control without giving it up."""

    holder: str | None
    """The new holder; None: nobody."""
    at: float | None
    """Session time; None: it happened while the connection was cut."""


def control_notice(
    record: ControlRecord, before: str | None, own_name: str
) -> tuple[Notice | None, ControlLost | None]:
    """The notice about a change of control, for the console `own_name`. `before` held control until now."""
    by, holder, is_own = short_name(record.by), short_name(record.holder), record.by == own_name
    if record.status == "asked":
        if is_own:
            return Notice(f"{short_name(before)} knows that you ask for control"), None
        # The holder's own screen shows a permanent line about it.
        return (None if before == own_name else Notice(f"{by} asks {short_name(before)} for control")), None
    if record.holder == before:  # the question was withdrawn
        return Notice("you no longer ask for control" if is_own else f"{by} no longer asks for control"), None
    if record.holder == own_name:
        if is_own:  # the first console gets it without a notice
            return (Notice("you have control: the keys work") if before is not None else None), None
        return Notice(f"{by} gave you control: your keys work", "wait"), None
    if before == own_name and not is_own:
        return None, ControlLost(record.holder, record.t)
    if record.status == "released" or record.holder is None:
        return Notice(
            "you released control: nobody has it" if is_own else f"{by} released control: nobody has it"
        ), None
    if record.status == "given":
        return Notice(f"you gave control to {holder}" if is_own else f"{by} gave control to {holder}"), None
    return Notice(f"{by} took control"), None


def control_lost_text(taken: ControlLost, key: str) -> str:
    """The line that stays until a key is pressed."""
    if taken.holder is None:
        return f"you lost control and nobody has it; {key} takes it"
    when = (
        f"took control at {format_clock(taken.at)}"
        if taken.at is not None
        else "took control while the connection was cut"
    )
    return f"{short_name(taken.holder)} {when}; you are watching; {key} takes it back"


def control_question(
    holder: str | None, asker: str | None, own_name: str, key_name: KeyNames, begins: Sequence[str] | None = None
) -> tuple[list[str], dict[ControlVerb, str]]:
    """The dialog about control: its lines, and its choices with their titles.

    `begins`: the acts that then continue or begin, in a recovered session that waits for a wizard.
    """
    is_own = holder == own_name
    release: dict[ControlVerb, str] = {"release": "Release it"}
    if not is_own and holder is None:
        lines = ["Nobody has control. Every console can still stop the robot."]
        if begins is not None:
            lines += [
                "The session was recovered. When you take control, it goes on",
                "with everything that runs or waits:",
            ]
            lines += [f"  {name}" for name in begins[:MAX_NAMED]] or ["  nothing at the moment"]
            lines += [f"  and {len(begins) - MAX_NAMED} more"] if len(begins) > MAX_NAMED else []
            lines += [f"If the robot should do none of that, stop everything first ({key_name('stop')})."]
        return lines, {"take": "Take it"}
    if not is_own and asker == own_name:
        lines = [f"{short_name(holder)} has control and knows that you ask for it."]
        return lines, {"release": "Stop asking", "take": "Take it"}
    if not is_own:
        lines = [
            f"{short_name(holder)} has control. You can still stop everything ({key_name('stop')}) and add notes.",
            "You can take it at once. They are told, and it is recorded.",
        ]
        return lines, {"ask": "Ask for it", "take": "Take it"}
    if asker is not None:
        lines = [f"{short_name(asker)} asks for control. You keep it until you give it."]
        return lines, {**release, "give": f"Give it to {short_name(asker)}"}
    return [
        "You have control.",
        "After a release nobody has it until somebody takes it. Running acts and rules go on.",
    ], release
