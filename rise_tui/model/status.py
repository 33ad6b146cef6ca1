"""What the status line says, and what of it gives way in a narrow terminal. Pure; knows no widget.

Mode, robot, link and whether keys act never give way. Cells keep their places: what comes and goes has its room kept.
"""

from __future__ import annotations

from typing import NamedTuple

from rise_tui.model.control import short
from rise_tui.model.cue import cue_line
from rise_tui.model.store import Store
from rise_tui.text import Line, Span, Tone, clock, crop, duration, fit, spread, width_of

ROBOT_GLYPHS = {"connected": "●", "degraded": "◐", "lost": "✗"}
FRESH = 2.0
"""Seconds for which a robot's sign of life counts as just now: the link brings one about every second."""
OLD = 3.0
"""From this age on something is wrong, whatever the link's word says."""
TITLE = 12
"""Cells that the title keeps before anything else gives way."""
NAME = 12
CUE, CUE_SHORT = 17, 12
"""Room that is kept for the cue."""
STATE = 9
"""Room for the longest of LIVE, SAFE, LOCKED and STOPPED."""

GAP: Span = ("  ", "plain")


class Cell(NamedTuple):
    """A piece of the line in its variants, the best first."""

    variants: tuple[Line, ...]
    keep: tuple[int, ...] = ()
    """How late each step to the next variant is taken: over all cells, the smallest number first."""


def status_line(store: Store, width: int) -> Line:
    """The whole line in exactly `width` cells."""
    participant, condition = _participant(store)
    both = (f"{participant} · {condition}",) if participant and condition else ()
    named: tuple[Line, ...] = tuple(((f"  {text}", "strong"),) for text in (*both, participant or condition) if text)
    right, who = _fitted([*_cells(store), Cell((*named, ()), (6, 11)[-len(named) :])], width - TITLE)
    title: Line = ((f" {store.scenario.title}", "muted" if who else "strong"),)
    room = max(0, width - width_of(right) - 1 - width_of(who))
    return spread((*crop(title, room), *who), right, width)


def _fitted(cells: list[Cell], width: int) -> tuple[Line, Line]:
    """The cells in the best variants that fit together; the last one, which stands elsewhere, apart."""
    chosen = [0] * len(cells)
    while sum(width_of(cell.variants[at]) for cell, at in zip(cells, chosen, strict=True)) > width:
        open_ends = [index for index, cell in enumerate(cells) if chosen[index] < len(cell.variants) - 1]
        if not open_ends:
            break
        chosen[min(open_ends, key=lambda index: cells[index].keep[chosen[index]])] += 1
    lines = [cell.variants[at] for cell, at in zip(cells, chosen, strict=True)]
    return tuple(span for line in lines[:-1] for span in line), lines[-1]


def _cells(store: Store) -> list[Cell]:
    if store.gone or store.cut is not None:
        return [_mode(store), *_robot(store), _time(store), *_end(store)]
    return [_mode(store), *_robot(store), _recording(store), _time(store), _cue(store), *_end(store)]


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


def _cue(store: Store) -> Cell:
    """The room stays when nothing is counted; where there is little, only while something is."""
    now = store.now()
    full, brief = cue_line(store.view.cue, now), cue_line(store.view.cue, now, short=True)
    return Cell((_padded(full, CUE), _padded(brief, CUE_SHORT), brief and ((" ", "plain"), *brief)), (5, 8))


def _padded(line: Line, width: int) -> Line:
    room = width - 1 - width_of(line)
    return ((" ", "plain"), *line, (" " * max(0, room), "plain"))


def _end(store: Store) -> list[Cell]:
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
        padding: Line = ((" " * max(0, STATE - width_of(words)), "plain"),)
        return [Cell(((("  ", "plain"), *words, *padding), (("  ", "plain"), *words)), (2,)), own]
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
