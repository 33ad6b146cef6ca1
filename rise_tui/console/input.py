"""The path of a key: through all protection against accidents (console.md 2.1 to 2.4) to a task for the engine.

Pure: times, focus and timers come in, and valid keys go out through `InputActions`. It uses no screen. Times are those
of the monotonic clock.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Protocol

from rise_engine.author.drawing.study_keys import EVENT
from rise_engine.base.suspend import suspended_seconds
from rise_engine.kernel.behaviors import describe_behavior, is_object
from rise_engine.scenario.model import normal_topic
from rise_tui.actions import BY_ID
from rise_tui.key_labels import key_name, keys_of, why_blocked, why_task_blocked
from rise_tui.model.control import (
    HELD_KEY_SECONDS,
    LOCKED_ACTIONS,
    STARTING_FUNCTIONS,
    InputMode,
    KeyAction,
    action_of_key,
    mode_notice,
    start_action,
    toggle_lock,
    toggle_safe,
)
from rise_tui.model.failures import is_question, newest_markable, unanswered_failures
from rise_tui.model.notice import Level, task_label
from rise_tui.model.store import Store

TOGETHER_SECONDS = 0.012
"""Two different keys closer than this cannot be two intended key presses."""
PASTE_QUIET_SECONDS = 0.3
"""Seconds without input after a paste before keys count again."""
STALL_SECONDS = 3.0
"""If the console did no work for this many seconds, waiting keys no longer count."""
ARMED_SECONDS = 4.0
"""Seconds that a start stays armed after its first press: long enough to read what it would say."""
CHANGE_SECONDS = 0.7
"""Seconds after something has opened or closed by which a wizard can have seen it."""

LINE_OPENERS = ("say", "note", "mistake")
"""Actions that open a line in which letters are not the scenario's keys."""
PASTED_KEYS = "several keys at once (a paste, or a stalled link): nothing was started"
EARLY_ENTER = "too soon: something has just opened or closed; press enter again"
PASTED_ENTER = "the keys came too fast to be typed: nothing was said; press enter again"


class EnterGuard:
    """Refuses an Enter soon after something has opened or closed (console.md 2.7). It was meant for what was before.

    Any other key in between shows that the wizard has seen the change. An Enter that is held down stays refused.
    """

    def __init__(self) -> None:
        self._changed_at = self._refused_at = float("-inf")

    def note_change(self, at: float) -> None:
        """Note that a screen or a line has opened or closed."""
        self._changed_at = at

    def admits(self, key: str, at: float) -> bool:
        """Whether a key may pass. Called for each key, before it has any effect."""
        if key != "enter":
            self._changed_at = self._refused_at = float("-inf")
        elif at - self._changed_at < CHANGE_SECONDS or at - self._refused_at < HELD_KEY_SECONDS:
            self._refused_at = at
            return False
        return True


class RunningTimer(Protocol):
    """A scheduled call."""

    def stop(self) -> None:
        """Cancel the call."""


class InputActions(Protocol):
    """The effects of keys. No method waits for the engine."""

    def submit(self, action: KeyAction, pressed: float | None) -> None:
        """Send a task to the engine. `pressed`: session time of its key; None: by mouse."""

    def submit_speech(self, action: KeyAction, typed: str, pressed: float | None) -> None:
        """The same for free speech, with the text `typed` in its field."""

    def show_notice(self, text: str, level: Level = "info") -> None:
        """Show the wizard a notice of this level."""

    def show_armed(self, action: KeyAction | None) -> None:
        """Show that the first of two presses was seen, and what the second would do; None: no longer."""

    def show_mode(self) -> None:
        """Show whether keys start things."""

    def ask_what_was_wrong(self, task: int) -> None:
        """Open the line that corrects a mark."""

    def leave_transient(self) -> None:
        """Handle Esc when no act is armed."""


class InputController:
    """All keys of one console: which of them count, and their requests to the engine.

    - Keys that arrive together are a paste, or come from a stalled link: none of them counts. The terminal's reader
      recognises them, because they came in one read. The pieces of a paste in several reads are faster than fingers.
    - Keys that were pressed while the console stood still do not count either.
    - A press within the debounce time of the last one of the same kind counts once; a held key counts once.
    - A `hold` act needs a second press, or Enter. Enter on a row needs a second Enter. A held key that repeats is not a
      second press.
    """

    def __init__(
        self,
        store: Store,
        actions: InputActions,
        set_timer: Callable[[float, Callable[[], None]], RunningTimer],
        clock: Callable[[], float] = monotonic,
    ) -> None:
        self._store, self._actions, self._set_timer, self._clock = store, actions, set_timer, clock
        self._key_at: float | None = None
        """When the key was pressed that caused the present work; None: by mouse."""
        self._last_key = ""
        self._last_at = float("-inf")
        self._paste_until = float("-inf")
        self._alive_at = float("inf")
        """When the console was last known to work."""
        self._suspended = 0.0
        """`suspended_seconds` at that time."""
        self._pressed: dict[tuple[str, str], float] = {}
        """The last press by function and behavior, whether it counted or not."""
        self._pending: tuple[KeyAction, float, RunningTimer] | None = None
        """The second press of an act that needs two. It counts unless it is a held key."""
        self._armed: KeyAction | None = None
        """The start whose first press was seen."""
        self._disarm_timer: RunningTimer | None = None
        self._typed = ""
        """The speech that is being sent, as in its field."""

    @property
    def is_pasting(self) -> bool:
        """Whether the last key was part of a paste."""
        return self._last_at < self._paste_until

    # --- input from the terminal ------------------------------------------------------------------------------------

    def observe_key(self, key: str, at: float, *, typing: bool = False, together: bool = False) -> None:
        """Note every key, before anything acts on it.

        `typing`: it goes into a text field. `together`: it came in one piece with others.
        """
        self._key_at = at
        self._check_standstill()
        if key != "enter":
            self._drop_choice()
        near = at - self._last_at < TOGETHER_SECONDS and key != self._last_key
        if together or (near and not typing) or at < self._paste_until:  # in a field, a typist's keys may be close
            if at >= self._paste_until and not typing:
                self._actions.show_notice(PASTED_KEYS)
            self._paste_until = at + PASTE_QUIET_SECONDS
            self.disarm()
        self._last_key, self._last_at = key, at

    def note_alive(self) -> None:
        """Note that the console works. Called every second."""
        self._check_standstill()
        self._alive_at, self._suspended = self._clock(), suspended_seconds()

    def _check_standstill(self) -> None:
        """Ignore keys for a moment after a standstill of the console."""
        now, suspended = self._clock(), suspended_seconds()
        stopped = now - self._alive_at + suspended - self._suspended
        if stopped > STALL_SECONDS:
            self._alive_at, self._suspended, self._paste_until = now, suspended, now + PASTE_QUIET_SECONDS
            self.disarm()
            self._actions.show_notice(f"the console stood still for {stopped:.0f} s: keys of that time start nothing")

    def ignore_keys(self) -> None:
        """Let no key start anything for a moment: a question has closed by itself, and its letters are keys of acts."""
        self._paste_until = max(self._paste_until, self._clock() + CHANGE_SECONDS)

    def observe_mouse(self) -> None:
        """Note a press of the mouse: the present work has no key."""
        self._key_at = None
        self._drop_choice()

    def admits_key(self, key: str, *, printable: bool, typing: bool, leaving: bool) -> bool:
        """Whether a key may reach the widget with the focus. All keys pass here, with or without a dialog.

        Text pasted outside a field does not act as commands or answers. While LOCKED, only the keys for stopping,
        leaving and unlocking pass, and answers to the question about leaving (`leaving`: it is open).
        """
        if self.is_pasting and not typing and (printable or key == "enter"):
            return False
        if any(key in keys_of(BY_ID[id]) for id in LOCKED_ACTIONS):
            return True
        return self.admits_other(leaving=leaving, says_why=True)

    def admits_other(self, *, leaving: bool, says_why: bool) -> bool:
        """Whether other input from the mouse or the clipboard may pass."""
        if self._store.input_mode != "LOCKED" or leaving:
            return True
        if says_why:
            self._actions.show_notice(f"LOCKED: {key_name('lock')} unlocks")
        return False

    @property
    def is_armed(self) -> bool:
        """Whether Enter would start something now."""
        return self._armed is not None

    def handle_key(self, key: str, at: float) -> bool:
        """Handle a key that no field has taken: one of the scenario, Enter for an armed start, or Esc. False: none of
        these.
        """
        if key == "enter" and self._armed is not None:
            if self._armed.by_enter:  # a held Enter repeats
                self.press(self._armed, at)
            else:
                self.confirm_armed()
        elif key == "escape":
            if not self.disarm():
                self._actions.leave_transient()
        elif (binding := self._store.scenario.keys.get(key)) is not None:
            self.start(action_of_key(self._store.scenario, binding), at)
        else:
            return False
        return True

    # --- requests ---------------------------------------------------------------------------------------------------

    def start(self, action: KeyAction, at: float | None = None) -> None:
        """Request something, with all protection against accidents. `at`: when its key was pressed."""
        if reason := why_task_blocked(self._store, action.function):
            self._refuse(action, reason)
        else:
            self.press(action, self._now_or_key if at is None else at)

    def speak(self, typed: str, text: str, *, at_once: bool) -> None:
        """Request free speech: `typed` is the text in its field, `text` has the memory's values filled in."""
        if reason := why_blocked(self._store, "start"):
            self._actions.show_notice(f"not said: {reason}", "wait")
            return
        self._typed = typed
        action = KeyAction("say", text, calling_type="Interrupt" if at_once else "Blocking")
        if not self.press(action, self._now_or_key):
            self._actions.show_notice(PASTED_ENTER, "wait")

    def repeat_failed_act(self) -> None:
        """Start the shown failed act again, as it was requested, with the usual protection of a start."""
        if (failed := next(iter(unanswered_failures(self._store)), None)) is not None:
            self._typed = ""
            if is_question(self._store, failed):
                self.start(KeyAction("repeatAct", str(failed.id)))
                return
            self.start(start_action(self._store.scenario, failed.function, failed.behavior, failed.calling_type))

    def go_on_without_failed_act(self) -> None:
        """Dismiss the shown failure."""
        if (failed := next(iter(unanswered_failures(self._store)), None)) is not None and not self.is_pasting:
            self.send("goOn", str(failed.id))

    def stop_rule_of_failed_act(self) -> None:
        """Stop the rule that waits for the end of the shown failed act."""
        if (failed := next(iter(unanswered_failures(self._store)), None)) is not None and not self.is_pasting:
            self.send("stopRuleOfAct", str(failed.id))

    def mark_mistake(self) -> None:
        """Mark the wizard's last action as wrong immediately, and ask for the correct word."""
        if self.is_pasting:
            return
        shadows = self._store.attach_reply.shadow
        task = newest_markable(self._store.view.tasks, None if shadows else self._store.person)
        if task is None:
            who = "the first wizard has" if shadows else "you have"
            self._actions.show_notice(f"{who} done nothing yet: there is nothing to mark")
            return
        self.send("markMistake", f"{task.id} wrong")
        self._actions.ask_what_was_wrong(task.id)

    def send(self, function: str, behavior: str = "") -> None:
        """Send a task to the engine immediately, whatever was pressed before: a stop, a mark, a memory change."""
        self._actions.submit(KeyAction(function, behavior), self._session_time(self._key_at))

    def switch_safe(self) -> None:
        """Switch between LIVE and SAFE."""
        self._switch(toggle_safe(self._store.input_mode))

    def switch_lock(self) -> None:
        """Switch to LOCKED, or from LOCKED to SAFE."""
        self._switch(toggle_lock(self._store.input_mode))

    def _switch(self, mode: InputMode) -> None:
        self.disarm()
        self._store.input_mode = mode
        self._actions.show_notice(mode_notice(mode, key_name))
        self._actions.show_mode()

    # --- valid presses ----------------------------------------------------------------------------------------------

    def press(self, action: KeyAction, at: float) -> bool:
        """Request what a key or Enter means. `at`: when it was pressed. False: it is part of a paste."""
        same = (action.function, action.behavior)
        last = self._pressed.get(same, float("-inf"))
        self._pressed[same] = at
        if at < self._paste_until:
            return False
        if self._armed is not None and same_start(self._armed, action):
            # A held key repeats: wait long enough to see whether another press of it follows.
            self._drop_pending()
            if at - last >= HELD_KEY_SECONDS:
                self._pending = action, at, self._set_timer(HELD_KEY_SECONDS, self._accept_pending)
        elif at - last < action.debounce:
            if self._pending is None and at - last >= HELD_KEY_SECONDS:
                what = action.behavior or task_label(action.function, "")
                self._actions.show_notice(f"{what}: pressed twice within {action.debounce:g} s, counted once")
        else:
            self._accept_at_once(action, at)
        return True

    def confirm_armed(self) -> None:
        """Start the armed act on Enter."""
        if self._armed is not None and not self.is_pasting:
            self._accept_at_once(self._armed, self._last_at)

    def disarm(self) -> bool:
        """Forget the presses of an act that needs two. True: there was one."""
        self._drop_pending()
        was, self._armed = self._armed, None
        if self._disarm_timer is not None:
            self._disarm_timer.stop()
            self._disarm_timer = None
        if was is not None:
            self._actions.show_armed(None)
        return was is not None

    def _drop_choice(self) -> None:
        """Disarm what Enter has chosen: another key or the mouse shows that the wizard goes on."""
        if self._armed is not None and self._armed.by_enter:
            self._pressed.pop((self._armed.function, self._armed.behavior), None)  # a key for it counts at once
            self.disarm()

    def _accept_at_once(self, action: KeyAction, at: float) -> None:
        if self._pending is not None and self._pending[0] != action:
            self._pending[2].stop()
            self._accept_pending()  # another key, too late for a paste: the earlier one counts
        self._drop_pending()
        self._accept_press(action, at)

    def _accept_pending(self) -> None:
        if self._pending is not None:
            action, at, _ = self._pending
            self._pending = None
            self._accept_press(action, at)

    def _drop_pending(self) -> None:
        if self._pending is not None:
            self._pending[2].stop()
            self._pending = None

    def _accept_press(self, action: KeyAction, at: float) -> None:
        """Accept a press: arm an act that needs two, or carry it out."""
        armed = self._armed is not None and same_start(self._armed, action)
        self.disarm()
        if action.hold and not armed:
            self._armed = action
            self._actions.show_armed(action)
            self._disarm_timer = self._set_timer(ARMED_SECONDS, self._disarm_later)
        else:
            self._carry_out(action, at)

    def _disarm_later(self) -> None:
        if self._pending is None:  # otherwise the second press is being examined
            self.disarm()

    def _carry_out(self, action: KeyAction, at: float) -> None:
        """Check again, because the action may no longer be possible, and carry it out."""
        if reason := why_task_blocked(self._store, action.function):
            self._refuse(action, reason)
        elif (kept := self._kept_task(action)) is not None:
            self.send("cancelTask", str(kept))
        elif action.function == "say" and self._typed:
            self._actions.submit_speech(action, self._typed, self._session_time(at))
        else:
            self._actions.submit(action, self._session_time(at))

    def _kept_task(self, action: KeyAction) -> int | None:
        """The task whose event is still kept, if a key requests it again, which takes the event back."""
        kept = self._store.view.kept
        if not kept or action.function != EVENT or not is_object(action.behavior):
            return None
        topic = normal_topic(describe_behavior(action.function, action.behavior))
        return next((task for task, each in kept.items() if normal_topic(each.topic) == topic), None)

    def _refuse(self, action: KeyAction, reason: str) -> None:
        what = task_label(action.function, action.behavior)
        starts = action.function in STARTING_FUNCTIONS
        self._actions.show_notice(f"{what} not started: {reason}" if starts else f"{what}: not now, {reason}")

    # --- times ------------------------------------------------------------------------------------------------------

    @property
    def _now_or_key(self) -> float:
        return self._clock() if self._key_at is None else self._key_at

    def _session_time(self, at: float | None) -> float | None:
        """The session time of something that happened at `at`."""
        return None if at is None else max(0.0, self._store.now() - max(0.0, self._clock() - at))


def same_start(one: KeyAction, other: KeyAction) -> bool:
    """Whether both request the same, in any way."""
    return (one.function, one.behavior) == (other.function, other.behavior)


def line_opener(key: str) -> str:
    """The action of this key that opens a line for letters; empty if there is none."""
    return next((id for id in LINE_OPENERS if key in keys_of(BY_ID[id])), "")
