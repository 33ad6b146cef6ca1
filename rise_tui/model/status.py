"""The text of the status line, and its cuts in a narrow terminal. Pure, without widgets.

Participant, condition, mode, robot, link, cue and the state of the keys are never cut. The title is cut first.
"""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.kernel.records import SessionRecord, describe_open_goal
from rise_engine.scenario.reading.conditions import condition_label
from rise_tui.model.alarms import all_recorders_run, recorders_word
from rise_tui.model.cue import cue_line
from rise_tui.model.memory_changes import CHANGED
from rise_tui.model.notice import act_label, short_name
from rise_tui.model.store import Store
from rise_tui.rendering.text import (
    StyledLine,
    StyledSpan,
    TextRole,
    align_at_both_ends,
    cell_width,
    clean,
    crop,
    fit_middle,
    format_clock,
    format_duration,
    line_width,
    shorten,
)

SHOWN = 5
"""Maximum number of named items; the others are only counted."""


def participant_parts(store: Store) -> list[str]:
    """The participant and the condition's label, as far as known. In a study the participant has the run and, if the
    session does not count, its purpose: `P07 run 2`."""
    session = store.view.session
    if session is None:
        return []
    run = f"run {session.run}" if session.study and session.run else ""
    rehearsal = session.purpose if session.purpose not in ("counted", "debug") else ""  # the mode shows debug
    who = " ".join(filter(None, (session.participant, run, rehearsal)))
    return [text for text in (who, _labelled_condition(store, session)) if text]


def _labelled_condition(store: Store, session: SessionRecord) -> str:
    """The condition's label. Empty until the study is read: a blinded wizard must not see the name even briefly."""
    if not session.study:
        return condition_label(store.scenario, session.condition)
    labels = store.condition_labels
    return "" if labels is None else labels.get(session.condition, session.condition)


def participant_text(store: Store) -> str:
    """`P07 · hesitation`; empty: no participant is named. `≠ changed`: somebody has changed the condition's values."""
    return clean(" · ".join(participant_parts(store))) + f" {CHANGED}" * bool(store.view.overridden)


def session_title(store: Store) -> str:
    """`P07 · hesitation · LabLinking: setting the table`."""
    return " · ".join(filter(None, (participant_text(store) or "no participant named", clean(store.scenario.title))))


def running_lines(store: Store) -> list[str]:
    """Running rules with their states, acts, and the robot's open goals, in lines for a question."""
    running = [f"rule {name}: in {store.view.rules[name].state}" for name in store.view.running_rules()]
    running += [f"act {act_label(task.function, task.behavior)}" for task in store.running_tasks]
    running += [f"act {act_label(task.function, task.behavior)}, waiting" for task in store.waiting_tasks]
    robot = store.view.robot
    left = [f"{clean(each)}." for each in map(describe_open_goal, robot.open if robot is not None else ())]
    if not running:
        return ["No rule and no act is running.", *left]
    more = [f"  and {len(running) - SHOWN} more"] if len(running) > SHOWN else []
    return ["Running now:", *(f"  {clean(each)}" for each in running[:SHOWN]), *more, *left]


ROBOT_GLYPHS = {"connected": "●", "degraded": "◐", "lost": "✗"}
FRESH_SECONDS = 2.0
"""Seconds for which a robot's sign of life counts as recent. The link brings one about every second."""
STALE_SECONDS = 3.0
"""Age in seconds of a sign of life from which something is wrong, whatever the link reports."""
TITLE = 12
"""Cells that the title keeps before anything else is cut, if there is some room."""
NAME = 12
CUE, CUE_SHORT = 19, 12
"""Cells that the cue takes from the title: if everything else fits beside it, and otherwise."""
NARROW = 80
"""Below this width no cells are kept for a cue."""
MIN_TITLE = 8
"""Cells below which a title is useless."""
FULL_TITLE_WIDTH = 100
"""From this width on the title keeps TITLE cells."""
OMITTED_STEP = 12
"""The step from which a cell is omitted (`StatusCell.keep`)."""
STATE = 9
"""Room for the longest of LIVE, SAFE, LOCKED and STOPPED."""

GAP: StyledSpan = ("  ", "plain")


class StatusCell(NamedTuple):
    """A piece of the line in several variants, the best first."""

    variants: tuple[StyledLine, ...]
    keep: tuple[int, ...] = ()
    """The priority of each step to the next variant: the smallest number of all cells comes first."""


def status_line(store: Store, width: int) -> StyledLine:
    """The whole line in exactly `width` cells.

    Participant and condition always come first. The title gets the remaining room. A counted cue takes part of the
    title's room, so that nothing else moves.
    """
    participant = _participant_line(store, _cells(store, padded=False), width)
    title: StyledLine = (
        (f"  {store.scenario.title}", "muted") if participant else (f" {store.scenario.title}", "strong"),
    )
    room = width - line_width(participant) - 1
    counts = not (store.gone_reason or store.cut_since is not None or store.attach_reply.replay)
    best = sum(line_width(cell.variants[0]) for cell in _cells(store, padded=True))
    awaits = counts and store.key_state != "STOPPED"  # no answer is possible then
    cue_room = (CUE if best + CUE <= room else CUE_SHORT if width >= NARROW else 0) if awaits else 0
    kept = max(TITLE if width >= FULL_TITLE_WIDTH else 0, cue_room)
    padded = best + max(kept, line_width(title)) <= room  # no blanks while something is cut
    right = _fit_cells(_cells(store, padded=padded), max(0, room - kept))
    cue = _cue_line(store, room - line_width(right)) if counts else ()
    participant = crop(participant, max(0, width - line_width(cue) - line_width(right) - 1))
    room = width - line_width(participant) - line_width(cue) - line_width(right) - 1
    shown = crop(title, room) if room >= min(MIN_TITLE, line_width(title)) else ()
    return align_at_both_ends((*participant, *shown), (*cue, *right), width)


def _participant_line(store: Store, cells: list[StatusCell], width: int) -> StyledLine:
    """`P07 · hesitation`, in full while `cells` fit beside it in informative variants. Then names are cut in the
    middle, the longer one first, because they often begin alike."""
    texts = [clean(text) for text in participant_parts(store)]
    changed: StyledLine = ()
    if store.view.overridden and width >= NARROW:
        changed = ((f" {CHANGED}", "wait"),)
    elif store.view.overridden:
        texts = [f"{CHANGED[0]} {texts[0] if texts else ''}", *texts[1:]]  # the beginning is never cut
    least = sum(_least_width(cell) for cell in cells) + (CUE_SHORT if width >= NARROW else 0) + 1 + line_width(changed)
    room = max(2 * max(8, width // 6), width - least - 4) - 1
    if len(texts) == 2:
        room -= 3  # the separator
        widths = [cell_width(text) for text in texts]
        texts = [
            fit_middle(text, max(room // 2, room - other)).rstrip() if sum(widths) > room else text
            for text, other in zip(texts, reversed(widths), strict=True)
        ]
    else:
        texts = [fit_middle(text, room).rstrip() for text in texts]
    return ((f" {' · '.join(texts)}", "strong"), *changed) if texts else changed


def _least_width(cell: StatusCell) -> int:
    """The width of the narrowest variant that still shows the cell's meaning."""
    steps = sum(1 for step in cell.keep if step < OMITTED_STEP)
    return line_width(cell.variants[min(steps, len(cell.variants) - 1)])


def _fit_cells(cells: list[StatusCell], width: int) -> StyledLine:
    """The cells in the best variants that fit together."""
    left = list(cells)
    while sum(line_width(cell.variants[0]) for cell in left) > width:
        shorter = [index for index, cell in enumerate(left) if len(cell.variants) > 1]
        if not shorter:
            break
        first = min(shorter, key=lambda index: left[index].keep[0])
        left[first] = StatusCell(left[first].variants[1:], left[first].keep[1:])
    return tuple(span for cell in left for span in cell.variants[0])


def _cells(store: Store, *, padded: bool) -> list[StatusCell]:
    """The cells on the right."""
    recording = [] if store.gone_reason or store.cut_since is not None else _recording_cells(store)
    return [_mode_cell(store), *_robot_cells(store), *recording, _time_cell(store), *_control_cells(store, padded)]


def _mode_cell(store: Store) -> StatusCell:
    attach_reply = store.attach_reply
    mode: StyledSpan = (attach_reply.mode.upper(), "wait" if attach_reply.mode == "real" else "accent")
    if attach_reply.replay:
        mode = (" REPLAY ", "call")
    elif attach_reply.shadow:
        mode = (" SHADOW ", "alarm")
    elif attach_reply.mode == "real" and store.scenario.robot.driver == "simulated":
        mode = ("REAL (simulated!)", "fault")
    return StatusCell(((GAP, mode),))


def _robot_cells(store: Store) -> list[StatusCell]:
    """The robot's name, its link in a word, and the time since its last sign of life."""
    attach_reply, robot = store.attach_reply, store.view.robot
    if attach_reply.replay or attach_reply.shadow:  # there is no robot
        return []
    status: str = robot.status if robot is not None else "no link"
    if store.gone_reason or store.cut_since is not None:
        status = "not known"
    role: TextRole = (
        "plain" if status == "connected" else "wait" if status in ("degraded", "no link", "not known") else "fault"
    )
    seen = store.heartbeat.robot_seen
    if seen is not None and robot is not None and status == "connected":
        seen = max(seen, robot.t)  # its return is a sign of life, too
    age = None if seen is None or store.gone_reason or store.cut_since is not None else max(0.0, store.now() - seen)
    if age is not None and age >= STALE_SECONDS and role == "plain":
        role = "wait"
    link = f"{ROBOT_GLYPHS.get(status, '○')} {status}"
    links = (link, link.replace("connected", "ok"))
    simulated = attach_reply.mode != "real"
    name = shorten(attach_reply.robot, NAME)
    names = (f"{name} (sim) ", f"{name} ") if simulated else (f"{name} ",)
    cells = [
        StatusCell(tuple((GAP, (text, role)) for text in names), (4,)),
        StatusCell(tuple(((text, role),) for text in dict.fromkeys(links)), (3,)),
    ]
    if age is not None:
        text = "<2 s" if age < FRESH_SECONDS else format_duration(age)
        shown: StyledLine = ((" ", "plain"), (text, "muted" if age < FRESH_SECONDS else role))
        cells.append(StatusCell((shown, ()) if age < FRESH_SECONDS else (shown,), (7,)))
    return cells


def _recording_cells(store: Store) -> list[StatusCell]:
    """The state of the record and, if it is bad, of the recorders."""
    found = recorders_word(store)
    if found is None:
        return [_recording_cell(store)]
    name, word, role = found
    glyph, short = ("✗" if role == "fault" else "◐"), shorten(name, NAME)
    texts = (f"{glyph} {short} {word}", f"{short} {word}", f"{glyph} {word}")
    return [_recording_cell(store), StatusCell(tuple((GAP, (text, role)) for text in texts), (8, 11))]


def _recording_cell(store: Store) -> StatusCell:
    if store.attach_reply.replay or store.attach_reply.shadow:
        return StatusCell(((),))
    if store.journal_status.trouble:
        return StatusCell(((GAP, ("✗ NOT REC", "fault")),))
    if store.journal_status.behind > 1:
        late = f"{store.journal_status.behind:.0f} s behind"
        return StatusCell(((GAP, (f"◐ disk {late}", "wait")), (GAP, (f"disk {late}", "wait"))), (9,))
    if not store.attach_reply.folder:
        return StatusCell(((GAP, ("○ NO REC", "wait")), (GAP, ("NO REC", "wait"))), (9,))
    word = "ALL REC" if all_recorders_run(store) else "REC"
    return StatusCell(((GAP, (f"● {word}", "plain")), (GAP, (word, "plain")), ()), (9, 14))


def _time_cell(store: Store) -> StatusCell:
    return StatusCell((((" ", "plain"), (format_clock(store.now()), "plain")), ()), (13,))


def _cue_line(store: Store, room: int) -> StyledLine:
    """The time since the cue while it is counted; in full if there is room."""
    full, brief = (cue_line(store.cue_clock, store.now(), short=short) for short in (False, True))
    if not full:
        return ()
    return (GAP, *full) if line_width(full) + line_width((GAP,)) <= room else ((" ", "plain"), *brief)


def _control_cells(store: Store, padded: bool) -> list[StatusCell]:
    """Whether keys start anything, and the holder of control."""
    name = shorten(short_name(store.own_name), NAME)
    own = StatusCell((((f" {store.attach_reply.role} {name} ", "muted"),), ((f" {name} ", "muted"),), ()), (1, 10))
    if store.gone_reason:
        return [StatusCell(((GAP, (" ENDED " if store.ended_in_order else " GONE ", "alarm"), (" ", "plain")),)), own]
    if store.cut_since is not None:
        return [StatusCell(((GAP, (" CUT, reconnecting ", "alarm"), (" ", "plain")),))]
    words = _key_state_line(store)
    if store.has_control and not store.attach_reply.replay:
        padding: StyledLine = ((" " * max(0, STATE - line_width(words)), "plain"),) if padded else ()
        return [StatusCell(((GAP, *words, *padding),)), own]
    if store.attach_reply.replay:
        return [StatusCell(((*((GAP, *words) if words else ()), (" ", "plain")),))]
    holder = shorten(short_name(store.view.control), NAME)
    watching = "WATCHING · " if store.view.control is not None or store.attach_reply.role != "wizard" else ""
    texts = (f"{watching}{holder} has control", f"{watching}{holder}" if watching else f"{holder} has control")
    shown: tuple[StyledLine, ...] = tuple((GAP, (f" {text} ", "call")) for text in dict.fromkeys(texts))
    # With little room, the red bar shows the first of these.
    return [StatusCell(((GAP, *words), ()) if words else ((),), (10,)), StatusCell(shown, (6,))]


def _key_state_line(store: Store) -> StyledLine:
    """The state of the keys. A console that only observes does not show LIVE."""
    words: list[StyledSpan] = []
    if store.silent_seconds and not store.view.stop.latched:  # the effect of a stop sent meanwhile is unknown
        words.append((" SILENT ", "alarm"))
    elif store.key_state == "STOPPED":
        words.append((" STOPPED ", "alarm"))
    elif store.journal_status.trouble:
        words.append((" PAUSED ", "alarm"))
    if store.input_mode != "LIVE":  # also beside a stop: it stays after the release
        words.append((f" {store.input_mode} ", "call"))
    elif not words and store.has_control and not store.attach_reply.replay:
        words.append((" LIVE ", "strong"))
    return tuple(words)
