"""When what is repainted: soon, never faster than a terminal can take, and only what differs (console.md 8.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import monotonic

from textual.timer import Timer
from textual.widgets import Input

from rise_tui.actions import BY_ID, actions_in, why_blocked
from rise_tui.console.layout import Layout
from rise_tui.model.cue import counts_tenths
from rise_tui.model.notice import Notice
from rise_tui.model.store import Store, StorePart
from rise_tui.widgets.alarm import AlarmBar, AttentionBar, FailureBar
from rise_tui.widgets.bars import KeyHints, NoticeLine, StatusLine
from rise_tui.widgets.mistake_line import MistakeLine
from rise_tui.widgets.note_line import NoteLine
from rise_tui.widgets.speech_band import KeyStrip, SpeechBand
from rise_tui.widgets.speech_input import SpeechField, SpeechInput

FRAME_SECONDS = 1 / 15
"""Seconds between two repaints while records pour in."""
PAINTING_SHARE = 1 / 8
"""Of the time, at most so much goes into painting while records pour in, however dear that is."""
LONGEST_PAUSE_SECONDS = 0.5
"""Whatever the last frame took: on a busy machine it may have been others that took it."""
NOTICE_SECONDS = 12.0
NOTICE_LEAST_SECONDS = 1.0
"""A notice stays this long, whatever is pressed."""
TENTH_SECONDS = 0.1
"""Seconds between two looks at the time since the cue, while it is counted."""
COMMON_ACTIONS = (
    *("stop", "say", "cue", "filler", "mistake", "palette", "help", "safe"),
    *("filter", "note", "lists", "next-pane", "zoom", "jump", "lock", "control"),
)
"""Actions that the hint line names for every pane."""


class RefreshScheduler:
    """The bars of the console, and the rhythm in which they and the panes follow the store."""

    def __init__(self, store: Store, panes: Layout, later: Callable[[float, Callable[[], None]], Timer]) -> None:
        self.status_line, self.alarm_bar, self.attention_bar = StatusLine(), AlarmBar(), AttentionBar()
        self.failure_bar = FailureBar()
        self.notice_line, self.key_hints = NoticeLine(), KeyHints()
        self.speech_band, self.key_strip = SpeechBand(), KeyStrip()
        self.speech_input, self.mistake_line = SpeechInput(store), MistakeLine()
        self._store, self._panes, self._later = store, panes, later
        self._dirty: set[StorePart] = set()
        self._frame: Timer | None = None
        self._cue_timer: Timer | None = None
        self._spent = 0.0
        """Seconds that it took to draw the latest frame."""
        self._painted = 0.0
        self._noticed: Notice | None = None
        self._noticed_at = 0.0
        self._some = False, False
        self._taken_at = 0.0

    def schedule(self, topics: frozenset[StorePart] | set[StorePart]) -> None:
        """The store changed; paint soon."""
        self._dirty |= topics
        if self._frame is None and self._panes.is_mounted:
            pause = max(FRAME_SECONDS, min(self._spent / PAINTING_SHARE, LONGEST_PAUSE_SECONDS))
            self._frame = self._later(max(0.001, self._painted + pause - monotonic()), self._paint)

    def repaint_panes(self, *names: str) -> None:
        """Paint these panes, those that can be seen, at once."""
        for pane in self._panes.visible_panes():
            if pane.SCOPE in names:
                pane.repaint()

    def draw_every_second(self) -> None:
        """Once a second."""
        self.status_line.draw(self._store)
        self.speech_band.draw(self._store)
        self.speech_input.draw()
        if self._store.cut_since is not None or self.alarm_bar.counts:
            self.alarm_bar.draw(self._store)
        self.repaint_panes("memory")
        if self._noticed is not None and monotonic() - self._noticed_at > NOTICE_SECONDS:
            self.clear_notice()

    def draw_every_half_second(self) -> None:
        """Several times a second; does something only while something runs or waits."""
        view = self._store.view
        if (view.running or view.waiting) and not self._store.gone_reason:
            self.repaint_panes("acts", "act", "scheduler")
            self.speech_input.draw()
        if self.speech_band.changes_by_tenths(self._store):
            self.speech_band.draw(self._store)

    def _tick_cue(self) -> None:
        """Several times a second, and only while somebody waits for an answer."""
        self._cue_timer = None
        self.status_line.draw(self._store)
        self._draw_notice()
        self._count_cue()

    def _count_cue(self) -> None:
        counts = (
            counts_tenths(self._store.view.cue, self._store.now())
            and not self._store.gone_reason
            and self._store.cut_since is None
        )
        if counts and self._cue_timer is None:
            self._cue_timer = self._later(TENTH_SECONDS, self._tick_cue)

    def dismiss_read_notices(self) -> None:
        """A notice has been read when the next key is pressed; so has the line that control was taken.

        They go with the next frame: what the key asks for comes first.
        """
        if (
            self._store.control_lost is not None
            and self._taken_at
            and monotonic() - self._taken_at > NOTICE_LEAST_SECONDS
        ):
            self._store.control_lost, self._taken_at = None, 0.0
            self.schedule({"status"})
        shown = self._noticed is not None and self._noticed is self._store.notice and self.notice_line.display
        if shown and monotonic() - self._noticed_at > NOTICE_LEAST_SECONDS:
            self._store.notice = None
            self.schedule({"notice"})

    def clear_notice(self) -> None:
        self._store.notice = None
        self._draw_notice()

    def fit_terminal(self) -> None:
        """The size of the terminal has changed, or is known now."""
        size = self._panes.app.size
        self.speech_band.fit_terminal(self._store, size)
        self.key_strip.fit_terminal(self._store, size)

    def draw_bars(self) -> None:
        self.status_line.draw(self._store)
        self.speech_band.draw(self._store)
        self.key_strip.draw(self._store)
        self.alarm_bar.draw(self._store)
        self._draw_call()
        self.failure_bar.draw(self._store)
        self._draw_notice()
        self.speech_input.draw()
        self.mistake_line.draw(self._store)
        self.draw_hints()

    def open_mistake(self, task: int) -> None:
        """Ask what was wrong about an act, where the notice stands."""
        self.notice_line.display = False
        self.mistake_line.open(task)
        self.mistake_line.draw(self._store)

    def draw_hints(self) -> None:
        focused = self._panes.screen.focused
        if isinstance(focused, SpeechField):
            self.key_hints.draw_saying(self._store, self.speech_input.effect, why_blocked(self._store, "start"))
            return
        if isinstance(focused, Input):
            self.key_hints.draw_typing(self._store, "add the note" if isinstance(focused, NoteLine) else "take")
            return
        pane = self._panes.focused_pane()
        own = list(actions_in(pane.SCOPE)) if pane is not None else []
        release = [BY_ID["release"]] if self._store.key_state == "STOPPED" else []
        if self._store.input_mode == "SAFE":
            release.append(BY_ID["safe"])
        if not BY_ID["control"].why_unavailable(self._store) and (self._store.asker or not self._store.has_control):
            release.append(BY_ID["control"])
        self.key_hints.draw([*release, *own], [BY_ID[name] for name in COMMON_ACTIONS], self._store)

    def _paint(self) -> None:
        self._painted = monotonic()
        self._frame = None
        dirty, self._dirty = self._dirty, set()
        for draw in self._jobs(dirty):
            draw()
        self._spent = monotonic() - self._painted

    def _jobs(self, dirty: set[StorePart]) -> Iterator[Callable[[], None]]:
        """What is to be drawn anew."""
        for pane in self._panes.visible_panes():
            if pane.is_affected_by(dirty):
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
        typing = self.speech_input.is_open or self.mistake_line.is_open
        if dirty & {"acts", "status", "stop"} or (typing and dirty & {"tasks", "memory"}):
            yield self._draw_fields
        some = bool(self._store.log.all), bool(self._store.view.memory)  # some actions are only for what there is
        if dirty & {"acts", "status", "stop"} or some != self._some:
            self._some = some
            yield self.draw_hints

    def _draw_status(self) -> None:
        self.status_line.draw(self._store)
        self._count_cue()

    def _draw_band(self) -> None:
        self.speech_band.draw(self._store)
        self.key_strip.draw(self._store)

    def _draw_alarm(self) -> None:
        self.alarm_bar.draw(self._store)
        self._draw_call()

    def _draw_failure(self) -> None:
        self.failure_bar.draw(self._store)

    def _draw_fields(self) -> None:
        self.speech_input.draw()
        self.mistake_line.draw(self._store)

    def _draw_call(self) -> None:
        self._taken_at = (self._taken_at or monotonic()) if self._store.control_lost is not None else 0.0
        self.attention_bar.draw(self._store)

    def _draw_notice(self) -> None:
        if self._store.notice is not self._noticed:
            self._noticed, self._noticed_at = self._store.notice, monotonic()
        self.notice_line.draw(self._store)
