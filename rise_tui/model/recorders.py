"""Whether everything records: the record itself, and what records the session from outside, in one word. Pure."""

from __future__ import annotations

from rise_engine.kernel.records import RecordingRecord
from rise_tui.model.store import Store
from rise_tui.rendering.text import TextRole, clean, format_clock

RUNS = frozenset({"started", "running"})
BROKEN = ("failed", "stalled")
"""The worse one first."""


def recorders_of(store: Store) -> list[RecordingRecord]:
    """The last word of each recorder, the worst first; none of an engine that has gone, of a replay, or of an engine
    before the one that recovered the session: whoever wrote that word may be gone, too."""
    if store.gone_reason or store.cut_since is not None or store.attach_reply.replay:
        return []
    session = store.view.session
    recovered = session.seq if session is not None and session.status == "recovered" else 0
    known = [each for each in store.view.recordings.values() if each.seq > recovered]
    order = [*BROKEN, "stopped"]
    return sorted(known, key=lambda each: order.index(each.status) if each.status in order else len(order))


def broken_recorders(store: Store) -> list[RecordingRecord]:
    """Those that should record, and do not."""
    return [each for each in recorders_of(store) if each.status in BROKEN]


def recorders_word(store: Store) -> tuple[str, str, TextRole] | None:
    """The name of the worst recorder and how it stands, in capitals where it is bad; None: all run, or there are none.

    When some run and others have stopped, those that have stopped are told.
    """
    known = recorders_of(store)
    if not known or all(each.status in RUNS for each in known):
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
    return bool(known) and all(each.status in RUNS for each in known)


def broken_recorders_text(store: Store) -> str:
    """What does not record, since when and why; all names stand before the first reason, which may be cut off. Empty
    when everything does."""
    broken = broken_recorders(store)
    told = ", ".join(f"{clean(each.name)} {each.status.upper()} at {format_clock(each.t)}" for each in broken)
    if len(broken) == 1:
        reasons = clean(broken[0].reason)
    else:
        reasons = "; ".join(f"{clean(each.name)}: {clean(each.reason)}" for each in broken if each.reason)
    return f"✗ not recorded: {told}" + (f": {reasons}" if reasons else "") if told else ""
