"""Stop-all: every action server of the robot is asked to cancel everything, also goals of others; each answer counts.

A part has confirmed when its answer has come and every goal that is known to run there has ended: ours by their
results, those of others by the server's status topic. A goal that its answer does not name is asked about by its id,
because what the status topic said last may be the word of a server that has been restarted since. What cannot confirm
is named with the reason. A server that is not there is never called confirmed, even if nothing was known to run: nobody
could be asked.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Protocol

from rise_adapters.ros2.action_client import (
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_UNKNOWN,
    CANCELING,
    TERMINAL,
    CancelAnswer,
)
from rise_adapters.ros2.port import PortError
from rise_adapters.ros2.robot.parts import ActionPart, Part
from rise_engine.kernel.inputs import StopReport
from rise_engine.robot import Clock, Timer

if TYPE_CHECKING:
    from rise_adapters.ros2.robot.goals import ActionGoal

_LOG = logging.getLogger(__name__)

ANSWER_WITHIN = 2.5
"""Seconds until the report is given; the kernel waits STOP_LIMIT, 3 s."""
ASK_AGAIN = 0.8
"""Seconds after which a server that has not answered is asked once more."""

MOST_BY_ID = 20
"""Goals of others that one server is asked about by id at most, in one stop."""


class Home(Protocol):
    """What a stop needs of its robot."""

    def ours(self, part: ActionPart) -> Mapping[bytes, ActionGoal]:
        """Our goals at a server that are remembered."""
        ...


class _Asked:
    """One action server that was asked to stop."""

    def __init__(self, part: ActionPart, home: Home) -> None:
        self.part = part
        self.answer: CancelAnswer | None = None
        self._home = home
        self._known: set[bytes] = set()
        """Goals that it is cancelling, or that it called unfinished."""
        self._stopping: set[bytes] = set()
        """Those that it has said it cancels."""
        self._listed: set[bytes] = set()
        """Those that its status topic has named: when it names one no more, that one is over."""
        self._by_id: set[bytes] = set()
        """Those of others that it was asked about one by one ..."""
        self._over: set[bytes] = set()
        """... and of which it said that it does not have them (any more)."""

    def take(self, answer: CancelAnswer) -> None:
        if self.answer is None or answer.goals:
            self.answer = answer
        self._known.update(answer.goals)
        self._stopping.update(answer.goals)
        ours = self._home.ours(self.part)
        for goal in answer.goals:
            if goal in ours:
                ours[goal].stops()

    def left(self) -> set[bytes]:
        """Goals that may be running there."""
        statuses = self.part.client.statuses
        self._known |= self.part.client.running()
        self._listed |= self._known & statuses.keys()
        ours = self._home.ours(self.part)
        over = {
            goal
            for goal in self._known
            if statuses.get(goal) in TERMINAL or (goal in self._listed and goal not in statuses)
        }
        others = self._known - over - self._over - ours.keys()
        return {id for id, goal in ours.items() if goal.open} | others

    def at_it(self, goals: set[bytes]) -> bool:
        """Whether it has said of all these that it stops them."""
        statuses, ours = self.part.client.statuses, self._home.ours(self.part)
        return all(
            goal in self._stopping or statuses.get(goal) == CANCELING or (goal in ours and ours[goal].stopping)
            for goal in goals
        )

    def ask_by_id(self, look: Callable[[], None]) -> None:
        """About goals of others that seem to run, and that its answer does not name. (Ours ask for themselves.)"""
        if self.answer is None:
            return
        unclear = self.left() - self._stopping - self._by_id - self._home.ours(self.part).keys()
        for goal in sorted(unclear)[: max(MOST_BY_ID - len(self._by_id), 0)]:
            self._by_id.add(goal)
            try:
                self.part.client.cancel(goal, partial(self._about, goal, self.part.presence.changes, look))
            except PortError as error:
                _LOG.warning("%s could not be asked about a goal: %s", self.part.name, error)

    def _about(self, goal: bytes, asked_of: int, look: Callable[[], None], answer: CancelAnswer) -> None:
        self._stopping.update(answer.goals)
        if answer.code == CANCEL_UNKNOWN and self.part.presence.changes == asked_of:
            self._over.add(goal)
        look()


class StopAll:
    """One stop, from the request to its report."""

    def __init__(self, clock: Clock, parts: Iterable[Part], home: Home, report: Callable[[StopReport], None]) -> None:
        self._clock = clock
        self._report = report
        self._over = False
        self._until = clock.now() + ANSWER_WITHIN
        self._timer: Timer | None = None
        self._asked: list[_Asked] = []
        self._silent: list[str] = []
        """Parts that cannot even be asked."""
        for part in parts:
            if not part.presence.count:
                self._silent.append(
                    f"{part.label} ({part.word or ('not there' if part.presence.ever else 'never seen')})"
                )
            elif isinstance(part, ActionPart):
                self._asked.append(_Asked(part, home))
            else:
                self._silent.append(f"{part.label} (told to stop; a topic gives no answer)")

    def begin(self) -> None:
        self._ask()
        self.look()

    def look(self) -> None:
        """Something has changed: have all confirmed?"""
        confirmed = [self._confirmed(asked) for asked in self._asked]  # all are looked at: see `left`
        if not self._over and all(confirmed):
            self._finish()

    def drop(self) -> None:
        """No report any more."""
        self._over = True
        if self._timer is not None:
            self._timer.cancel()

    def _ask(self) -> None:
        for asked in self._asked:
            if asked.answer is None and not self._over:
                try:
                    asked.part.client.cancel_all(partial(self._answered, asked))
                except PortError as error:
                    _LOG.warning("%s could not be asked to stop: %s", asked.part.name, error)
        again = self._clock.now() + ASK_AGAIN
        if self._over:
            return
        if again < self._until:
            self._timer = self._clock.call_at(again, self._ask)
        else:
            self._timer = self._clock.call_at(self._until, self._finish)

    def _answered(self, asked: _Asked, answer: CancelAnswer) -> None:
        asked.take(answer)
        asked.ask_by_id(self.look)
        self.look()

    def _confirmed(self, asked: _Asked) -> bool:
        quiet = not asked.left()
        return quiet and asked.answer is not None and asked.part.presence.count == 1

    def _finish(self) -> None:
        if self._over:
            return
        self.drop()
        confirmed, silent = [], self._silent
        for asked in self._asked:
            if self._confirmed(asked):
                confirmed.append(asked.part.label)
            else:
                silent.append(f"{asked.part.label} ({self._why_not(asked)})")
        self._report(StopReport(confirmed=tuple(sorted(confirmed)), unconfirmed=tuple(sorted(silent))))

    def _why_not(self, asked: _Asked) -> str:
        count = asked.part.presence.count
        if count != 1:
            return f"{count} servers, and only one can have answered" if count else "gone"
        if asked.answer is None:
            asked.part.unanswered()
            return "no answer"
        if asked.answer.code in (CANCEL_NONE, CANCEL_REJECTED) and not asked.at_it(asked.left()):
            return "it refused"
        return "still running"
