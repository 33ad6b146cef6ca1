"""Who of several consoles may act, in words. Pure; knows no screen."""

from __future__ import annotations

from typing import NamedTuple

from msgspec import Struct

from rise_engine.kernel.records import ControlRecord, stopper_words
from rise_engine.run.protocol.client import ControlVerb
from rise_tui.model.blocked import KeyNames
from rise_tui.model.notice import Notice
from rise_tui.rendering.text import clean, format_clock


class ControlChoice(NamedTuple):
    """One thing that a wizard can do about control now."""

    verb: ControlVerb
    key: str
    title: str


class ControlLost(Struct, frozen=True):
    """Control has gone from this console without its doing."""

    holder: str | None
    """Who has it now; null: nobody."""
    at: float | None
    """Session time; None when it happened while the connection was cut."""


def short_name(name: str | None) -> str:
    """`anna` for `wizard:anna`; a program keeps its whole name."""
    return clean(stopper_words(name or "nobody").removeprefix("wizard:").removeprefix("observer:"))


def control_notice(
    record: ControlRecord, before: str | None, own_name: str
) -> tuple[Notice | None, ControlLost | None]:
    """What to say about a change, to the console called `own_name`; `before` held control until now."""
    by, holder, is_own = short_name(record.by), short_name(record.holder), record.by == own_name
    if record.status == "asked":
        if is_own:
            return Notice(f"{short_name(before)} knows that you ask for control"), None
        # The holder's own screen says so in a line that stays.
        return (None if before == own_name else Notice(f"{by} asks {short_name(before)} for control")), None
    if record.holder == before:  # somebody who had asked does not ask any more
        return Notice("you no longer ask for control" if is_own else f"{by} no longer asks for control"), None
    if record.holder == own_name:
        if is_own:  # whoever attaches first gets it, and needs no sentence
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
    holder: str | None, asker: str | None, own_name: str, key_name: KeyNames
) -> tuple[list[str], list[ControlChoice]]:
    """The dialog about control: what it says, and what can be done."""
    is_own = holder == own_name
    release = ControlChoice("release", "r", "Release it")
    if not is_own and holder is None:
        return ["Nobody has control. Every console can still stop the robot."], [ControlChoice("take", "t", "Take it")]
    if not is_own and asker == own_name:
        lines = [f"{short_name(holder)} has control and knows that you ask for it."]
        return lines, [ControlChoice("release", "r", "Stop asking"), ControlChoice("take", "t", "Take it")]
    if not is_own:
        lines = [
            f"{short_name(holder)} has control. You can still stop everything ({key_name('stop')}) and add notes.",
            "You can take it at once. They are told, and it is recorded.",
        ]
        return lines, [ControlChoice("ask", "a", "Ask for it"), ControlChoice("take", "t", "Take it")]
    if asker is not None:
        lines = [f"{short_name(asker)} asks for control. You keep it until you give it."]
        return lines, [release, ControlChoice("give", "g", f"Give it to {short_name(asker)}")]
    return [
        "You have control.",
        "After a release nobody has it until somebody takes it. Running acts and rules go on.",
    ], [release]
