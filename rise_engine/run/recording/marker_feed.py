"""The markers of a running session for a stream, each with its exact time.

The feed is an observer of the session. Markers wait for the first consumer, so that a recorder that starts late loses
none; the session never waits. The payload `short` describes an event in names of the scenario
(`rise_engine.results.analysis.markers`). `json` contains whole records, as the export level `shared` includes them.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import msgspec
from msgspec import Struct

from rise_engine.base.errors import AdapterError, SessionError
from rise_engine.base.json_codec import encode
from rise_engine.base.text import pluralize
from rise_engine.kernel.records import AnyRecord
from rise_engine.ports.outlet import OutletPlan
from rise_engine.privacy.levels import LevelFilter
from rise_engine.privacy.private_values import PrivateValues
from rise_engine.results.analysis.markers import describe_session, live_words, source_id
from rise_engine.results.analysis.model import SessionFacts
from rise_engine.run.client import LinkLost, Session, connect
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import encode_record
from rise_engine.session.journal_reader import read_journal
from rise_engine.study.traces import study_of_session, wizard_names

_LOG = logging.getLogger(__name__)

CLIENT_NAME = "lsl"
MAX_WAITING = 30_000
"""Maximum number of waiting markers; beyond it the oldest are dropped. The library keeps 36,000."""
POLL_SECONDS = 0.1
"""Interval for checking whether there is a consumer, while markers wait."""
GRACE_SECONDS = 0.3
"""Time after the request to finish in which records are still accepted."""
LINGER_SECONDS = 5.0
"""Time for consumers to fetch the last markers, which they do not confirm. It ends early when they disconnect."""
SHORT_LINGER_SECONDS = 1.5
"""The same if a process waits for the end."""


class MarkerStream(Struct, frozen=True, kw_only=True):
    """The description of a stream."""

    name: str
    type: str
    source_id: str
    """Identifies the stream for receivers after its process was restarted."""
    description: dict[str, str]
    """Facts about its session, by element name."""


class MarkerOutlet(Protocol):
    """One stream. No method blocks."""

    def send(self, text: str, at: float) -> None:
        """Send one marker.

        :param at: its time in seconds of `time.monotonic()` on this computer; may be long ago.
        """

    def has_consumers(self) -> bool:
        """Return whether there is a consumer now."""
        ...

    def close(self) -> None:
        """Close the stream. Markers that consumers have not fetched may be lost."""


OpenStream: TypeAlias = Callable[[MarkerStream], MarkerOutlet]
"""An opener of a stream. Raises AdapterError."""


class MarkerFeed:
    """The sender of one session's markers."""

    def __init__(self, plan: OutletPlan, open_stream: OpenStream) -> None:
        """:param plan: the session and the payload.
        :param open_stream: makes the outlet, once.
        """
        self._plan, self._open_stream = plan, open_stream
        self._outlet: MarkerOutlet | None = None
        self._waiting: deque[tuple[str, float]] = deque()
        self._lost = 0
        self._arrived = asyncio.Event()
        self.seq = 0
        """The `seq` of the last record taken."""
        self.sent = 0
        """The number of markers that were sent."""

    async def run(self, finish: asyncio.Event) -> None:
        """Send until the session ends or `finish` is set; then let consumers fetch the last markers.

        Raises EngineGone if there is no such session, or its engine went without an end, and AdapterError.
        """
        stopping = asyncio.create_task(finish.wait())
        following = asyncio.create_task(self._follow())
        sending = asyncio.create_task(self._send_waiting())
        tasks: tuple[asyncio.Task[Any], ...] = (stopping, following, sending)
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if finish.is_set():  # earlier records may still be arriving
                await asyncio.wait((following,), timeout=GRACE_SECONDS)
            for task in (following, sending):
                if task.done():
                    task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self._finish(SHORT_LINGER_SECONDS if finish.is_set() else LINGER_SECONDS)

    async def _follow(self) -> None:
        while True:
            try:
                async with connect(self._plan.socket, CLIENT_NAME, role="observer") as session:
                    records = session.records()
                    if self.seq and (missed := session.view.seq - self.seq) > 0:
                        _LOG.warning(f"the connection was cut; {pluralize(missed, 'record')} of it gave no marker")
                    word = await self._make_words(session)
                    self._open(session)
                    origin, speed = session.attach_reply.origin or 0.0, session.attach_reply.speed
                    async for record in records:
                        self.seq = record.seq
                        for text in word(record):
                            self._add(text, origin + record.t / speed)
                return
            except LinkLost:  # the engine continues
                await asyncio.sleep(POLL_SECONDS)

    def _open(self, session: Session) -> None:
        """Open the stream. Raises AdapterError."""
        if self._outlet is not None:
            return
        reply = session.attach_reply
        if reply.origin is None:
            raise AdapterError("this session's time is not that of the clock, so its markers have no times for others")
        facts = session_facts(session)
        stream = MarkerStream(
            name="rise",
            type="Markers",
            source_id=source_id(facts.study, facts.session),
            description={
                **describe_session(facts),
                "format": self._plan.payload,
                "session_start": f"{reply.origin:.6f}",
                "speed": f"{reply.speed:g}",
            },
        )
        self._outlet = self._open_stream(stream)
        where = {"machine": "this computer", "link": "the network segment", "site": "the whole network"}[
            self._plan.scope
        ]
        _LOG.info(
            f"sending markers of {facts.session} to LSL: stream rise, source {stream.source_id}, seen on {where}, "
            f"from {max(session.now(), 0.0):.1f} s of the session on"
        )
        if session.view.t > 0 and session.view.tasks:
            _LOG.warning("earlier events are not sent; `rise-engine export --format xdf` has all of it afterwards")
        if self._plan.payload == "json":
            _LOG.warning("whole records go out in clear text: all that is said, but for private keys, notes and names")

    async def _make_words(self, session: Session) -> Callable[[AnyRecord], Iterable[str]]:
        """Return the function that makes markers. Raises AdapterError if the private values cannot be determined."""
        private = PrivateValues(session.scenario)
        folder = Path(session.attach_reply.folder) if session.attach_reply.folder else None
        study = study_of_session(folder) if folder is not None else None
        tells = LevelFilter("shared", private, wizard_names(study))
        words = live_words(session.scenario, lambda name: str(private.hide_value(name)))
        words.skip_to(session.view)  # before the first await: the view changes, and later records still come
        if session.view.seq and (self._plan.payload == "json" or private.keys):  # old private values still count
            tells.note(await asyncio.to_thread(_records_before, folder))
        if self._plan.payload == "json":

            def word_whole(record: AnyRecord) -> Iterable[str]:
                tells.note([record])
                values: dict[str, Any] = msgspec.json.decode(encode_record(record))
                return (encode(tells.apply(values)).decode(),)

            return word_whole

        def word_short(record: AnyRecord) -> Iterable[str]:
            private.note(record)
            return words.words(record)

        return word_short

    def _add(self, text: str, at: float) -> None:
        if len(self._waiting) >= MAX_WAITING:
            self._waiting.popleft()
            self._lost += 1
        self._waiting.append((text, at))
        self._arrived.set()

    async def _send_waiting(self) -> None:
        while True:
            await self._arrived.wait()
            if self._send_now():
                self._arrived.clear()
            else:
                await asyncio.sleep(POLL_SECONDS)

    def _send_now(self) -> bool:
        """Send the waiting markers if there is a consumer; return whether none waits any more."""
        if self._outlet is not None and self._waiting and self._outlet.has_consumers():
            while self._waiting:
                self._outlet.send(*self._waiting.popleft())
                self.sent += 1
        return not self._waiting

    async def _finish(self, seconds: float) -> None:
        if self._outlet is None:
            return
        self._send_now()
        for _ in range(round(seconds / POLL_SECONDS)):
            if self.sent and self._outlet.has_consumers():
                await asyncio.sleep(POLL_SECONDS)
        if unsent := len(self._waiting) + self._lost:
            _LOG.warning(f"{pluralize(unsent, 'marker')} were sent, but no program received the stream")
        self._outlet.close()
        self._outlet = None


def session_facts(session: Session) -> SessionFacts:
    """Collect a session's facts for a stream. They include its whole name, because a live listener knows the date."""
    reply, about = session.attach_reply, session.view.session
    return SessionFacts(
        session=Path(reply.folder).name if reply.folder else "",
        participant=about.participant if about is not None else "",
        condition=about.condition if about is not None else "",
        factors=about.factors if about is not None else {},
        study=about.study if about is not None else "",
        run=about.run if about is not None else 0,
        purpose=about.purpose if about is not None else "",
        mode=reply.mode,
        title=session.scenario.title,
        scenario_hash=session.scenario.hash,
        robot=reply.robot,
        versions=about.versions if about is not None else {},
    )


def _records_before(folder: Path | None) -> list[AnyRecord]:
    """Read the session's records so far. Raises AdapterError."""
    if folder is None:
        return []
    try:
        return list(read_journal(folder / JOURNAL).read_records())
    except SessionError as error:
        raise AdapterError(f"the private values of this session cannot be found: {error}") from None
