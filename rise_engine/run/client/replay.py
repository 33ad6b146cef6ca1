"""A recorded session, replayed to a console through the same `Client`, but without changes."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from rise_engine.base.errors import SessionError
from rise_engine.kernel.records import AnyRecord
from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol.client import AttachReply, ClientInput, ControlVerb, EngineGone, Reply, Update
from rise_engine.session.folder import JOURNAL, read_info
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.scenario_copies import load_session_scenario
from rise_engine.study.labels import refuse_relabelled

BATCH = 500
"""Maximum number of records in one batch, so that a console can paint in between."""

_NOT_IN_REPLAY = Reply(False, "this is a replay: nothing can be changed in it")


class ReplayClient:
    """An implementation of `rise_engine.run.protocol.client.Client` over a session's folder."""

    def __init__(self, folder: Path, speed: float = 1.0) -> None:
        """
        :param folder: the session's.
        :param speed: session seconds in a second.
        """
        self._folder = folder
        self._speed = speed
        self._records: Iterator[AnyRecord] = iter(())
        self._began = 0.0
        self._closed = asyncio.Event()

    async def attach(self) -> AttachReply:
        try:
            return await asyncio.to_thread(self._open)
        except SessionError as error:
            raise EngineGone(str(error)) from None
        finally:
            self._began = time.monotonic()

    def _open(self) -> AttachReply:
        refuse_relabelled(self._folder)
        info = read_info(self._folder)
        contents = read_journal(self._folder / JOURNAL)
        notes: list[str] = []
        scenario = load_session_scenario(self._folder, info, notes)
        self._records = contents.read_records()
        return AttachReply(
            scenario,
            info.mode,
            info.robot,
            info.seed,
            SessionView(),
            you="observer:replay",
            role="observer",
            folder=str(self._folder),
            replay=True,
        )

    async def records(self) -> AsyncIterator[Sequence[Update]]:
        record = next(self._records, None)
        while record is not None and not self._closed.is_set():
            wait = (record.t - self.now()) / self._speed
            if wait > 0:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._closed.wait(), wait)
                continue
            batch, now = [record], self.now()
            while (record := next(self._records, None)) is not None and len(batch) < BATCH and record.t <= now:
                batch.append(record)
            yield batch
            await asyncio.sleep(0)

    async def send(self, message: ClientInput) -> Reply:
        return _NOT_IN_REPLAY

    async def change_control(self, verb: ControlVerb) -> Reply:
        return _NOT_IN_REPLAY

    async def take_over(self) -> Reply:
        return _NOT_IN_REPLAY

    def now(self) -> float:
        return (time.monotonic() - self._began) * self._speed

    async def close(self, *, end_session: bool = False) -> None:
        self._closed.set()
