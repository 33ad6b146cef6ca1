"""Who of several consoles may act, in words. Pure; knows no screen."""

from __future__ import annotations

from typing import NamedTuple

from msgspec import Struct

from rise_engine.kernel.records import ControlRecord
from rise_engine.link.client import Verb
from rise_tui.model.blocked import KeyNames
from rise_tui.model.notice import Notice
from rise_tui.text import clean, clock


class Way(NamedTuple):
    """One thing that a wizard can do about control now."""

    verb: Verb
    key: str
    title: str


class Taken(Struct, frozen=True):
    """Control has gone from this console without its doing."""

    holder: str | None
    """Who has it now; null: nobody."""
    at: float | None
    """Session time; None when it happened while the connection was cut."""


def short(name: str | None) -> str:
    """`anna` for `wizard:anna`; a program keeps its whole name."""
    return clean((name or "nobody").removeprefix("wizard:").removeprefix("observer:"))


def told(record: ControlRecord, before: str | None, me: str) -> tuple[Notice | None, Taken | None]:
    """What to say about a change, to the console called `me`; `before` held control until now."""
    by, holder, mine = short(record.by), short(record.holder), record.by == me
    if record.status == "asked":
        if mine:
            return Notice(f"{short(before)} sees that you ask for control"), None
        # The holder's own screen says so in a line that stays.
        return (None if before == me else Notice(f"{by} asks {short(before)} for control")), None
    if record.holder == before:  # somebody who had asked does not ask any more
        return Notice("you ask for control no longer" if mine else f"{by} asks for control no longer"), None
    if record.holder == me:
        if mine:  # whoever attaches first gets it, and needs no sentence
            return (Notice("you have control: the keys work") if before is not None else None), None
        return Notice(f"{by} gave you control: your keys work", "wait"), None
    if before == me and not mine:
        return None, Taken(record.holder, record.t)
    if record.status == "released" or record.holder is None:
        return Notice("you released control: nobody has it" if mine else f"{by} released control: nobody has it"), None
    if record.status == "given":
        return Notice(f"you gave control to {holder}" if mine else f"{by} gave control to {holder}"), None
    return Notice(f"{by} took control"), None


def taken_words(taken: Taken, asks: str) -> str:
    """The line that stays until a key is pressed."""
    if taken.holder is None:
        return f"you lost control and nobody has it; {asks} takes it"
    when = f"took control at {clock(taken.at)}" if taken.at is not None else "took control while the connection was cut"
    return f"{short(taken.holder)} {when}; you are watching; {asks} takes it back"


def question(holder: str | None, asker: str | None, me: str, key_name: KeyNames) -> tuple[list[str], list[Way]]:
    """The dialog about control: what it says, and what can be done."""
    mine = holder == me
    release = Way("release", "r", "Release it")
    if not mine and holder is None:
        return ["Nobody has control: only stopping works, from every console."], [Way("take", "t", "Take it")]
    if not mine and asker == me:
        said = [f"{short(holder)} has control and sees that you ask for it."]
        return said, [Way("release", "r", "Ask no longer"), Way("take", "t", "Take it")]
    if not mine:
        said = [
            f"{short(holder)} has control. You watch: {key_name('stop')} stops everything, notes can be added.",
            "Taking it works at once; they are told, and it is recorded.",
        ]
        return said, [Way("ask", "a", "Ask for it"), Way("take", "t", "Take it")]
    if asker is not None:
        said = [f"{short(asker)} asks for control. You have it until you give it."]
        return said, [release, Way("give", "g", f"Give it to {short(asker)}")]
    return ["You have control.", "Released, nobody has it until somebody takes it. What runs goes on."], [release]
