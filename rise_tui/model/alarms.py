"""Alarms that every wizard must see immediately: the fault, what still works, and the remedy, in words. Pure.

An alarm takes three lines, or four after a stop if some parts have not confirmed and others cannot be stopped. Of
several alarms, the worst is shown, and the last line names the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from time import monotonic

from rise_engine.kernel.records import RecordingRecord
from rise_engine.kernel.view import StopView
from rise_engine.run.protocol.client import UnrecordedStop
from rise_tui.model.control import KeyNames
from rise_tui.model.notice import short_name
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, StyledSpan, TextRole, clean, format_age, format_clock, line_width

RUNNING_STATES = frozenset({"started", "running"})
BROKEN = ("failed", "stalled")
"""The worse status first."""


def recorders_of(store: Store) -> list[RecordingRecord]:
    """The last report of each recorder, the worst first. Empty if the engine has gone, in a replay, and for an engine
    before a recovery, because those recorders may have gone, too."""
    if store.gone_reason or store.cut_since is not None or store.attach_reply.replay:
        return []
    session = store.view.session
    recovered = session.seq if session is not None and session.status == "recovered" else 0
    known = [each for each in store.view.recordings.values() if each.seq > recovered]
    order = [*BROKEN, "stopped"]
    return sorted(known, key=lambda each: order.index(each.status) if each.status in order else len(order))


def broken_recorders(store: Store) -> list[RecordingRecord]:
    """The recorders that should record, but do not."""
    return [each for each in recorders_of(store) if each.status in BROKEN]


def recorders_word(store: Store) -> tuple[str, str, TextRole] | None:
    """The name of the worst recorder and its state, in capitals if it is bad; None: all run, or there are none.

    If only some have stopped, those are named.
    """
    known = recorders_of(store)
    if not known or all(each.status in RUNNING_STATES for each in known):
        return None
    worst = known[0]
    also = sum(each.status == worst.status for each in known) - 1
    name = clean(worst.name) + (f" +{also}" if also else "")
    if worst.status in BROKEN:
        return name, worst.status.upper(), "fault"
    return name, worst.status, "wait"


def all_recorders_run(store: Store) -> bool:
    """Whether there are recorders, and all of them record."""
    known = recorders_of(store)
    return bool(known) and all(each.status in RUNNING_STATES for each in known)


def broken_recorders_text(store: Store) -> str:
    """The recorders that do not record, since when and why; empty: all run. All names come before the first reason,
    which may be cut."""
    broken = broken_recorders(store)
    failures = ", ".join(f"{clean(each.name)} {each.status.upper()} at {format_clock(each.t)}" for each in broken)
    if len(broken) == 1:
        reasons = clean(broken[0].reason)
    else:
        reasons = "; ".join(f"{clean(each.name)}: {clean(each.reason)}" for each in broken if each.reason)
    return f"✗ not recorded: {failures}" + (f": {reasons}" if reasons else "") if failures else ""


def shadow_line(store: Store, key_name: KeyNames, width: int) -> StyledLine:
    """`SHADOW  cue 3 of 12   F8 pauses   your keys are recorded, not sent`; empty outside a shadow.

    The most important part comes first, because the line may be cut.
    """
    status = store.shadow
    if not store.attach_reply.shadow or status is None:
        return ()
    lead: StyledLine = ((" SHADOW ", "alarm"), (f" cue {status.shown} of {status.cues}  ", "strong"))
    if store.gone_reason:
        state: StyledLine = (("all cues were shown", "strong"), ("  leave, and compare: rise-engine agree", "plain"))
    elif status.paused:
        at = format_clock(store.now())
        state = ((f" \u2016 PAUSED at {at} ", "call"), (f"  {key_name('control')} resumes here", "plain"))
    else:
        state = ((f"\u25b6 {key_name('control')} pauses", "plain"),)
    nowhere: StyledLine = (("   your keys are recorded, not sent", "plain"),)
    line = (*lead, *state)
    return (*line, *nowhere) if line_width(line) + line_width(nowhere) <= width else line


CUT_SECONDS = 1.0
"""Seconds that a cut connection may last without an alarm."""


class Alarm:
    """One fault."""

    def __init__(self, head: StyledLine, *more: StyledLine, counts_seconds: bool = False) -> None:
        """`more`: its other lines. `counts_seconds`: it shows its duration, so it changes every second."""
        self.head, self.more, self.counts_seconds = head, more, counts_seconds


def alarm_lines(found: Sequence[Alarm]) -> tuple[StyledLine, ...]:
    """The lines to show."""
    if not found:
        return ()
    worst, *others = found
    if not others:
        return (worst.head, *worst.more)
    # The second line is more important than the others, except for lines about parts that may still move after a stop.
    middle = [line for line in worst.more if any(role == "fault" for _, role in line)] or worst.more[:1]
    gap: StyledLine = (("  ", "plain"),)
    named = others[0].head if len(others) == 1 else sum((other.head[:1] + gap for other in others), ())
    return (worst.head, *middle, named)


def current_alarms(store: Store, key_name: KeyNames) -> list[Alarm]:
    """All alarms, the worst first."""
    if store.gone_reason:
        return [_gone_alarm(store, key_name)]
    if store.cut_since is not None and (store.stop_unsent or monotonic() - store.cut_since >= CUT_SECONDS):
        return [_cut_alarm(store, store.cut_since)]
    return [
        *_silent_alarms(store, key_name),
        *_stop_alarms(store, key_name),
        *_recording_alarms(store, key_name),
        *_robot_alarms(store, key_name),
        *_open_goal_alarms(store, key_name),
    ]


def _gone_alarm(store: Store, key_name: KeyNames) -> Alarm:
    leave: StyledSpan = (f"   {key_name('quit')}", "key")
    if store.end_unrecorded:
        sent = store.journal_status.stop
        unknown: StyledLine = (("   what the robot was doing then is not known", "plain"),)
        return Alarm(
            ((" ■ ENDED, NOT RECORDED ", "alarm"), ("  the disk did not take its end: look at the robot", "strong")),
            *(_answer_lines(sent, key_name)[1:] if sent is not None and sent.answered else (unknown,)),
            (leave, (" leaves", "plain")),
        )
    if store.ended_in_order:
        return Alarm(
            ((" ■ SESSION ENDED ", "alarm"), (f"  {store.gone_reason}", "strong")),
            (("   keys do nothing now; the screen shows how it ended", "plain"),),
            (leave, (" leaves", "plain")),
        )
    again = "recovers the session, or leaves" if store.attach_reply.folder else "leaves"
    if store.attach_reply.role == "observer":
        again = "watches again once it is recovered, or leaves"
    stop = key_name("stop")
    return Alarm(
        ((" ✗ ENGINE GONE ", "alarm"), (f"  {store.gone_reason}", "strong")),
        ((f"   no key reaches the robot, not even {stop}; use the robot's own switch", "plain"),),
        (leave, (f" {again}; this is the last known state", "plain")),
    )


def unrecorded_end_text(store: Store) -> str:
    """The warning after the end of a session whose record has no end; empty: it has one."""
    if not store.end_unrecorded:
        return ""
    stop = store.journal_status.stop
    stopped = f"; {stop.sentence}" if stop is not None else ""
    return f"LOOK AT THE ROBOT: the session has ended, and the end of its record could not be written{stopped}"


def _cut_alarm(store: Store, since: float) -> Alarm:
    head = " ✗ STOP NOT SENT " if store.stop_unsent else " ✗ CONNECTION CUT "
    return Alarm(
        ((head, "alarm"), (f"  cut {format_age(monotonic() - since)} ago; the console is reconnecting", "strong")),
        (("   the session goes on without this console; no key reaches it", "plain"),),
        (("   to stop the robot now, use its own switch", "strong"),),
        counts_seconds=True,
    )


def _silent_alarms(store: Store, key_name: KeyNames) -> Iterator[Alarm]:
    if silent := store.silent_seconds:
        yield Alarm(
            ((" ✗ ENGINE SILENT ", "alarm"), (f"  no sign of life for {format_age(silent)}", "strong")),
            (("   keys start nothing until it answers; this is the last known state", "plain"),),
            ((f"   {key_name('stop')} may not reach the robot: use its own switch", "fault"),),
            counts_seconds=True,
        )


def _stop_alarms(store: Store, key_name: KeyNames) -> Iterator[Alarm]:
    stop = store.view.stop
    if (unrecorded := store.journal_status.stop) is not None:
        yield Alarm(
            (
                (" ■ STOP ", "alarm"),
                (f"  sent to the robot by {short_name(unrecorded.source)}; not recorded yet", "strong"),
            ),
            *(_answer_lines(unrecorded, key_name) if unrecorded.answered else _WAITING),
        )
    elif not stop.latched:
        if store.stopping:
            yield Alarm(((" ■ STOP sent ", "alarm"), ("  waiting for the engine", "strong")))
    elif stop.status == "requested":
        yield Alarm(
            (
                (" ■ STOP requested ", "alarm"),
                (f"  asked {format_clock(stop.since)} by {short_name(stop.source)}", "strong"),
            ),
            *_WAITING,
        )
    else:
        head = "nothing starts until it is released"
        release: StyledLine = ((f"   {key_name('release')} release", "key"),) if store.has_control else ()
        if stop.held_by:
            head, release = f"{', '.join(map(short_name, stop.held_by))} has not been let go", ()
        confirmed, *missing = _answer_lines(stop, key_name)
        yield Alarm(
            ((" ■ STOPPED ", "alarm"), (f"  {head}", "strong"), *release),
            (*confirmed, (f"   by {short_name(stop.source)}", "muted")),
            *missing,
        )


_WAITING: tuple[StyledLine, ...] = (
    (("   waiting for the robot to confirm", "plain"),),
    (("   if the robot keeps moving, use its own switch", "plain"),),
)


def _answer_lines(stop: StopView | UnrecordedStop, key_name: KeyNames) -> list[StyledLine]:
    """The parts that have confirmed a stop, and those that have not, which are cut last."""
    look: StyledLine = ((f"   look at the robot; {key_name('stop')} asks again", "plain"),) if stop.unconfirmed else ()
    confirmed = group_parts(stop.confirmed) or "no part"
    lines: list[StyledLine] = [((f"   {'confirmed':<15}", "plain"), (confirmed, "strong"), *look)]
    for words, parts in (("NOT CONFIRMED", stop.unconfirmed), ("CANNOT BE STOPPED", stop.unstoppable)):
        if parts:
            lines.append(((f"   {words}  ", "fault"), (group_parts(parts), "strong")))
    if len(lines) > 1 or not stop.confirmed:
        return lines
    return [*lines, (("   every part has confirmed", "plain"),)]


def _recording_alarms(store: Store, key_name: KeyNames) -> Iterator[Alarm]:
    if why := store.journal_status.trouble:
        yield Alarm(
            ((" ✗ NOT RECORDING ", "alarm"), (f"  {why}", "strong")),
            (("   the session is paused until the disk accepts records again", "plain"),),
            ((f"   {key_name('stop')}", "key"), (" still stops the robot; free some disk space", "plain")),
        )


def _robot_alarms(store: Store, key_name: KeyNames) -> Iterator[Alarm]:
    robot = store.view.robot
    if robot is None or robot.status != "lost":
        return
    since = f"  for {format_age(store.now() - robot.t)}"
    broken = [name for name, act in store.view.acts.items() if act.last is not None and act.last.ended == robot.t]
    broken += ["the say line"] if _speech_ended_at(store, robot.t) else []
    until = "acts fail until the robot is back; rules and memory go on"
    was = f"interrupted: {', '.join(broken)}; " if broken else ""
    switch = f"check the robot and its network; {key_name('stop')} may not reach it, its own switch will"
    then = (
        f"this is a {store.attach_reply.recorded_as}: it shows what happened then"
        if store.attach_reply.is_recorded
        else switch
    )
    yield Alarm(
        ((" ✗ ROBOT LOST ", "alarm"), (f"{since}: {robot.detail}" if robot.detail else since, "strong")),
        ((f"   {was}{until}", "plain"),),
        ((f"   {then}", "plain"),),
        counts_seconds=True,
    )


def _open_goal_alarms(store: Store, key_name: KeyNames) -> Iterator[Alarm]:
    """Alarms about open goals. During a stop, the stop's own alarm covers them."""
    open = store.open_goals
    if not open or store.view.stop.latched:
        return
    first, *others = open
    more = f", and {len(others)} more" if others else ""
    keys: StyledLine = (
        (f"   {key_name('cancel-open')}", "key"),
        (" asks it to stop", "plain"),
        (f"   {key_name('release')}", "key"),
        (" releases the part", "plain"),
    )
    yield Alarm(
        (
            (" ✗ STILL RUNNING? ", "alarm"),
            (f"  {first.part} may still be doing {first.type}{more}", "strong"),
        ),
        ((f"   {first.reason}", "wait"), ("; the part gets no new actions; look at the robot", "plain")),
        keys if not store.attach_reply.replay else (),
    )


def _speech_ended_at(store: Store, at: float) -> bool:
    """Whether free speech ended at this time."""
    latest = next(reversed(store.view.tasks.values()), None)
    return latest is not None and latest.function == "say" and latest.ended == at


def degraded_text(store: Store) -> str:
    """The fault of a robot that still works, or empty. Open goals have an alarm of their own."""
    robot = store.view.robot
    if robot is None or robot.status != "degraded" or store.open_goals:
        return ""
    return f"◐ robot degraded since {format_clock(robot.t)}: {robot.detail or 'no details given'}"


def group_parts(names: Sequence[str]) -> str:
    """Parts of robots, with each robot named once: `pepper: arms, gaze`."""
    by_robot: dict[str, list[str]] = {}
    for name in names:
        robot, _, part = name.rpartition("/")
        by_robot.setdefault(f"{robot}: " if robot else "", []).append(part)
    return "; ".join(robot + ", ".join(parts) for robot, parts in by_robot.items())
