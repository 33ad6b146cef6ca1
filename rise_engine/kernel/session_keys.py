"""The engine's values in the memory under `session`, for scenarios that read them (semantics.md 7.2)."""

from __future__ import annotations

from typing import Any

from rise_engine.kernel.act_runner import ActRunner
from rise_engine.kernel.core import Core
from rise_engine.kernel.memory import WorkingMemory
from rise_engine.kernel.records import ENGINE
from rise_engine.kernel.stop import StopLatch
from rise_engine.scenario.model import SESSION


class SessionKeys:
    """Keeps `session` up to date. It changes only after tasks and inputs, so that a change reversed within one, such as
    the silence between two sentences of an act, does not show."""

    def __init__(self, core: Core, memory: WorkingMemory, runner: ActRunner, stop: StopLatch) -> None:
        self._core = core
        self._memory = memory
        self._runner = runner
        self._stop = stop
        self._is_read = core.scenario.reads_session

    def begin(self, participant: str, condition: str, factors: dict[str, Any]) -> None:
        """Write all values at the start of the session."""
        if self._is_read:
            fixed = {"participant": participant, "condition": condition, "factors": factors}
            language = self._core.scenario.language
            self._memory.write(SESSION, {**self._changing(), **fixed, "language": language}, ENGINE)

    def update(self) -> bool:
        """Write the values that have changed; returns whether any has."""
        if not self._is_read or (session := self._core.memory.get(SESSION)) is None:
            return False
        changed = {name: value for name, value in self._changing().items() if session[name] != value}
        for name, value in changed.items():
            session = {**session, name: value}
            self._memory.write(SESSION, session, ENGINE, part=f"{SESSION}.{name}")
        return bool(changed)

    def _changing(self) -> dict[str, bool]:
        return {
            "speaking": self._runner.is_speaking,
            "cue": self._core.open_cue_at is not None,
            "stopped": self._stop.latched,
        }
