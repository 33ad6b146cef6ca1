"""How the session stands, as rules can read it (semantics.md 7.2)."""

from __future__ import annotations

import copy
from typing import Any

from rise_engine.kernel.inputs import SessionStarted

from .session import Session

KEY = "session"


class Standing:
    """Keeps the object under the key `session`."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.begun = False

    @property
    def is_kept(self) -> bool:
        """Whether anything in the scenario reads it."""
        return self.session.scenario.reads_session

    def owns(self, key: str) -> bool:
        """Whether nobody else may write a key."""
        return self.is_kept and key.split(".")[0] == KEY

    def begin(self, input: SessionStarted) -> None:
        """Write it for the first time."""
        if self.is_kept:
            people = {"participant": input.participant, "condition": input.condition, "factors": input.factors}
            value = {**self._now(), **people, "language": self.session.scenario.language}
            self.session.memory.set(KEY, value, "engine")
            self.begun = True

    def update(self) -> bool:
        """Write what has changed. Says whether anything has."""
        if not self.begun:
            return False
        before = self.session.memory.values[KEY]
        for part, value in self._now().items():
            written = self.session.memory.values[KEY]
            if written[part] != value:
                changed = copy.deepcopy(written)
                changed[part] = value
                self.session.memory.set(KEY, changed, "engine", part=f"{KEY}.{part}")
        return bool(self.session.memory.values[KEY] != before)

    def _now(self) -> dict[str, Any]:
        session = self.session
        actions = session.scenario.robot.actions
        doing = [doing for run in session.scheduler.running for doing in run.doing.values()]
        speaking = any("speech" in actions[each.sent_as or each.type].channels for each in doing)
        return {
            "speaking": speaking,
            "cue": session.marks.cue_at is not None,
            "stopped": session.stop.in_force,
        }
