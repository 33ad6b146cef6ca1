"""An engine in this process, on a thread and an asyncio loop of its own, and clients that talk to it by messages.

The engine never waits for a client: records go into a client's mailbox, and one wake-up is posted to its loop however
many arrive. A client that is gone, stalled or closed costs the engine nothing more than that. Several may be attached.
"""

from __future__ import annotations

import asyncio
import atexit
import logging
import threading
from collections import deque
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import suppress
from typing import Any
from weakref import WeakSet

from msgspec.structs import replace

from rise_engine.clock import RealClock
from rise_engine.engine import Engine
from rise_engine.kernel.inputs import Note, Submit
from rise_engine.kernel.records import AnyRecord
from rise_engine.link.client import ClientInput, EngineGone, Hello, Reply
from rise_engine.link.mailbox import Call, Mailbox
from rise_engine.robots import make_robot, warning_for
from rise_engine.scenario.model import Mode, RobotProfile, Scenario
from rise_engine.view import ActView, TaskView, View

_LOG = logging.getLogger(__name__)

END_SECONDS = 6.0
"""Real seconds that the robot gets to confirm the last stop before the session ends without it."""

_hosts: WeakSet[EngineHost] = WeakSet()


def start_local(
    scenario: Scenario,
    *,
    mode: Mode | None = None,
    robot: RobotProfile | str | None = None,
    seed: int = 0,
    speed: float = 1.0,
    faults: Sequence[str] = (),
) -> LocalClient:
    """Start an engine for `scenario` and give a client of it. Does not wait: `attach` says when it could not start.

    `mode` and `robot` default to the scenario's. Another robot's profile must know all actions of the scenario, so that
    it is better chosen when loading; a name is only accepted when it is the scenario's own robot (ValueError).
    """
    return EngineHost(scenario, mode=mode, robot=robot, seed=seed, speed=speed, faults=faults).start().client()


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
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="rise-engine", daemon=True)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._backlog: list[Callable[[], None]] = []
        self._calls: set[Call] = set()
        self._mailboxes: list[Mailbox] = []
        self._gone: str | None = None
        # These belong to the engine's thread:
        self._clock: RealClock | None = None
        self._engine: Engine | None = None
        self._view = View()

    def start(self) -> EngineHost:
        """Begin the session. Call it once."""
        _hosts.add(self)
        self._thread.start()
        return self

    def client(self) -> LocalClient:
        """A new connection; any number may be attached at once."""
        return LocalClient(self)

    @property
    def gone(self) -> str | None:
        """Why the engine has ended, or None while it runs."""
        return self._gone

    def now(self) -> float:
        """Session time in seconds; 0 before it has begun, and the last moment after it has ended."""
        clock = self._clock
        return self._view.t if clock is None or self._gone is not None else max(clock.now(), 0.0)

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
        loop = asyncio.get_running_loop()
        call = Call(loop, loop.create_future())

        def run() -> None:
            try:
                result = work()
            except Exception as error:
                # A failed kernel ends the thread, which settles every call with the reason.
                if self._engine is None or self._engine.failure is None:
                    self._settle(call, None, error)
            else:
                self._settle(call, result, None)

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
        engine = Engine(scenario, robot, clock, self.seed, sinks=(self._view.apply, self._deliver))
        ended = asyncio.Event()
        engine.when_ended(ended.set)
        engine.start()
        warning = warning_for(scenario.robot, scenario.mode)
        if warning is not None:
            engine.post(Note(text=warning))
        with self._lock:
            self._engine, self._clock, self._loop = engine, clock, loop
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

    def _deliver(self, record: AnyRecord) -> None:
        for mailbox in tuple(self._mailboxes):
            if not mailbox.put(record):
                self.leave(mailbox)

    def enter(self, mailbox: Mailbox) -> Hello:
        """Between two steps: the state, and from here on every record."""
        with self._lock:
            self._mailboxes.append(mailbox)
        scenario = self.scenario
        return Hello(scenario, scenario.mode, scenario.robot.name, self.seed, copy_of(self._view))

    def leave(self, mailbox: Mailbox) -> None:
        with self._lock, suppress(ValueError):
            self._mailboxes.remove(mailbox)

    def accept(self, message: ClientInput) -> Reply:
        assert self._engine is not None
        return self._engine.accept(message)


class LocalClient:
    """Implements `rise_engine.link.client.Client`. All methods belong to one loop: the one that called `attach`."""

    def __init__(self, host: EngineHost) -> None:
        self.host = host
        self._mailbox: Mailbox | None = None

    async def attach(self) -> Hello:
        self._detach()
        mailbox = Mailbox(asyncio.get_running_loop())
        hello: Hello = await self.host.call(lambda: self.host.enter(mailbox))
        self._mailbox = mailbox
        return hello

    def records(self) -> AsyncIterator[Sequence[AnyRecord]]:
        """As the protocol says. Raises EngineGone when the engine failed or this client fell too far behind."""
        if self._mailbox is None:
            raise RuntimeError("attach first")
        return self._mailbox.batches()

    async def send(self, message: ClientInput) -> Reply:
        if not isinstance(message, Submit | Note):
            raise TypeError(f"a client may send Submit and Note, not {type(message).__name__}")
        reply: Reply = await self.host.call(lambda: self.host.accept(message))
        return reply

    def now(self) -> float:
        return self.host.now()

    async def close(self, *, end_session: bool = True) -> None:
        if end_session:
            last = Mailbox(asyncio.get_running_loop())
            with suppress(EngineGone):
                await self.host.call(lambda: self.host.enter(last))
                self.host.end("the console has ended the session")
                async for _ in last.batches():
                    pass
        self._detach()

    def _detach(self) -> None:
        mailbox, self._mailbox = self._mailbox, None
        if mailbox is not None:
            mailbox.close()
            self.host.leave(mailbox)


def copy_of(view: View) -> View:
    """A view that the engine will not change any more. What has ended is shared, because nothing changes it again."""
    copies = {
        number: _copy_of_task(task)
        for number, task in view.tasks.items()
        if task.ended is None or any(action.ended is None for action in task.actions.values())
    }
    tasks = view.tasks | copies
    return replace(
        view,
        tasks=tasks,
        acts={name: _copy_of_act(act) for name, act in view.acts.items()},
        rules={name: replace(rule) for name, rule in view.rules.items()},
        memory=dict(view.memory),
        running=list(view.running),
        waiting=list(view.waiting),
        unhandled=deque(view.unhandled, view.unhandled.maxlen),
    )


def _copy_of_task(task: TaskView) -> TaskView:
    return replace(task, actions={name: replace(action) for name, action in task.actions.items()})


def _copy_of_act(act: ActView) -> ActView:
    return replace(act, running=list(act.running), waiting=list(act.waiting))


def _end_all() -> None:
    """A program that ends leaves no robot moving."""
    for host in tuple(_hosts):
        if host.gone is None:
            host.end("the program has ended")
            host.join(END_SECONDS + 2)


atexit.register(_end_all)
