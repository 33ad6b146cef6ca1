"""What is asked when somebody leaves, and what the terminal shows afterwards."""

from __future__ import annotations

from rise_tui.model.store import Store
from rise_tui.screens.dialog import Answer, Dialog
from rise_tui.start.choose import tilde

GONE_ON = (
    "the engine starts again, and the session goes on.",
    "What the robot was doing counts as lost:",
    "nothing is repeated to the participant by itself.",
)


def question(store: Store, *, outlives: bool) -> Dialog:
    """What can be done when leaving: a session can be ended only by who has control.

    `outlives`: whether the session goes on without this process.
    """
    if not outlives:
        said = ["The robot is stopped and the session ends. It cannot be continued."]
        return Dialog("End the session?", said, Answer("e", "End"), no="Stay")
    detach = ["Detach  the session goes on without this console;", "        rise-tui brings it back."]
    if why_not := store.cannot_act():
        said = [*detach, f"Ending the session needs control: {why_not}."]
        return Dialog("Leave?", said, Answer("d", "Detach"), no="Stay", first="d")
    said = [*detach, "End     the robot is stopped; it cannot be continued."]
    return Dialog("Leave?", said, Answer("d", "Detach"), Answer("e", "End the session"), no="Stay", first="d")


def question_of_gone(store: Store) -> Dialog:
    """What can be done when the engine has gone in the midst of a session."""
    said = [f"Recover  {line}" if line is GONE_ON[0] else f"         {line}" for line in GONE_ON]
    if store.hello.role == "observer":
        said = ["Watch    goes on, once somebody has recovered the session."]
    ways = Answer("r", "Watch" if store.hello.role == "observer" else "Recover"), Answer("l", "Leave")
    return Dialog("The engine has gone", said, *ways, no="Stay")


def last_words(store: Store, *, end: bool, in_time: bool, patience: float, by: str = "") -> str:
    """What became of the session, in one line. `patience`: seconds it had to end. `by`: the signal, if one did it."""
    if store.hello.replay:
        return ""
    title, lead = store.scenario.title, f"{by}: " if by else ""
    if store.gone and not store.over:
        again = f"rise-tui --config {tilde(store.scenario.folder)}"
        return f"{lead}the engine has gone; to recover the session: {again}"
    if end and not in_time:
        return f"{lead}{title} did not end within {patience:g} s: look at the robot; rise-tui shows what runs"
    if end or store.over:
        kept = store.hello.folder
        return f"{lead}ended: the record is in {tilde(kept)}" if kept else f"{lead}ended: {title}"
    return f"{lead}detached: {title} goes on; come back with: rise-tui"
