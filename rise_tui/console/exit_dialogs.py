"""The questions on leaving, and what the terminal shows afterwards."""

from __future__ import annotations

import shlex

from rise_engine.kernel.records import look_at_robot_text
from rise_tui.config.paths import abbreviate_home
from rise_tui.key_labels import why_blocked
from rise_tui.model.alarms import unrecorded_end_text
from rise_tui.model.status import running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.rendering.text import format_clock
from rise_tui.screens.dialog import Dialog, DialogChoice

RECOVERY_LINES = (
    "Recover  the engine starts again, and the session goes on.",
    "         What the robot was doing counts as lost; nothing",
    "         is repeated automatically. A real robot begins",
    "         nothing until somebody takes control, unless its",
    '         profile has unattended = "go on".',
)
"""What to recover a session means."""

END_KEY = "ctrl+x"
"""Asks to end the session. No study can bind it, and it opens only a question that needs a typed word."""


def leave_dialog(store: Store) -> Dialog:
    """The choices on leaving. Only the console with control can end the session."""
    lines = [session_title(store), *running_lines(store), ""]
    lines += ["Detach  the session goes on without this console;", "        reopen it with rise-tui."]
    if why_not := why_blocked(store, "change"):
        lines += [f"Ending the session needs control: {why_not}."]
        return Dialog("Leave?", lines, DialogChoice("d", "Detach"), no="Stay", default="d")
    lines += ["End     permanently; you are asked once more."]
    return Dialog(
        "Leave?", lines, DialogChoice("d", "Detach"), DialogChoice(END_KEY, "End the session"), no="Stay", default="d"
    )


def engine_gone_dialog(store: Store, *, in_study: bool = False) -> Dialog:
    """The choices when the engine has gone during a session."""
    lines = list(RECOVERY_LINES)
    if store.attach_reply.role == "observer":
        lines = ["Watch    goes on, once somebody has recovered the session."]
    lines = [session_title(store), f"Its record ends at {format_clock(store.view.t)}.", "", *lines]
    choices = (
        DialogChoice("r", "Watch" if store.attach_reply.role == "observer" else "Recover"),
        DialogChoice("b", "Back to the study") if in_study else DialogChoice("l", "Leave"),
    )
    return Dialog("The engine has gone", lines, *choices, no="Stay")


def leave_shadow_dialog(store: Store) -> Dialog:
    """The choices on leaving a shadow. The keys that were pressed so far are saved."""
    lines = [session_title(store), f"It is at {format_clock(store.now())}. The keys that you pressed are kept.", ""]
    lines += ["Continue with: rise-tui --shadow SESSION --recover"]
    return Dialog("Leave the shadow?", lines, DialogChoice("l", "Leave"), no="Stay", default="l")


END_PATIENCE = 13.0
"""Seconds that the engine may take before the console leaves without it: 6 s for the robot, 5 s for the disk."""
RECORDERS_PATIENCE = 19.0
"""... and so many more if recorders have to complete their files before."""


def end_patience(store: Store) -> float:
    """Return the seconds that the session may take to end."""
    is_recorded = any(each.status not in ("stopped", "failed") for each in store.view.recordings.values())
    return END_PATIENCE + RECORDERS_PATIENCE * is_recorded


def exit_message(store: Store, *, end: bool, in_time: bool, patience: float, signal_name: str = "") -> str:
    """What became of the session, in one line, and how to read what happened in it.

    `patience`: seconds that it had to end. `signal_name`: the signal that ended the console, if one did.
    """
    if store.attach_reply.replay:
        return ""
    title, lead = store.scenario.title, f"{signal_name}: " if signal_name else ""
    if store.attach_reply.shadow:
        if store.shadow is None or not store.shadow.kept:
            return f"{lead}nothing was played, and nothing is kept"
        kept = abbreviate_home(store.attach_reply.folder)
        if store.ended_in_order:
            return f"{lead}all cues were shown; your keys are in {kept}/shadow. Compare: rise-engine agree {kept}"
        return f"{lead}your keys are in {kept}/shadow; to continue: rise-tui --shadow {kept} --recover"
    if store.gone_reason and not store.ended_in_order:
        again = f"rise-tui --config {abbreviate_home(store.scenario.folder)}"
        return f"{lead}the engine has gone; to recover the session: {again}"
    if end and not in_time:
        return f"{lead}{title} did not end within {patience:g} s: look at the robot; rise-tui shows what runs"
    if end or store.ended_in_order:
        kept = store.attach_reply.folder
        if store.end_unrecorded:
            return f"{lead}{unrecorded_end_text(store)}\nthe record until then is in {abbreviate_home(kept)}"
        if left := look_at_robot_text(store.view.left_open):
            lead = f"{left}\n{lead}"
        if not kept:
            return f"{lead}ended: {title}"
        where = abbreviate_home(kept)
        plain = where.removeprefix("~/")
        typed = where if shlex.quote(plain) == plain else shlex.quote(kept)  # in quotes, `~` is not the home folder
        return f"{lead}ended: the record is in {where}\nwhat happened: rise-engine report {typed}"
    return f"{lead}detached: {title} goes on; come back with: rise-tui"


def leave_study_dialog() -> Dialog:
    """The question on leaving while something is being prepared or asked on the screen of a study."""
    lines = ["No session is running or starting.", "The results of the checks so far are saved."]
    return Dialog("Leave the study?", lines, DialogChoice("l", "Leave"), no="Stay")


def study_exit_message(folder: str, busy: str, signal_name: str) -> str:
    """What the terminal shows after the screen of a study. `busy`: what was in progress."""
    lead = f"{signal_name}: " if signal_name else ""
    state = f"{busy}, and goes on without this console" if busy else "no session is running"
    return f"{lead}{state}; to come back to the study: rise-tui --config {abbreviate_home(folder)}"
