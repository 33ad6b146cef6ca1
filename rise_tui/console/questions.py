"""The console's questions, also on leaving, and their withdrawal when their subject has changed."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

from rise_engine.kernel.behaviors import release_behavior
from rise_engine.kernel.records import open_goals_warning, stopper_words
from rise_engine.scenario.model import rule_start_behavior
from rise_tui.actions import BY_ID
from rise_tui.config.preferences import abbreviate_home, typed_command
from rise_tui.key_labels import key_name, keys_of, why_blocked
from rise_tui.model.alarms import unrecorded_end_text
from rise_tui.model.control import KeyAction, control_question
from rise_tui.model.notice import act_label
from rise_tui.model.resumption import InterruptedRule, entry_lines, find_back_step, interrupted_rules, question_lines
from rise_tui.model.status import running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.rendering.text import format_clock
from rise_tui.requests import ConsoleHost
from rise_tui.screens.dialog import Dialog, DialogChoice, ReleaseDialog, StepBackDialog

RECOVERY_LINES = (
    "Recover  the engine starts again, and the session goes on.",
    "         What the robot was doing counts as lost; nothing",
    "         is repeated automatically. A real robot begins",
    "         nothing until somebody takes control, unless its",
    '         profile has unattended = "go on".',
)
"""The meaning of recovering a session."""

END_KEY = "ctrl+x"
"""Asks to end the session. No study can bind it, and it opens only a question that requires a typed word."""


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
"""Seconds for the engine before the console leaves without it: 6 s for the robot, 5 s for the disk."""
RECORDERS_PATIENCE = 19.0
"""Additional seconds if recorders must complete their files first."""


def end_patience(store: Store) -> float:
    """Return the seconds that the session may take to end."""
    is_recorded = any(each.status not in ("stopped", "failed") for each in store.view.recordings.values())
    return END_PATIENCE + RECORDERS_PATIENCE * is_recorded


def exit_message(store: Store, *, end: bool, in_time: bool, patience: float, signal_name: str = "") -> str:
    """Describe the end of the session in one line, and how to read its record.

    `patience`: seconds that it had to end. `signal_name`: the signal that ended the console, if any.
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
        return f"{lead}your keys are in {kept}/shadow; to continue: {typed_command()} --shadow {kept} --recover"
    if store.gone_reason and not store.ended_in_order:
        again = f"{typed_command()} --config {abbreviate_home(store.scenario.folder)}"
        return f"{lead}the engine has gone; to recover the session: {again}"
    if end and not in_time:
        return f"{lead}{title} did not end within {patience:g} s: look at the robot; {typed_command()} shows what runs"
    if end or store.ended_in_order:
        kept = store.attach_reply.folder
        if store.end_unrecorded:
            return f"{lead}{unrecorded_end_text(store)}\nthe record until then is in {abbreviate_home(kept)}"
        if warning := open_goals_warning(store.view.left_open):
            lead = f"{warning}\n{lead}"
        if not kept:
            return f"{lead}ended: {title}"
        where = abbreviate_home(kept)
        plain = where.removeprefix("~/")
        typed = where if shlex.quote(plain) == plain else shlex.quote(kept)  # in quotes, `~` is not the home folder
        return f"{lead}ended: the record is in {where}\nwhat happened: {typed_command('rise-engine')} report {typed}"
    return f"{lead}detached: {title} goes on; come back with: {typed_command()}"


def leave_study_dialog() -> Dialog:
    """The question on leaving during preparations or questions on the screen of a study."""
    lines = ["No session is running or starting.", "The results of the checks so far are saved."]
    return Dialog("Leave the study?", lines, DialogChoice("l", "Leave"), no="Stay")


def study_exit_message(folder: str, busy: str, signal_name: str) -> str:
    """The terminal's text after the screen of a study. `busy`: the work in progress."""
    lead = f"{signal_name}: " if signal_name else ""
    state = f"{busy}, and goes on without this console" if busy else "no session is running"
    return f"{lead}{state}; to come back to the study: {typed_command()} --config {abbreviate_home(folder)}"


DIALOG_WIDTH = 58
"""Characters in a line of a question."""


class Confirmations:
    """The questions of one console."""

    def __init__(self, console: ConsoleHost) -> None:
        self._console = console
        self._control_shown: object = None
        """The holder of control, its asker and the acts it would begin, as of the question about control."""
        self._release_shown: tuple[int, object] = 0, None
        """The contents of the question about the release: the stop and the parts."""

    def ask_to_release(self) -> None:
        """Ask whether to release the stop or, if nothing is stopped, the held parts."""
        console = self._console
        stop = console.store.view.stop
        self._release_shown = self._release_facts()
        if not stop.latched and console.store.open_goals:
            self._ask_to_release_parts()
            return
        lines = [f"Stopped by {stopper_words(stop.source) or 'the console'}."]
        lines.append(f"Confirmed: {', '.join(stop.confirmed) or 'no part'}.")
        if stop.unconfirmed:
            lines.append(f"NOT confirmed: {', '.join(stop.unconfirmed)}. Look at the robot first.")
        if stop.unstoppable:
            lines.append(f"Cannot be stopped: {', '.join(stop.unstoppable)}. Look at the robot first.")
        if stop.status == "requested":
            lines.append("The robot has not answered yet. Look at it first.")
        lines.append("After this, keys start acts and rules again.")
        keys = keys_of(BY_ID["release"])
        lines += [f"Press {key_name('release')} again to release it."] * bool(keys)
        if rules := interrupted_rules(console.store):
            self._ask_about_rules(lines, rules, keys)
            return
        dialog = Dialog("Release the stop?", lines, DialogChoice("r", "Release"), no="Stay stopped", repeat_keys=keys)
        dialog.add_class("-release")
        console.app.push_screen(dialog, lambda yes: self._release({}) if yes else None)

    def _release(self, rules: Mapping[str, str]) -> None:
        self._console.send("releaseStop", release_behavior(rules, self._release_shown[0]))

    def _ask_to_release_parts(self) -> None:
        console = self._console
        goals = console.store.open_goals
        lines = [f"{goal.part} may still be doing {goal.type}: {goal.reason}." for goal in goals]
        lines.append("Look at the robot first. After this, it accepts new actions even while the old one still runs.")
        dialog = Dialog("Release the part?", lines, DialogChoice("r", "Release"), no="Keep it held")
        dialog.add_class("-release")

        def release(yes: str | None) -> None:
            for part in dict.fromkeys(goal.part for goal in goals) if yes else ():
                console.send("releaseOpenGoals", part)

        console.app.push_screen(dialog, release)

    def _ask_about_rules(self, lines: list[str], rules: list[InterruptedRule], keys: Sequence[str]) -> None:
        """Ask the same, and choose the resumption of the rules that the stop ended."""
        console = self._console
        dialog = ReleaseDialog(lines, rules, keys)
        dialog.add_class("-release")
        console.app.push_screen(dialog, lambda yes: self._release(dialog.chosen) if yes else None)

    def ask_to_start(self, name: str, state: str) -> None:
        """Ask whether to start a rule in a state, with or without the functions of its `onEntry`."""
        console = self._console
        store = console.store
        entered = store.scenario.rules[name].states[state]
        lines = [f"Rule {name} would start in the state {state}. Its onEntry:"]
        lines += [f"  {line}" for line in entry_lines(store.scenario, entered, store.memory, DIALOG_WIDTH - 2)]
        running = store.rule(name).running
        lines += [f"It is running in {store.rule(name).state} and is stopped first."] * running
        lines.append("Waiting there skips onEntry.")
        start, wait = DialogChoice("s", "Start here"), DialogChoice("w", "Wait here")

        def begin(key: str | None) -> None:
            if not key:
                return
            if store.rule(name).running:
                console.send("stopInteractionRule", name)
            console.start(KeyAction("startInteractionRule", rule_start_behavior(name, state, key == "s")))

        console.app.push_screen(Dialog("Start here?", lines, start, wait), begin)

    def ask_to_step_back(self, name: str) -> None:
        """Ask whether a rule should go back one step, and show the consequences."""
        console = self._console
        step = find_back_step(console.store, name)
        if step is None:
            console.show_notice("the rule shown here has no earlier state to go back to")
            return
        dialog = StepBackDialog(question_lines(console.store, step, DIALOG_WIDTH), step)

        def go_back(answer: str | None) -> None:
            if answer:
                console.start(KeyAction("stepBack", dialog.behavior(answer)))

        console.app.push_screen(dialog, go_back)

    def ask_about_control(self) -> None:
        """Ask what to do with control, depending on its holder and asker."""
        console = self._console
        store = console.store
        holder, asker, begins = self._control_shown = self._control_facts()
        lines, choices = control_question(holder, asker, store.own_name, key_name, begins)
        verbs = {verb[0]: verb for verb in choices}  # the keys are their first letters
        dialog = Dialog("Control", lines, *(DialogChoice(verb[0], choices[verb]) for verb in choices), no="Leave it")
        dialog.add_class("-control")
        console.app.push_screen(dialog, lambda key: console.request_control(verbs[key]) if key else None)

    def close_release_question(self) -> None:
        """Close the question about the release, because everything is being stopped again."""
        self._withdraw("-release", "stopped again: the question about releasing the stop was closed")

    def close_outdated_release_question(self) -> None:
        """Close the question about the release if the robot's answer, a goal, a stop or a release outdated it."""
        if self._release_facts() != self._release_shown:
            self._withdraw("-release", "the stop or a held part has just changed: the question about it was closed")

    def _release_facts(self) -> tuple[int, object]:
        """The contents of the question about the release: the number of the stop, and the robot's answer."""
        store = self._console.store
        stop = store.view.stop
        answer = stop.status, stop.confirmed, stop.unconfirmed, stop.unstoppable
        return stop.count, answer if stop.latched else store.open_goals

    def close_outdated_control_question(self) -> None:
        """Close the question about control if the holder, the asker or the acts that it would begin changed."""
        if self._control_facts() != self._control_shown:
            self._withdraw("-control", "control, or what it begins, has just changed: the question was closed")

    def _control_facts(self) -> tuple[str | None, str | None, list[str] | None]:
        """The holder of control, its asker, and the acts that go on when it is taken; None: none."""
        store = self._console.store
        tasks = (*store.running_tasks, *store.waiting_tasks)
        begins = [act_label(task.function, task.behavior) for task in tasks] if store.view.waits_for_wizard else None
        return store.view.control, store.view.asked, begins

    def _withdraw(self, kind: str, lines: str) -> None:
        for screen in self._console.app.screen_stack:
            if isinstance(screen, Dialog) and screen.has_class(kind) and screen.withdraw():
                self._console.ignore_keys()
                self._console.show_notice(lines)
