"""The session's socket, in the engine's loop. The engine never waits for a client.

What keeps the loop free, whatever clients do:
- messages are taken in turn, one of each client, and only so many before the loop goes on; stop-all comes first;
- records are encoded once, gathered for one turn of the loop, and shared by everybody's queue;
- a client that leaves more than `BACKLOG` bytes waiting gets no more records, and the state anew once it has taken
  those; or, if it does not take that, it is dropped, and attaches again when it can;
- the state for those who attach goes out in portions, in turn, and only so many before the loop goes on.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property, partial
from pathlib import Path
from time import perf_counter

import msgspec
from msgspec.structs import replace

from rise_engine.engine import Answer as Callback
from rise_engine.engine import versions
from rise_engine.kernel.records import ActionRecord, AnyRecord, MistakeRecord, TaskRecord, TimingRecord
from rise_engine.link.client import Journaling, Pulse, Reply, Role, Update
from rise_engine.link.early import Early
from rise_engine.link.messages import (
    VERSION,
    About,
    Answer,
    Ended,
    JournalingChanged,
    PulseTold,
    ScenarioTold,
    Tasks,
    Welcome,
    line,
    state_of,
)
from rise_engine.link.peer import LINGER_SECONDS, Peer, in_pieces
from rise_engine.link.room import Member, Room
from rise_engine.scenario.exchange import to_json
from rise_engine.session.lines import record_bytes
from rise_engine.view import TaskView

TASKS_AT_ONCE = 128
TURN_LINES = 4
"""Lines that are taken at once in one turn of the loop, without waiting for a turn."""
PULSE_SECONDS = 1.0
"""Between two signs of life."""
TURN_SECONDS = 0.005
TURN_BYTES = 65_536
"""For which, and up to which, messages are taken in one turn of the loop: what comes of them has to go out too."""
READ = 262_144
"""Bytes that are read from one client at once."""


class LagMeter:
    """How late the loop is: the measure of whether anything holds it up."""

    TICK = 0.05
    KEPT = 100

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._latest: deque[float] = deque(maxlen=self.KEPT)
        self.max = 0.0
        self._due = loop.time() + self.TICK
        self._timer = loop.call_at(self._due, self._tick)

    @property
    def recent(self) -> float:
        """Seconds by which it was late at most, in the latest five seconds."""
        return max(self._latest, default=0.0)

    def _tick(self) -> None:
        late = max(0.0, self._loop.time() - self._due)
        self._latest.append(late)
        self.max = max(self.max, late)
        self._due = self._loop.time() + self.TICK
        self._timer = self._loop.call_at(self._due, self._tick)

    def close(self) -> None:
        self._timer.cancel()


class Server:
    """Listens for clients of one room. All methods belong to the engine's loop."""

    def __init__(self, room: Room, path: str | os.PathLike[str], *, allowed: frozenset[int] | None = None) -> None:
        """`allowed`: the users whose programs may connect; without it, this process's own and root."""
        self.room = room
        self.path = Path(path)
        self.allowed = allowed if allowed is not None else frozenset({os.getuid(), 0})
        self.peers: dict[Peer, None] = {}
        """Every connection, the oldest first."""
        self.ended: Ended | None = None
        self.lag: LagMeter | None = None
        self._server: asyncio.AbstractServer | None = None
        self._audience: set[Peer] = set()
        self._behind: set[Peer] = set()
        """Those who get no records until they have taken what waits for them."""
        self._turns: deque[Peer] = deque()
        self._turning = False
        self._hasty = 0
        """Lines that were taken at once in this turn of the loop."""
        self._states: deque[Peer] = deque()
        self._stating = False
        self._all_gone = asyncio.Event()
        self._pending: list[bytes] = []
        self._answered: list[Peer] = []
        self._early: tuple[Peer, Early] | None = None
        """What may have gone to one client already of the records that are pending next."""
        self._flushing = False
        self.buffer = memoryview(bytearray(READ))
        """What a client says arrives here; a new buffer for each message would cost more than taking the message."""
        room.subscribe(self._update)
        room.engine.after_inputs = self._flush_now

    async def start(self) -> None:
        """Listen. Raises OSError."""
        self._loop = asyncio.get_running_loop()
        listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            listening.setblocking(False)
            listening.bind(str(self.path))
            self.path.chmod(0o600)
            # The loop accepts `backlog` connections in one turn, so this is small; the system's own queue is longer.
            self._server = await self._loop.create_unix_server(partial(Peer, self), sock=listening, backlog=16)
            listening.listen(512)
        except BaseException:
            listening.close()
            raise
        self.lag = LagMeter(self._loop)
        self._pulse = self._loop.call_later(PULSE_SECONDS, self._beat)

    async def close(self) -> None:
        """Say that the session is over, if it is, and end all connections. Waits a moment for clients that read."""
        if self._server is None:
            return
        self._server.close()
        with suppress(OSError):
            self.path.unlink()
        self._flush()
        engine = self.room.engine
        if engine.failure is not None:
            self.ended = Ended(f"the engine stopped: {engine.failure or type(engine.failure).__name__}", failed=True)
        elif engine.ended:
            self.ended = Ended(self.room.end_reason)
        for peer in tuple(self.peers):
            peer.finish(self.ended)
        with suppress(TimeoutError):
            await asyncio.wait_for(self._all_gone.wait() if self.peers else asyncio.sleep(0), LINGER_SECONDS)
        for peer in tuple(self.peers):
            peer.abort()
        if self.lag is not None:
            self.lag.close()
        self._pulse.cancel()
        self._server = None

    def about(self) -> About:
        lag = self.lag
        assert lag is not None
        return replace(self.room.about(), program=f"rise-tui {versions()['rise-tui']}", lag=lag.recent, lag_max=lag.max)

    # --- in: one message of each client in turn ---------------------------------------------------------------------

    def has_line(self, peer: Peer, *, first: bool = False) -> None:
        """`peer` has a whole line. Call it once until that is taken."""
        if first:
            self._turns.appendleft(peer)
        else:
            self._turns.append(peer)
        if not self._turning:
            self._turning = True
            self._loop.call_soon(self._round)

    def make_room(self, newcomer: Peer) -> bool:
        """Let the oldest connection go that has not said who it is, so that such ones keep no console out."""
        idle = next((peer for peer in self.peers if peer.idle and peer is not newcomer), None)
        if idle is not None:
            idle.refuse("others are waiting to connect, and you have not attached")
        return idle is not None

    def at_leisure(self) -> bool:
        """Whether a line can be taken at once: nobody waits, and little was done in this turn of the loop."""
        if self._turning or self._hasty >= TURN_LINES:
            return False
        if not self._hasty:
            self._loop.call_soon(self._rested)
        self._hasty += 1
        return True

    def turn_taken(self, size: int) -> None:
        """A line was taken at once; a long one counts as many."""
        self._hasty += size * TURN_LINES // TURN_BYTES

    def _rested(self) -> None:
        self._hasty = 0

    def _round(self) -> None:
        self._turning = False
        until, size = perf_counter() + TURN_SECONDS, 0
        for _ in range(len(self._turns)):
            size += self._turns.popleft().take_turn()
            if size > TURN_BYTES or perf_counter() > until:
                break
        if self._turns and not self._turning:
            self._turning = True
            self._loop.call_soon(self._round)

    # --- out: everything of one turn together -----------------------------------------------------------------------

    def _update(self, update: Update) -> None:
        if self._behind and (task := _task_of(update)) is not None:
            for peer in self._behind:
                if peer.behind is not None:
                    peer.behind.add(task)
        if not self._audience:
            return
        if isinstance(update, Pulse):
            return
        if isinstance(update, Journaling):
            self._flush_records()
            self._broadcast(line(JournalingChanged(update)))
        else:
            self._pending.append(record_bytes(update))
            self._flush_soon()

    def _beat(self) -> None:
        """Signs of life, for those who are attached."""
        self._pulse = self._loop.call_later(PULSE_SECONDS, self._beat)
        if self._audience:
            assert self.lag is not None
            seen = self.room.engine.robot_seen
            pulse = Pulse(None if seen is None else round(seen, 1), round(self.lag.recent, 3))
            self._flush_records()
            self._broadcast(line(PulseTold(pulse)))

    def hasten(self, peer: Peer, id: int, answer: Callback) -> None:
        """`peer`, for whom nothing waits, has sent the message `id`: let it have the answer as early as can be."""

        def prepare(records: list[AnyRecord], reply: Reply) -> Callable[[], None]:
            data = _records_line(list(map(record_bytes, records)))
            early = peer.early(id, len(records), data + line(Answer(id, reply.accepted, reply.reason, reply.task)))
            self._early = (peer, early)
            return early.send

        if not (self._pending or self._answered):
            self.room.engine.hasten(answer, prepare)

    def has_answer(self, peer: Peer) -> None:
        self._answered.append(peer)
        self._flush_soon()

    def _flush_soon(self) -> None:
        if not self._flushing:
            self._flushing = True
            self._loop.call_soon(self._flush)

    def _flush(self) -> None:
        """Records first: who reads that an input was accepted has seen what came of it."""
        self._flushing = False
        answered, self._answered = self._answered, []
        if len(answered) == 1 and self._pending:  # the usual case: one console asked for something
            self._flush_records(answered[0])
        else:
            self._flush_records()
        for peer in answered:
            peer.send_answers()

    def _flush_now(self) -> None:
        """When the engine has sent out all that it had: no need to wait for the loop's next turn."""
        if self._pending or self._answered:
            self._flush()

    def _flush_records(self, asker: Peer | None = None) -> None:
        if not self._pending:
            return
        records, self._pending = self._pending, []
        if self._early is not None:
            (peer, early), self._early = self._early, None
            if early.left():
                first, records = records[: early.records], records[early.records :]
                self._broadcast(_records_line(first), without=peer)
        if records:
            self._broadcast(_records_line(records), asker)

    def _broadcast(self, data: bytes, asker: Peer | None = None, *, without: Peer | None = None) -> None:
        pieces = in_pieces(data)
        for peer in tuple(self._audience):
            if peer is without:
                continue
            peer.push(pieces, answers=peer is asker)
        if asker is not None:
            asker.send_answers()

    def has_state(self, peer: Peer) -> None:
        """`peer` could be sent more of the state."""
        self._states.append(peer)
        if not self._stating:
            self._stating = True
            self._loop.call_soon(self._send_states)

    def _send_states(self) -> None:
        until = perf_counter() + TURN_SECONDS
        while self._states and perf_counter() < until:
            self._states.popleft().send_state()
        self._stating = bool(self._states)
        if self._stating:
            self._loop.call_soon(self._send_states)

    # --- coming and going -------------------------------------------------------------------------------------------

    def admit(self, peer: Peer, name: str, role: Role) -> Member:
        """Raises NotAdmitted."""
        member = self.room.attach(name, role)
        self._flush_records()  # the state has them already
        self._audience.add(peer)
        return member

    def left_behind(self, peer: Peer) -> None:
        """`peer` gets no records any more, until `state_again`."""
        self._audience.discard(peer)
        self._behind.add(peer)

    def state_again(self, peer: Peer, member: Member, changed: set[int]) -> tuple[bytes, Iterator[list[TaskView]]]:
        """The state at this moment for one who was left behind, with the tasks that are not over or have `changed`."""
        self._behind.discard(peer)
        self._flush_records()
        self._audience.add(peer)
        open, _ = self.room.tasks()
        tasks = self.room.view.tasks
        more = [tasks[id] for id in sorted(changed - {task.id for task in open}) if id in tasks]
        return line(self._welcome(member)) + line(Tasks(open)), _in_portions(more, set())

    def state_for(self, member: Member, *, scenario: bool) -> tuple[bytes, Iterator[list[TaskView]]]:
        """The state at this moment: the greeting with everything that can still change, encoded now; and the tasks that
        cannot, some at a time. `scenario`: with what the session runs."""
        open, all = self.room.tasks()
        first = line(self._welcome(member)) + (self._scenario_line if scenario else b"") + line(Tasks(open))
        return first, _in_portions(all, {task.id for task in open})

    def _welcome(self, member: Member) -> Welcome:
        room = self.room
        engine, runs = room.engine, room.engine.scenario
        return Welcome(
            version=VERSION,
            you=member.name,
            role=member.role,
            mode=runs.mode,
            robot=runs.robot.name,
            seed=engine.seed,
            scenario_hash=runs.hash,
            folder=room.folder,
            replay=room.replay,
            journaling=engine.journaling,
            t=max(engine.clock.now(), 0.0),
            speed=getattr(engine.clock, "speed", 1.0),
            state=state_of(room.view),
            tasks=len(room.view.tasks),
        )

    @cached_property
    def _scenario_line(self) -> bytes:
        """Empty when it cannot be sent; then a client reads the copy in the session's folder."""
        try:
            return line(ScenarioTold(msgspec.Raw(to_json(self.room.engine.scenario))))
        except ValueError:
            return b""

    def forget(self, peer: Peer) -> None:
        """Nothing more goes to `peer`."""
        self._audience.discard(peer)
        self._behind.discard(peer)

    def lost(self, peer: Peer) -> None:
        """The connection is no more."""
        self.forget(peer)
        self.peers.pop(peer, None)
        if peer.member is not None:
            self.room.leave(peer.member)
        if not self.peers and self._server is not None and not self._server.is_serving():
            self._all_gone.set()


def _task_of(update: Update) -> int | None:
    """The task that a record is about."""
    match update:
        case TaskRecord(id=task) | ActionRecord(task=task) | MistakeRecord(task=task) | TimingRecord(task=task):
            return task
        case _:
            return None


def _records_line(records: list[bytes]) -> bytes:
    return b'{"type":"records","records":[' + b",".join(records) + b"]}\n"


def _in_portions(tasks: list[TaskView], without: set[int]) -> Iterator[list[TaskView]]:
    for at in range(0, len(tasks), TASKS_AT_ONCE):
        portion = [task for task in tasks[at : at + TASKS_AT_ONCE] if task.id not in without]
        if portion:
            yield portion
