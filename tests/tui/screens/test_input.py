"""Which keys count, and what they ask of the engine (console.md 2.1 to 2.4); no screen, and time under control."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from rise_engine.base.suspend import suspended_seconds
from rise_engine.kernel.records import ControlRecord, KeptRecord
from rise_tui.console.input import (
    ARMED_SECONDS,
    CHANGE_SECONDS,
    PASTE_QUIET_SECONDS,
    PASTED_KEYS,
    EnterGuard,
    InputController,
)
from rise_tui.model.control import MARK_CUE, InputMode, KeyAction
from rise_tui.model.notice import Level
from rise_tui.model.store import Store
from tests.tui.fake import FakeClient, demo

BEGUN = 83.0
"""Session time at which these tests begin."""


class FakeTimer:
    def __init__(self, at: float, call: Callable[[], None]) -> None:
        self.at, self.call, self.stopped = at, call, False

    def stop(self) -> None:
        self.stopped = True


class Keyboard:
    """A wizard's hands and what comes of them. Implements `InputActions`."""

    def __init__(self) -> None:
        self.now = 0.0
        self.fired: list[str] = []
        self.tasks: list[tuple[str, str, str]] = []
        """Function, behavior and calling type of what was submitted."""
        self.pressed: list[float | None] = []
        """Session time at which what was submitted was pressed, counted from the beginning of the test."""
        self.typed: list[str] = []
        self.told: list[str] = []
        self.armed: list[str] = []
        self.modes = self.transients = 0
        self.asked: list[int] = []
        self._timers: list[FakeTimer] = []
        self.client = FakeClient(demo())
        self.store = Store(self.client.attach_reply(), "anna", lambda: BEGUN + self.now)
        self.input = InputController(self.store, self, self._set_timer, clock=lambda: self.now)

    # --- InputActions ---

    def submit(self, action: KeyAction, pressed: float | None) -> None:
        self.fired.append(action.behavior)
        self.tasks.append((action.function, action.behavior, action.calling_type))
        self.pressed.append(None if pressed is None else pressed - BEGUN)

    def submit_speech(self, action: KeyAction, typed: str, pressed: float | None) -> None:
        self.typed.append(typed)
        self.submit(action, pressed)

    def show_notice(self, text: str, level: Level = "info") -> None:
        self.told.append(text)

    def show_armed(self, action: KeyAction | None) -> None:
        self.armed.append(action.behavior if action is not None else "")

    def show_mode(self) -> None:
        self.modes += 1

    def ask_what_was_wrong(self, task: int) -> None:
        self.asked.append(task)

    def leave_transient(self) -> None:
        self.transients += 1

    # --- what a test does ---

    def _set_timer(self, wait: float, call: Callable[[], None]) -> FakeTimer:
        timer = FakeTimer(self.now + wait, call)
        self._timers.append(timer)
        return timer

    def wait(self, seconds: float) -> None:
        end = self.now + seconds
        while due := [timer for timer in self._timers if not timer.stopped and timer.at <= end]:
            first = min(due, key=lambda timer: timer.at)
            self._timers.remove(first)
            self.now = first.at
            first.call()
        self.now = end

    def press(self, key: str, action: KeyAction | None = None, together: bool = False) -> None:
        self.input.observe_key(key, self.now, together=together)
        if action is not None:
            self.input.press(action, self.now)

    def handle(self, key: str) -> bool:
        """A key that comes alone and that no field takes."""
        self.input.observe_key(key, self.now, together=False)
        return self.input.handle_key(key, self.now)

    def enter(self, action: KeyAction) -> None:
        """Enter on a row: what is armed gets it first, as on the console."""
        self.input.observe_key("enter", self.now)
        if not (self.input.is_armed and self.input.handle_key("enter", self.now)):
            self.input.start(action, self.now)


A = KeyAction("startCommunicationRobotAct", "A")
B = KeyAction("startCommunicationRobotAct", "B")
HOLD = KeyAction("startCommunicationRobotAct", "H", hold=True)
ROW = KeyAction("startCommunicationRobotAct", "A", hold=True, by_enter=True)
"""Enter on the row of A."""


def test_one_press_fires_once_and_soon() -> None:
    keys = Keyboard()
    keys.press("a", A)
    keys.wait(0.03)
    assert keys.fired == ["A"]


async def test_time_that_only_passes_in_a_test_is_no_suspend() -> None:
    """Else a busy machine, on which more time passes than in the test, would drop keys."""
    before = suspended_seconds()
    await asyncio.sleep(100)
    assert abs(suspended_seconds() - before) < 1


@pytest.mark.parametrize("suspended", [True, False])
@pytest.mark.parametrize("first", ["key", "tick"])
def test_a_key_that_waited_while_the_console_stood_still_starts_nothing(
    monkeypatch: pytest.MonkeyPatch, first: str, suspended: bool
) -> None:
    """Nobody wants now what was wanted then; and the stop key goes on."""
    keys = Keyboard()
    keys.input.note_alive()
    keys.wait(1.0)
    keys.input.note_alive()
    if suspended:
        before = suspended_seconds()
        monkeypatch.setattr("rise_tui.console.input.suspended_seconds", lambda: before + 12)
    else:
        keys.wait(12.0)
    if first == "tick":
        keys.input.note_alive()
    keys.input.observe_key("a", keys.now)
    assert not keys.input.admits_key("a", printable=True, typing=False, leaving=False)
    assert keys.input.admits_key("f9", printable=False, typing=False, leaving=False)
    assert keys.told == ["the console stood still for 12 s: keys of that time start nothing"]
    keys.wait(1.0)
    keys.input.note_alive()
    keys.press("a", A)
    keys.wait(0.03)
    assert keys.fired == ["A"]


def test_two_keys_of_a_fast_typist_both_count() -> None:
    keys = Keyboard()
    keys.press("a", A)
    keys.wait(0.04)
    keys.press("b", B)
    keys.wait(0.04)
    assert keys.fired == ["A", "B"]


def test_keys_that_arrive_together_do_not_count_however_many_follow() -> None:
    keys = Keyboard()
    for _ in range(50):
        keys.press("a", A, together=True)
        keys.press("b", B, together=True)
        keys.wait(0.1)  # a slow link cuts the paste into pieces
    assert keys.fired == []
    assert len(keys.told) == 1
    keys.wait(0.5)
    keys.press("a", A)
    keys.wait(0.1)
    assert keys.fired == ["A"]


def test_a_held_key_counts_once() -> None:
    keys = Keyboard()
    keys.press("a", A)
    keys.wait(0.4)
    for _ in range(100):
        keys.press("a", A)
        keys.wait(0.033)
    assert keys.fired == ["A"]


def test_a_held_key_of_a_hold_act_is_not_its_own_second_press() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(0.5)
    for _ in range(100):
        keys.press("h", HOLD)
        keys.wait(0.033)
    keys.wait(3)
    assert keys.fired == []


def test_a_hold_act_fires_at_the_second_press_within_two_seconds() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(1.0)
    assert keys.armed == ["H"] and keys.fired == []
    keys.press("h", HOLD)
    keys.wait(0.3)
    assert keys.fired == ["H"]
    assert keys.armed[-1:] in ([], [""])


def test_the_first_press_of_a_hold_act_lapses() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(ARMED_SECONDS + 1.0)
    assert keys.armed == ["H", ""]
    keys.press("h", HOLD)
    keys.wait(0.5)
    assert keys.fired == [] and keys.armed[-1] == "H"


def test_another_act_disarms() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(0.5)
    keys.press("a", A)
    keys.wait(0.5)
    assert keys.fired == ["A"] and keys.armed[-1:] in ([], [""])


def test_the_press_right_after_a_lapsed_hold_arms_anew_only() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(ARMED_SECONDS + 0.2)
    keys.press("h", HOLD)
    keys.wait(1.0)
    assert keys.fired == [] and keys.armed[-1] == "H"


def test_disarming_forgets_a_second_press_that_has_not_fired() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(0.5)
    keys.press("h", HOLD)
    keys.input.disarm()
    keys.wait(1)
    assert keys.fired == []


Presses = list[tuple[float, str, bool]]
"""Seconds since the press before, key, and whether it came together with others."""


@pytest.mark.parametrize(
    ("presses", "fired"),
    [
        ([(0, "a", False)], ["A"]),
        ([(0, "a", True)], []),
        ([(0, "a", True), (0, "b", True), (0, "a", True)], []),
        ([(0, "a", True), (0, "a", True)], []),  # also a paste of one letter many times
        ([(0, "a", False), (0.02, "b", False)], ["A", "B"]),
        ([(0, "a", False), (0.005, "b", False)], ["A"]),  # no two fingers are that quick: a paste that came in pieces
        ([(0, "a", False), (0.005, "b", True)], ["A"]),
        ([(0, "a", False), (0.05, "b", False)], ["A", "B"]),
        ([(0, "a", True), (0.1, "b", False)], []),  # the rest of a paste
        ([(0, "a", True), (PASTE_QUIET_SECONDS + 0.01, "b", False)], ["B"]),
        ([(0, "a", False), (0.2, "a", False)], ["A"]),  # the debounce time
        ([(0, "a", False), (0.6, "a", False)], ["A", "A"]),
    ],
)
def test_which_presses_count(presses: Presses, fired: list[str]) -> None:
    keys = Keyboard()
    for wait, key, together in presses:
        keys.wait(wait)
        keys.press(key, {"a": A, "b": B}[key], together)
    keys.wait(1)
    assert keys.fired == fired


def test_a_key_that_came_alone_waits_for_no_other() -> None:
    keys = Keyboard()
    keys.press("a", A)
    assert keys.fired == ["A"]


def test_what_fires_says_when_it_was_pressed() -> None:
    keys = Keyboard()
    keys.wait(1.0)
    keys.press("a", A)
    keys.wait(1.0)
    keys.press("h", HOLD)
    keys.wait(1.0)
    keys.press("h", HOLD)
    keys.wait(1.0)
    assert keys.pressed == pytest.approx([1.0, 3.0])  # of a hold act, the second press


def test_another_key_does_not_swallow_the_one_before() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(0.5)
    keys.press("h", HOLD)
    keys.wait(0.05)  # it is still looked whether the key is held down
    keys.press("a", A)
    keys.wait(1)
    assert keys.fired == ["H", "A"]


def test_who_types_fast_pastes_nothing_when_each_key_came_alone() -> None:
    keys = Keyboard()
    for key in "abc":
        keys.input.observe_key(key, keys.now, typing=True, together=False)
        keys.wait(0.004)
    keys.input.observe_key("enter", keys.now, typing=True, together=False)
    assert keys.input.press(KeyAction("say", "abc"), keys.now)
    assert keys.fired == ["abc"] and keys.told == []


def test_a_pasted_line_end_says_nothing() -> None:
    keys = Keyboard()
    for key in ("a", "b", "enter"):
        keys.input.observe_key(key, keys.now, typing=True, together=True)
    assert not keys.input.press(KeyAction("say", "ab"), keys.now)
    keys.wait(1)
    assert keys.fired == [] and keys.told == []


def test_a_mark_without_a_name_is_told_by_its_function() -> None:
    keys = Keyboard()
    keys.press("space", MARK_CUE)
    keys.wait(0.3)
    keys.press("space", MARK_CUE)
    assert keys.told == ["cue: pressed twice within 0.5 s, counted once"]


# --- the way of a key ------------------------------------------------------------------------------------------------


def test_a_key_of_the_scenario_starts_its_act_and_the_record_gets_the_time_of_the_press() -> None:
    keys = Keyboard()
    keys.wait(2.0)
    assert keys.handle("g")
    assert keys.tasks == [("startCommunicationRobotAct", "Greet", "")] and keys.pressed == pytest.approx([2.0])
    assert not keys.handle("f6")


def test_the_mouse_has_no_time_of_a_press() -> None:
    keys = Keyboard()
    keys.input.observe_mouse()
    keys.input.send("moveTask", "3 0")
    assert keys.pressed == [None]


def test_enter_starts_the_armed_act_wherever_the_cursor_is() -> None:
    keys = Keyboard()
    keys.handle("b")
    assert keys.armed == ["Goodbye"] and keys.fired == []
    keys.wait(1.0)
    keys.enter(ROW)
    keys.wait(0.5)
    assert keys.fired == ["Goodbye"]


def test_enter_on_a_row_starts_it_only_the_second_time() -> None:
    keys = Keyboard()
    keys.enter(ROW)
    keys.wait(1.0)
    assert keys.armed == ["A"] and keys.fired == []
    keys.enter(ROW)
    keys.wait(0.5)
    assert keys.fired == ["A"]


def test_an_enter_that_is_held_never_starts_its_row() -> None:
    keys = Keyboard()
    keys.enter(ROW)
    keys.wait(0.5)
    for _ in range(90):
        keys.enter(ROW)
        keys.wait(0.033)
    keys.wait(10)
    assert keys.fired == []


@pytest.mark.parametrize("between", ["down", "tab", "x", "mouse", "wait"])
def test_what_enter_has_chosen_is_dropped_when_the_wizard_goes_on(between: str) -> None:
    keys = Keyboard()
    keys.enter(ROW)
    keys.wait(0.5)
    if between == "mouse":
        keys.input.observe_mouse()
    elif between == "wait":
        keys.wait(ARMED_SECONDS)
    else:
        keys.input.observe_key(between, keys.now)
    assert keys.armed == ["A", ""]
    keys.wait(0.5)
    keys.enter(ROW)
    keys.wait(1)
    assert keys.fired == [] and keys.armed == ["A", "", "A"]


def test_a_key_of_the_study_starts_its_act_once_while_enter_has_chosen_it() -> None:
    """The key is a decision; the row was none."""
    keys = Keyboard()
    keys.enter(ROW)
    keys.wait(0.2)
    keys.press("a", A)
    keys.wait(1)
    assert keys.fired == ["A"] and not keys.input.is_armed


def test_enter_waits_until_what_has_opened_can_have_been_seen() -> None:
    guard = EnterGuard()
    assert guard.admits("enter", 0.0)
    guard.note_change(5.0)
    assert not guard.admits("enter", 5.0) and not guard.admits("enter", 5.0 + CHANGE_SECONDS - 0.01)
    assert guard.admits("enter", 5.0 + CHANGE_SECONDS + 0.2)
    guard.note_change(8.0)
    assert not any(guard.admits("enter", 8.0 + n / 30) for n in range(60)), "held down"
    guard.note_change(12.0)
    assert guard.admits("a", 12.1) and guard.admits("enter", 12.2), "another key shows that it was seen"


def test_the_letters_of_a_question_that_has_closed_by_itself_start_nothing() -> None:
    keys = Keyboard()
    keys.input.ignore_keys()
    keys.handle("g")
    keys.wait(CHANGE_SECONDS + 0.01)
    assert keys.fired == []
    keys.handle("g")
    assert keys.fired == ["Greet"]


def test_esc_forgets_the_first_of_two_presses_and_else_leaves_what_is_open() -> None:
    keys = Keyboard()
    keys.handle("b")
    keys.wait(0.5)
    assert keys.handle("escape") and keys.armed == ["Goodbye", ""] and keys.transients == 0
    keys.wait(0.5)
    assert keys.handle("escape") and keys.transients == 1 and keys.fired == []


def test_esc_forgets_a_second_press_that_is_still_looked_at() -> None:
    keys = Keyboard()
    keys.handle("b")
    keys.wait(0.5)
    keys.handle("b")
    keys.wait(0.05)
    keys.handle("escape")
    keys.wait(1)
    assert keys.fired == [] and keys.armed == ["Goodbye", ""]


def test_what_cannot_be_started_when_it_counts_is_refused_then() -> None:
    keys = Keyboard()
    greet = KeyAction("startCommunicationRobotAct", "Greet", hold=True)
    keys.press("g", greet)
    keys.wait(0.5)
    keys.press("g", greet)
    keys.store.input_mode = "SAFE"
    keys.wait(1)
    assert keys.fired == [] and keys.told == ["act Greet not started: SAFE: ctrl+x turns keys on"]


def test_without_control_a_key_says_who_has_it() -> None:
    keys = Keyboard()
    keys.store.apply([ControlRecord(0, 0.0, "", status="taken", by="wizard:ben", holder="wizard:ben")])
    keys.handle("g")
    assert keys.fired == [] and keys.told[-1] == "act Greet not started: ben has control (F8)"


@pytest.mark.parametrize(
    ("mode", "key", "leaving", "allowed"),
    [
        ("LIVE", "g", False, True),
        ("SAFE", "g", False, True),
        ("LOCKED", "g", False, False),
        ("LOCKED", "f9", False, True),
        ("LOCKED", "ctrl+c", False, True),
        ("LOCKED", "f7", False, True),
        ("LOCKED", "d", True, True),
    ],
)
def test_which_keys_may_go_on(mode: InputMode, key: str, leaving: bool, allowed: bool) -> None:
    keys = Keyboard()
    keys.store.input_mode = mode
    keys.press(key, together=False)
    assert keys.input.admits_key(key, printable=len(key) == 1, typing=False, leaving=leaving) is allowed
    assert keys.told == ([] if allowed else ["LOCKED: F7 unlocks"])


def test_pasted_text_goes_on_only_where_somebody_types() -> None:
    keys = Keyboard()
    keys.press("d", together=True)
    assert keys.told == [PASTED_KEYS]
    assert not keys.input.admits_key("d", printable=True, typing=False, leaving=False)
    assert not keys.input.admits_key("enter", printable=False, typing=False, leaving=False)
    assert keys.input.admits_key("escape", printable=False, typing=False, leaving=False)
    assert keys.input.admits_key("d", printable=True, typing=True, leaving=False)


def test_choosing_a_mode_forgets_what_was_pressed() -> None:
    keys = Keyboard()
    keys.handle("b")
    keys.input.switch_safe()
    assert keys.armed[-1:] in ([], [""]) and keys.store.input_mode == "SAFE" and keys.modes == 1
    keys.input.switch_lock()
    assert keys.store.input_mode == "LOCKED"


def test_speech_is_sent_with_what_stood_in_its_field() -> None:
    keys = Keyboard()
    keys.press("enter", together=False)
    keys.input.speak("Hi {name}", "Hi Tim", at_once=True)
    assert keys.typed == ["Hi {name}"] and keys.tasks == [("say", "Hi Tim", "Interrupt")]


def test_a_mark_is_about_what_the_wizard_did_last() -> None:
    keys = Keyboard()
    keys.input.mark_mistake()
    assert keys.told == ["you have done nothing yet: there is nothing to mark"]
    keys.client.task("startCommunicationRobotAct", "Greet")
    keys.store.view = keys.client.attach_reply().view
    keys.input.mark_mistake()
    assert keys.tasks == [("markMistake", "1 wrong", "")] and keys.asked == [1]


def test_the_same_key_takes_back_what_is_kept() -> None:
    keys = Keyboard()
    early = KeyAction("raiseEventTopic", '{"event": "/understood", "keep": "2s"}')
    keys.press("u", early)
    keys.store.apply([KeptRecord(1, 0.0, "", 7, "/understood", "kept", 2.0)])
    keys.wait(0.2)
    keys.press("u", early)
    assert keys.tasks == [("raiseEventTopic", early.behavior, "")], "a key that bounces takes nothing back"
    keys.wait(0.6)
    keys.press("u", early)
    assert keys.tasks[1:] == [("cancelTask", "7", "")]
    keys.store.apply([KeptRecord(2, 0.0, "", 7, "/understood", "taken-back")])
    keys.wait(1)
    keys.press("u", early)
    assert keys.tasks[2:] == [("raiseEventTopic", early.behavior, "")]
