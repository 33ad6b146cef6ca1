"""The bars around the panes, and the times of repaints.

Repaints come soon, never faster than a terminal accepts, and only for differences (console.md 8.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import monotonic

from textual.geometry import Size
from textual.timer import Timer
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.actions import BY_ID, ConsoleAction, actions_in
from rise_tui.console.layout import Layout
from rise_tui.key_labels import why_blocked, why_unavailable
from rise_tui.model.control import LOCKED_ACTIONS
from rise_tui.model.cue import counts_tenths
from rise_tui.model.notice import Notice
from rise_tui.model.speech_band import changes_by_tenths
from rise_tui.model.store import Store, StorePart
from rise_tui.widgets.bars import (
    AlarmBar,
    AttentionBar,
    FailureBar,
    KeyHints,
    KeyStrip,
    NoticeLine,
    ShadowBar,
    SpeechBand,
    StatusLine,
)
from rise_tui.widgets.fields import MistakeLine, NoteLine
from rise_tui.widgets.speech_input import SpeechField, SpeechInput

COMMON_ACTIONS = (
    *("stop", "stop-running", "say", "cue", "filler", "mistake", "palette", "help", "safe"),
    *("filter", "note", "lists", "next-pane", "zoom", "jump", "lock", "control"),
)
"""Actions that the hint line shows for every pane."""

FRAME_SECONDS = 1 / 15
"""Seconds between two repaints while many records arrive."""
PAINTING_SHARE = 1 / 8
"""Maximum share of time for painting while many records arrive, however slow painting is."""
LONGEST_PAUSE_SECONDS = 0.5
"""Maximum pause in seconds, whatever the last frame took: on a busy machine, other programs may have taken the time."""
NOTICE_SECONDS = 12.0
NOTICE_MIN_SECONDS = 1.0
"""Minimum time in seconds that a notice stays, whatever the wizard presses."""
TENTH_SECONDS = 0.1
"""Seconds between two updates of the time since the cue."""


class ConsoleBars:
    """All bars, composed by the console, and the rhythm in which they and the panes follow the store."""

    def __init__(self, store: Store, panes: Layout, set_timer: Callable[[float, Callable[[], None]], Timer]) -> None:
        """`panes`: the area between the bars. The hints belong to the pane with the focus."""
        self._store, self._panes, self._set_timer = store, panes, set_timer
        self.status_line, self.speech_band, self.shadow_bar = StatusLine(store), SpeechBand(store), ShadowBar(store)
        self.alarm_bar, self.attention_bar, self.failure_bar = AlarmBar(store), AttentionBar(store), FailureBar(store)
        self.notice_line, self.mistake_line, self.note_line = NoticeLine(store), MistakeLine(store), NoteLine()
        self.speech_input, self.key_strip, self.key_hints = SpeechInput(store), KeyStrip(store), KeyHints()
        self._dirty: set[StorePart] = set()
        self._frame: Timer | None = None
        self._cue_timer: Timer | None = None
        self._spent = 0.0
        """Seconds for drawing the latest frame."""
        self._painted = 0.0
        """The time of that frame, on the monotonic clock."""
        self._notice: Notice | None = None
        """The shown notice, and since when, on the monotonic clock."""
        self._notice_at = 0.0
        self._control_lost_at = 0.0
        """Since when the line about lost control is shown, on the monotonic clock; 0: it is not."""
        self._has_rows = False, False
        """Whether the log and the memory had rows when the hints were last drawn."""
        self._draw_by_parts: tuple[tuple[frozenset[StorePart], Callable[[], None]], ...] = (
            (frozenset({"status", "stop", "cue"}), self._draw_status),
            (frozenset({"acts", "rules", "memory", "status", "stop", "cue"}), self.speech_band.draw),
            (frozenset({"acts", "rules", "memory", "status", "stop", "cue"}), self.key_strip.draw),
            (frozenset({"status", "cue"}), self.shadow_bar.draw),
            (frozenset({"status", "stop"}), self._draw_alarms),
            (frozenset({"acts", "tasks", "status", "stop", "memory"}), self.failure_bar.draw),
            (frozenset({"notice", "cue", "acts"}), self._draw_notice),
        )
        """The parts of the store that each bar shows."""

    def widgets_above(self) -> Iterator[Widget]:
        """The bars above the panes, from the top."""
        yield from (self.status_line, self.shadow_bar, self.speech_band)
        yield from (self.alarm_bar, self.attention_bar, self.failure_bar)

    def widgets_below(self) -> Iterator[Widget]:
        """The bars below the panes."""
        yield from (self.notice_line, self.mistake_line, self.note_line)
        yield from (self.speech_input, self.key_strip, self.key_hints)

    def fit_terminal(self, size: Size) -> None:
        """Give the bars of variable height their rows in a terminal of this size."""
        self.speech_band.fit_terminal(size)
        self.key_strip.fit_terminal(size)

    @property
    def is_typing(self) -> bool:
        """Whether a line is open that shows the state of tasks and values."""
        return self.speech_input.is_open or self.mistake_line.is_open

    def open_mistake(self, task: int) -> None:
        """Ask about the error of a task, in the place of the notice."""
        self.notice_line.display = False
        self.mistake_line.open(task)
        self.mistake_line.draw()

    def open_note(self, text: str) -> None:
        """Ask for a note, beginning with `text`, in the place of the notice."""
        self.notice_line.display = False
        self.note_line.open(text)

    def draw_open_lines(self) -> None:
        """Draw the lines for typing and choosing, including the closed say line."""
        self.speech_input.draw()
        self.mistake_line.draw()

    def draw_keys(self) -> None:
        """Draw the study's keys and the hints, because something has covered or uncovered the screen."""
        self.key_strip.draw()
        self.draw_hints()

    def draw_hints(self) -> None:
        """Draw the effects of keys now, for the pane with the focus."""
        focused, store = self._panes.screen.focused, self._store
        if store.is_covered:
            self.key_hints.draw_covered(store)
        elif store.input_mode == "LOCKED":
            self.key_hints.draw((), [BY_ID[id] for id in LOCKED_ACTIONS], store)
        elif isinstance(focused, SpeechField):
            self.key_hints.draw_speech_hints(store, self.speech_input.effect, why_blocked(store, "start"))
        elif isinstance(focused, Input):
            self.key_hints.draw_typing(store, "add the note" if isinstance(focused, NoteLine) else "take")
        else:
            pane = self._panes.focused_pane()
            own = list(actions_in(pane.SCOPE)) if pane is not None else []
            self.key_hints.draw([*self._urgent_actions(), *own], [BY_ID[id] for id in COMMON_ACTIONS], store)

    def _urgent_actions(self) -> Iterator[ConsoleAction]:
        """Yield the first needs of a wizard who cannot act, or must answer a question."""
        store = self._store
        if store.key_state == "STOPPED":
            yield BY_ID["release"]
        if store.input_mode == "SAFE":
            yield BY_ID["safe"]
        if not why_unavailable(BY_ID["control"], store) and (store.asker or not store.has_control):
            yield BY_ID["control"]

    # --- when to draw -----------------------------------------------------------------------------------------------

    def schedule(self, parts: frozenset[StorePart] | set[StorePart]) -> None:
        """Paint changed parts of the store soon."""
        self._dirty |= parts
        if self._frame is None and self._panes.is_mounted:
            pause = max(FRAME_SECONDS, min(self._spent / PAINTING_SHARE, LONGEST_PAUSE_SECONDS))
            self._frame = self._set_timer(max(0.001, self._painted + pause - monotonic()), self._paint)

    def repaint_panes(self, *names: str) -> None:
        """Repaint the visible ones of these panes immediately."""
        for pane in self._panes.visible_panes():
            if pane.SCOPE in names:
                pane.repaint()

    def draw_all(self) -> None:
        """Draw every bar, changed or not."""
        for _, draw in self._draw_by_parts:
            draw()
        self.draw_open_lines()
        self.draw_hints()

    # --- updates by the clock ---------------------------------------------------------------------------------------

    def draw_every_second(self) -> None:
        """Draw everything that changes with the clock, once a second."""
        store = self._store
        self.status_line.draw()
        self.speech_band.draw()
        self.speech_input.draw()
        if store.cut_since is not None or store.silent_seconds or self.alarm_bar.counts:
            self.alarm_bar.draw()
        if store.view.repeats:
            self.failure_bar.draw()
        self.repaint_panes("memory")
        if self._notice is not None and monotonic() - self._notice_at > NOTICE_SECONDS:
            self.clear_notice()

    def draw_every_half_second(self) -> None:
        """Draw running times twice a second, while something runs or waits."""
        view = self._store.view
        if (view.running or view.waiting) and not self._store.gone_reason:
            self.repaint_panes("acts", "act", "scheduler")
            self.speech_input.draw()
        if changes_by_tenths(self._store):
            self.speech_band.draw()

    def _draw_every_tenth(self) -> None:
        """Draw ten times a second, while a cue waits for an answer."""
        self._cue_timer = None
        self._draw_status()
        self._draw_notice()

    def _draw_in_a_tenth(self) -> None:
        """Draw again in a tenth of a second if a cue is counted."""
        store = self._store
        counts = counts_tenths(store.cue_clock, store.now()) and not store.gone_reason and store.cut_since is None
        if counts and self._cue_timer is None:
            self._cue_timer = self._set_timer(TENTH_SECONDS, self._draw_every_tenth)

    # --- notices ------------------------------------------------------------------------------------------------------

    def dismiss_read_notices(self) -> None:
        """Dismiss the read notices: the next key counts as reading, also for the line about lost control.

        They go with the next frame, because the key's own effect comes first.
        """
        store = self._store
        lost = store.control_lost is not None and self._control_lost_at
        if lost and monotonic() - self._control_lost_at > NOTICE_MIN_SECONDS:
            store.control_lost, self._control_lost_at = None, 0.0
            self.schedule({"status"})
        shown = self._notice is not None and self._notice is store.notice and self.notice_line.display
        if shown and monotonic() - self._notice_at > NOTICE_MIN_SECONDS:
            store.notice = None
            self.schedule({"notice"})

    def clear_notice(self) -> None:
        self._store.notice = None
        self._draw_notice()

    # --- frames -------------------------------------------------------------------------------------------------------

    def _paint(self) -> None:
        self._painted = monotonic()
        self._frame = None
        dirty, self._dirty = self._dirty, set()
        for pane in self._panes.visible_panes():
            if pane.is_affected_by(dirty):
                pane.repaint()
        for parts, draw in self._draw_by_parts:
            if dirty & parts:
                draw()
        if dirty & {"acts", "status", "stop"} or (self.is_typing and dirty & {"tasks", "memory"}):
            self.draw_open_lines()
        has_rows = bool(self._store.log.all), bool(self._store.view.memory)  # some actions need rows
        if dirty & {"acts", "status", "stop"} or has_rows != self._has_rows:
            self._has_rows = has_rows
            self.draw_hints()
        self._spent = monotonic() - self._painted

    def _draw_status(self) -> None:
        self.status_line.draw()
        self._draw_in_a_tenth()

    def _draw_alarms(self) -> None:
        self._control_lost_at = (self._control_lost_at or monotonic()) if self._store.control_lost is not None else 0.0
        self.alarm_bar.draw()
        self.attention_bar.draw()

    def _draw_notice(self) -> None:
        if self._store.notice is not self._notice:
            self._notice, self._notice_at = self._store.notice, monotonic()
        self.notice_line.draw()
