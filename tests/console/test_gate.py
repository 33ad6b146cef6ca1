"""The gate alone, with time under control."""

from __future__ import annotations

from collections.abc import Callable

from rise_tui.gate import Gate, Trigger


class FakeTimer:
    def __init__(self, at: float, call: Callable[[], None]) -> None:
        self.at, self.call, self.stopped = at, call, False

    def stop(self) -> None:
        self.stopped = True


class Keyboard:
    def __init__(self) -> None:
        self.now = 0.0
        self.fired: list[str] = []
        self.told: list[str] = []
        self.armed: list[str] = []
        self._timers: list[FakeTimer] = []
        self.gate = Gate(
            lambda trigger: self.fired.append(trigger.behavior),
            lambda trigger: self.armed.append(trigger.behavior if trigger else ""),
            self.told.append,
            self._later,
        )

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

    def press(self, key: str, trigger: Trigger | None = None) -> None:
        self.gate.observe(key, self.now)
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
