"""The bars above and below the panes, and the part of the store that each of them shows."""

from __future__ import annotations

from collections.abc import Iterator

from textual.geometry import Size
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.actions import BY_ID, ConsoleAction, actions_in
from rise_tui.console.layout import Layout
from rise_tui.key_labels import why_blocked, why_unavailable
from rise_tui.model.control import LOCKED_ACTIONS
from rise_tui.model.store import Store
from rise_tui.widgets.alarm import AlarmBar, AttentionBar, FailureBar, ShadowBar
from rise_tui.widgets.bars import KeyHints, KeyStrip, NoticeLine, SpeechBand, StatusLine
from rise_tui.widgets.mistake_line import MistakeLine
from rise_tui.widgets.prompt_bar import NoteLine
from rise_tui.widgets.speech_input import SpeechField, SpeechInput

COMMON_ACTIONS = (
    *("stop", "say", "cue", "filler", "mistake", "palette", "help", "safe"),
    *("filter", "note", "lists", "next-pane", "zoom", "jump", "lock", "control"),
)
"""Actions that the hint line shows for every pane."""


class ConsoleBars:
    """Created and composed by the console. `RefreshScheduler` decides when each is drawn."""

    def __init__(self, store: Store, panes: Layout) -> None:
        """`panes`: the area between the bars. The hints belong to the pane with the focus."""
        self._store, self._panes = store, panes
        self.status_line, self.speech_band, self.shadow_bar = StatusLine(store), SpeechBand(store), ShadowBar(store)
        self.alarm_bar, self.attention_bar, self.failure_bar = AlarmBar(store), AttentionBar(store), FailureBar(store)
        self.notice_line, self.mistake_line, self.note_line = NoticeLine(store), MistakeLine(store), NoteLine()
        self.speech_input, self.key_strip, self.key_hints = SpeechInput(store), KeyStrip(store), KeyHints()

    def widgets_above(self) -> Iterator[Widget]:
        """The bars above the panes, from the top."""
        yield from (self.status_line, self.shadow_bar, self.speech_band)
        yield from (self.alarm_bar, self.attention_bar, self.failure_bar)

    def widgets_below(self) -> Iterator[Widget]:
        """The bars below the panes."""
        yield from (self.notice_line, self.mistake_line, self.note_line)
        yield from (self.speech_input, self.key_strip, self.key_hints)

    def fit_terminal(self, size: Size) -> None:
        """Give the bars of variable height the rows that a terminal of this size has for them."""
        self.speech_band.fit_terminal(size)
        self.key_strip.fit_terminal(size)

    @property
    def is_typing(self) -> bool:
        """Whether a line is open that shows the state of tasks and values."""
        return self.speech_input.is_open or self.mistake_line.is_open

    def open_mistake(self, task: int) -> None:
        """Ask what was wrong about a task, in the place of the notice."""
        self.notice_line.display = False
        self.mistake_line.open(task)
        self.mistake_line.draw()

    def open_note(self, text: str) -> None:
        """Ask for a note, beginning with `text`, in the place of the notice."""
        self.notice_line.display = False
        self.note_line.open(text)

    def draw_open_lines(self) -> None:
        """Draw the lines for typing and choosing, including the say line when it is closed."""
        self.speech_input.draw()
        self.mistake_line.draw()

    def draw_hints(self) -> None:
        """Draw what keys do now, for the pane with the focus."""
        focused, store = self._panes.screen.focused, self._store
        if store.input_mode == "LOCKED":
            self.key_hints.draw((), [BY_ID[id] for id in LOCKED_ACTIONS], store)
        elif isinstance(focused, SpeechField):
            self.key_hints.draw_saying(store, self.speech_input.effect, why_blocked(store, "start"))
        elif isinstance(focused, Input):
            self.key_hints.draw_typing(store, "add the note" if isinstance(focused, NoteLine) else "take")
        else:
            pane = self._panes.focused_pane()
            own = list(actions_in(pane.SCOPE)) if pane is not None else []
            self.key_hints.draw([*self._urgent_actions(), *own], [BY_ID[id] for id in COMMON_ACTIONS], store)

    def _urgent_actions(self) -> Iterator[ConsoleAction]:
        """What a wizard who cannot act, or is asked a question, needs first."""
        store = self._store
        if store.key_state == "STOPPED":
            yield BY_ID["release"]
        if store.input_mode == "SAFE":
            yield BY_ID["safe"]
        if not why_unavailable(BY_ID["control"], store) and (store.asker or not store.has_control):
            yield BY_ID["control"]
