"""The console's own bars: status, notice, and key hints. Those that alarm are in `alarm`."""

from __future__ import annotations

from collections.abc import Sequence

from textual import events
from textual.app import ComposeResult
from textual.containers import Horizontal

from rise_tui.actions import BY_ID, Action
from rise_tui.control import short
from rise_tui.messages import ActionAsked
from rise_tui.store import Store
from rise_tui.text import Line, Span, Tone, clock, crop, fit, spread, width_of
from rise_tui.widgets.line import Lines

ROBOT_GLYPHS = {"connected": "●", "degraded": "◐", "lost": "✗"}

WIDE = 100
"""From this width on there is room for `wizard` before the name."""

NOTICES: dict[str, tuple[str, Tone]] = {"info": ("·", "plain"), "wait": ("!", "wait"), "fault": ("✗", "fault")}


class StatusLine(Horizontal):
    """Always on top: what runs, in which mode, on which robot, since when, and whether keys start anything.

    The clock is a widget of its own, so that a second costs the clock and not the line.
    """

    DEFAULT_CSS = """
    StatusLine { height: 1; }
    StatusLine Lines { background: $rise-bar; }
    StatusLine #status-clock { width: 10; }
    """

    def __init__(self) -> None:
        super().__init__()
        self._left, self._clock, self._right = Lines(), Lines(id="status-clock"), Lines()

    def compose(self) -> ComposeResult:
        yield self._left
        yield self._clock
        yield self._right

    @property
    def text(self) -> str:
        """The characters shown."""
        return f"{self._left.text}{self._clock.text}{self._right.text}"

    def draw(self, store: Store) -> None:
        hello, robot = store.hello, store.view.robot
        status = robot.status if robot is not None else "no link"
        tone: Tone = "plain" if status == "connected" else "wait" if status in ("degraded", "no link") else "fault"
        gap: Span = ("  ", "plain")
        simulated = store.scenario.robot.driver == "simulated"
        what: Span = (hello.mode.upper(), "wait" if hello.mode == "real" else "accent")
        if hello.mode == "real" and simulated:
            what = ("REAL (simulated!)", "fault")
        if hello.replay:
            what = (" REPLAY ", "call")
        name = hello.robot if hello.mode == "real" and not hello.replay else f"{hello.robot} (sim)"
        link: Span = (f"{name} {ROBOT_GLYPHS.get(status, '○')} {status}", tone)
        mode: Line = (what,) if hello.replay else (what, gap, link)
        right = _right_end(store, self.size.width)
        if self._right.styles.width is None or self._right.styles.width.value != width_of(right):
            self._right.styles.width = width_of(right)
        self._left.show(spread(((f" {store.scenario.title}", "strong"),), mode, self._left.size.width))
        self._clock.show(((f"  {clock(store.now())}", "plain"),))
        self._right.show(right)


def _right_end(store: Store, width: int) -> Line:
    """Whether keys start anything, and who may press them."""
    gap: Span = ("  ", "plain")
    me = short(store.me)
    wide = width >= WIDE
    own: Line = (
        (f"wizard {fit(me, min(len(me), 12))}" if wide else fit(me, min(len(me), 12)), "muted"),
        (" ", "plain"),
    )
    if store.gone:
        return (gap, (" ENDED " if store.over else " GONE ", "alarm"), gap, *own)
    if store.cut is not None:
        return (gap, (" CUT, attaching again ", "alarm"), (" ", "plain"))
    late: Line = (gap, (f"disk {store.journaling.behind:.0f} s behind", "wait")) if store.journaling.behind > 1 else ()
    paused: Line = (gap, (" PAUSED ", "alarm")) if store.journaling.trouble else ()
    stopped: Line = (gap, (" STOPPED ", "alarm")) if store.state == "STOPPED" else ()
    if store.hello.replay:
        return (*stopped, (" ", "plain"))
    if store.has_control:
        return (*late, *(stopped or paused or (gap, (" LIVE ", "strong"))), gap, *own)
    holder = short(store.view.control)
    holder = fit(holder, min(len(holder), 12))
    if store.view.control is None and store.hello.role == "wizard":
        who = f" {holder} has control "
    else:
        who = f" WATCHING · {holder} has control "
    # Where there is little room the robot's link needs it, and the red bar says these two as well.
    alarmed = (stopped or paused) if width >= WIDE else ()
    return (*late, *alarmed, gap, (who, "call"))


class NoticeLine(Lines):
    """One sentence: a rejection, a fault, an answer to a key."""

    def draw(self, store: Store) -> None:
        notice = store.notice
        if notice is None:
            self.show()
            return
        glyph, tone = NOTICES[notice.level]
        self.show(crop(((f" {glyph} {notice.text}", tone),), self.size.width))


class KeyHints(Lines):
    """The keys of the focused pane and those that always work; each can be clicked."""

    DEFAULT_CSS = """
    KeyHints { background: $rise-bar; }
    """

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._places: list[tuple[int, int, str]] = []

    def draw(self, own: Sequence[Action], common: Sequence[Action], store: Store) -> None:
        spans: list[Span] = []
        self._places.clear()
        width = self.size.width
        for action in dict.fromkeys((*common[:1], *own, *common[1:])):
            if not action.hint or not action.keys:
                continue
            piece = _hint(action, bool(action.unavailable(store)))
            start = width_of(spans)
            if start + width_of(piece) > width:
                break
            self._places.append((start, start + width_of(piece) - 1, action.id))
            spans += piece
        self.show(tuple(spans))

    def draw_typing(self, enter: str) -> None:
        """While a text field has the focus no key starts anything, but the stop key stops. `enter`: what Enter does."""
        self._places = [(0, 12, "stop")]
        rest: Line = ((" enter", "key"), (f" {enter} ", "plain"), (" esc", "key"), (" leave ", "plain"))
        self.show((*_hint(BY_ID["stop"], False), *rest, ("  typing: keys start nothing", "muted")))

    def on_click(self, event: events.Click) -> None:
        for start, end, action in self._places:
            if start <= event.x < end:
                self.post_message(ActionAsked(action))


def _hint(action: Action, off: bool) -> list[Span]:
    stop = action.id == "stop"
    key = "F9/^G" if stop else action.key_label
    return [
        (f" {key}", "muted" if off else "fault" if stop else "key"),
        (f" {action.hint} ", "muted" if off else "fault" if stop else "plain"),
    ]
