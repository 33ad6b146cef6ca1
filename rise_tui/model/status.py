"""What the status line says, and what of it gives way in a narrow terminal. Pure; knows no widget.

Who takes part, the condition, mode, robot, link, cue and whether keys act never give way. The title does first.
"""

from __future__ import annotations

from typing import NamedTuple

from rise_tui.model.control import short
from rise_tui.model.cue import cue_line
from rise_tui.model.store import Store
from rise_tui.text import Line, Span, Tone, cells, clean, clock, crop, duration, fit, spread, width_of

ROBOT_GLYPHS = {"connected": "●", "degraded": "◐", "lost": "✗"}
FRESH = 2.0
"""Seconds for which a robot's sign of life counts as just now: the link brings one about every second."""
OLD = 3.0
"""From this age on something is wrong, whatever the link's word says."""
TITLE = 12
"""Cells that the title keeps before anything else gives way, where there is some room."""
NAME = 12
CUE, CUE_SHORT = 19, 12
"""Cells that the cue takes from the title: where all else has room beside it, and elsewhere."""
NARROW = 80
"""Below this width nothing is kept for a cue."""
LEAST_TITLE = 8
"""Cells below which a title says nothing."""
USUAL = 100
"""From this width on the title keeps TITLE cells."""
STATE = 9
"""Room for the longest of LIVE, SAFE, LOCKED and STOPPED."""

GAP: Span = ("  ", "plain")


class Cell(NamedTuple):
    """A piece of the line in its variants, the best first."""

    variants: tuple[Line, ...]
    keep: tuple[int, ...] = ()
    """How late each step to the next variant is taken: over all cells, the smallest number first."""


def status_line(store: Store, width: int) -> Line:
    """The whole line in exactly `width` cells.

    Who takes part and in which condition comes first, whatever else is there. Then the title, which has the room that
    is left. A part of that is the cue's while one is counted, so that nothing else moves when it comes and goes.
    """
    who = _who(store, width)
    title: Line = ((f"  {store.scenario.title}" if who else f" {store.scenario.title}", "muted" if who else "strong"),)
    room = width - width_of(who) - 1
    counts = not (store.gone or store.cut is not None or store.hello.replay)
    best = sum(width_of(cell.variants[0]) for cell in _cells(store, padded=True))
    cue_room = (CUE if best + CUE <= room else CUE_SHORT if width >= NARROW else 0) if counts else 0
    kept = max(TITLE if width >= USUAL else 0, cue_room)
    padded = best + max(kept, width_of(title)) <= room  # no blanks are kept while something is cut
    right = _fitted(_cells(store, padded=padded), max(0, room - kept))
    cue = _cue(store, room - width_of(right)) if counts else ()
    who = crop(who, max(0, width - width_of(cue) - width_of(right) - 1))
    room = width - width_of(who) - width_of(cue) - width_of(right) - 1
    shown = crop(title, room) if room >= min(LEAST_TITLE, width_of(title)) else ()
    return spread((*who, *shown), (*cue, *right), width)


def _who(store: Store, width: int) -> Line:
    """`P07 · hesitation`. Only in a terminal that has no room for it a long one is cut."""
    participant, condition = (clean(text) for text in _participant(store))
    half = max(8, width // 6)
    parts = [fit(text, min(cells(text), half)).rstrip() for text in (participant, condition) if text]
    return ((f" {' · '.join(parts)}", "strong"),) if parts else ()


def _fitted(made: list[Cell], width: int) -> Line:
    """The cells in the best variants that fit together."""
    chosen = [0] * len(made)
    while sum(width_of(cell.variants[at]) for cell, at in zip(made, chosen, strict=True)) > width:
        open_ends = [index for index, cell in enumerate(made) if chosen[index] < len(cell.variants) - 1]
        if not open_ends:
            break
        chosen[min(open_ends, key=lambda index: made[index].keep[chosen[index]])] += 1
    return tuple(span for cell, at in zip(made, chosen, strict=True) for span in cell.variants[at])


def _cells(store: Store, *, padded: bool) -> list[Cell]:
    """Those at the right."""
    if store.gone or store.cut is not None:
        return [_mode(store), *_robot(store), _time(store), *_end(store, padded)]
    return [_mode(store), *_robot(store), _recording(store), _time(store), *_end(store, padded)]


def _participant(store: Store) -> tuple[str, str]:
    session = store.view.session
    return (session.participant, session.condition) if session is not None else ("", "")


def _mode(store: Store) -> Cell:
    hello = store.hello
    what: Span = (hello.mode.upper(), "wait" if hello.mode == "real" else "accent")
    if hello.replay:
        what = (" REPLAY ", "call")
    elif hello.mode == "real" and store.scenario.robot.driver == "simulated":
        what = ("REAL (simulated!)", "fault")
    return Cell(((("  ", "plain"), what),))


def _robot(store: Store) -> list[Cell]:
    """Its name, its link in a word, and how long ago it was heard of."""
    hello, robot = store.hello, store.view.robot
    if hello.replay:
        return []
    status = robot.status if robot is not None else "no link"
    tone: Tone = "plain" if status == "connected" else "wait" if status in ("degraded", "no link") else "fault"
    seen = store.pulse.robot_seen
    if seen is not None and robot is not None and status == "connected":
        seen = max(seen, robot.t)  # that it is back is a sign of life, and pulses come once a second
    age = None if seen is None or store.gone or store.cut is not None else max(0.0, store.now() - seen)
    if age is not None and age >= OLD and tone == "plain":
        tone = "wait"
    link = f"{ROBOT_GLYPHS.get(status, '○')} {status}"
    links = (link, link.replace("connected", "ok"))
    simulated = hello.mode != "real"
    name = fit(hello.robot, min(len(hello.robot), NAME))
    names = (f"{name} (sim) ", f"{name} ") if simulated else (f"{name} ",)
    cells = [
        Cell(tuple((GAP, (text, tone)) for text in names), (4,)),
        Cell(tuple(((text, tone),) for text in dict.fromkeys(links)), (3,)),
    ]
    if age is not None:
        text = "<2 s" if age < FRESH else duration(age)
        shown: Line = ((" ", "plain"), (text, "muted" if age < FRESH else tone))
        cells.append(Cell((shown, ()) if age < FRESH else (shown,), (7,)))
    return cells


def _recording(store: Store) -> Cell:
    if store.hello.replay:
        return Cell(((),))
    if store.journaling.trouble:
        return Cell(((GAP, ("✗ NOT REC", "fault")),))
    if store.journaling.behind > 1:
        late = f"{store.journaling.behind:.0f} s behind"
        return Cell(((GAP, (f"◐ disk {late}", "wait")), (("  ", "plain"), (f"disk {late}", "wait"))), (9,))
    if not store.hello.folder:
        return Cell(((GAP, ("○ NO REC", "wait")), (GAP, ("NO REC", "wait"))), (9,))
    return Cell(((GAP, ("● REC", "plain")), (("  ", "plain"), ("REC", "plain")), ()), (9, 12))


def _time(store: Store) -> Cell:
    return Cell((((" ", "plain"), (clock(store.now()), "plain")), ()), (13,))


def _cue(store: Store, room: int) -> Line:
    """The time since the cue, while it is counted: the whole where there is room for it."""
    full, brief = (cue_line(store.view.cue, store.now(), short=short) for short in (False, True))
    if not full:
        return ()
    return (GAP, *full) if width_of(full) + width_of((GAP,)) <= room else ((" ", "plain"), *brief)


def _end(store: Store, padded: bool) -> list[Cell]:
    """Whether keys start anything, and who may press them."""
    me = short(store.me)
    name = fit(me, min(len(me), NAME))
    own = Cell((((f" {store.hello.role} {name} ", "muted"),), ((f" {name} ", "muted"),), ()), (1, 10))
    if store.gone:
        return [Cell(((GAP, (" ENDED " if store.over else " GONE ", "alarm"), (" ", "plain")),)), own]
    if store.cut is not None:
        return [Cell(((GAP, (" CUT, attaching again ", "alarm"), (" ", "plain")),))]
    words = _state(store)
    if store.has_control and not store.hello.replay:
        padding: Line = ((" " * max(0, STATE - width_of(words)), "plain"),) if padded else ()
        return [Cell(((GAP, *words, *padding),)), own]
    if store.hello.replay:
        return [Cell(((*((GAP, *words) if words else ()), (" ", "plain")),))]
    holder = short(store.view.control)
    holder = fit(holder, min(len(holder), NAME))
    who = f"{holder} has control"
    if store.view.control is not None or store.hello.role != "wizard":
        who = f"WATCHING · {who}"
    shown: Line = (GAP, (f" {who} ", "call"))
    # Where there is little room the red bar says the first of these.
    return [Cell(((GAP, *words), ()) if words else ((),), (10,)), Cell((shown,))]


def _state(store: Store) -> Line:
    """LIVE is not said of a console that only watches."""
    stopped = store.state == "STOPPED"
    words: list[Span] = []
    if stopped:
        words.append((" STOPPED ", "alarm"))
    elif store.journaling.trouble:
        words.append((" PAUSED ", "alarm"))
    if store.guard != "LIVE":  # also beside a stop: it still holds when that is released
        words.append((f" {store.guard} ", "call"))
    elif not words and store.has_control and not store.hello.replay:
        words.append((" LIVE ", "strong"))
    return tuple(words)
