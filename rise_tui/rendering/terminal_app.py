"""An app that writes only different cells, skips frames that its terminal cannot take, and sees every key first."""

from __future__ import annotations

import asyncio
import re
from collections import deque
from collections.abc import Awaitable, Callable, Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.control import Control
from rich.segment import Segment
from rich.style import Style
from textual import events
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.app import App
from textual.geometry import Size
from textual.message_pump import MessagePump
from textual.screen import Screen
from textual.strip import Strip
from textual.timer import Timer

from rise_tui.rendering.terminal_driver import TerminalDriver, TerminalWriter, read_together

GAP = 8
"""Up to this many equal cells between two different ones cost less than moving the cursor."""
SECOND = "\0"
"""The beginning of a wide character's second cell, so that it differs whenever the character does."""

Cell: TypeAlias = tuple[str, Style | None]


class CellRun(NamedTuple):
    """Cells to write from a position."""

    x: int
    y: int
    strip: Strip


class CellBuffer:
    """What was written so far. Call `forget` after anything else has written to the terminal."""

    def __init__(self) -> None:
        self._rows: list[list[Cell | None]] = []
        self._size = 0, 0

    @property
    def is_known(self) -> bool:
        """Whether anything was written since the last `forget`."""
        return self._size != (0, 0)

    def forget(self) -> None:
        """Forget everything: the next update is written in full."""
        self._rows, self._size = [], (0, 0)

    def resize(self, width: int, height: int) -> None:
        """Forget everything if the size has changed, because the window's contents are then unknown."""
        if self._size != (width, height):
            self._rows, self._size = [[None] * width for _ in range(height)], (width, height)

    def put(self, x: int, y: int, strip: Strip) -> list[CellRun]:
        """Take in new content at a position; returns what must be written for it."""
        if not 0 <= y < len(self._rows):
            return []
        row = self._rows[y]
        cells = cells_of(strip)[: max(0, len(row) - x)]
        before, row[x : x + len(cells)] = row[x : x + len(cells)], cells
        return [CellRun(x + start, y, strip_of(cells[start:end])) for start, end in differing_spans(before, cells)]


def cells_of(strip: Iterable[Segment]) -> list[Cell]:
    """One entry for each cell. Marks without a width belong to the cell before."""
    cells: list[Cell] = []
    for text, style, control in strip:
        if control:
            continue
        if text.isascii():
            cells += [(character, style) for character in text]
            continue
        for character in text:
            width = cell_len(character)
            if width:
                cells.append((character, style))
                cells += [(SECOND + character, style)] * (width - 1)
            elif cells:
                cells[-1] = (cells[-1][0] + character, cells[-1][1])
    return cells


def strip_of(cells: Iterable[Cell]) -> Strip:
    """Cells as a strip to write."""
    return Strip(
        [
            Segment("".join(text for text, _ in run if not text.startswith(SECOND)), style)
            for style, run in groupby(cells, key=lambda cell: cell[1])
        ]
    )


def differing_spans(before: Sequence[Cell | None], after: Sequence[Cell]) -> list[tuple[int, int]]:
    """The spans in which two rows differ. Spans that are close together become one."""
    found: list[tuple[int, int]] = []
    for x, (old, new) in enumerate(zip(before, after, strict=True)):
        if old == new:
            continue
        if found and x - found[-1][1] <= GAP:
            found[-1] = found[-1][0], x + 1
        else:
            found.append((x, x + 1))
    return found


# --- what of a repaint is sent ----------------------------------------------------------------------------------------

# Rich writes a full style before each piece and resets it afterwards. For a moved cursor in a list, that is half of the
# bytes sent. So style codes that change nothing are left out, too.


class DiffUpdate(CompositorUpdate):
    """An update, reduced to the cells that the terminal does not show yet.

    The stock updates write every cell of every repainted region. Opening or closing any dialog, and any change of
    focus, writes the whole screen, 27 kB at 120x40; leaving a row writes all of it.
    """

    def __init__(self, update: LayoutUpdate | ChopsUpdate, cells: CellBuffer, size: Size) -> None:
        """`cells`: the contents of a terminal of this size; it takes in what is written."""
        self._update, self._cells, self._size = update, cells, size

    def render_segments(self, console: Console) -> str:
        """The terminal's codes for the cells that differ."""
        self._cells.resize(*self._size)
        update = self._update
        runs = (
            _runs_of_lines(update, self._cells)
            if isinstance(update, LayoutUpdate)
            else _runs_of_chops(update, self._cells)
        )
        return shorten_styles(
            "".join(Control.move_to(run.x, run.y).segment.text + run.strip.render(console) for run in runs)
        )


def _runs_of_lines(update: LayoutUpdate, cells: CellBuffer) -> Iterator[CellRun]:
    for y, line in enumerate(update.strips, update.region.y):
        yield from cells.put(update.region.x, y, Strip.join(line))


def _runs_of_chops(update: ChopsUpdate, cells: CellBuffer) -> Iterator[CellRun]:
    """The runs of a partial update. A chop is a piece of a line between two borders; a span is the part to paint."""
    for y, start, end in update.spans:
        for (x, strip), chop_end in zip(update.chops[y].items(), update.chop_ends[y], strict=False):
            left, right = max(x, start), min(chop_end, end)
            if strip is not None and left < right:
                yield from cells.put(left, y, strip.crop(left - x, right - x))


# --- style codes ------------------------------------------------------------------------------------------------------

_STYLE = re.compile(r"\x1b\[([\d;]*)m")
_MOVE = re.compile(r"\x1b\[[\d;]*[A-HJKfdG]")
_COLOUR = re.compile(r"(?:^|;)((?:38|48);(?:5;\d+|2;\d+;\d+;\d+)|3[0-79]|4[0-79]|9[0-7]|10[0-7])(?=;|$)")
_SEEN_ON_BLANKS = frozenset("479")
"""Underlined, reversed, struck out."""


class _Style(NamedTuple):
    """The effect of a code; empty: the terminal's default."""

    attributes: str = ""
    """Bold and similar."""
    foreground: str = ""
    background: str = ""


def shorten_styles(codes: str) -> str:
    """The same text with the same look, without codes that change nothing. It begins and ends without a style.

    The colour of a blank is invisible, and may differ.
    """
    first, *rest = _STYLE.split(codes)
    written, shown, wanted = [first], _Style(), _Style()
    for parameters, text in zip(rest[::2], rest[1::2], strict=True):
        wanted = _read(parameters)
        if printed := _MOVE.sub("", text):
            is_blank = not printed.strip(" ")
            if not (is_blank and _looks_alike_on_blanks(shown, wanted)):
                written.append(_change(shown, wanted))
                shown = wanted
        written.append(text)
    written.append(_change(shown, _Style()))
    return "".join(written)


def _read(parameters: str) -> _Style:
    if parameters in ("", "0"):
        return _Style()
    colours = _COLOUR.findall(parameters)
    foreground = next((each for each in colours if each[0] in "39"), "")
    background = next((each for each in colours if each[0] in "41"), "")
    return _Style(_COLOUR.sub("", parameters).strip(";"), foreground, background)


def _looks_alike_on_blanks(one: _Style, other: _Style) -> bool:
    seen = _SEEN_ON_BLANKS & {*one.attributes.split(";"), *other.attributes.split(";")}
    return one.background == other.background and not seen


def _change(shown: _Style, wanted: _Style) -> str:
    """The codes from one style to another."""
    if shown == wanted:
        return ""
    if wanted == _Style():
        return "\x1b[0m"
    takes_back = any(before and not after for before, after in zip(shown[1:], wanted[1:], strict=True))
    if takes_back or shown.attributes not in ("", wanted.attributes):
        return f"\x1b[{';'.join(('0', *filter(None, wanted)))}m"
    return f"\x1b[{';'.join(after for before, after in zip(shown, wanted, strict=True) if after and after != before)}m"


CATCH_UP_SECONDS = 0.05
"""Seconds between two checks whether a slow terminal accepts more."""


class TerminalApp(App[Any]):
    """An app on a terminal that may be far away, slow, or gone."""

    def __init__(self, **options: Any) -> None:
        super().__init__(driver_class=TerminalDriver, **options)
        self._cells = CellBuffer()
        """What the terminal shows."""
        self._catching_up: Timer | None = None
        self.key_queue = KeyQueue(self, self._pass_on)

    # --- writing ----------------------------------------------------------------------------------------------------

    @property
    def terminal_writer(self) -> TerminalWriter | None:
        """The connection to the terminal; None without one (tests)."""
        writer = getattr(self._driver, "terminal_writer", None)
        return writer if isinstance(writer, TerminalWriter) else None

    def forget_terminal(self) -> None:
        """Forget what the terminal shows: the next paint is written in full."""
        self._cells.forget()

    def repaint_everything(self) -> None:
        """Write every cell again, after something else has written to the terminal."""
        self.forget_terminal()
        self.screen.refresh()

    def on_resize(self, event: events.Resize) -> None:
        """Repaint a window that has its old size again, because its contents are unknown after another size."""
        if event.size == self._size and self._cells.is_known:
            self.repaint_everything()

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        if not isinstance(renderable, LayoutUpdate | ChopsUpdate) or self._batch_count:
            super()._display(screen, renderable)
        elif self._is_behind:  # the newest state is painted when the terminal is ready
            self._catching_up = self._catching_up or self.set_interval(CATCH_UP_SECONDS, self._catch_up)
        else:
            super()._display(screen, DiffUpdate(renderable, self._cells, self.size))  # type: ignore[arg-type]

    @property
    def _is_behind(self) -> bool:
        return self.terminal_writer is not None and self.terminal_writer.is_behind

    def _catch_up(self) -> None:
        if self._catching_up is not None and not self._is_behind:
            self._catching_up.stop()
            self._catching_up = None
            self.screen.refresh()

    # --- keys -------------------------------------------------------------------------------------------------------

    def observe_key(self, event: events.Key, together: bool) -> None:
        """Called once for each key, before anything acts on it, including keys for a binding or a dialog.

        `together`: whether it came in one piece with other keys, as a paste does.
        """

    def admits(self, event: events.Event) -> bool:
        """Whether a keyboard or mouse event may go on. Called once for each; for keys after `observe_key`."""
        return True

    def handle_key_first(self, event: events.Key) -> bool:
        """Carry out a key immediately that nothing else could want; False: it goes its usual way."""
        return False

    def waits_for_keys(self, event: events.Key) -> bool:
        """Whether a key may be meant for what an earlier key opens. It then waits until that is open."""
        return False

    async def on_event(self, event: events.Event) -> None:
        """Handle an event. Input comes once from the driver, and again as it bubbles up; only the first counts."""
        if isinstance(event, events.InputEvent | events.Paste) and not event.is_forwarded:
            if isinstance(event, events.Key):
                self.observe_key(event, read_together(event))
                if self.waits_for_keys(event):
                    self.key_queue.put(event)
                    return
            await self._pass_on(event)
        else:
            await super().on_event(event)

    async def _pass_on(self, event: events.Event) -> None:
        if self.admits(event) and not (isinstance(event, events.Key) and self.handle_key_first(event)):
            await super().on_event(event)


def repaint_everything(app: App[Any]) -> None:
    """Write every cell again, if the app is on a terminal of ours."""
    if isinstance(app, TerminalApp):
        app.repaint_everything()


# --- keys, one after the other ----------------------------------------------------------------------------------------

# Textual gives a key to the widget with the focus when the key arrives. Over a slow line several keys come in one
# piece. Then `/` and the letters after it would all go to the list in which `/` opens a line.


LOOK_SECONDS = 0.004
"""Seconds between two checks whether a screen has opened, or work is done."""
MOST_LOOKS = 500
"""The most checks whether a key's effect is complete. The limit counts checks, not seconds: on a busy machine
everything takes longer, and a key that did not wait would go to the wrong field."""
ROUNDS = 3
"""Walks from the focus up to the app: for a key's message, that message's answer, and what it opens."""


@runtime_checkable
class WorkingScreen(Protocol):
    """A screen whose keys begin work that opens something at its end."""

    @property
    def is_working(self) -> bool:
        """Whether such work is in progress."""


class KeyQueue:
    """Passes keys on in order."""

    def __init__(self, app: App[Any], pass_on: Callable[[events.Key], Awaitable[None]]) -> None:
        self._app, self._pass_on = app, pass_on
        self._keys: deque[events.Key] = deque()
        self._task: asyncio.Task[None] | None = None

    @property
    def is_empty(self) -> bool:
        """Whether every key has been carried out."""
        return self._task is None

    def put(self, event: events.Key) -> None:
        """Pass this key on after those before it have been carried out."""
        self._keys.append(event)
        if self._task is None:
            self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        try:
            while self._keys:
                await self._pass_on(self._keys.popleft())
                carried_out = asyncio.create_task(self._carried_out())
                try:
                    for _ in range(MOST_LOOKS):
                        if (await asyncio.wait([carried_out], timeout=LOOK_SECONDS))[0]:
                            carried_out.result()
                            break
                finally:
                    carried_out.cancel()
        finally:
            self._task = None

    async def _carried_out(self) -> None:
        """Return when the last key, and the work that it began, is done."""
        for _ in range(ROUNDS):
            await self._go_round()
            while not self._is_ready:  # noqa: ASYNC110 - no event announces this
                await asyncio.sleep(LOOK_SECONDS)

    async def _go_round(self) -> None:
        """Wait until everything from the focus up to the app has handled its present messages."""
        stack = self._app.screen_stack
        node: MessagePump | None = (self._app.focused or stack[-1]) if stack else None
        while node is not None:
            done = asyncio.get_running_loop().create_future()
            if node.is_running and node.call_later(_set, done):
                await done
            node = node._parent

    @property
    def _is_ready(self) -> bool:
        stack = self._app.screen_stack
        if not stack:  # the key has ended the program
            return True
        if not stack[-1]._is_mounted or any(isinstance(each, WorkingScreen) and each.is_working for each in stack):
            return False
        return all(not node.message_queue_size for node in (self._app, *stack[-1].walk_children(with_self=True)))


def _set(done: asyncio.Future[None]) -> None:
    if not done.done():
        done.set_result(None)
