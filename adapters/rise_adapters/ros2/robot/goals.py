"""One action on its way to the robot and back: a deadline for each phase, and exactly one ending whatever happens.

    waiting --a server is there--> sent --accepted--> running --result--> ended
       |                            |                   |
       +-- server-missing           +-- rejected        +-- lost, timed-out, aborted, cancel-refused, ...
           two-servers              +-- no-accept

A goal that has ended for the engine may still run on the robot: one that was accepted too late, or that refused to be
cancelled. It is remembered under its id and cancelled as soon as the server can be reached, and what it then says is
noted and changes nothing.

Nothing in here has a timer of its own. `due` says when a goal wants to be looked at, `look` does what is due.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias
from uuid import uuid4

from rise_adapters.ros2.action_client import (
    ABORTED,
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCELED,
    CANCELING,
    SUCCEEDED,
    TERMINAL,
    UNKNOWN,
    CancelAnswer,
)
from rise_adapters.ros2.ends import WORDS, several
from rise_adapters.ros2.port import Message, PortError
from rise_adapters.ros2.robot.parts import ActionPart, Part
from rise_engine.kernel.acts import CANCEL_LIMIT
from rise_engine.robot import Clock

if TYPE_CHECKING:
    from rise_adapters.ros2.carriers import Carrier
    from rise_adapters.ros2.robot.topic_goals import TopicGoal

_LOG = logging.getLogger(__name__)

Phase: TypeAlias = Literal["waiting", "sent", "running", "ended"]
Ending: TypeAlias = Literal["succeeded", "failed", "canceled", "timed-out", "lost"]

NAMES = ("unknown", "accepted", "executing", "canceling", "succeeded", "canceled", "aborted")
"""Of a goal's status, for a person."""

SENDS = 3
"""How often a goal is sent at most, when its server goes away before it has answered. It keeps its id, so that a server
which has it already refuses it."""
ASK_AGAIN = 5.0
"""Seconds after which a running goal's result is asked for once more: a server that was restarted unnoticed answers at
once that it does not know the goal."""
LOOK_AGAIN = 1.0
"""The same when there is a reason to doubt, and between requests to cancel that bring nothing."""
CANCELS = 5
"""How often a goal that has ended here is cancelled at most while its server is there."""
CANCEL_MOST = CANCEL_LIMIT - 0.25
"""The kernel gives a cancel up after CANCEL_LIMIT; our word about it must be there before."""
RESULT_GRACE = 2.0
"""Seconds that a result may come after the status topic has said that the goal is over."""
UNKNOWN_GRACE = 0.3
"""Seconds that the status topic may need to say how a goal has ended whose result the server has thrown away."""
EARLY = 1e-5
"""Seconds that a timer may be early."""
OVERDUE = 1.0
"""Seconds before a goal's time limit from which a cancel counts as the kernel's, which has recorded an ending."""


class Home(Protocol):
    """What a goal needs of its robot."""

    clock: Clock

    def accepted(self, action: str) -> None: ...

    def ended(self, action: str, status: Ending, reason: str) -> None:
        """The one ending of an action."""
        ...

    def note(self, part: Part, text: str) -> None: ...

    def changed(self, goal: ActionGoal | TopicGoal) -> None:
        """A goal wants to be looked at at another time than before, or stands otherwise."""
        ...


class ActionGoal:
    """One goal of ours at one action server."""

    def __init__(
        self,
        home: Home,
        part: ActionPart,
        action: str,
        carrier: Carrier,
        message: Message,
        expected: float,
        limit: float,
    ) -> None:
        """`expected` and `limit` in seconds: how long it will take, and when the kernel gives it up."""
        self.id = uuid4().bytes
        self.action = action
        self.phase: Phase = "waiting"
        self._home = home
        self.part = part
        self._carrier = carrier
        self._message = message
        self._expected = expected
        now = home.clock.now()
        self._limit_at = now + limit
        self._server_by = now + carrier.deadlines.server
        self._deadline = self._server_by
        """Of the phase."""
        self._sends = 0
        self._accepted: bool | None = None
        """What the server said; None: nothing yet."""
        self._heard = 0.0
        """Its last feedback."""
        self._answers = 0
        """How often the server said whether it takes the goal."""
        self._asks = 0
        """How often the result was asked for, and how often one came."""
        self._results = 0
        self._result_taken = False
        """A result has been looked at; further ones say the same."""
        self._asked_at = 0.0
        self._over_since: float | None = None
        """Since when the status topic says that it is over."""
        self._over_as = UNKNOWN
        """How, in its words."""
        self._unknown_since: float | None = None
        """Since when the server says that it does not know it, which is decided about a moment later."""
        self._ending: Ending | None = None
        self._ended_at = 0.0
        # Cancelling, before or after the end:
        self._cancel_wanted = False
        self._overdue = False
        self._cancel_by = inf
        self._cancel_next = inf
        self._cancels = 0
        self._cancel_round = -1
        """The servers (`Presence.changes`) that `_cancels` counts for."""
        self._stopping = False
        """The server has said that it cancels it."""
        self._refused_at: float | None = None
        """When the server did not let it be stopped for the first time."""
        self._open = False
        """It may be running on the robot."""
        self._noted: set[tuple[str, str]] = set()
        """What was remarked already: a server that repeats itself is reported once."""

    # --- from the engine ----------------------------------------------------------------------------------------

    def cancel(self) -> None:
        """Stop it. Before it was sent that is all; after that the server is asked as soon as it has accepted it. One
        that has ended here, and may be going on there, is asked about once more."""
        if self.phase == "ended" and self._open:
            self._cancels = 0
            self._ask_cancel()
        if self.phase == "ended" or self._cancel_wanted:
            return
        now = self._home.clock.now()
        self._cancel_wanted = True
        self._overdue = now >= self._limit_at - OVERDUE
        self._cancel_by = now + min(self._carrier.deadlines.cancel, CANCEL_MOST)
        if self.phase == "waiting":
            self._end("canceled", "its server had gone before taking it" if self._sends else "it had not been sent yet")
        elif self.phase == "running":
            self._ask_cancel()
        self._home.changed(self)

    @property
    def open(self) -> bool:
        """Whether it may be running on the robot now, whatever the engine thinks of it."""
        return self._open

    @property
    def stopping(self) -> bool:
        """Whether its server has said that it stops it."""
        return self._stopping

    def matters(self) -> bool:
        """Whether it is still to be looked at: it has not ended, or it has to be stopped on the robot."""
        return self.phase != "ended" or self._cancel_next < inf

    # --- from the clock -----------------------------------------------------------------------------------------

    def due(self) -> float:
        """When it wants to be looked at."""
        if self.phase == "ended":
            return self._cancel_next
        due = min(self._deadline, self._cancel_by)
        if self.phase == "running":
            due = min(due, self._asked_at + ASK_AGAIN, self._cancel_next, self._silent_at())
            if self._over_since is not None:
                due = min(due, self._over_since + RESULT_GRACE)
            if self._unknown_since is not None:
                due = min(due, self._unknown_since + UNKNOWN_GRACE)
        return due

    def look(self) -> None:
        """Do what is due."""
        now = self._home.clock.now() + EARLY
        if self.phase == "waiting":
            self._look_for_server(now)
        elif self.phase == "sent":
            self._look_for_answer(now)
        elif self.phase == "running":
            self._look_after(now)
        elif now >= self._cancel_next:
            self._ask_cancel()

    def _look_for_server(self, now: float) -> None:
        part = self.part
        part.examine()
        if part.misfit:
            self._end("failed", part.misfit)
        elif part.ready:
            self._send()
        elif part.presence.count > 1 and (part.presence.twice_from_start or now >= self._deadline):
            self._end("failed", f"two-servers: {several(part.presence.count, part.name)}; end all but one")
        elif now >= self._deadline:
            if self._sends:
                why = f"what offers {part.name} went away {_times(self._sends)} before it took it"
            elif part.presence.count and not part.presence.settled:
                why = f"{part.name} comes and goes, {_times(part.presence.losses)} lately"
            elif part.found.seen:
                why = part.trouble
            else:
                why = f"{part.trouble}; is the robot's wrapper running?"
            self._end("failed", f"server-missing: {why}")

    def _look_for_answer(self, now: float) -> None:
        if now >= self._deadline:
            self.part.unanswered()
            seconds = self._carrier.deadlines.acceptance
            self._end("timed-out", f"no-accept: {self.part.name} did not say within {seconds:g} s whether it takes it")
        elif now >= self._cancel_by:
            self.part.unanswered()
            self._end("timed-out", f"no-accept: it was to be stopped, and {self.part.name} has not even taken it")

    def _look_after(self, now: float) -> None:
        part, carrier = self.part, self._carrier
        if self._unknown_since is not None and now >= self._unknown_since + UNKNOWN_GRACE:
            self._end_unknown()
        elif now >= self._cancel_by:
            self._end_uncancelled()
        elif now >= self._deadline:
            self._end(
                "timed-out",
                f"no-result: it was to take {self._expected:.1f} s, and {part.name} had not ended it "
                f"{carrier.deadlines.result:g} s later",
            )
        elif now >= self._silent_at():
            part.unanswered()
            self._end("lost", f"silent: {part.name} has sent no feedback for {carrier.deadlines.feedback:g} s")
        elif self._over_since is not None and now >= self._over_since + RESULT_GRACE:
            self._end_without_result()
        else:
            if now >= self._cancel_next:
                self._ask_cancel()
            if now >= self._asked_at + ASK_AGAIN:
                self._ask_result()

    def _silent_at(self) -> float:
        """When its silence means something."""
        expected = self._carrier.deadlines.feedback
        return self._heard + expected if expected and not self._cancel_wanted else inf

    # --- from the wire ------------------------------------------------------------------------------------------

    def server_gone(self) -> None:
        """Nothing offers the action any more. What runs there, nobody knows."""
        part = self.part
        if self.phase == "sent":
            self._deadline = self._server_by
            if self._sends < SENDS and not self._cancel_wanted and self._home.clock.now() < self._server_by:
                self.phase = "waiting"
                self._home.changed(self)
            else:
                why = f"what offers {part.name} went away {_times(self._sends)} before it took it"
                self._end("failed", f"server-missing: {why}")
        elif self.phase == "running":
            self._end("lost", f"server-gone: what offered {part.name} has gone away in the middle of it")

    def server_changed(self) -> None:
        """There are more servers than before, or fewer: was it restarted, and which of them has the goal?"""
        if self.phase == "running":
            self._ask_result()
        elif self.phase == "ended" and self._open:
            self._cancel_next = self._home.clock.now()
            self._home.changed(self)

    def lose(self, reason: str) -> None:
        """The robot is lost as a whole."""
        if self.phase == "waiting" and not self._sends:
            self._end(
                "failed", reason if reason.startswith(("server-missing", *WORDS)) else f"server-missing: {reason}"
            )
        elif self.phase != "ended":
            self._end("lost", reason)

    def move(self, part: ActionPart) -> None:
        """Its server is reached in another way from now on."""
        self.part = part
        self._cancel_round = -1

    def feedback(self) -> None:
        """A sign of life. It changes nothing, however many come."""
        self._heard = self._home.clock.now()

    def status(self, statuses: Mapping[bytes, int]) -> None:
        """The server has said how its goals stand."""
        status = statuses.get(self.id)
        now = self._home.clock.now()
        if status is not None:
            self._heard = now
        if status == CANCELING:
            self.stops()
        if status is None:
            if self.phase == "running" and now >= self._asked_at + LOOK_AGAIN:
                self._ask_result()
        elif status in TERMINAL:
            if self._unanswered():
                self._accept()
            if self.phase == "running" and self._over_since is None:
                self._over_since, self._over_as = now, status
                if self._unknown_since is not None:
                    self._end_unknown()
                elif now >= self._asked_at + LOOK_AGAIN:
                    self._ask_result()
                self._home.changed(self)
            elif self.phase == "ended":
                self._settle()
        elif status and self._unanswered():
            self._accept()
        elif status and self.phase == "ended" and self._accepted is None:
            self._accepted_late()

    def stops(self) -> None:
        """Its server has said that it stops it, whoever asked for that."""
        self._stopping = True
        self._refused_at = None

    # --- sending ------------------------------------------------------------------------------------------------

    def _send(self) -> None:
        now = self._home.clock.now()
        self._sends += 1
        number = self._sends
        self.phase = "sent"
        self._open = True
        self._deadline = now + self._carrier.deadlines.acceptance
        try:
            self.part.client.send(self.id, self._message, lambda accepted: self._answered(accepted, number))
        except PortError as error:
            self._open = number > 1
            self._end("failed", f"not-sent: {error}")
        self._home.changed(self)

    def _answered(self, accepted: bool, number: int) -> None:
        self._answers += 1
        if self._answers > self._sends:
            self._note("duplicate", f"{self.part.name} answered twice whether it takes {self.action}")
        elif self._unanswered():
            if accepted:
                self._accept()
            elif number > 1:
                # The server that had gone away before may be the same one, which has the goal and refuses it twice.
                self._end("failed", f"rejected: {self.part.name} refused it when it was sent once more")
            else:
                self._open = False
                self._accepted = False
                self._end("failed", f"rejected: {self.part.name} refused it")
        elif self._accepted is None and self.phase == "ended":
            if accepted:
                self._accepted_late()
            else:
                self._accepted = False
                self._note("late", f"{self.part.name} refused {self.action} {self._since()} after its end")
                self._settle()

    def _unanswered(self) -> bool:
        """It was sent, and the server has not said whether it takes it. (It may have gone away meanwhile.)"""
        return self.phase == "sent" or (self.phase == "waiting" and self._sends > 0)

    def _accept(self) -> None:
        now = self._home.clock.now()
        self._accepted = True
        self.phase = "running"
        self._heard = now
        result = self._carrier.deadlines.result
        self._deadline = now + self._expected + result if result else inf
        self._ask_result()
        if self._cancel_wanted:
            self._ask_cancel()
        self._home.accepted(self.action)
        self._home.changed(self)

    def _accepted_late(self) -> None:
        self._accepted = True
        self._open = True
        self._note(
            "late",
            f"{self.part.name} took {self.action} {self._since()} after its end ({self._ending}); "
            "it is cancelled at once",
        )
        self._cancels = 0
        self._ask_result()
        self._ask_cancel()

    # --- results ------------------------------------------------------------------------------------------------

    def _ask_result(self) -> None:
        self._asks += 1
        self._asked_at = self._home.clock.now()
        try:
            self.part.client.get_result(self.id, partial(self._result, self.part.presence.changes))
        except PortError as error:
            _LOG.debug("the result of %s could not be asked for: %s", self.action, error)
        self._home.changed(self)

    def _result(self, asked_of: int, status: int, result: Message) -> None:
        """`asked_of`: the servers that there were when it was asked for (`Presence.changes`)."""
        self._results += 1
        if self._results > self._asks:
            self._note(
                "duplicate", f"the result of {self.action} came twice; the second one counts for nothing", "result"
            )
        if self.phase == "ended":
            if not self._result_taken and status in TERMINAL and not (self._cancels and status == CANCELED):
                self._note(
                    "late",
                    f"the result of {self.action} ({NAMES[status]}) came {self._since()} after its end "
                    f"({self._ending}); it changes nothing",
                    "result",
                )
            self._result_taken = self._result_taken or status in TERMINAL
            if status in TERMINAL or self._only(asked_of):
                self._settle()
            return
        if status not in TERMINAL:  # UNKNOWN, or what no result can have: never a success by itself
            self._unknown(asked_of)
            return
        self._result_taken = True
        self._open = False
        if status == SUCCEEDED:
            self._succeeded(result)
        elif status == CANCELED:
            asked = self._cancel_wanted
            self._end("canceled", "" if asked else f"canceled: somebody else stopped it at {self.part.name}")
        else:
            why = self._said(self._carrier.reason, result) or "the robot gave it up and did not say why"
            self._end("failed", f"aborted: {why}")

    def _only(self, asked_of: int) -> bool:
        """Whether what was asked of the servers of then was answered by the only one that there is."""
        presence = self.part.presence
        return presence.count == 1 and presence.changes == asked_of

    def _unknown(self, asked_of: int) -> None:
        """The server does not know it: one that was restarted, or that keeps no results. The latter's status topic says
        how it ended, perhaps a moment later."""
        presence = self.part.presence
        if presence.changes != asked_of:
            return  # whoever is there now has been asked since
        if self._over_since is not None:
            self._end_unknown()
        elif presence.count > 1:
            self._result_taken = True
            self._end("lost", self._restarted())  # another one may have it, and is told to stop
        elif self._unknown_since is None:
            self._unknown_since = self._home.clock.now()
            self._home.changed(self)

    def _end_unknown(self) -> None:
        """It is over there, and nobody has its result."""
        self._result_taken = True
        self._open = False
        gone = f"{self.part.name} did not keep its result (its result_timeout is too short)"
        if self._over_as == SUCCEEDED and self._cancel_wanted:
            self._end("succeeded", f"succeeded-during-cancel: {gone}")
        elif self._over_as == SUCCEEDED:
            self._end("succeeded", f"result-not-kept: it says that it succeeded, and {gone}")
        elif self._over_as == CANCELED:
            self._end("canceled", "" if self._cancel_wanted else f"canceled: somebody else stopped it; {gone}")
        elif self._over_as == ABORTED:
            self._end("failed", f"aborted: why is not known; {gone}")
        else:
            self._end("lost", self._restarted())

    def _restarted(self) -> str:
        return f"server-restarted: {self.part.name} does not know it any more; was the robot's wrapper restarted?"

    def _succeeded(self, result: Message) -> None:
        wrong = self._said(self._carrier.error, result)
        if wrong:
            self._end("failed", f"robot-error: {wrong}")
        elif self._cancel_wanted:
            self._end("succeeded", "succeeded-during-cancel: the robot finished it although it was to stop")
        else:
            self._end("succeeded", "")

    def _end_without_result(self) -> None:
        """The status topic has said how it ended, and the result does not come."""
        status = self.part.client.statuses.get(self.id)
        if status == CANCELED:
            self._open = False
            self._end("canceled", "" if self._cancel_wanted else f"canceled: somebody else stopped it, {_NO_RESULT}")
        elif status == ABORTED:
            self._open = False
            self._end("failed", f"aborted: {_NO_RESULT}")
        else:
            self._end("timed-out", f"no-result: {self.part.name} says that it has ended, {_NO_RESULT}")

    def _said(self, read: Callable[[Message], str], result: Message) -> str:
        try:
            return read(result)
        except Exception as error:
            _LOG.exception("the result of %s cannot be read", self.action)
            return f"its result cannot be read ({error})"

    # --- cancelling ---------------------------------------------------------------------------------------------

    def _ask_cancel(self) -> None:
        presence = self.part.presence
        if self._cancel_round != presence.changes:
            self._cancel_round = presence.changes
            self._cancels = 0
        if not presence.count:
            self._cancel_next = inf  # `server_changed` comes when it is back
        elif self.phase == "ended" and self._cancels >= CANCELS:
            self._cancel_next = inf
            self._note(
                "still-running",
                f"{self.action} could not be stopped at {self.part.name} in {CANCELS} tries; "
                "the robot may go on with it",
            )
        else:
            self._cancels += 1
            self._cancel_next = self._home.clock.now() + LOOK_AGAIN
            try:
                self.part.client.cancel(self.id, partial(self._cancel_answered, presence.changes))
            except PortError as error:
                _LOG.debug("%s could not be cancelled: %s", self.action, error)
        self._home.changed(self)

    def _cancel_answered(self, asked_of: int, answer: CancelAnswer) -> None:
        """`asked_of`: the servers that there were when it was asked (`Presence.changes`)."""
        if self.id in answer.goals:
            self.stops()
            self._cancel_next = inf
            if not self._asks:
                self._ask_result()
        elif answer.code in (CANCEL_NONE, CANCEL_REJECTED):
            self._refuse()
        elif self.phase == "ended":  # the server does not have it, or it is over
            status = self.part.client.statuses.get(self.id, UNKNOWN)
            if answer.code == CANCEL_TERMINATED:
                # rcl says this also of a goal that it is cancelling already; then its end is still to come.
                self._cancel_next = inf
                if status != CANCELING:
                    self._settle()
            elif self._only(asked_of):
                self._settle()
            elif self.part.presence.changes == asked_of:
                self._cancel_next = inf  # one of several; `server_changed` comes when only one is left
        elif self.phase == "running":
            self._cancel_next = inf
            self._ask_result()  # it has ended, or the server has forgotten it: both come as a result
        self._home.changed(self)

    def _refuse(self) -> None:
        """The server does not let it be stopped; or it is at it already, or over at this very moment, which is answered
        the same way. Only one who says so again a while later has refused."""
        if not self._open or self._stopping:
            return
        now = self._home.clock.now()
        if self._refused_at is None:
            self._refused_at = now
        elif now >= self._refused_at + LOOK_AGAIN / 2:
            self._note("cancel-refused", f"{self.part.name} does not stop {self.action}; it goes on")

    def _end_uncancelled(self) -> None:
        """It was to be stopped and was not."""
        part, seconds = self.part, min(self._carrier.deadlines.cancel, CANCEL_MOST)
        if self._stopping:
            self._end("lost", f"cancel-unconfirmed: {part.name} said that it stops, and did not within {seconds:g} s")
        elif self._refused_at is not None:
            self._end("failed", f"cancel-refused: {part.name} did not let it be stopped; it may still be going on")
        else:
            part.unanswered()
            self._end("lost", f"cancel-unanswered: {part.name} did not answer within {seconds:g} s")

    # --- the end ------------------------------------------------------------------------------------------------

    def _end(self, status: Ending, reason: str) -> None:
        """The one place where a goal ends."""
        assert self.phase != "ended"
        self.phase = "ended"
        self._ending = status
        self._ended_at = self._home.clock.now()
        self._deadline = self._cancel_by = self._cancel_next = inf
        if self._open and not self._stopping:
            self._cancels = 0
            self._ask_cancel()
        if self._overdue and status != "canceled":
            self._note("late", f"{self.action} {status}{f' ({reason})' if reason else ''}, after its time was over")
        self._home.changed(self)
        self._home.ended(self.action, status, reason)

    def _settle(self) -> None:
        """Nothing of it runs on the robot any more."""
        self._open = False
        self._cancel_next = inf
        self._home.changed(self)

    def _since(self) -> str:
        return f"{self._home.clock.now() - self._ended_at:.1f} s"

    def _note(self, word: str, text: str, about: str = "") -> None:
        """For the record, each kind once."""
        if (word, about) not in self._noted:
            self._noted.add((word, about))
            self._home.note(self.part, f"{word}: {text}")


_NO_RESULT = f"and its result did not come within {RESULT_GRACE:g} s"


def _times(number: int) -> str:
    return "once" if number == 1 else f"{number} times"
