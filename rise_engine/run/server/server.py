"""The session's socket, in the engine's loop. The engine never waits for a client.

What keeps the loop free, whatever clients do:
- messages are taken in turn, one of each client, and only so many before the loop goes on; stop-all goes first;
- records are encoded once, gathered for one turn of the loop, and shared by everybody's queue;
- a client that leaves more than `attachment.BACKLOG` bytes waiting gets no more records, and the state anew once it has
  taken those; or, if it does not take that, it is dropped, and attaches again when it can;
- the state for those who attach goes out in portions, in turn, and only so many before the loop goes on.
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
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import (
    ActionRecord,
    AnyRecord,
    FailureRecord,
    KeptRecord,
    MistakeRecord,
    TaskRecord,
    TimingRecord,
)
from rise_engine.kernel.task_view import TaskView
from rise_engine.run.engine.engine import versions
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
from rise_engine.run.server.attachment import Attachment
from rise_engine.run.server.connection import LINGER_SECONDS, ClientConnection, split_into_pieces
from rise_engine.run.server.hub import AttachedClient, SessionHub
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.serialization import encode_scenario
from rise_engine.session.journal_format import encode_record

_LOG = logging.getLogger(__name__)

MAX_CLIENTS = 200
MAX_UNANSWERED = 256
"""Messages of one client that are not answered yet."""
ATTACH_SECONDS = 5.0
"""Within which a connection has to attach."""
TASKS_AT_ONCE = 128
"""Tasks of the state in one message."""
HEARTBEAT_SECONDS = 1.0
"""Between two signs of life."""
SLICE_SECONDS = 0.005
SLICE_BYTES = 65_536
"""For which, and up to which, messages are taken in one turn of the loop: what comes of them has to go out too."""


class SessionServer:
    """Listens for clients of one session. All methods belong to the engine's loop."""

    def __init__(self, hub: SessionHub, path: str | os.PathLike[str]) -> None:
        """
        :param hub: the session.
        :param path: of the socket; nothing is there yet.
        """
        self.hub = hub
        self.path = Path(path)
        self.connections: dict[ClientConnection, Attachment | None] = {}
        """Every connection, the oldest first; None for one that has not attached."""
        self.lag: LagMeter
        self._server: asyncio.AbstractServer | None = None
        self._encoded_scenario: tuple[Scenario | None, bytes] = (None, b"")
        """What a client is sent that asks for it, made once."""
        self._attached: set[Attachment] = set()
        self._waiting_connections: deque[ClientConnection] = deque()
        """Those that have sent something that was not taken yet."""
        self._messages = TimeSlicer(self._take_message, SLICE_SECONDS, most=SLICE_BYTES)
        self._getting_state: deque[Attachment] = deque()
        """Those that can be sent more of the state."""
        self._state_portions = TimeSlicer(self._send_state, SLICE_SECONDS)
        self._all_gone = asyncio.Event()
        self._records: list[bytes] = []
        """Encoded, of this turn of the loop."""
        self._replies: dict[Attachment, list[bytes]] = {}
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
            # The loop accepts `backlog` connections in one turn, so this is small; the system's own queue is longer.
            accept = partial(ClientConnection, self)
            self._server = await self._loop.create_unix_server(accept, sock=listening, backlog=16)
            listening.listen(512)
        except BaseException:
            listening.close()
            raise
        self.lag = LagMeter(self._loop)
        self._heartbeat = self._loop.call_later(HEARTBEAT_SECONDS, self._on_heartbeat)

    async def close(self) -> None:
        """Say that the session is over, if it is, and end all connections. Waits a moment for clients that read."""
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
        for slicer in (self._messages, self._state_portions):
            slicer.cancel()
        self.lag.close()
        self._heartbeat.cancel()
        self._server = None

    def summary(self) -> SessionSummary:
        """The session in a few words, and how late its loop is."""
        program = f"rise-tui {versions()['rise-tui']}"
        return replace(self.hub.summary(), program=program, lag=self.lag.recent, lag_max=self.lag.max)

    # --- connections ------------------------------------------------------------------------------------------------

    def connection_opened(self, connection: ClientConnection) -> None:
        self.connections[connection] = None
        if connection.user not in (None, os.getuid(), 0):  # root may do everything anyway
            _refuse(connection, "this session belongs to another user")
        elif len(self.connections) > MAX_CLIENTS and not self._close_idle(connection):
            _refuse(connection, f"{MAX_CLIENTS} clients are connected to this session already")

    def _refuse_unattached(self) -> None:
        """Refuse those that have had their time. Timers of their own would hold on to many that have gone."""
        oldest = self._loop.time() - ATTACH_SECONDS
        for connection, attachment in self.connections.items():
            if attachment is None and connection.opened_at < oldest:
                _refuse(connection, f"you have not attached within {ATTACH_SECONDS:g} seconds")

    def _close_idle(self, newcomer: ClientConnection) -> bool:
        """Refuse the oldest connection that has not attached, so that such ones keep no console out."""
        for connection, attachment in self.connections.items():
            if attachment is None and not connection.closing and connection is not newcomer:
                _refuse(connection, "others are waiting to connect, and you have not attached")
                return True
        return False

    def connection_drained(self, connection: ClientConnection) -> None:
        attachment = self.connections.get(connection)
        if attachment is None:
            return
        attachment.resume()
        if attachment.getting_state:
            self._getting_state.append(attachment)
            self._state_portions.wake()
        elif attachment.has_caught_up:
            self._send_state_again(attachment)

    def connection_closed(self, connection: ClientConnection) -> None:
        attachment = self.connections.pop(connection, None)
        if attachment is not None:
            attachment.close()
            self._attached.discard(attachment)
            self.hub.detach(attachment.client)
        if not self.connections and self._server is not None and not self._server.is_serving():
            self._all_gone.set()

    # --- in: one message of each client in turn ---------------------------------------------------------------------

    def line_arrived(self, connection: ClientConnection, *, urgent: bool) -> None:
        if urgent:  # a stop-all does not wait behind the long messages of others
            self._waiting_connections.appendleft(connection)
        else:
            self._waiting_connections.append(connection)
        self._messages.wake()

    def _take_message(self) -> int:
        """Take one message of the client whose turn it is; gives its length."""
        if not self._waiting_connections:
            return 0
        connection = self._waiting_connections.popleft()
        if not connection.has_line:  # it has ended meanwhile
            return 1
        data = connection.take_line()
        try:
            self._take_line(connection, data)
        except Exception:  # the engine's own failure ends the session; nothing else may hurt other clients
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
        attachment = self.connections[connection]
        match message:
            case AttachMessage():
                try:
                    self._attach(connection, message)
                except Rejected as refusal:
                    _refuse(connection, str(refusal))
            case AskSummaryMessage():
                connection.finish(encode_line(self.summary()))
            case _ if attachment is not None:
                self._take_request(attachment, message, len(data))
            case _:
                _refuse(connection, "attach first")

    def _take_request(
        self, attachment: Attachment, message: SendMessage | ControlMessage | EndMessage | TakeOverMessage, size: int
    ) -> None:
        client = attachment.client
        attachment.unanswered += 1
        answer = partial(self._queue_reply, attachment, message.id)
        match message:
            case SendMessage() if size > MAX_MESSAGE_BYTES:
                answer(Reply(False, f"a message may have {MAX_MESSAGE_BYTES:,} bytes at most"))
            case SendMessage(message=input) if attachment.unanswered > MAX_UNANSWERED and not _is_stop(input):
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
        """Raises Rejected."""
        if message.version != VERSION:
            raise Rejected(
                f"this session speaks version {VERSION} of the protocol, and you speak version {message.version}; "
                "use the same release of rise-tui for both"
            )
        if self.connections[connection] is not None:
            raise Rejected("you are attached already")
        client = self.hub.attach(message.name, message.role)
        self._flush_records()  # the state has them already
        attachment = self.connections[connection] = Attachment(connection, client, resyncs=message.resync)
        self._attached.add(attachment)
        # Everything that can still change is encoded now; the tasks that cannot, some at a time.
        changing = self.hub.changing_tasks()
        scenario = self._scenario_line if message.scenario else b""
        first = encode_line(self._make_hello(client)) + scenario + encode_line(TasksMessage(changing))
        self._begin_state(attachment, first, _in_portions(self.hub.all_tasks(), {task.id for task in changing}))

    # --- out: everything of one turn together -----------------------------------------------------------------------

    def _on_update(self, update: Update) -> None:
        if not self._attached or isinstance(update, Heartbeat):
            return
        if isinstance(update, JournalStatus):
            self._flush_records()
            self._broadcast(encode_line(JournalStatusMessage(update)))
        else:
            task = _task_of(update)
            for attachment in self._attached:
                if task is not None and attachment.missed_tasks is not None:
                    attachment.missed_tasks.add(task)
            self._records.append(encode_record(update))
            self._flush_soon()

    def _on_heartbeat(self) -> None:
        """Signs of life, for those that are attached."""
        self._heartbeat = self._loop.call_later(HEARTBEAT_SECONDS, self._on_heartbeat)
        self._refuse_unattached()
        if self._attached:
            seen = self.hub.engine.robot_seen
            heartbeat = Heartbeat(None if seen is None else round(seen, 1), round(self.lag.recent, 3))
            self._flush_records()
            self._broadcast(encode_line(HeartbeatMessage(heartbeat)))

    def _queue_reply(self, attachment: Attachment, id: int, reply: Reply) -> None:
        attachment.unanswered -= 1
        answer = encode_line(ReplyMessage(id, reply.accepted, reply.reason, reply.task))
        self._replies.setdefault(attachment, []).append(answer)
        self._flush_soon()

    def _flush_soon(self) -> None:
        if not self._flushing:
            self._flushing = True
            self._loop.call_soon(self._flush)

    def _flush(self) -> None:
        """Records first: who reads that an input was accepted has seen what came of it."""
        self._flushing = False
        self._flush_records()
        replies, self._replies = self._replies, {}
        for attachment, lines in replies.items():
            attachment.send_replies(b"".join(lines))

    def _flush_records(self) -> None:
        if self._records:
            records, self._records = self._records, []
            self._broadcast(b'{"type":"records","records":[' + b",".join(records) + b"]}\n")

    def _broadcast(self, data: bytes) -> None:
        pieces = split_into_pieces(data)
        for attachment in self._attached:
            if attachment.missed_tasks is None:
                attachment.send(pieces)

    # --- the state, for clients that attach or lay behind -----------------------------------------------------------

    def _begin_state(self, attachment: Attachment, first: bytes, portions: Iterator[list[TaskView]]) -> None:
        attachment.begin_state(first, portions)
        self._getting_state.append(attachment)
        self._state_portions.wake()

    def _send_state(self) -> bool:
        """A portion for the one whose turn it is."""
        if not self._getting_state:
            return False
        attachment = self._getting_state.popleft()
        if attachment.send_state():
            self._getting_state.append(attachment)
        elif attachment.has_caught_up:  # so much has happened meanwhile that it lay behind at once
            self._send_state_again(attachment)
        return True

    def _send_state_again(self, attachment: Attachment) -> None:
        """The state for one who lay behind, with the tasks that are not over or have changed meanwhile."""
        self._flush_records()
        changing = self.hub.changing_tasks()
        tasks = self.hub.view.tasks
        missed = (attachment.missed_tasks or set()) - {task.id for task in changing}
        changed = [tasks[id] for id in sorted(missed) if id in tasks]
        first = encode_line(self._make_hello(attachment.client)) + encode_line(TasksMessage(changing))
        self._begin_state(attachment, first, _in_portions(changed, set()))

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
        """The session goes on with another scenario: whoever is attached attaches anew, and gets it then."""
        self._loop.call_soon(self._let_attach_anew)

    def _let_attach_anew(self) -> None:
        """After what is on its way, an answer to who has asked for it among that."""
        self._flush()
        for attachment in list(self._attached):
            _refuse(attachment.connection, "the files of the scenario have changed: attach again")

    @property
    def _scenario_line(self) -> bytes:
        """Empty when it cannot be sent; then a client reads the copy in the session's folder."""
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


def _is_stop(message: object) -> bool:
    return isinstance(message, Submit) and message.function == "stopAll"


def _task_of(record: AnyRecord) -> int | None:
    """The task that a record is about."""
    match record:
        case TaskRecord(id=task) | ActionRecord(task=task) | MistakeRecord(task=task):
            return task
        case TimingRecord(task=task) | FailureRecord(task=task) | KeptRecord(task=task):
            return task
        case _:
            return None


def _in_portions(tasks: list[TaskView], without: set[int]) -> Iterator[list[TaskView]]:
    for at in range(0, len(tasks), TASKS_AT_ONCE):
        portion = [task for task in tasks[at : at + TASKS_AT_ONCE] if task.id not in without]
        if portion:
            yield portion
