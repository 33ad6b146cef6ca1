"""No accidents (law 2): which key presses count. Pure; time comes in, what counts goes out through `fire`.

- Keys that arrive together are a paste, or a link that stalled: none of them counts. A terminal's driver may know that
  (they came in one read) or know the opposite; where it does not, the time between two keys tells.
- A press within the debounce time of the last one of the same kind counts once; a held key counts once.
- A `hold` act needs a second press, or Enter, and a key that repeats because it is held down is not a second press.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from msgspec import Struct

from rise_tui.model.deeds import describe

TOGETHER = 0.012
"""Seconds below which two different keys cannot come from two fingers' intent."""
SETTLE = 0.025
"""A press waits this long for a key that would make it part of a paste."""
SETTLE_ALONE = 0.0
"""The same where the driver is sure that the key came alone: it has waited long enough itself."""
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
        fire: Callable[[Trigger, float], None],
        arm: Callable[[Trigger | None], None],
        tell: Callable[[str], None],
        later: Callable[[float, Callable[[], None]], Timer],
    ) -> None:
        """`fire` gets what counts and when it was pressed; `arm` the `hold` act whose first press was seen, or None."""
        self._fire, self._arm, self._tell, self._later = fire, arm, tell, later
        self._last_key = ""
        self._last_at = float("-inf")
        self._alone = False
        """The driver is sure that the last key came alone."""
        self._paste_until = float("-inf")
        self._pending: tuple[Trigger, float, Timer] | None = None
        self._pressed: dict[tuple[str, str], float] = {}
        self._armed: Trigger | None = None
        self._disarm_timer: Timer | None = None

    @property
    def armed(self) -> Trigger | None:
        return self._armed

    @property
    def pasting(self) -> bool:
        """Whether the last key was part of a paste."""
        return self._last_at < self._paste_until

    def observe(self, key: str, at: float, *, typing: bool = False, together: bool | None = None) -> None:
        """Every key of the keyboard, before anything acts on it.

        `typing`: it goes into a text field. `together`: whether it came in one piece with others; None: nobody knows.
        """
        near = at - self._last_at < TOGETHER and key != self._last_key
        # A fast typist's keys may come near each other; where the driver knows that they came alone, they are no paste.
        paste = together or (near and not (typing and together is False))
        if paste or at < self._paste_until:
            if at >= self._paste_until and not typing:
                self._tell("several keys at once (a paste, or a stalled link): nothing was started")
            self._paste_until = at + QUIET
            self._drop()
            self.disarm()
        self._last_key, self._last_at, self._alone = key, at, together is False

    def press(self, trigger: Trigger, at: float) -> bool:
        """A key or Enter asks for something; `at` is when it was pressed. False when it is part of a paste."""
        same = (trigger.function, trigger.behavior)
        last = self._pressed.get(same, float("-inf"))
        self._pressed[same] = at
        if at < self._paste_until:
            return False
        if self._armed is not None and (self._armed.function, self._armed.behavior) == same:
            # A held key repeats: wait long enough to see whether another of its kind follows.
            if at - last < REPEAT:
                self._drop()
            else:
                self._wait(trigger, at, REPEAT)
        elif at - last < trigger.debounce:
            if self._pending is None and at - last >= REPEAT:
                what = trigger.behavior or describe(trigger.function, "")
                self._tell(f"{what}: pressed twice within {trigger.debounce:g} s, taken once")
        else:
            self._wait(trigger, at, self._settle_time)
        return True

    def confirm(self) -> bool:
        """Enter, while an act is armed: fires it. False when none is."""
        if self._armed is None or self._last_at < self._paste_until:
            return False
        trigger = self._armed
        self._wait(trigger, self._last_at, self._settle_time)
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

    @property
    def _settle_time(self) -> float:
        return SETTLE_ALONE if self._alone else SETTLE

    def _wait(self, trigger: Trigger, at: float, wait: float) -> None:
        if self._pending is not None and self._pending[0] != trigger:
            self._pending[2].stop()
            self._settle()  # another key, not near enough to be a paste: the one before it counts
        self._drop()
        if wait > 0:
            self._pending = trigger, at, self._later(wait, self._settle)
        else:
            self._take(trigger, at)

    def _settle(self) -> None:
        if self._pending is not None:
            trigger, at, _ = self._pending
            self._pending = None
            self._take(trigger, at)

    def _take(self, trigger: Trigger, at: float) -> None:
        if trigger.hold and (self._armed is None or self._armed.behavior != trigger.behavior):
            self.disarm()
            self._armed = trigger
            self._arm(trigger)
            self._disarm_timer = self._later(HOLD_TIME, self._lapse)
        else:
            self.disarm()
            self._fire(trigger, at)

    def _lapse(self) -> None:
        if self._pending is None:
            self.disarm()

    def _drop(self) -> None:
        if self._pending is not None:
            self._pending[2].stop()
            self._pending = None
