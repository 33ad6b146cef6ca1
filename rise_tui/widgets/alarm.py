"""The bars that cannot be missed: red for a stop, a disk, a link, an engine; amber for control."""

from __future__ import annotations

from collections.abc import Sequence
from time import monotonic

from rise_tui.control import short, taken_words
from rise_tui.store import Store
from rise_tui.text import Line, age, clock, crop
from rise_tui.widgets.line import Lines

CUT_SECONDS = 1.0
"""A connection that is back before this is not worth an alarm that comes and goes."""


class AlarmBar(Lines):
    """Shown while something holds that every wizard must know: first a stop, then a record that fails."""

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
            return _gone(store)
        if store.cut is not None and (store.unstopped or monotonic() - store.cut >= CUT_SECONDS):
            return _cut(store)
        stop, trouble = _stop(store), store.journaling.trouble
        if not trouble:
            return stop
        why, _, stopped = trouble.partition("; ")
        what: Line = ((" ✗ NOT RECORDING ", "alarm"), (f"  {why}", "strong"))
        if stopped:  # asked for while nothing can be recorded: the engine tells it here, and records it later
            sent, _, confirmed = stopped.partition(", ")
            answer = confirmed.replace("confirmed by ", "") or "the robot has not answered yet"
            return (
                what,
                ((" ■ STOP ", "alarm"), (f"  {sent}", "strong")),
                (("   confirmed      ", "plain"), (answer, "strong")),
            )
        if stop:
            return (stop[0], stop[2] if _missing(store) else stop[1], what)
        return (
            what,
            (("   the session is paused: nothing starts until the disk takes records again", "plain"),),
            (("   F9", "key"), (" still stops the robot", "plain")),
        )


def _missing(store: Store) -> bool:
    return store.view.stop.status == "latched" and bool(store.view.stop.unconfirmed)


def _gone(store: Store) -> tuple[Line, ...]:
    if store.over:
        return (
            ((" ■ SESSION ENDED ", "alarm"), (f"  {store.gone}", "strong")),
            (("   keys do nothing any more; what is shown is how it ended", "plain"),),
            (("   ^C", "key"), (" leaves", "plain")),
        )
    again = ", and says how to start rise-tui again: the session can be recovered" if store.hello.folder else ""
    return (
        ((" ✗ ENGINE GONE ", "alarm"), (f"  {store.gone}", "strong")),
        (("   keys do nothing any more, F9 neither; what is shown is the last known state", "plain"),),
        (
            ("   ^C", "key"),
            (f" leaves{again}", "plain"),
        ),
    )


def _cut(store: Store) -> tuple[Line, ...]:
    assert store.cut is not None
    since = age(monotonic() - store.cut)
    head = " ✗ STOP NOT SENT " if store.unstopped else " ✗ CONNECTION CUT "
    return (
        ((head, "alarm"), (f"  cut {since} ago; the console is attaching again", "strong")),
        (("   the session goes on without this console, and no key reaches it", "plain"),),
        (("   to stop the robot now, use its own switch", "strong"),),
    )


def _stop(store: Store) -> tuple[Line, ...]:
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
    release: Line = (("   ^R release", "key"),) if store.has_control else ()
    return (
        ((" ■ STOPPED ", "alarm"), *asked, *release),
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


class CallBar(Lines):
    """One amber line: somebody asks for control, or has taken it."""

    DEFAULT_CSS = """
    CallBar { height: 1; background: $warning 18%; display: none; }
    CallBar.-on { display: block; }
    """

    def draw(self, store: Store) -> None:
        line = self._line(store)
        self.set_class(bool(line), "-on")
        self.show(crop(line, self.size.width) if self.size.width else line)

    def _line(self, store: Store) -> Line:
        if store.gone or store.hello.replay:
            return ()
        if store.taken is not None and not store.has_control:
            return ((f" {taken_words(store.taken, 'F8')} ", "call"),)
        if store.asker is not None:
            return ((f" {short(store.asker)} asks for control: F8 to answer ", "call"),)
        return ()
