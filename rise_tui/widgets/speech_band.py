"""What the robot says and what comes next, and the study's own keys: two bars that always stand in their places."""

from __future__ import annotations

from textual import events
from textual.geometry import Size

from rise_tui.key_labels import key_name
from rise_tui.messages import RequestStart, RunAction
from rise_tui.model.key_action import action_of_key
from rise_tui.model.key_strip import KeyStripPiece, key_strip_height, key_strip_lines
from rise_tui.model.speech_band import sentence_height, speech_band_lines
from rise_tui.model.store import Store
from rise_tui.widgets.static_lines import StaticLines


class SpeechBand(StaticLines):
    """The sentence that the robot says, on every size, and what comes next if nobody does anything."""

    DEFAULT_CSS = """
    SpeechBand { height: 2; background: $surface; }
    """

    def fit_terminal(self, store: Store, size: Size) -> None:
        """Take as many lines as this session needs in a terminal of this size."""
        rows = sentence_height(store.scenario, store.scenario.memory, size.width, size.height) + 1
        if self.styles.height is None or self.styles.height.value != rows:
            self.styles.height = rows

    def draw(self, store: Store) -> None:
        height = self.styles.height
        rows = int(height.value) if height is not None else 2
        self.show(*speech_band_lines(store, self.size.width, rows - 1, key_name))


class KeyStrip(StaticLines):
    """The study's own keys; each can be clicked."""

    DEFAULT_CSS = """
    KeyStrip { height: 1; background: $surface; }
    """

    def __init__(self) -> None:
        super().__init__()
        self._pieces: tuple[KeyStripPiece, ...] = ()
        self._store: Store | None = None

    def fit_terminal(self, store: Store, size: Size) -> None:
        rows = key_strip_height(store.scenario, store.study_keys, size.width, size.height)
        if self.styles.height is None or self.styles.height.value != rows:
            self.styles.height = rows
            self.display = rows > 0

    def draw(self, store: Store) -> None:
        self._store = store
        height = self.styles.height
        found = key_strip_lines(store, self.size.width, int(height.value) if height is not None else 1)
        self._pieces = found.pieces
        self.show(*found.lines)

    def on_click(self, event: events.Click) -> None:
        for key, line, start, end in self._pieces:
            if line != event.y or not start <= event.x < end or self._store is None:
                continue
            if key is None:
                self.post_message(RunAction("help"))
                return
            self.post_message(RequestStart(action_of_key(self._store.scenario, key)))
            return
