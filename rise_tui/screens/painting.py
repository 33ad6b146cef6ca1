"""When what is repainted: soon after a change, never faster than a terminal can take, and only what differs (law 8)."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

from textual.timer import Timer
from textual.widgets import Input

from rise_tui.actions import BY_ID, at
from rise_tui.notice import Notice
from rise_tui.screens.arrangement import Arrangement
from rise_tui.store import Store, Topic
from rise_tui.widgets.alarm import AlarmBar, CallBar
from rise_tui.widgets.bars import KeyHints, NoticeLine, StatusLine
from rise_tui.widgets.note import NoteLine

FRAME = 1 / 15
"""Seconds between two repaints while records pour in."""
NOTICE_SECONDS = 12.0
NOTICE_LEAST = 1.0
"""A notice stays this long, whatever is pressed."""
COMMON = ("stop", "palette", "help", "lists", "next-pane", "note", "filter", "zoom", "control")
"""Actions that the hint line names for every pane."""


class Painting:
    """The bars of the console, and the rhythm in which they and the panes follow the store."""

    def __init__(self, store: Store, panes: Arrangement, later: Callable[[float, Callable[[], None]], Timer]) -> None:
        self.status, self.alarm, self.call = StatusLine(), AlarmBar(), CallBar()
        self.notice, self.hints = NoticeLine(), KeyHints()
        self._store, self._panes, self._later = store, panes, later
        self._dirty: set[Topic] = set()
        self._frame: Timer | None = None
        self._painted = 0.0
        self._noticed: Notice | None = None
        self._noticed_at = 0.0
        self._taken_at = 0.0

    def changed(self, topics: frozenset[Topic] | set[Topic]) -> None:
        """The store changed; paint soon."""
        self._dirty |= topics
        if self._frame is None and self._panes.is_mounted:
            self._frame = self._later(max(0.001, self._painted + FRAME - monotonic()), self._paint)

    def repaint(self, *names: str) -> None:
        """Paint these panes, those that can be seen, at once."""
        for pane in self._panes.shown():
            if pane.PLACE in names:
                pane.repaint()

    def tick(self) -> None:
        """Once a second."""
        self.status.draw(self._store)
        if self._store.cut is not None:
            self.alarm.draw(self._store)
        self.repaint("memory")
        if self._noticed is not None and monotonic() - self._noticed_at > NOTICE_SECONDS:
            self.clear_notice()

    def tick_tenths(self) -> None:
        """Several times a second; does something only while something runs or waits."""
        view = self._store.view
        if (view.running or view.waiting) and not self._store.gone:
            self.repaint("acts", "act", "scheduler")

    def key_pressed(self) -> None:
        """A notice has been read when the next key is pressed; so has the line that control was taken."""
        if self._store.taken is not None and self._taken_at and monotonic() - self._taken_at > NOTICE_LEAST:
            self._store.taken = None
            self._draw_call()
        if self._noticed is not None and monotonic() - self._noticed_at > NOTICE_LEAST:
            self.clear_notice()

    def clear_notice(self) -> None:
        self._store.notice = None
        self._draw_notice()

    def draw_bars(self) -> None:
        self.status.draw(self._store)
        self.alarm.draw(self._store)
        self._draw_call()
        self._draw_notice()
        self.draw_hints()

    def draw_hints(self) -> None:
        focused = self._panes.screen.focused
        if isinstance(focused, Input):
            self.hints.draw_typing("add the note" if isinstance(focused, NoteLine) else "take")
            return
        pane = self._panes.focused()
        own = list(at(pane.PLACE)) if pane is not None else []
        release = [BY_ID["release"]] if self._store.state == "STOPPED" else []
        if not BY_ID["control"].unavailable(self._store) and (self._store.asker or not self._store.has_control):
            release.append(BY_ID["control"])
        self.hints.draw([*release, *own], [BY_ID[name] for name in COMMON], self._store)

    def _paint(self) -> None:
        self._frame, self._painted = None, monotonic()
        dirty, self._dirty = self._dirty, set()
        for pane in self._panes.shown():
            if dirty & pane.TOPICS:
                pane.repaint()
        if dirty & {"status", "stop"}:
            self.status.draw(self._store)
            self.alarm.draw(self._store)
            self._draw_call()
        if "notice" in dirty:
            self._draw_notice()
        if dirty & {"stop", "tasks", "rules", "status"}:
            self.draw_hints()

    def _draw_call(self) -> None:
        self._taken_at = (self._taken_at or monotonic()) if self._store.taken is not None else 0.0
        self.call.draw(self._store)

    def _draw_notice(self) -> None:
        if self._store.notice is not self._noticed:
            self._noticed, self._noticed_at = self._store.notice, monotonic()
        self.notice.draw(self._store)
