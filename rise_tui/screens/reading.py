"""Texts to read over another screen: a task of the log, a long value, the report of a session that has ended."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import NamedTuple

from textual import events, on, work
from textual.app import ComposeResult

from rise_engine.results.report.document import Document
from rise_engine.results.report.page import WIDTH, text_lines
from rise_tui.rendering.text import ListRow, TextRole, crop, wrap
from rise_tui.screens.dialog import SingleDismissModal, TitledBox
from rise_tui.widgets.lines import RowList, RowView

REFRESH_SECONDS = 0.5
"""Seconds until a changed row is shown."""


class DetailScreen(SingleDismissModal[str]):
    """Shows rows until the wizard leaves. The result is the pressed letter, empty for none."""

    DEFAULT_CSS = """
    DetailScreen {
        align: center middle; background: transparent;
        #box { width: 100; max-height: 80%; border-title-color: $foreground; }
        RowList { height: auto; max-height: 100%; background: $panel; }
    }
    """

    def __init__(
        self,
        title: str,
        rows: Callable[[int], Sequence[ListRow]],
        letters: Sequence[tuple[str, str]] = (),
        step: Callable[[int], None] | None = None,
    ) -> None:
        """`rows` makes the rows for a width. `letters`: keys with their effects, in a word or two.

        `step`: goes to the previous (-1) or next (1) text, with the left and right arrows; without it there is only
        one.
        """
        super().__init__()
        self._title, self._make_rows = title, rows
        self._letters, self._step = dict(letters), step
        self.list = RowList(id="reading-rows")

    def compose(self) -> ComposeResult:
        steps = ["←→ others"] if self._step is not None else []
        letters = [f"{key} {does}" for key, does in self._letters.items()]
        with TitledBox(self._title, " · ".join(["esc closes", *steps, *letters])):
            yield self.list

    def on_mount(self) -> None:
        self.set_focus(self.list)
        self.set_interval(REFRESH_SECONDS, self._draw)
        self.call_after_refresh(self._draw)

    @on(RowView.Resized)
    def _draw(self) -> None:
        if (width := self.list.row_width) > 0:
            rows = [row._replace(selectable=False) for row in self._make_rows(width)]
            self.list.styles.height = len(rows)
            self.list.show(rows)

    def on_key(self, event: events.Key) -> None:
        if event.key in ("escape", "enter"):
            self.dismiss("")
        elif event.key in self._letters:
            self.dismiss(event.key)
        elif event.key in ("left", "right") and self._step is not None:
            self._step(-1 if event.key == "left" else 1)
            self._draw()
        else:
            return
        event.stop()
        event.prevent_default()


RULE = "\u2500"
KEYS = "esc closes · ↑↓ pgup pgdn · ←→ section"


class ReportOf(NamedTuple):
    """A session whose report can be read."""

    title: str
    """`P07, run 2`."""
    folder: str
    """The name of its folder."""


class ReadingList(RowList):
    """Lines to read. Page keys scroll, because no line can be selected."""

    def action_page(self, direction: int) -> None:
        self.scroll_relative(y=direction * max(1, self.size.height - 2), animate=False)


class ReportScreen(SingleDismissModal[None]):
    """Shows the report of one session, and can switch between several."""

    DEFAULT_CSS = """
    ReportScreen {
        align: center middle; background: transparent;
        #box { width: 86; max-width: 100%; height: 100%; padding: 0; border-title-color: $foreground; }
        RowList { background: $panel; }
    }
    """

    def __init__(self, sessions: Sequence[ReportOf], make: Callable[[str], Document]) -> None:
        """
        :param sessions: the sessions whose reports can be read; the last one is shown first.
        :param make: makes the report of a session by its folder's name; may take long, raises RiseError with a
            sentence, and is called off the loop.
        """
        super().__init__()
        self._sessions, self._make = list(sessions), make
        self._shown = len(self._sessions) - 1
        self._document: Document | None = None
        self.list = ReadingList(id="report-rows")

    @property
    def text(self) -> str:
        """The text of the report."""
        return self.list.text

    def compose(self) -> ComposeResult:
        keys = KEYS + (" · [ ] other session" if len(self._sessions) > 1 else "")
        with TitledBox(self._title, keys):
            yield self.list

    @property
    def _title(self) -> str:
        of = self._sessions[self._shown].title
        return f"{of} ({self._shown + 1} of {len(self._sessions)})" if len(self._sessions) > 1 else of

    def on_mount(self) -> None:
        self.set_focus(self.list)
        self._load()

    def _load(self) -> None:
        self._document = None
        self.query_one("#box").border_title = f" {self._title} "
        self._show(["", " reading the record …"])
        self._read(self._sessions[self._shown].folder)

    @work(group="report", exclusive=True)
    async def _read(self, folder: str) -> None:
        try:
            self._document = await asyncio.to_thread(self._make, folder)
        except Exception as error:  # after any error: a report must not close the screen of a study
            self._show(["", *(f" {line}" for line in wrap(f"there is no report: {error}", self._width - 2))])
            return
        await self._lay_out(self._document)

    async def _lay_out(self, document: Document) -> None:
        width = self._width
        lines = await asyncio.to_thread(text_lines, document, width - 2)
        self._show([f" {line}" for line in lines])
        self.list.scroll_to(y=0, animate=False)

    @property
    def _width(self) -> int:
        return self.list.row_width or WIDTH

    @on(RowView.Resized)
    def _resized(self) -> None:
        if self._document is not None:
            again: Callable[[], Awaitable[None]] = partial(self._lay_out, self._document)
            self.run_worker(again, group="report", exclusive=True)

    def _show(self, lines: Sequence[str]) -> None:
        rows = []
        for at, line in enumerate(lines):
            following = lines[at + 1] if at + 1 < len(lines) else ""
            role: TextRole = "plain"
            if line.strip() and set(line.strip()) == {RULE}:
                role = "muted"
            elif following.strip() and set(following.strip()) == {RULE}:
                role = "strong"
            elif line.startswith(" !!"):
                role = "wait"
            rows.append(ListRow(str(at), crop(((line, role),), max(1, self._width)), selectable=False))
        self.list.show(rows)

    # --- keys -------------------------------------------------------------------------------------------------------

    def on_key(self, event: events.Key) -> None:
        if event.key in ("escape", "enter"):
            self.dismiss(None)
        elif event.key in ("left", "right"):
            self._go_to_section(-1 if event.key == "left" else 1)
        elif event.key in ("left_square_bracket", "right_square_bracket"):
            self._go_to_session(-1 if event.key == "left_square_bracket" else 1)
        elif event.key == "space":
            self.list.action_page(1)
        else:
            return
        event.stop()
        event.prevent_default()

    def _go_to_section(self, direction: int) -> None:
        """Go to the beginning of the next section, or of the previous one."""
        lines = self.list.text.split("\n")
        starts = [0, *(at - 1 for at, line in enumerate(lines) if at > 0 and _underlines(line, lines[at - 1]))]
        now = round(self.list.scroll_y)
        later = [start for start in starts if (start > now if direction > 0 else start < now)]
        if later:
            self.list.scroll_to(y=min(later) if direction > 0 else max(later), animate=False)

    def _go_to_session(self, direction: int) -> None:
        shown = self._shown + direction
        if 0 <= shown < len(self._sessions):
            self._shown = shown
            self._load()


def _underlines(line: str, before: str) -> bool:
    """Whether a line underlines a section's title: it is as long as the title."""
    rule = line.strip()
    return bool(rule) and set(rule) == {RULE} and len(rule) == len(before.strip())
