"""What the robot says and what comes next, and the study's own keys: two bars that always stand in their places."""

from __future__ import annotations

from textual import events
from textual.geometry import Size

from rise_tui.key_labels import key_name
from rise_tui.messages import RequestStart, RunAction
from rise_tui.model.key_action import action_of_key
from rise_tui.model.key_strip import KeyStripPiece, key_strip_height, key_strip_lines
from rise_tui.model.speech_band import sentence_height, speech_band_lines
from rise_tui.widgets.static_lines import StoreLines


class SpeechBand(StoreLines):
    """The sentence that the robot says, on every size, and what comes next if nobody does anything."""

    DEFAULT_CSS = """
    SpeechBand { height: 2; background: $surface; }
    """

    _sentence_rows = 1

    def fit_terminal(self, size: Size) -> None:
        """Take as many lines as this session needs in a terminal of this size."""
        scenario = self.store.scenario
        self._sentence_rows = sentence_height(
            scenario, {**scenario.table_memory, **scenario.memory}, size.width, size.height
        )
        self.styles.height = self._sentence_rows + 1

    def draw(self) -> None:
        self.show(*speech_band_lines(self.store, self.size.width, self._sentence_rows, key_name))


class KeyStrip(StoreLines):
    """The study's own keys; each can be clicked."""

    DEFAULT_CSS = """
    KeyStrip { height: 1; background: $surface; }
    """

    _rows = 1
    _pieces: tuple[KeyStripPiece, ...] = ()

    def fit_terminal(self, size: Size) -> None:
        """The same."""
        self._rows = key_strip_height(self.store.scenario, self.store.study_keys, size.width, size.height)
        self.styles.height = self._rows
        self.display = self._rows > 0

    def draw(self) -> None:
        found = key_strip_lines(self.store, self.size.width, self._rows)
        self._pieces = found.pieces
        self.show(*found.lines)

    def on_click(self, event: events.Click) -> None:
        for key, line, start, end in self._pieces:
            if line == event.y and start <= event.x < end:
                action = RequestStart(action_of_key(self.store.scenario, key)) if key is not None else RunAction("help")
                self.post_message(action)
