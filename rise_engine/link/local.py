"""An engine in this process, on a thread and an asyncio loop of its own, and clients that talk to it by messages.

The engine never waits for a client: records go into a client's mailbox, and one wake-up is posted to its loop however
many arrive. A client that is gone, stalled or closed costs the engine nothing more than that. Several may be attached;
who of them may do what is the room's matter (`rise_engine.link.room`). Nothing is kept: there is no journal.
"""

from __future__ import annotations

import asyncio
import atexit
import logging
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import suppress
from typing import Any
from weakref import WeakSet

from msgspec.structs import replace

from rise_engine.clock import RealClock
from rise_engine.engine import Answer, Engine
from rise_engine.kernel.inputs import Note, Submit
from rise_engine.link.client import (
    ClientInput,
    EngineGone,
    Hello,
    Journaling,
    LinkLost,
    Pulse,
    Reply,
    Role,
    Update,
    Verb,
)
from rise_engine.link.mailbox import Call, Mailbox
from rise_engine.link.room import END_SECONDS, Member, NotAdmitted, Room
from rise_engine.robots import make_robot, warning_for
from rise_engine.scenario.model import Mode, RobotProfile, Scenario

_LOG = logging.getLogger(__name__)

_hosts: WeakSet[EngineHost] = WeakSet()


def start_local(
    scenario: Scenario,
    *,
    mode: Mode | None = None,
    robot: RobotProfile | str | None = None,
    seed: int = 0,
    speed: float = 1.0,
    faults: Sequence[str] = (),
    participant: str = "",
    condition: str = "",
    who: str = "local",
    role: Role = "wizard",
) -> LocalClient:
    """Start an engine for `scenario` and give a client of it. Does not wait: `attach` says when it could not start.

    `who` is the client's name in the record, without its role.
    `mode` and `robot` default to the scenario's. Another robot's profile must know all actions of the scenario, so that
    it is better chosen when loading; a name is only accepted when it is the scenario's own robot (ValueError).
    """
    host = EngineHost(
        scenario,
        mode=mode,
        robot=robot,
        seed=seed,
        speed=speed,
        faults=faults,
        participant=participant,
        condition=condition,
    )
    return host.start().client(who, role)


class EngineHost:
    """One engine on its own thread. Every method may be called from any thread and returns at once, but `join`."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        mode: Mode | None = None,
        robot: RobotProfile | str | None = None,
        seed: int = 0,
        speed: float = 1.0,
        faults: Sequence[str] = (),
        participant: str = "",
        condition: str = "",
    ) -> None:
        if isinstance(robot, str):
            if robot != scenario.robot.name:
                raise ValueError(
                    f"the scenario was read for the robot {scenario.robot.name!r}; read it again for {robot!r}"
                )
            robot = None
        self.scenario = replace(scenario, mode=mode or scenario.mode, robot=robot or scenario.robot)
        self.seed = seed
        self._speed = speed
        self._faults = tuple(faults)
        self._who = participant, condition
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="rise-engine", daemon=True)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._backlog: list[Callable[[], None]] = []
        self._calls: set[Call] = set()
        self._mailboxes: dict[Mailbox, Member | None] = {}
        """Whoever gets records; None: somebody who only waits for the end."""
        self._gone: str | None = None
        # These belong to the engine's thread:
        self._clock: RealClock | None = None
        self._engine: Engine | None = None
        self._room: Room | None = None

    def start(self) -> EngineHost:
        """Begin the session. Call it once."""
        _hosts.add(self)
        self._thread.start()
        return self

    def client(self, who: str = "local", role: Role = "wizard") -> LocalClient:
        """A new connection; any number may be attached at once."""
        return LocalClient(self, who, role)

    @property
    def gone(self) -> str | None:
        """Why the engine has ended, or None while it runs."""
        return self._gone

    def now(self) -> float:
        """Session time in seconds; 0 before it has begun, and the last moment after it has ended."""
        clock, room = self._clock, self._room
        if clock is None or room is None:
            return 0.0
        return room.view.t if self._gone is not None else max(clock.now(), 0.0)

    def end(self, reason: str) -> None:
        """Stop the robot when anything runs and end the session."""
        self._post(lambda: self._begin_end(reason))

    def join(self, timeout: float | None = None) -> bool:
        """Wait (blocking) until the engine's thread has ended; False when it has not within `timeout` seconds."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    # --- from clients, any thread -------------------------------------------------------------------------------

    def call(self, work: Callable[[], Any]) -> asyncio.Future[Any]:
        """Run `work` on the engine's thread; a future of the calling loop gets what comes of it, or EngineGone."""
        return self._call(lambda settle: settle(work()))

    def ask(self, question: Callable[[Room, Answer], None]) -> asyncio.Future[Reply]:
        """Put a question to the room on the engine's thread; the future gets the room's answer, or EngineGone."""
        return self._call(lambda settle: question(self.room, settle))

    def _call(self, work: Callable[[Callable[[Any], None]], None]) -> asyncio.Future[Any]:
        loop = asyncio.get_running_loop()
        call = Call(loop, loop.create_future())

        def run() -> None:
            try:
                work(lambda result: self._settle(call, result, None))
            except Exception as error:
                # A failed kernel ends the thread, which settles every call with the reason.
                if self._engine is None or self._engine.failure is None:
                    self._settle(call, None, error)

        with self._lock:
            self._calls.add(call)
        if not self._post(run):
            self._settle(call, None, EngineGone(self._gone or "the engine has ended"))
        return call.future

    def _post(self, work: Callable[[], None]) -> bool:
        with self._lock:
            if self._gone is not None:
                return False
            if self._loop is None:
                self._backlog.append(work)
                return True
            try:
                self._loop.call_soon_threadsafe(work)
            except RuntimeError:  # its loop has just closed
                return False
            return True

    def _settle(self, call: Call, result: Any, error: Exception | None) -> None:
        with self._lock:
            if call not in self._calls:
                return
            self._calls.remove(call)
        call.settle(result, error)

    # --- on the engine's thread ---------------------------------------------------------------------------------

    def _run(self) -> None:
        reason, failed = "the session has ended", False
        try:
            asyncio.run(self._serve())
        except Exception as error:
            _LOG.exception("the engine's thread ended by an error")
            reason, failed = f"the engine stopped: {error}" if str(error) else f"the engine stopped: {error!r}", True
        with self._lock:
            self._gone = reason
            calls, mailboxes = tuple(self._calls), tuple(self._mailboxes)
            self._calls.clear()
            self._mailboxes.clear()
        for call in calls:
            call.settle(None, EngineGone(reason))
        for mailbox in mailboxes:
            mailbox.finish(reason if failed else None)

    async def _serve(self) -> None:
        loop = asyncio.get_running_loop()
        clock = RealClock(loop, self._speed)
        scenario = self.scenario
        robot = make_robot(scenario.robot, scenario.mode, clock, self.seed, self._faults)
        participant, condition = self._who
        engine = Engine(scenario, robot, clock, self.seed, participant=participant, condition=condition)
        room = Room(engine, end=self._begin_end)
        room.subscribe(self._deliver)
        ended = asyncio.Event()
        engine.when_ended(ended.set)
        engine.start()
        warning = warning_for(scenario.robot, scenario.mode)
        if warning is not None:
            engine.post(Note(text=warning))
        with self._lock:
            self._engine, self._room, self._clock, self._loop = engine, room, clock, loop
            for work in self._backlog:
                loop.call_soon(work)
            self._backlog.clear()
        await ended.wait()
        if engine.failure is not None:
            raise engine.failure

    def _begin_end(self, reason: str) -> None:
        engine, loop = self._engine, self._loop
        assert engine is not None and loop is not None
        engine.end(reason)
        loop.call_later(END_SECONDS, engine.end_now, reason)

    def _deliver(self, update: Update) -> None:
        if isinstance(update, Journaling | Pulse):  # there is no journal, and the engine is in this very process
            return
        for mailbox in tuple(self._mailboxes):
            if not mailbox.put(update):
                self.leave(mailbox)

    @property
    def room(self) -> Room:
        """For work that runs on the engine's thread."""
        assert self._room is not None
        return self._room

    def enter(self, mailbox: Mailbox, who: str, role: Role) -> tuple[Member, Hello]:
        """Between two steps: the state, and from here on every record."""
        try:
            member = self.room.attach(who, role)
        except NotAdmitted as problem:
            raise EngineGone(str(problem)) from None
        hello = self.room.hello(member)
        self.listen(mailbox, member)
        return member, hello

    def listen(self, mailbox: Mailbox, member: Member | None = None) -> None:
        with self._lock:
            self._mailboxes[mailbox] = member

    def leave(self, mailbox: Mailbox) -> None:
        with self._lock:
            member = self._mailboxes.pop(mailbox, None)
        if member is not None:
            self.room.leave(member)

    def leave_soon(self, mailbox: Mailbox) -> None:
        """From any thread."""
        self._post(lambda: self.leave(mailbox))


class LocalClient:
    """Implements `rise_engine.link.client.Client`. All methods belong to one loop: the one that called `attach`."""

    def __init__(self, host: EngineHost, who: str = "local", role: Role = "wizard") -> None:
        self.host = host
        self._who = who
        self._role: Role = role
        self._mailbox: Mailbox | None = None
        self._member: Member | None = None

    async def attach(self) -> Hello:
        self._detach()
        mailbox = Mailbox(asyncio.get_running_loop())
        member, hello = await self.host.call(lambda: self.host.enter(mailbox, self._who, self._role))
        self._mailbox, self._member = mailbox, member
        return hello  # type: ignore[no-any-return]

    def records(self) -> AsyncIterator[Sequence[Update]]:
        """As the protocol says. Raises LinkLost when this client fell too far behind."""
        if self._mailbox is None:
            raise RuntimeError("attach first")
        return self._from(self._mailbox)

    async def _from(self, mailbox: Mailbox) -> AsyncIterator[Sequence[Update]]:
        try:
            async for batch in mailbox.batches():
                yield batch
        except EngineGone as error:
            if self.host.gone is None:
                raise LinkLost(str(error)) from None
            raise

    async def send(self, message: ClientInput) -> Reply:
        if not isinstance(message, Submit | Note):
            raise TypeError(f"a client may send Submit and Note, not {type(message).__name__}")
        return await self.host.ask(lambda room, answer: room.send(self._attached(), message, answer))

    async def control(self, verb: Verb) -> Reply:
        return await self.host.ask(lambda room, answer: room.control(self._attached(), verb, answer))

    def now(self) -> float:
        return self.host.now()

    async def close(self, *, end_session: bool = False, reason: str = "") -> None:
        """As the protocol says. Raises PermissionError, and stays attached, when this client may not end the session;
        returns when the session has ended."""
        if end_session:
            await self._end(reason)
        self._detach()

    async def _end(self, reason: str) -> None:
        last = Mailbox(asyncio.get_running_loop())
        with suppress(EngineGone):
            await self.host.call(lambda: self.host.listen(last))
            member = self._member
            if member is None:  # who has started it may end it
                self.host.end(reason or "ended by its starter")
                reply = Reply(True)
            else:
                reply = await self.host.ask(lambda room, answer: room.end(member, reason, answer))
            if not reply.accepted:
                last.close()
                self.host.leave_soon(last)
                raise PermissionError(reply.reason)
            async for _ in last.batches():
                pass

    def _attached(self) -> Member:
        if self._member is None:
            raise LinkLost("this client is not attached to a session")
        return self._member

    def _detach(self) -> None:
        mailbox, self._mailbox, self._member = self._mailbox, None, None
        if mailbox is not None:
            mailbox.close()
            self.host.leave_soon(mailbox)


def _end_all() -> None:
    """A program that ends leaves no robot moving."""
    for host in tuple(_hosts):
        if host.gone is None:
            host.end("the program has ended")
            host.join(END_SECONDS + 2)


atexit.register(_end_all)
