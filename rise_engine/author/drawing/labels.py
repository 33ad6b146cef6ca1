"""Short names of what rules wait for, as drawings and screens show them."""

from __future__ import annotations

from rise_engine.scenario.model import Delay, Transition


def delay_text(delay: Delay) -> str:
    """A time as it is shown: `8 s`, or the expression that gives it."""
    return delay.text if delay.seconds is None else f"{delay.seconds:g} s"


def transition_label(transition: Transition, *, condition: bool = False) -> str:
    """A transition's short name: its event, its time, or its condition; with `condition`, also what must be true then.

    >>> transition_label(Transition(event="next", target="Tea"))
    'next'
    """
    label = _waited_label(transition)
    if condition and transition.condition is not None and not transition.is_eventless:
        return f"{label} if {transition.condition.text}"
    return label


def _waited_label(transition: Transition) -> str:
    if transition.ended is not None:
        return f"{transition.ended} {' or '.join(transition.outcomes) or 'ended'}"
    if transition.event is not None:
        return transition.event
    if transition.after is not None:
        time = f"after {delay_text(transition.after)}"
        return time if transition.held is None else f"{time} of {transition.held.text}"
    return transition.condition.text if transition.condition is not None else "at once"
