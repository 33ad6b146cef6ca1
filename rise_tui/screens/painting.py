"""When what is repainted: soon, never faster than a terminal can take, and only what differs (console.md 8.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import monotonic

from textual.timer import Timer
from textual.widgets import Input

from rise_tui.actions import BY_ID, at, why_blocked
from rise_tui.model.cue import ticks
from rise_tui.model.notice import Notice
from rise_tui.model.store import Store, Topic
from rise_tui.screens.arrangement import Arrangement
from rise_tui.widgets.alarm import AlarmBar, CallBar, FailureBar
from rise_tui.widgets.band import KeyStrip, SpeechBand
from rise_tui.widgets.bars import KeyHints, NoticeLine, StatusLine
from rise_tui.widgets.mistake import MistakeLine
from rise_tui.widgets.note import NoteLine
from rise_tui.widgets.say import SayField, SayLine

FRAME = 1 / 15
"""Seconds between two repaints while records pour in."""
SHARE = 1 / 8
"""Of the time, at most so much goes into painting while records pour in, however dear that is."""
LONGEST_PAUSE = 0.5
"""Whatever the last frame took: on a busy machine it may have been others that took it."""
NOTICE_SECONDS = 12.0
NOTICE_LEAST = 1.0
"""A notice stays this long, whatever is pressed."""
TENTH = 0.1
"""Seconds between two looks at the time since the cue, while it is counted."""
COMMON = (
    *("stop", "say", "cue", "filler", "mistake", "palette", "help", "safe"),
    *("filter", "note", "lists", "next-pane", "zoom", "jump", "lock", "control"),
)
"""Actions that the hint line names for every pane."""


class Painting:
    """The bars of the console, and the rhythm in which they and the panes follow the store."""

    def __init__(self, store: Store, panes: Arrangement, later: Callable[[float, Callable[[], None]], Timer]) -> None:
        self.status, self.alarm, self.call = StatusLine(), AlarmBar(), CallBar()
        self.failure = FailureBar()
        self.notice, self.hints = NoticeLine(), KeyHints()
        self.band, self.strip = SpeechBand(), KeyStrip()
        self.say, self.mistake = SayLine(store), MistakeLine()
        self._store, self._panes, self._later = store, panes, later
        self._dirty: set[Topic] = set()
        self._frame: Timer | None = None
        self._cue_timer: Timer | None = None
        self._spent = 0.0
        """Seconds that it took to draw the latest frame."""
        self._painted = 0.0
        self._noticed: Notice | None = None
        self._noticed_at = 0.0
        self._some = False, False
        self._taken_at = 0.0

    def changed(self, topics: frozenset[Topic] | set[Topic]) -> None:
        """The store changed; paint soon."""
        self._dirty |= topics
        if self._frame is None and self._panes.is_mounted:
            pause = max(FRAME, min(self._spent / SHARE, LONGEST_PAUSE))
            self._frame = self._later(max(0.001, self._painted + pause - monotonic()), self._paint)

    def repaint(self, *names: str) -> None:
        """Paint these panes, those that can be seen, at once."""
        for pane in self._panes.shown():
            if pane.PLACE in names:
                pane.repaint()

    def tick(self) -> None:
        """Once a second."""
        self.status.draw(self._store)
        self.band.draw(self._store)
        self.say.draw()
        if self._store.cut is not None or self.alarm.counts:
            self.alarm.draw(self._store)
        self.repaint("memory")
        if self._noticed is not None and monotonic() - self._noticed_at > NOTICE_SECONDS:
            self.clear_notice()

    def tick_tenths(self) -> None:
        """Several times a second; does something only while something runs or waits."""
        view = self._store.view
        if (view.running or view.waiting) and not self._store.gone:
            self.repaint("acts", "act", "scheduler")
            self.say.draw()
        if self.band.counts(self._store):
            self.band.draw(self._store)

    def _tick_cue(self) -> None:
        """Several times a second, and only while somebody waits for an answer."""
        self._cue_timer = None
        self.status.draw(self._store)
        self._draw_notice()
        self._count_cue()

    def _count_cue(self) -> None:
        counts = ticks(self._store.view.cue, self._store.now()) and not self._store.gone and self._store.cut is None
        if counts and self._cue_timer is None:
            self._cue_timer = self._later(TENTH, self._tick_cue)

    def key_pressed(self) -> None:
        """A notice has been read when the next key is pressed; so has the line that control was taken.

        They go with the next frame: what the key asks for comes first.
        """
        if self._store.taken is not None and self._taken_at and monotonic() - self._taken_at > NOTICE_LEAST:
            self._store.taken, self._taken_at = None, 0.0
            self.changed({"status"})
        shown = self._noticed is not None and self._noticed is self._store.notice and self.notice.display
        if shown and monotonic() - self._noticed_at > NOTICE_LEAST:
            self._store.notice = None
            self.changed({"notice"})

    def clear_notice(self) -> None:
        self._store.notice = None
        self._draw_notice()

    def fit(self) -> None:
        """The size of the terminal has changed, or is known now."""
        size = self._panes.app.size
        self.band.fit(self._store, size)
        self.strip.fit(self._store, size)

    def draw_bars(self) -> None:
        self.status.draw(self._store)
        self.band.draw(self._store)
        self.strip.draw(self._store)
        self.alarm.draw(self._store)
        self._draw_call()
        self.failure.draw(self._store)
        self._draw_notice()
        self.say.draw()
        self.mistake.draw(self._store)
        self.draw_hints()

    def open_mistake(self, task: int) -> None:
        """Ask what was wrong about an act, where the notice stands."""
        self.notice.display = False
        self.mistake.open(task)
        self.mistake.draw(self._store)

    def draw_hints(self) -> None:
        focused = self._panes.screen.focused
        if isinstance(focused, SayField):
            self.hints.draw_saying(self._store, self.say.effect, why_blocked(self._store, "start"))
            return
        if isinstance(focused, Input):
            self.hints.draw_typing(self._store, "add the note" if isinstance(focused, NoteLine) else "take")
            return
        pane = self._panes.focused()
        own = list(at(pane.PLACE)) if pane is not None else []
        release = [BY_ID["release"]] if self._store.state == "STOPPED" else []
        if self._store.guard == "SAFE":
            release.append(BY_ID["safe"])
        if not BY_ID["control"].unavailable(self._store) and (self._store.asker or not self._store.has_control):
            release.append(BY_ID["control"])
        self.hints.draw([*release, *own], [BY_ID[name] for name in COMMON], self._store)

    def _paint(self) -> None:
        self._painted = monotonic()
        self._frame = None
        dirty, self._dirty = self._dirty, set()
        for draw in self._jobs(dirty):
            draw()
        self._spent = monotonic() - self._painted

    def _jobs(self, dirty: set[Topic]) -> Iterator[Callable[[], None]]:
        """What is to be drawn anew."""
        for pane in self._panes.shown():
            if pane.looks_different(dirty):
                yield pane.repaint
        if dirty & {"status", "stop", "cue"}:
            yield self._draw_status
        if dirty & {"acts", "rules", "memory", "status", "stop", "cue"}:
            yield self._draw_band
        if dirty & {"status", "stop"}:
            yield self._draw_alarm
        if dirty & {"acts", "tasks", "status", "stop", "memory"}:
            yield self._draw_failure
        if dirty & {"notice", "cue", "acts"}:
            yield self._draw_notice
        typing = self.say.is_open or self.mistake.is_open
        if dirty & {"acts", "status", "stop"} or (typing and dirty & {"tasks", "memory"}):
            yield self._draw_fields
        some = bool(self._store.log.all), bool(self._store.view.memory)  # some actions are only for what there is
        if dirty & {"acts", "status", "stop"} or some != self._some:
            self._some = some
            yield self.draw_hints

    def _draw_status(self) -> None:
        self.status.draw(self._store)
        self._count_cue()

    def _draw_band(self) -> None:
        self.band.draw(self._store)
        self.strip.draw(self._store)

    def _draw_alarm(self) -> None:
        self.alarm.draw(self._store)
        self._draw_call()

    def _draw_failure(self) -> None:
        self.failure.draw(self._store)

    def _draw_fields(self) -> None:
        self.say.draw()
        self.mistake.draw(self._store)

    def _draw_call(self) -> None:
        self._taken_at = (self._taken_at or monotonic()) if self._store.taken is not None else 0.0
        self.call.draw(self._store)

    def _draw_notice(self) -> None:
        if self._store.notice is not self._noticed:
            self._noticed, self._noticed_at = self._store.notice, monotonic()
        self.notice.draw(self._store)
