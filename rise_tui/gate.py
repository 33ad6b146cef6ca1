"""No accidents (law 2): which key presses count. Pure; time comes in, what counts goes out through `fire`.

- Keys that arrive together are a paste, or a link that stalled: none of them counts.
- A press within the debounce time of the last one of the same kind counts once; a held key counts once.
- A `hold` act needs a second press, or Enter, and a key that repeats because it is held down is not a second press.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from msgspec import Struct

TOGETHER = 0.012
"""Seconds below which two different keys cannot come from two fingers' intent."""
SETTLE = 0.025
"""A press waits this long for a key that would make it part of a paste."""
QUIET = 0.3
"""After a paste, keys count again once nothing has come for this long."""
REPEAT = 0.15
"""Same keys nearer than this come from a key held down."""
HOLD_TIME = 2.0
"""How long the first press of a `hold` act stays armed."""


class Timer(Protocol):
    def stop(self) -> None: ...


class Trigger(Struct, frozen=True):
    """What a press asks for."""

    function: str
    behavior: str
    debounce: float = 0.5
    hold: bool = False
    calling_type: str = ""


class Gate:
    """Between the keyboard and the engine."""

    def __init__(
        self,
        fire: Callable[[Trigger], None],
        arm: Callable[[Trigger | None], None],
        tell: Callable[[str], None],
        later: Callable[[float, Callable[[], None]], Timer],
    ) -> None:
        self._fire, self._arm, self._tell, self._later = fire, arm, tell, later
        self._last_key = ""
        self._last_at = float("-inf")
        self._paste_until = float("-inf")
        self._pending: tuple[Trigger, Timer] | None = None
        self._pressed: dict[tuple[str, str], float] = {}
        self._armed: Trigger | None = None
        self._disarm_timer: Timer | None = None

    @property
    def armed(self) -> Trigger | None:
        return self._armed

    def observe(self, key: str, at: float, *, typing: bool = False) -> None:
        """Every key of the keyboard, before anything acts on it. `typing`: it goes into a text field."""
        together = at - self._last_at < TOGETHER and key != self._last_key
        if together or at < self._paste_until:
            if at >= self._paste_until and not typing:
                self._tell("several keys at once (a paste, or a stalled link): nothing was started")
            self._paste_until = at + QUIET
            self._drop()
            self.disarm()
        self._last_key, self._last_at = key, at

    def press(self, trigger: Trigger, at: float) -> None:
        """A key or Enter asks for something."""
        same = (trigger.function, trigger.behavior)
        last = self._pressed.get(same, float("-inf"))
        self._pressed[same] = at
        if at < self._paste_until:
            return
        if self._armed is not None and (self._armed.function, self._armed.behavior) == same:
            # A held key repeats: wait long enough to see whether another of its kind follows.
            if at - last < REPEAT:
                self._drop()
            else:
                self._wait(trigger, at, REPEAT)
        elif at - last < trigger.debounce:
            if self._pending is None and at - last >= REPEAT:
                self._tell(f"{trigger.behavior}: pressed twice within {trigger.debounce:g} s, taken once")
        else:
            self._wait(trigger, at, SETTLE)

    def confirm(self) -> bool:
        """Enter, while an act is armed: fires it. False when none is."""
        if self._armed is None or self._last_at < self._paste_until:
            return False
        trigger = self._armed
        self._wait(trigger, self._last_at, SETTLE)
        return True

    def disarm(self) -> bool:
        """Forget the first press. True when there was one."""
        was, self._armed = self._armed, None
        if self._disarm_timer is not None:
            self._disarm_timer.stop()
            self._disarm_timer = None
        if was is not None:
            self._arm(None)
        return was is not None

    def reset(self) -> None:
        """Forget everything that was pressed and has not fired."""
        self._drop()
        self.disarm()

    def _wait(self, trigger: Trigger, at: float, wait: float) -> None:
        self._drop()
        self._pending = trigger, self._later(wait, self._settle)

    def _settle(self) -> None:
        if self._pending is None:
            return
        trigger, _ = self._pending
        self._pending = None
        if trigger.hold and (self._armed is None or self._armed.behavior != trigger.behavior):
            self.disarm()
            self._armed = trigger
            self._arm(trigger)
            self._disarm_timer = self._later(HOLD_TIME, self._lapse)
        else:
            self.disarm()
            self._fire(trigger)

    def _lapse(self) -> None:
        if self._pending is None:
            self.disarm()

    def _drop(self) -> None:
        if self._pending is not None:
            self._pending[1].stop()
            self._pending = None
