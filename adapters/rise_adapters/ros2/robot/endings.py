"""The one ending of an action at a server, with its reason, for everything that can arrive.

A reason begins with a word for programs (docs/explanation/ros2.md, "Nothing is lost on the way to the robot"). A
sentence for the people who run the study follows. Only `ResultQuery` and `Cancellation` have a state.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from math import inf
from typing import TypeAlias

from rise_adapters.ros2.actions.client import ABORTED, CANCELED, SUCCEEDED, UNKNOWN
from rise_adapters.ros2.compatibility import MISMATCH_KINDS, describe_several_servers
from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.robot.endpoints import ActionEndpoint, Endpoint, ServiceEndpoint
from rise_adapters.ros2.robot.goal_host import Ending
from rise_adapters.ros2.transport.port import Message

# --- asking for a result ----------------------------------------------------------------------------------------------

REPEAT_SECONDS = 5.0
"""Seconds between requests for a running goal's result. A server that was restarted unnoticed does not know the
goal."""
SHORT_REPEAT_SECONDS = 1.0
"""The shorter interval if there is a reason for doubt."""
UNKNOWN_GRACE = 0.3
"""Seconds that the status topic may take to report the ending of a goal whose result was discarded."""


class ResultQuery:
    """The requests for one goal's result. All times are session times in seconds."""

    def __init__(self) -> None:
        self.requests = 0
        """The number of requests."""
        self.responses = 0
        """The number of answers."""
        self.taken = False
        """Whether a result was processed. Further ones are duplicates."""
        self.finished_as = UNKNOWN
        """The goal's final status on the status topic; UNKNOWN: none yet."""
        self.missing_at = inf
        """When the result of a finished goal starts to count as missing."""
        self.discarded_at = inf
        """When a server that does not know the goal has had enough time to report its ending."""
        self._requested_at = 0.0

    def request(self, now: float) -> None:
        """Note that a request is about to be sent."""
        self.requests += 1
        self._requested_at = now

    def receive(self) -> bool:
        """Note an answer. True if there are now more answers than requests."""
        self.responses += 1
        return self.responses > self.requests

    def finish(self, now: float, status: int) -> None:
        """Note that the status topic reports the end of the goal."""
        self.finished_as = status
        self.missing_at = now + RESULT_GRACE

    def note_unknown_goal(self, now: float) -> None:
        """Note that the server does not know the goal. UNKNOWN_GRACE later the goal is judged."""
        self.discarded_at = now + UNKNOWN_GRACE

    def is_due(self, now: float) -> bool:
        return now >= self._requested_at + REPEAT_SECONDS

    def may_repeat_request(self, now: float) -> bool:
        """Whether the last request is old enough to repeat it when something seems wrong."""
        return now >= self._requested_at + SHORT_REPEAT_SECONDS

    def next_deadline(self) -> float:
        """The next time to ask again, or to give up."""
        return min(self._requested_at + REPEAT_SECONDS, self.missing_at, self.discarded_at)


# --- stopping a goal --------------------------------------------------------------------------------------------------

RETRY_SECONDS = 1.0
"""Seconds between failed requests to cancel."""
MAX_TRIES = 5
"""The number of requests at short intervals. Then the server is asked every SLOW_RETRY_SECONDS."""
SLOW_RETRY_SECONDS = 5.0
OVERDUE_SECONDS = 1.0
"""Seconds before a goal's time limit. A later cancel counts as the kernel's, which has already recorded an ending."""


class Cancellation:
    """The cancel of one goal, before or after the goal's end. All times are session times in seconds."""

    def __init__(self, seconds: float) -> None:
        """`seconds`: the profile's limit from the request to the end."""
        self.seconds = seconds
        self.wanted = False
        """Whether the engine has requested it."""
        self.overdue = False
        """Whether it did so because the goal's time limit was over."""
        self.deadline = inf
        """The time by which the goal must have ended."""
        self.next_try = inf
        """The time of the next request to the server."""
        self.tries = 0
        self.confirmed = False
        """Whether the server has confirmed that it cancels the goal, for any client."""
        self.refused_at: float | None = None
        """When the server first refused to stop the goal."""
        self._servers = -1
        """The value of `ServerPresence.changes` that `tries` belongs to."""

    def request(self, now: float, limit: float) -> None:
        """Note the engine's request. `limit`: when the kernel gives up the goal."""
        self.wanted = True
        self.overdue = now >= limit - OVERDUE_SECONDS
        self.deadline = now + self.seconds

    def begin_try(self, now: float) -> None:
        """Note that a request is about to be sent."""
        self.tries += 1
        self.next_try = now + (RETRY_SECONDS if self.tries <= MAX_TRIES else SLOW_RETRY_SECONDS)

    def start_over_for(self, servers: int) -> None:
        """Count the tries again from zero if the servers have changed."""
        if self._servers != servers:
            self._servers = servers
            self.tries = 0

    def pause(self) -> None:
        """Do not ask again automatically."""
        self.next_try = inf

    def confirm(self) -> None:
        self.confirmed = True
        self.refused_at = None

    def refuse(self, now: float) -> bool:
        """Note a refusal, and return whether it counts: only a later repetition does. The first may mean that the goal
        is stopping or has just ended."""
        if self.refused_at is None:
            self.refused_at = now
            return False
        return now >= self.refused_at + RETRY_SECONDS / 2


_LOG = logging.getLogger(__name__)

RESULT_GRACE = 2.0
"""Seconds that a result may arrive after the status topic has reported the end."""
_NO_RESULT = f"and its result did not come within {RESULT_GRACE:g} s"

Outcome: TypeAlias = tuple[Ending, str]
"""A status and its reason."""


def of_result(status: int, result: Message, mapping: ActionMapping, name: str, *, cancel_wanted: bool) -> Outcome:
    """The ending for a server's result. `status`: SUCCEEDED, CANCELED or ABORTED; `name`: the action's name on ROS."""
    if status == CANCELED:
        return "canceled", "" if cancel_wanted else f"canceled: somebody else stopped it at {name}"
    if status == ABORTED:
        why = _read(mapping.result_rule.why_not_succeeded, result, name) or "the robot gave it up and did not say why"
        return "aborted", f"aborted: {why}"
    if wrong := _read(mapping.result_rule.failure, result, name):
        return "failed", f"robot-error: {wrong}"
    if cancel_wanted:
        return "succeeded", "succeeded-during-cancel: the robot finished it although it was asked to stop"
    return "succeeded", ""


def of_response(response: Message, mapping: ActionMapping, name: str) -> Outcome:
    """The ending for a service's answer."""
    wrong = _read(mapping.result_rule.failure, response, name)
    return ("failed", f"robot-error: {wrong}") if wrong else ("succeeded", "")


def of_unstoppable_call(name: str, *, is_overdue: bool) -> Outcome:
    """The ending of a cancelled service call: no service supports that. `is_overdue`: its time limit was over."""
    what = f"nothing stops a call of {name}; the robot may go on until it answers"
    return ("timed-out", f"no-result: {what}") if is_overdue else ("canceled", f"unstoppable: {what}")


def is_overdue(now: float, limit_at: float) -> bool:
    """Whether a cancel at this time comes from the kernel, at the end of the action's time limit."""
    return now >= limit_at - OVERDUE_SECONDS


def of_late_start(seconds: float) -> Outcome:
    """The ending if a standstill of the session delayed a possible start until `seconds` after the deadline."""
    return "failed", f"standstill: the session stood still, and it would have begun {seconds:.0f} s too late"


def of_missing_answer(name: str, seconds: float | None) -> Outcome:
    """The ending if the server did not answer the goal within `seconds`; None: the goal was cancelled before that."""
    what = f"it was asked to stop, and {name} had not accepted it yet"
    if seconds is not None:
        what = f"{name} did not say within {seconds:g} s whether it accepts it"
    return "timed-out", f"no-accept: {what}"


def of_silence(name: str, seconds: float) -> Outcome:
    return "lost", f"silent: {name} has sent no feedback for {seconds:g} s"


def of_overdue_result(name: str, expected: float, grace: float) -> Outcome:
    """The ending if the action takes longer than allowed. `expected` and `grace` are in seconds."""
    what = f"it should have taken {expected:.1f} s, and {name} had not ended it {grace:g} s later"
    return "timed-out", f"no-result: {what}"


def of_missing_result(status: int | None, name: str, *, cancel_wanted: bool) -> Outcome:
    """The ending if the status topic reported the end (as `status`), but no result arrives."""
    if status == CANCELED:
        return "canceled", "" if cancel_wanted else f"canceled: somebody else stopped it, {_NO_RESULT}"
    if status == ABORTED:
        return "aborted", f"aborted: {_NO_RESULT}"
    return "timed-out", f"no-result: {name} says that it has ended, {_NO_RESULT}"


def of_discarded_result(status: int, name: str, *, cancel_wanted: bool) -> Outcome:
    """The ending if the server no longer knows the goal. `status`: the final status on its status topic, if any."""
    gone = f"{name} did not keep its result (its result_timeout is too short)"
    if status == SUCCEEDED and cancel_wanted:
        return "succeeded", f"succeeded-during-cancel: {gone}"
    if status == SUCCEEDED:
        return "succeeded", f"result-not-kept: it says that it succeeded, and {gone}"
    if status == CANCELED:
        return "canceled", "" if cancel_wanted else f"canceled: somebody else stopped it; {gone}"
    if status == ABORTED:
        return "aborted", f"aborted: the reason is unknown; {gone}"
    return of_restart(name)


def of_restart(name: str) -> Outcome:
    """The ending if the server does not know the goal and reports nothing else."""
    return "lost", f"server-restarted: {name} no longer knows it; was the robot's wrapper restarted?"


def of_failed_cancel(cancellation: Cancellation, name: str) -> Outcome:
    """The ending if a cancelled goal did not stop in time."""
    seconds = cancellation.seconds
    if cancellation.confirmed:
        return "lost", f"cancel-unconfirmed: {name} said that it would stop, but did not within {seconds:g} s"
    if cancellation.refused_at is not None:
        return "failed", f"cancel-refused: {name} refused to cancel it; it may still be running"
    return "lost", f"cancel-unanswered: {name} did not answer within {seconds:g} s"


def of_missing_server(endpoint: ActionEndpoint | ServiceEndpoint, sends: int) -> Outcome:
    """The ending if no server accepted the goal in time. `sends`: how many times it was sent."""
    presence = endpoint.presence
    if sends:
        why = f"the server of {endpoint.name} went away {times_in_words(sends)} before it accepted the action"
    elif presence.count and not presence.is_settled:
        why = f"{endpoint.name} comes and goes, {times_in_words(presence.recent_losses)} lately"
    else:
        why = describe_missing(endpoint)
    return "failed", f"server-missing: {why}"


def of_two_servers(endpoint: ActionEndpoint | ServiceEndpoint) -> Outcome:
    return "failed", f"two-servers: {describe_several_servers(endpoint.presence.count, endpoint.name)}; end all but one"


def of_lost_robot(reason: str, *, was_sent: bool) -> Outcome:
    """The ending if the whole robot is lost. A goal that was not sent has failed; the state of a sent one is
    unknown."""
    if was_sent:
        return "lost", reason
    return "failed", reason if reason.startswith(("server-missing", *MISMATCH_KINDS)) else f"server-missing: {reason}"


def describe_missing(endpoint: Endpoint) -> str:
    """Why an endpoint cannot be reached, with a hint if nothing of it is visible."""
    return endpoint.trouble + ("" if endpoint.comparison.seen else "; is the robot's wrapper running?")


def times_in_words(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _read(read: Callable[[Message], str], result: Message, name: str) -> str:
    """The text that a rule of the profile reads from a result, or a sentence that it cannot be read."""
    try:
        return read(result)
    except Exception as error:  # the rule comes from a profile, the data from another program
        _LOG.exception("a result of %s cannot be read", name)
        return f"its result cannot be read ({error})"
