"""Replaces the scenario of a running session by its changed files (semantics.md 12.5)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from rise_engine.base.errors import SessionError
from rise_engine.run.engine.engine import Engine, ReplyCallback
from rise_engine.run.protocol.client import Reply
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import read_info, speech_arguments
from rise_engine.session.scenario_copies import remove_copy, write_copy

MAX_ERRORS = 3
"""Maximum number of errors in an answer; `rise-engine check` lists them all."""


class ScenarioTakeover:
    """The takeover of changed files: it reads and copies them, and passes them to the engine."""

    def __init__(self, engine: Engine, folder: Path, paths: dict[str, str], taken_over: Callable[[], object]) -> None:
        """:param engine: the session's.
        :param folder: the session's.
        :param paths: paths of acts, rules and memory, if they differ from the scenario's.
        :param taken_over: called afterwards.
        """
        self._engine = engine
        self._folder = folder
        self._paths = paths
        self._taken_over = taken_over
        self._under_way: asyncio.Task[None] | None = None

    def begin(self, source: str, answer: ReplyCallback) -> None:
        """Begin the takeover; the loop does not wait for the disk.

        :param source: who requested it.
        :param answer: called once with the result.
        """
        if self._under_way is not None:
            answer(Reply(False, "the session is already taking over changed files"))
            return
        self._under_way = asyncio.get_running_loop().create_task(self._take_over(source, answer))

    async def _take_over(self, source: str, answer: ReplyCallback) -> None:
        try:
            await self._read_and_take_over(source, answer)
        except Exception as error:  # the caller waits for the answer
            answer(Reply(False, f"the changed files could not be taken over ({error})"))
            raise
        finally:
            self._under_way = None

    def _load(self, before: Scenario) -> LoadResult:
        spoken = speech_arguments(read_info(self._folder))
        return load(before.folder, robot=before.robot.name, mode=before.mode, paths=self._paths, **spoken)

    def _then_notify(self, answer: ReplyCallback) -> ReplyCallback:
        """Return a callback that answers and then notifies the owner."""

        def answer_and_notify(reply: Reply) -> None:
            answer(reply)
            if reply.accepted:
                self._taken_over()

        return answer_and_notify

    async def _read_and_take_over(self, source: str, answer: ReplyCallback) -> None:
        engine, before = self._engine, self._engine.scenario
        loaded = await asyncio.to_thread(self._load, before)
        scenario = loaded.scenario
        if scenario is None:
            answer(Reply(False, _errors_text(loaded)))
        elif scenario.hash == before.hash:
            answer(Reply(False, "the files have not changed since the session read them"))
        elif problems := engine.why_not_take_over(scenario):  # before anything is written
            answer(Reply(False, "; ".join(problems)))
        else:
            try:
                copy = await asyncio.to_thread(write_copy, self._folder, loaded.files)
            except SessionError as error:
                answer(Reply(False, str(error)))
                return
            if not engine.take_over(scenario, copy.name, source, self._then_notify(answer)):
                await asyncio.to_thread(remove_copy, copy)


def _errors_text(loaded: LoadResult) -> str:
    errors = loaded.errors
    more = f", and {len(errors) - MAX_ERRORS} more" if len(errors) > MAX_ERRORS else ""
    return f"the changed files have errors: {'; '.join(map(str, errors[:MAX_ERRORS]))}{more}"
