"""A recorded session that is played to a second wizard: the line that says so. Pure; knows no screen."""

from __future__ import annotations

from rise_tui.model.blocked import KeyNames
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, format_clock, line_width


def shadow_line(store: Store, key_name: KeyNames, width: int) -> StyledLine:
    """`SHADOW  cue 3 of 12   F8 pauses   your keys are recorded, not sent`; empty when it is none.

    What comes first matters most where the line is cut.
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
