"""Screens over the whole console: a window that is too small, a letter on every pane and tab, the boxes of the tour."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from textual import events
from textual.app import App, ComposeResult
from textual.geometry import Offset, Region, Size

from rise_tui.actions import ACTIONS
from rise_tui.key_labels import key_name
from rise_tui.model.alarms import current_alarms
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, StyledSpan, crop, fixed_span, wrap
from rise_tui.screens.dialog import SingleDismissModal
from rise_tui.widgets.lines import StaticLines

REFRESH_SECONDS = 0.5
MIN_SIZE = (50, 15)
"""Columns and rows below which nothing is readable."""


def is_too_small(width: int, height: int) -> bool:
    """Whether a terminal is too small for a console."""
    return width < MIN_SIZE[0] or height < MIN_SIZE[1]


def too_small_lines(size: Size, store: Store | None) -> list[StyledLine]:
    """Sentences in the available room, the most important first."""
    alarms = current_alarms(store, key_name) if store is not None else []
    head: list[StyledLine] = [crop(alarms[0].head, size.width)] if alarms else []
    stop, leave = key_name("stop"), key_name("quit")
    sentences = [
        f"This window has {size.width} x {size.height} cells; the console needs {MIN_SIZE[0]} x {MIN_SIZE[1]}.",
        f"{stop} stops everything, {leave} leaves. No other key works here.",
        f"{'The session goes on. ' if store is not None else ''}Make the window larger or the font smaller.",
    ]
    lines: list[StyledLine] = [((line, "plain"),) for text in sentences for line in wrap(text, max(8, size.width))]
    return [*head, *lines][: size.height]


class TooSmallScreen(SingleDismissModal[None]):
    """Covers everything until the window is large enough."""

    COVERS = False
    DEFAULT_CSS = """
    TooSmallScreen { background: $background; }
    TooSmallScreen StaticLines { height: 100%; }
    """

    def __init__(self, store: Store | None) -> None:
        """`store`: of the running session; None without one."""
        super().__init__()
        self._store = store
        self.lines = StaticLines()

    def compose(self) -> ComposeResult:
        yield self.lines

    def on_mount(self) -> None:
        self.set_interval(REFRESH_SECONDS, self._draw)

    def _draw(self) -> None:
        size = self.app.size
        if is_too_small(*size):
            self.lines.show(*too_small_lines(size, self._store))
        else:
            self.dismiss(None)  # has no effect below a question, which is answered first

    def on_resize(self) -> None:
        self._draw()

    def on_screen_resume(self) -> None:
        self._draw()

    def on_key(self, event: events.Key) -> None:
        event.stop()
        event.prevent_default()


def show_when_too_small(app: App[object], store: Store | None) -> None:
    """Show the required size if the window is too small for a console. `store`: None: no session runs."""
    if is_too_small(*app.size) and not any(isinstance(screen, TooSmallScreen) for screen in app.screen_stack):
        app.push_screen(TooSmallScreen(store))


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

    COVERS = False
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


FRESH_SECONDS = 60.0
WIDTH = 60
FOLLOW_SECONDS = 0.5
"""Seconds until a box follows its part of the screen when an alarm moves it."""


class TourStep(NamedTuple):
    """One box, and the id of the part of the screen that it points at."""

    part: str
    title: str
    template: str
    """The text, with keys by their actions: `{stop}`."""

    @property
    def text(self) -> str:
        return self.template.format_map({action.id: key_name(action.id) for action in ACTIONS})


STEPS = (
    TourStep(
        "status",
        "The top line",
        "Who takes part and in which condition, DEBUG or REAL, the robot and its link, the time, and whether your keys "
        "start anything. LIVE: they do. {cue} marks the end of the participant's turn, and the time since then is "
        "counted here. Below it: what the robot says, word for word, and what comes next if nobody does anything.",
    ),
    TourStep(
        "acts",
        "What you start",
        "Acts and rules, each with its key and its state in words. Press the key, or choose the row and press Enter "
        "twice. {safe} changes between LIVE and SAFE: in SAFE nothing starts while you look around. {lock} locks the "
        "keys.",
    ),
    TourStep(
        "stop",
        "Stop",
        "{stop} stops the robot and everything else at once, also while you type or read this. A red bar says who has "
        "confirmed it. Nothing starts until {release} releases the stop.",
    ),
    TourStep(
        "watching",
        "What you watch",
        "Rule shows where the study is and why: what each transition waits for, and which of your keys triggers "
        "it. {next-pane} goes to the next pane, {jump} and a letter to any of them.",
    ),
    TourStep(
        "hints",
        "Finding the rest",
        "Above this line are the keys of your study, those that it waits for first; this line names the console's. "
        "{help} explains all of them, {palette} finds any command by "
        "name, {quit} leaves: the session goes on without you, or ends if you say so.",
    ),
)
"""The boxes, in the order of a wizard's questions."""


def is_tour_due(store: Store) -> bool:
    """Whether this is a good moment for the tour: a wizard's own session that has just begun."""
    quiet = not (store.gone_reason or store.attach_reply.is_recorded or store.view.tasks or store.view.stop.latched)
    return quiet and store.has_control and store.attach_reply.role == "wizard" and store.now() <= FRESH_SECONDS


class TourScreen(SingleDismissModal[None]):
    """Shows the tour. Enter or right goes on, left goes back, Esc ends it. Other keys only stop or leave."""

    COVERS = False
    DEFAULT_CSS = """
    TourScreen { background: transparent; }
    TourScreen StaticLines { position: absolute; background: $rise-bar-focused; }
    """

    def __init__(self, part_of: Callable[[str], Region], room: Callable[[], Region]) -> None:
        """`part_of`: the place of a part on the screen. `room`: the place for boxes; an alarm is never covered."""
        super().__init__()
        self._part_of, self._room = part_of, room
        self._step_number = 0
        self._box, self._pointer = StaticLines(), StaticLines()

    def compose(self) -> ComposeResult:
        yield self._box
        yield self._pointer

    def on_mount(self) -> None:
        self._pointer.styles.width, self._pointer.styles.height = 3, 1
        self.set_interval(FOLLOW_SECONDS, self._show_step)
        self._show_step()

    @property
    def text(self) -> str:
        """The characters of the box."""
        return self._box.text

    def _show_step(self) -> None:
        step = STEPS[self._step_number]
        part, room = self._part_of(step.part), self._room()
        lines = box_lines(step, self._step_number + 1, min(WIDTH, room.width))
        size = Size(min(WIDTH, room.width), len(lines))
        at, pointer, arrow = place_box(part, size, room)
        self._box.styles.width, self._box.styles.height = size
        self._box.styles.offset, self._pointer.styles.offset = at, pointer
        self._box.show(*lines)
        self._pointer.show(((f" {arrow} ", "call"),))

    def on_key(self, event: events.Key) -> None:
        event.stop()
        event.prevent_default()
        if event.key == "escape" or (event.key in ("enter", "right") and self._step_number == len(STEPS) - 1):
            self.dismiss(None)
        elif event.key in ("enter", "right", "left"):
            self._step_number = max(0, self._step_number + (-1 if event.key == "left" else 1))
            self._show_step()

    def on_resize(self) -> None:
        self._show_step()


def box_lines(step: TourStep, number: int, width: int) -> tuple[StyledLine, ...]:
    """Title, text, and keys, in a frame."""
    inner = width - 4
    keys = "enter next · ← back · esc ends the tour" if number < len(STEPS) else "enter ends the tour · ← back"
    title: StyledLine = (
        fixed_span(step.title, inner - 7, "accent"),
        fixed_span(f"{number} of {len(STEPS)}", 7, "muted", right=True),
    )
    empty: StyledLine = ((" " * inner, "plain"),)
    texts: list[StyledLine] = [(fixed_span(line, inner),) for line in wrap(step.text, inner)]
    foot: StyledLine = (fixed_span(keys, inner, "muted"),)
    framed = [(("│ ", "key"), *line, (" │", "key")) for line in (title, empty, *texts, empty, foot)]
    edge = "─" * (width - 2)
    return (((f"╭{edge}╮", "key"),), *framed, ((f"╰{edge}╯", "key"),))


def place_box(part: Region, size: Size, room: Region) -> tuple[Offset, Offset, str]:
    """The place of the box, the place of its pointer, and the pointer's direction. Both stay within the room.

    The box goes below a part above the room, above a part below it, and otherwise beside or inside the part.
    """
    x = min(max(part.x + 2, room.x), max(room.x, room.right - size.width))
    tip = min(max(part.x + 4, x), x + size.width - 3)
    if part.bottom <= room.y:
        return Offset(x, room.y + 1), Offset(tip, room.y), "▲"
    if part.y >= room.bottom:
        return Offset(x, max(room.y, room.bottom - 1 - size.height)), Offset(tip, room.bottom - 1), "▼"
    y = min(part.y + 3, max(room.y, room.bottom - size.height))
    if part.right + 3 + size.width <= room.right:
        return Offset(part.right + 3, y), Offset(part.right, y + 1), "◄"
    if part.x - 3 - size.width >= room.x:
        return Offset(part.x - 3 - size.width, y), Offset(part.x - 3, y + 1), "►"
    return Offset(x, y), Offset(tip, y - 1), "▲"
