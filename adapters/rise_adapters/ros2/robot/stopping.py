"""Stop-all: every action server of the robot is asked to cancel everything, also goals of others; each answer counts.

A part has confirmed when its answer has come and every goal that is known to run there has ended: ours by their
results, those of others by the server's status topic. What cannot confirm is named with the reason. A server that is
not there is never called confirmed, even if nothing was known to run: nobody could be asked.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeAlias

from rise_adapters.ros2.action_client import CANCEL_NONE, CANCEL_REJECTED, TERMINAL, CancelAnswer
from rise_adapters.ros2.port import PortError
from rise_adapters.ros2.robot.parts import ActionPart, Part
from rise_engine.kernel.inputs import StopReport
from rise_engine.robot import Clock, Timer

_LOG = logging.getLogger(__name__)

ANSWER_WITHIN = 2.5
"""Seconds until the report is given; the kernel waits STOP_LIMIT, 3 s."""
ASK_AGAIN = 0.8
"""Seconds after which a server that has not answered is asked once more."""

Running: TypeAlias = Callable[[ActionPart, set[bytes]], set[bytes]]
"""Of the goals that an action server is known to have, and of ours there, those that may be running."""


class _Asked:
    """One action server that was asked to stop."""

    def __init__(self, part: ActionPart) -> None:
        self.part = part
        self.answer: CancelAnswer | None = None
        self._known: set[bytes] = set()
        """Goals that it is cancelling, or that it called unfinished."""
        self._listed: set[bytes] = set()
        """Those that its status topic has named: when it names one no more, that one is over."""

    def take(self, answer: CancelAnswer) -> None:
        if self.answer is None or answer.goals:
            self.answer = answer
        self._known.update(answer.goals)

    def quiet(self, running: Running) -> bool:
        """Nothing is known to run there."""
        statuses = self.part.client.statuses
        self._known |= self.part.client.running()
        self._listed |= self._known & statuses.keys()
        over = {
            goal
            for goal in self._known
            if statuses.get(goal) in TERMINAL or (goal in self._listed and goal not in statuses)
        }
        return not running(self.part, self._known - over)


class StopAll:
    """One stop, from the request to its report."""

    def __init__(
        self, clock: Clock, parts: Iterable[Part], running: Running, report: Callable[[StopReport], None]
    ) -> None:
        self._clock = clock
        self._running = running
        self._report = report
        self._over = False
        self._until = clock.now() + ANSWER_WITHIN
        self._timer: Timer | None = None
        self._asked: list[_Asked] = []
        self._silent: list[str] = []
        """Parts that cannot even be asked."""
        for part in parts:
            if not part.presence.count:
                self._silent.append(f"{part.label} ({part.word or ('not there' if part.presence.ever else 'never seen')})")
            elif isinstance(part, ActionPart):
                self._asked.append(_Asked(part))
            else:
                self._silent.append(f"{part.label} (told to stop; a topic gives no answer)")

    def begin(self) -> None:
        self._ask()
        self.look()

    def look(self) -> None:
        """Something has changed: have all confirmed?"""
        confirmed = [self._confirmed(asked) for asked in self._asked]  # all are looked at: see `quiet`
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
        self.look()

    def _confirmed(self, asked: _Asked) -> bool:
        quiet = asked.quiet(self._running)
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
        if not asked.answer.goals and asked.answer.code in (CANCEL_NONE, CANCEL_REJECTED):
            return "it refused"
        return "still running"
