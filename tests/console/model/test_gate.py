"""The gate alone, with time under control."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rise_tui.model.gate import QUIET, SETTLE, SETTLE_ALONE, Gate, Trigger


class FakeTimer:
    def __init__(self, at: float, call: Callable[[], None]) -> None:
        self.at, self.call, self.stopped = at, call, False

    def stop(self) -> None:
        self.stopped = True


class Keyboard:
    def __init__(self) -> None:
        self.now = 0.0
        self.fired: list[str] = []
        self.pressed: list[float] = []
        """When what fired was pressed."""
        self.told: list[str] = []
        self.armed: list[str] = []
        self._timers: list[FakeTimer] = []
        self.gate = Gate(
            self._fired,
            lambda trigger: self.armed.append(trigger.behavior if trigger else ""),
            self.told.append,
            self._later,
        )

    def _fired(self, trigger: Trigger, at: float) -> None:
        self.fired.append(trigger.behavior)
        self.pressed.append(at)

    def _later(self, wait: float, call: Callable[[], None]) -> FakeTimer:
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

    def press(self, key: str, trigger: Trigger | None = None, together: bool | None = None) -> None:
        self.gate.observe(key, self.now, together=together)
        if trigger is not None:
            self.gate.press(trigger, self.now)


A = Trigger("startCommunicationRobotAct", "A")
B = Trigger("startCommunicationRobotAct", "B")
HOLD = Trigger("startCommunicationRobotAct", "H", hold=True)


def test_one_press_fires_once_and_soon() -> None:
    keys = Keyboard()
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
        keys.press("a", A)
        keys.press("b", B)
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
    assert keys.gate.armed is None


def test_the_first_press_of_a_hold_act_lapses() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(3.0)
    assert keys.armed == ["H", ""]
    keys.press("h", HOLD)
    keys.wait(0.5)
    assert keys.fired == [] and keys.gate.armed is HOLD


def test_another_act_disarms() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(0.5)
    keys.press("a", A)
    keys.wait(0.5)
    assert keys.fired == ["A"] and keys.gate.armed is None


def test_the_press_right_after_a_lapsed_hold_arms_anew_only() -> None:
    keys = Keyboard()
    keys.press("h", HOLD)
    keys.wait(2.2)
    keys.press("h", HOLD)
    keys.wait(1.0)
    assert keys.fired == [] and keys.gate.armed is HOLD


def test_reset_forgets_a_press_that_has_not_fired() -> None:
    keys = Keyboard()
    keys.press("a", A)
    keys.gate.reset()
    keys.wait(1)
    assert keys.fired == []


Presses = list[tuple[float, str, bool | None]]
"""Seconds since the press before, key, and whether the driver knows that it came together with others."""


@pytest.mark.parametrize(
    ("presses", "fired"),
    [
        ([(0, "a", None)], ["A"]),
        ([(0, "a", False)], ["A"]),
        ([(0, "a", True)], []),
        ([(0, "a", True), (0, "b", True), (0, "a", True)], []),
        ([(0, "a", True), (0, "a", True)], []),  # also a paste of one letter many times
        ([(0, "a", None), (0.005, "b", None)], []),
        ([(0, "a", None), (0.02, "b", None)], ["A", "B"]),
        ([(0, "a", False), (0.005, "b", False)], ["A"]),  # no two fingers are that quick: a paste that came in pieces
        ([(0, "a", False), (0.005, "b", True)], ["A"]),
        ([(0, "a", False), (0.05, "b", False)], ["A", "B"]),
        ([(0, "a", True), (0.1, "b", False)], []),  # the rest of a paste
        ([(0, "a", True), (QUIET + 0.01, "b", False)], ["B"]),
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


def test_a_key_that_surely_came_alone_waits_for_no_other() -> None:
    keys = Keyboard()
    keys.press("a", A, False)
    keys.wait(SETTLE_ALONE)
    assert SETTLE_ALONE <= 0.002 and keys.fired == ["A"]
    keys.wait(1)
    keys.press("b", B)
    keys.wait(SETTLE - 0.001)
    assert keys.fired == ["A"]  # nobody knows: another may follow
    keys.wait(0.002)
    assert keys.fired == ["A", "B"]


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
        keys.gate.observe(key, keys.now, typing=True, together=False)
        keys.wait(0.004)
    keys.gate.observe("enter", keys.now, typing=True, together=False)
    assert keys.gate.press(Trigger("say", "abc"), keys.now)
    keys.wait(1)
    assert keys.fired == ["abc"]


def test_a_pasted_line_end_says_nothing() -> None:
    keys = Keyboard()
    for key in ("a", "b", "enter"):
        keys.gate.observe(key, keys.now, typing=True, together=True)
    assert not keys.gate.press(Trigger("say", "ab"), keys.now)
    keys.wait(1)
    assert keys.fired == [] and keys.told == []


def test_a_mark_without_a_name_is_told_by_its_function() -> None:
    keys = Keyboard()
    keys.press("space", Trigger("markCue", ""))
    keys.wait(0.3)
    keys.press("space", Trigger("markCue", ""))
    assert keys.told == ["cue: pressed twice within 0.5 s, taken once"]
