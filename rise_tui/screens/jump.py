"""Jump mode: a letter on every list, pane and tab. The letter goes there; every other key leaves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from textual import events
from textual.app import ComposeResult
from textual.geometry import Region

from rise_tui.rendering.modal import SingleDismissModal
from rise_tui.rendering.text import StyledLine, StyledSpan, crop
from rise_tui.widgets.static_lines import StaticLines

LETTERS = {"acts": "a", "rules": "r", "rule": "u", "act": "c", "memory": "m", "log": "l", "scheduler": "s"}
"""The letters never change, so that wizards can learn them."""


class TitleLabels(NamedTuple):
    """The labels over one title bar."""

    region: Region
    line: StyledLine


def label_line(titles: Sequence[tuple[str, str, bool]]) -> StyledLine:
    """Letter and title of each tab; the front tab is emphasised. A letter takes one cell more than its spaces."""
    spans: list[StyledSpan] = []
    for letter, title, front in titles:
        spans += [(f"[{letter}]", "key"), (title.upper() if front else title.lower(), "strong" if front else "muted")]
    return tuple(spans)


class JumpScreen(SingleDismissModal[str]):
    """The labels over the console; the result is the pane to go to, or empty."""

    DEFAULT_CSS = """
    JumpScreen { background: transparent; }
    JumpScreen StaticLines { position: absolute; background: $rise-bar-focused; }
    """

    def __init__(self, labels: Iterable[TitleLabels], hints_region: Region) -> None:
        """`labels`: one for each title bar. `hints_region`: the place of the key hints, which this text replaces."""
        super().__init__()
        usage: StyledLine = (("  press a letter to go there", "strong"), ("   esc", "key"), (" leaves", "plain"))
        self._labels = [*labels, TitleLabels(hints_region, crop(usage, hints_region.width))]

    def compose(self) -> ComposeResult:
        for region, line in self._labels:
            bar = StaticLines()
            bar.styles.width, bar.styles.height = region.width, 1
            bar.styles.offset = region.offset
            bar.show(line)
            yield bar

    def on_key(self, event: events.Key) -> None:
        event.stop()
        event.prevent_default()
        self.dismiss(next((name for name, letter in LETTERS.items() if letter == event.key), ""))

    def on_click(self) -> None:
        self.dismiss("")

    def on_mount(self) -> None:
        self._terminal_size = self.app.size
        """The terminal size for which the labels are in the right places."""

    def on_resize(self) -> None:
        if self.app.size != self._terminal_size:
            self.dismiss("")
