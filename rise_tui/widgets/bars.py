"""The console's own bars: status, stop, notice, and key hints."""

from __future__ import annotations

from collections.abc import Sequence

from textual import events
from textual.app import ComposeResult
from textual.containers import Horizontal

from rise_tui.actions import BY_ID, Action
from rise_tui.messages import ActionAsked
from rise_tui.store import Store
from rise_tui.text import Line, Span, Tone, clock, crop, fit, spread, width_of
from rise_tui.widgets.line import Lines

ROBOT_GLYPHS = {"connected": "●", "degraded": "◐", "lost": "✗"}

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
        name = hello.robot if hello.mode == "real" else f"{hello.robot} (sim)"
        mode: Line = (
            what,
            gap,
            (f"{name} {ROBOT_GLYPHS.get(status, '○')} {status}", tone),
        )
        armed: Span = (f" {store.state} ", "alarm" if store.state == "STOPPED" else "strong")
        if store.gone:
            armed = (" ENDED ", "alarm")
        right: Line = (gap, armed, gap, (fit(store.wizard, min(len(store.wizard), 12)), "muted"), (" ", "plain"))
        if self._right.styles.width is None or self._right.styles.width.value != width_of(right):
            self._right.styles.width = width_of(right)
        self._left.show(spread(((f" {store.scenario.title}", "strong"),), mode, self._left.size.width))
        self._clock.show(((f"  {clock(store.now())}", "plain"),))
        self._right.show(right)


class AlarmBar(Lines):
    """Shown while a stop holds or after the engine has ended: what was asked, who confirmed, who did not."""

    DEFAULT_CSS = """
    AlarmBar { height: 3; background: $error 18%; display: none; }
    AlarmBar.-on { display: block; }
    """

    def draw(self, store: Store) -> None:
        lines = self._lines(store)
        self.set_class(bool(lines), "-on")
        width = self.size.width
        self.show(*(crop(line, width) if width else line for line in lines))

    def _lines(self, store: Store) -> tuple[Line, ...]:
        if store.gone:
            return (
                ((" ✗ ENGINE ENDED ", "alarm"), (f"  {store.gone}", "strong")),
                (("   keys do nothing any more; what is shown is the last known state", "plain"),),
                (("   ^C leaves", "plain"),),
            )
        stop = store.view.stop
        if not stop.latched:
            if not store.stopping:
                return ()
            return ((" ■ STOP sent ", "alarm"), ("  waiting for the engine", "strong")), (), ()
        requested = stop.status == "requested"
        what = f"asked {clock(stop.since)} by {stop.source}" if requested else "nothing starts until it is released"
        asked: Line = ((f"  {what}", "strong"),)
        if requested:
            return (
                ((" ■ STOP requested ", "alarm"), *asked),
                (("   waiting for the robot to confirm", "plain"),),
                (),
            )
        confirmed = parts(stop.confirmed) or "nobody"
        missing: Line = (
            (("   NOT CONFIRMED  ", "fault"), (parts(stop.unconfirmed), "strong")) if stop.unconfirmed
            else (("   everything asked has confirmed", "plain"),)
        )  # fmt: skip
        return (
            ((" ■ STOPPED ", "alarm"), *asked, ("   ^R release", "key")),
            (("   confirmed      ", "plain"), (confirmed, "strong"), (f"   stop by {stop.source}", "muted")),
            missing,
        )


def parts(names: Sequence[str]) -> str:
    """Parts of robots, each robot named once: `pepper: arms, gaze`."""
    found: dict[str, list[str]] = {}
    for name in names:
        robot, _, part = name.rpartition("/")
        found.setdefault(robot, []).append(part)
    return "; ".join(f"{robot}: {', '.join(of)}" if robot else ", ".join(of) for robot, of in found.items())


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
        for action in (*common[:1], *own, *common[1:]):
            if not action.hint or not action.keys:
                continue
            piece = _hint(action, bool(action.unavailable(store)))
            start = width_of(spans)
            if start + width_of(piece) > width:
                break
            self._places.append((start, start + width_of(piece) - 1, action.id))
            spans += piece
        self.show(tuple(spans))

    def draw_typing(self) -> None:
        """While a text field has the focus no key starts anything, but the stop key stops."""
        self._places = [(0, 12, "stop")]
        rest: Line = ((" enter", "key"), (" take ", "plain"), (" esc", "key"), (" leave ", "plain"))
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
