"""The session's socket, in the engine's loop. The engine never waits for a client.

These rules keep the loop free:
- messages are handled in turn, one of each client, with a limit for each turn of the loop; stop-all comes first;
- records are encoded once, gathered for one turn of the loop, and shared by all queues;
- a client that is too far behind is cut, and attaches again when it can;
- attaching clients get the state in pieces, a few in each turn of the loop.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import msgspec
from msgspec.structs import replace

from rise_engine.base.lag_meter import LagMeter
from rise_engine.base.time_slicer import TimeSlicer
from rise_engine.kernel.task_view import TaskView
from rise_engine.run.engine.engine import requests_stop, versions
from rise_engine.run.protocol.client import Heartbeat, JournalStatus, Rejected, Reply, Update
from rise_engine.run.protocol.messages import (
    MAX_LINE_BYTES,
    MAX_MESSAGE_BYTES,
    VERSION,
    AskSummaryMessage,
    AttachMessage,
    ControlMessage,
    EndedMessage,
    EndMessage,
    HeartbeatMessage,
    HelloMessage,
    JournalStatusMessage,
    ReadyMessage,
    RefusedMessage,
    ReplyMessage,
    ScenarioMessage,
    SendMessage,
    SessionSummary,
    TakeOverMessage,
    TasksMessage,
    decode_client_message,
    encode_line,
    without_tasks,
)
from rise_engine.run.server.connection import LINGER_SECONDS, ClientConnection, split_into_pieces
from rise_engine.run.server.hub import AttachedClient, SessionHub
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.serialization import encode_scenario
from rise_engine.session.journal_format import encode_record

_LOG = logging.getLogger(__name__)

MAX_CLIENTS = 200
MAX_UNANSWERED = 256
"""Maximum number of unanswered messages of one client."""
ATTACH_SECONDS = 5.0
"""Time limit for attaching after a connection."""
TASKS_AT_ONCE = 128
"""Tasks of the state in one message."""
HEARTBEAT_SECONDS = 1.0
"""Interval between two signs of life."""
SLICE_SECONDS = 0.005
SLICE_BYTES = 65_536
"""Limits in seconds and bytes of the messages handled in one turn of the loop, so that their effects are sent, too."""


class SessionServer:
    """A server for the clients of one session. All methods belong to the engine's loop."""

    def __init__(self, hub: SessionHub, path: str | os.PathLike[str]) -> None:
        """:param hub: the session.
        :param path: the socket's; nothing exists there yet.
        """
        self.hub = hub
        self.path = Path(path)
        self.connections: set[ClientConnection] = set()
        self.lag: LagMeter
        self._server: asyncio.AbstractServer | None = None
        self._encoded_scenario: tuple[Scenario | None, bytes] = (None, b"")
        """The scenario's message for clients that want it, with its scenario."""
        self._attached: set[ClientConnection] = set()
        self._waiting_connections: deque[ClientConnection] = deque()
        """Connections with waiting lines."""
        self._messages = TimeSlicer(self._take_message, SLICE_SECONDS, most=SLICE_BYTES)
        self._all_gone = asyncio.Event()
        self._records: list[bytes] = []
        """Encoded records of this turn of the loop."""
        self._replies: dict[ClientConnection, list[bytes]] = {}
        self._flushing = False
        hub.subscribe(self._on_update)

    async def start(self) -> None:
        """Listen. Raises OSError."""
        self._loop = asyncio.get_running_loop()
        listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            listening.setblocking(False)
            listening.bind(str(self.path))
            self.path.chmod(0o600)
            # Small, because the loop accepts `backlog` connections in one turn. The system's own queue is longer.
            accept = partial(ClientConnection, self)
            self._server = await self._loop.create_unix_server(accept, sock=listening, backlog=16)
            listening.listen(512)
        except BaseException:
            listening.close()
            raise
        self.lag = LagMeter(self._loop)
        self._heartbeat = self._loop.call_later(HEARTBEAT_SECONDS, self._on_heartbeat)

    async def close(self) -> None:
        """Announce the session's end, if it is over, and end all connections. Waits briefly for clients that read."""
        if self._server is None:
            return
        self._server.close()
        with suppress(OSError):
            self.path.unlink()
        self._flush()
        engine = self.hub.engine
        last = b""
        if engine.failure is not None:
            reason = f"the engine stopped: {engine.failure or type(engine.failure).__name__}"
            last = encode_line(EndedMessage(reason, failed=True))
        elif engine.ended:
            last = encode_line(EndedMessage(self.hub.view.end_reason))
        for connection in tuple(self.connections):
            connection.finish(last)
        if self.connections:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._all_gone.wait(), LINGER_SECONDS)
        for connection in tuple(self.connections):
            connection.abort()
        self._messages.cancel()
        self.lag.close()
        self._heartbeat.cancel()
        self._server = None

    def summary(self) -> SessionSummary:
        """Summarize the session, including the delay of its loop."""
        program = f"rise-tui {versions()['rise-tui']}"
        return replace(self.hub.summary(), program=program, lag=self.lag.recent, lag_max=self.lag.max)

    # --- connections ------------------------------------------------------------------------------------------------

    def connection_opened(self, connection: ClientConnection) -> None:
        self.connections.add(connection)
        if connection.user not in (None, os.getuid(), 0):  # root may do everything anyway
            _refuse(connection, "this session belongs to another user")

    def _end_idle(self) -> None:
        """End the connections whose time limit to attach or to read is over."""
        oldest = self._loop.time() - ATTACH_SECONDS
        for connection in tuple(self.connections):
            if connection.client is None and connection.opened_at < oldest:
                _refuse(connection, f"you have not attached within {ATTACH_SECONDS:g} seconds")
            elif connection.is_stalled:
                connection.abort()

    def connection_closed(self, connection: ClientConnection) -> None:
        self.connections.discard(connection)
        if connection.client is not None:
            self._attached.discard(connection)
            self.hub.detach(connection.client)
        if not self.connections and self._server is not None and not self._server.is_serving():
            self._all_gone.set()

    # --- input: one message of each client in turn ------------------------------------------------------------------

    def line_arrived(self, connection: ClientConnection, *, urgent: bool) -> None:
        if urgent:  # a stop-all does not wait behind long messages of other clients
            self._waiting_connections.appendleft(connection)
        else:
            self._waiting_connections.append(connection)
        self._messages.wake()

    def _take_message(self) -> int:
        """Handle one message of the next client; return its length."""
        if not self._waiting_connections:
            return 0
        connection = self._waiting_connections.popleft()
        if not connection.has_line:  # it has ended meanwhile
            return 1
        data = connection.take_line()
        try:
            self._take_line(connection, data)
        except Exception:  # only the engine's own failure ends the session
            _LOG.exception("a client's message failed")
            _refuse(connection, "this message could not be handled; the engine's log says why")
        if connection.has_line:
            self._waiting_connections.append(connection)
        return len(data) + 1

    def _take_line(self, connection: ClientConnection, data: bytes) -> None:
        if len(data) > MAX_LINE_BYTES:
            _refuse(connection, f"a line has more than {MAX_LINE_BYTES:,} bytes")
            return
        try:
            message = decode_client_message(data)
        except ValueError as problem:
            _refuse(connection, str(problem))
            return
        match message:
            case AttachMessage():
                try:
                    self._attach(connection, message)
                except Rejected as refusal:
                    _refuse(connection, str(refusal))
            case AskSummaryMessage():
                connection.finish(encode_line(self.summary()))
            case _ if connection.client is not None:
                self._take_request(connection, connection.client, message, len(data))
            case _:
                _refuse(connection, "attach first")

    def _take_request(
        self,
        connection: ClientConnection,
        client: AttachedClient,
        message: SendMessage | ControlMessage | EndMessage | TakeOverMessage,
        size: int,
    ) -> None:
        connection.unanswered += 1
        answer = partial(self._queue_reply, connection, message.id)
        match message:
            case SendMessage() if size > MAX_MESSAGE_BYTES:
                answer(Reply(False, f"a message may have {MAX_MESSAGE_BYTES:,} bytes at most"))
            case SendMessage(message=input) if connection.unanswered > MAX_UNANSWERED and not requests_stop(input):
                answer(Reply(False, f"{MAX_UNANSWERED} of your messages are not answered yet; wait"))
            case SendMessage(message=input):
                self.hub.submit(client, input, answer)
            case ControlMessage(verb=verb):
                self.hub.change_control(client, verb, answer)
            case EndMessage(reason=reason):
                self.hub.end_session(client, reason, answer)
            case TakeOverMessage():
                self.hub.take_over_scenario(client, answer)

    def _attach(self, connection: ClientConnection, message: AttachMessage) -> None:
        """Attach a client. Raises Rejected."""
        if message.version != VERSION:
            raise Rejected(
                f"this session speaks version {VERSION} of the protocol, and you speak version {message.version}; "
                "use the same release of rise-tui for both"
            )
        if connection.client is not None:
            raise Rejected("you are attached already")
        if len(self._attached) >= MAX_CLIENTS:
            raise Rejected(f"{MAX_CLIENTS} clients are connected to this session already")
        client = connection.client = self.hub.attach(message.name, message.role)
        self._flush_records()  # the state includes them
        self._attached.add(connection)
        # Tasks that can still change are encoded now; the others follow in portions.
        changing = self.hub.changing_tasks()
        scenario = self._scenario_line if message.scenario else b""
        first = encode_line(self._make_hello(client)) + scenario + encode_line(TasksMessage(changing))
        connection.send_state(_state_pieces(first, self.hub.all_tasks(), {task.id for task in changing}))

    # --- output: everything of one turn together --------------------------------------------------------------------

    def _on_update(self, update: Update) -> None:
        if not self._attached or isinstance(update, Heartbeat):
            return
        if isinstance(update, JournalStatus):
            self._flush_records()
            self._broadcast(encode_line(JournalStatusMessage(update)))
        else:
            self._records.append(encode_record(update))
            self._flush_soon()

    def _on_heartbeat(self) -> None:
        """Send signs of life to the attached clients."""
        self._heartbeat = self._loop.call_later(HEARTBEAT_SECONDS, self._on_heartbeat)
        self._end_idle()
        if self._attached:
            seen = self.hub.engine.robot_seen
            heartbeat = Heartbeat(None if seen is None else round(seen, 1), round(self.lag.recent, 3))
            self._flush_records()
            self._broadcast(encode_line(HeartbeatMessage(heartbeat)))

    def _queue_reply(self, connection: ClientConnection, id: int, reply: Reply) -> None:
        connection.unanswered -= 1
        answer = encode_line(ReplyMessage(id, reply.accepted, reply.reason, reply.task))
        self._replies.setdefault(connection, []).append(answer)
        self._flush_soon()

    def _flush_soon(self) -> None:
        if not self._flushing:
            self._flushing = True
            self._loop.call_soon(self._flush)

    def _flush(self) -> None:
        """Send records before replies: a client has the records of an input when it reads that it was accepted."""
        self._flushing = False
        self._flush_records()
        replies, self._replies = self._replies, {}
        for connection, lines in replies.items():
            connection.send(split_into_pieces(b"".join(lines)))

    def _flush_records(self) -> None:
        if self._records:
            records, self._records = self._records, []
            self._broadcast(b'{"type":"records","records":[' + b",".join(records) + b"]}\n")

    def _broadcast(self, data: bytes) -> None:
        pieces = split_into_pieces(data)
        for connection in self._attached:
            connection.send(pieces)

    def _make_hello(self, client: AttachedClient) -> HelloMessage:
        hub = self.hub
        engine, scenario = hub.engine, hub.engine.scenario
        return HelloMessage(
            version=VERSION,
            you=client.name,
            role=client.role,
            mode=scenario.mode,
            robot=scenario.robot.name,
            seed=engine.seed,
            scenario_hash=scenario.hash,
            folder=hub.folder,
            replay=False,
            journaling=engine.journal_status,
            t=max(engine.clock.now(), 0.0),
            speed=getattr(engine.clock, "speed", 1.0),
            state=without_tasks(hub.view),
            tasks=len(hub.view.tasks),
            origin=getattr(engine.clock, "origin", None),
        )

    def scenario_changed(self) -> None:
        """Make all clients attach again, because the session continues with another scenario."""
        self._loop.call_soon(self._let_attach_anew)

    def _let_attach_anew(self) -> None:
        """Send waiting data, including the reply to the request, and end the connections."""
        self._flush()
        for connection in tuple(self._attached):
            _refuse(connection, "the files of the scenario have changed: attach again")

    @property
    def _scenario_line(self) -> bytes:
        """The scenario's message; empty if it cannot be sent: clients then read the copy in the session's folder."""
        scenario = self.hub.engine.scenario
        if scenario is not self._encoded_scenario[0]:
            try:
                line = encode_line(ScenarioMessage(msgspec.Raw(encode_scenario(scenario))))
            except ValueError:
                line = b""
            self._encoded_scenario = scenario, line
        return self._encoded_scenario[1]


def _refuse(connection: ClientConnection, reason: str) -> None:
    """End a connection with a sentence."""
    connection.finish(encode_line(RefusedMessage(reason)))


def _state_pieces(first: bytes, tasks: list[TaskView], sent: set[int]) -> Iterator[bytes]:
    """Yield the state of a session: `first`, then the tasks that were not sent with it."""
    yield from split_into_pieces(first)
    for at in range(0, len(tasks), TASKS_AT_ONCE):
        portion = [task for task in tasks[at : at + TASKS_AT_ONCE] if task.id not in sent]
        if portion:
            yield from split_into_pieces(encode_line(TasksMessage(portion)))
    yield encode_line(ReadyMessage())
