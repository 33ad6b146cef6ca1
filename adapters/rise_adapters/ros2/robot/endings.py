"""How an action at a server ends: for everything that the wire can bring, the one ending and its reason.

A reason begins with a word that programs can look for (docs/explanation/ros2.md, "Nothing is lost on the way to the
robot"), and goes on with a sentence for the people who run the study. Nothing here has a state.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from math import inf
from typing import TypeAlias

from rise_adapters.ros2.actions.client import ABORTED, CANCELED, SUCCEEDED, UNKNOWN
from rise_adapters.ros2.compatibility import MISFIT_KINDS, describe_several_servers
from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.robot.endpoints import ActionEndpoint, Endpoint, ServiceEndpoint
from rise_adapters.ros2.robot.goal_host import Ending
from rise_adapters.ros2.transport.port import Message
from rise_engine.kernel.act_runner import CANCEL_LIMIT

# --- asking for a result ----------------------------------------------------------------------------------------------

REPEAT_SECONDS = 5.0
"""After which a running goal's result is asked for once more: a server that was restarted unnoticed answers at once
that it does not know the goal."""
DOUBT_SECONDS = 1.0
"""The same when there is a reason to doubt."""
UNKNOWN_GRACE = 0.3
"""Seconds that the status topic may need to say how a goal has ended whose result the server has thrown away."""


class ResultQuery:
    """Asking for one goal's result. All times are session times in seconds."""

    def __init__(self) -> None:
        self.requests = 0
        """How often it was asked for ..."""
        self.responses = 0
        """... and how often an answer came."""
        self.taken = False
        """A result has been looked at; further ones say the same."""
        self.finished_as = UNKNOWN
        """How the goal is over, in the words of the status topic; UNKNOWN: it does not say so."""
        self.missing_at = inf
        """From when on the result of a goal that is over counts as missing."""
        self.discarded_at = inf
        """From when on a server that says that it does not know the goal has had the time to say how it ended."""
        self._requested_at = 0.0

    def request(self, now: float) -> None:
        """A request is about to be sent."""
        self.requests += 1
        self._requested_at = now

    def receive(self) -> bool:
        """An answer has come. Whether it is one more than was asked for."""
        self.responses += 1
        return self.responses > self.requests

    def finish(self, now: float, status: int) -> None:
        """The status topic says that the goal is over."""
        self.finished_as = status
        self.missing_at = now + RESULT_GRACE

    def disown(self, now: float) -> None:
        """The server says that it does not know the goal; what that means is decided a moment later."""
        self.discarded_at = now + UNKNOWN_GRACE

    def is_due(self, now: float) -> bool:
        return now >= self._requested_at + REPEAT_SECONDS

    def may_doubt(self, now: float) -> bool:
        """Whether the last request is so long ago that another one is worth it, where something seems to be wrong."""
        return now >= self._requested_at + DOUBT_SECONDS

    def next_deadline(self) -> float:
        """When something is due: to ask again, or to ask no more."""
        return min(self._requested_at + REPEAT_SECONDS, self.missing_at, self.discarded_at)


# --- stopping a goal --------------------------------------------------------------------------------------------------

RETRY_SECONDS = 1.0
"""Between requests to cancel that bring nothing."""
MAX_TRIES = 5
"""So many requests follow each other closely; after them the server is asked every SLOW_RETRY_SECONDS."""
SLOW_RETRY_SECONDS = 5.0
MAX_SECONDS = CANCEL_LIMIT - 0.25
"""Seconds. The kernel gives a cancel up after CANCEL_LIMIT; our word about it must be there before."""
OVERDUE_SECONDS = 1.0
"""Before a goal's time limit, from which on a cancel counts as the kernel's, which has recorded an ending."""


class Cancellation:
    """One goal's cancel, before or after the goal's end. All times are session times in seconds."""

    def __init__(self, seconds: float) -> None:
        """`seconds`: what the profile allows from the request to the end."""
        self.seconds = min(seconds, MAX_SECONDS)
        self.wanted = False
        """The engine has asked for it."""
        self.overdue = False
        """... when the goal's time was over."""
        self.deadline = inf
        """By when the goal must have ended."""
        self.next_try = inf
        """When the server is asked (again)."""
        self.tries = 0
        self.confirmed = False
        """The server has said that it cancels it, whoever asked for that."""
        self.refused_at: float | None = None
        """When the server did not let it be stopped for the first time."""
        self._servers = -1
        """The servers (`ServerPresence.changes`) that `tries` counts for."""

    def request(self, now: float, limit: float) -> None:
        """The engine wants it stopped; `limit` is when the kernel gives the goal up."""
        self.wanted = True
        self.overdue = now >= limit - OVERDUE_SECONDS
        self.deadline = now + self.seconds

    def begin_try(self, now: float) -> None:
        """A request is about to be sent."""
        self.tries += 1
        self.next_try = now + (RETRY_SECONDS if self.tries <= MAX_TRIES else SLOW_RETRY_SECONDS)

    def start_over_for(self, servers: int) -> None:
        """Count the tries anew when there are other servers than before."""
        if self._servers != servers:
            self._servers = servers
            self.tries = 0

    def pause(self) -> None:
        """Do not ask again by itself."""
        self.next_try = inf

    def confirm(self) -> None:
        self.confirmed = True
        self.refused_at = None

    def refuse(self, now: float) -> bool:
        """The server did not let it be stopped; or it is at it already, or over at this very moment, which is answered
        the same way. True when it says so again a while later: only then it has refused."""
        if self.refused_at is None:
            self.refused_at = now
            return False
        return now >= self.refused_at + RETRY_SECONDS / 2


_LOG = logging.getLogger(__name__)

RESULT_GRACE = 2.0
"""Seconds that a result may come after the status topic has said that the goal is over."""
_NO_RESULT = f"and its result did not come within {RESULT_GRACE:g} s"

Outcome: TypeAlias = tuple[Ending, str]
"""A status, and its reason."""


def of_result(status: int, result: Message, mapping: ActionMapping, name: str, *, cancel_wanted: bool) -> Outcome:
    """The server has given the result. `status` is one of SUCCEEDED, CANCELED, ABORTED; `name` the action's on ROS."""
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
    """A service has answered."""
    wrong = _read(mapping.result_rule.failure, response, name)
    return ("failed", f"robot-error: {wrong}") if wrong else ("succeeded", "")


def of_unstoppable_call(name: str, *, is_overdue: bool) -> Outcome:
    """A call was to be stopped, which no service can. `is_overdue`: its time was over."""
    what = f"nothing stops a call of {name}; the robot may go on until it answers"
    return ("timed-out", f"no-result: {what}") if is_overdue else ("canceled", f"unstoppable: {what}")


def is_overdue(now: float, limit_at: float) -> bool:
    """Whether a cancel at this time is the kernel's, at the end of the time that the action may take."""
    return now >= limit_at - OVERDUE_SECONDS


def of_missing_answer(name: str, seconds: float | None) -> Outcome:
    """The server did not say whether it takes it within `seconds`; None: it was to be stopped before that."""
    what = f"it was asked to stop, and {name} had not accepted it yet"
    if seconds is not None:
        what = f"{name} did not say within {seconds:g} s whether it accepts it"
    return "timed-out", f"no-accept: {what}"


def of_silence(name: str, seconds: float) -> Outcome:
    return "lost", f"silent: {name} has sent no feedback for {seconds:g} s"


def of_overdue_result(name: str, expected: float, grace: float) -> Outcome:
    """It takes longer than it may. `expected` and `grace` in seconds."""
    what = f"it should have taken {expected:.1f} s, and {name} had not ended it {grace:g} s later"
    return "timed-out", f"no-result: {what}"


def of_missing_result(status: int | None, name: str, *, cancel_wanted: bool) -> Outcome:
    """The status topic has said that it is over (as `status`), and the result does not come."""
    if status == CANCELED:
        return "canceled", "" if cancel_wanted else f"canceled: somebody else stopped it, {_NO_RESULT}"
    if status == ABORTED:
        return "aborted", f"aborted: {_NO_RESULT}"
    return "timed-out", f"no-result: {name} says that it has ended, {_NO_RESULT}"


def of_discarded_result(status: int, name: str, *, cancel_wanted: bool) -> Outcome:
    """The server does not know it any more. What its status topic has said of the end is `status`, if it did."""
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
    """The server does not know it, and says nothing else."""
    return "lost", f"server-restarted: {name} does not know it any more; was the robot's wrapper restarted?"


def of_failed_cancel(cancellation: Cancellation, name: str) -> Outcome:
    """It was to be stopped and was not, in the time that there was for that."""
    seconds = cancellation.seconds
    if cancellation.confirmed:
        return "lost", f"cancel-unconfirmed: {name} said that it stops, and did not within {seconds:g} s"
    if cancellation.refused_at is not None:
        return "failed", f"cancel-refused: {name} did not let it be stopped; it may still be going on"
    return "lost", f"cancel-unanswered: {name} did not answer within {seconds:g} s"


def of_missing_server(endpoint: ActionEndpoint | ServiceEndpoint, sends: int) -> Outcome:
    """Nothing took it in time. `sends`: how often it was sent nevertheless."""
    presence = endpoint.presence
    if sends:
        why = f"what offers {endpoint.name} went away {times_in_words(sends)} before it took it"
    elif presence.count and not presence.is_settled:
        why = f"{endpoint.name} comes and goes, {times_in_words(presence.recent_losses)} lately"
    else:
        why = describe_missing(endpoint)
    return "failed", f"server-missing: {why}"


def of_two_servers(endpoint: ActionEndpoint | ServiceEndpoint) -> Outcome:
    return "failed", f"two-servers: {describe_several_servers(endpoint.presence.count, endpoint.name)}; end all but one"


def of_lost_robot(reason: str, *, was_sent: bool) -> Outcome:
    """The robot is lost as a whole, for this reason. What was not sent has failed; what was, nobody knows."""
    if was_sent:
        return "lost", reason
    return "failed", reason if reason.startswith(("server-missing", *MISFIT_KINDS)) else f"server-missing: {reason}"


def describe_missing(endpoint: Endpoint) -> str:
    """Why an endpoint cannot be reached, with a hint where nothing of it is seen."""
    return endpoint.trouble + ("" if endpoint.comparison.seen else "; is the robot's wrapper running?")


def times_in_words(number: int) -> str:
    return "once" if number == 1 else f"{number} times"


def _read(read: Callable[[Message], str], result: Message, name: str) -> str:
    """What a rule of the profile reads in a result; or that it cannot."""
    try:
        return read(result)
    except Exception as error:  # a rule of the profile, on whatever another program has sent
        _LOG.exception("a result of %s cannot be read", name)
        return f"its result cannot be read ({error})"
