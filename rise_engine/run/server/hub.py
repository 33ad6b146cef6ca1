"""The clients of a session: which are attached, which has control, and what each may do. It has no sockets.

At most one client has control: the wizard who may act. All others watch, add notes, and can stop everything. Changes of
control are inputs of the engine, so that they are in the record.

A client has two names. Its own name is unique (`wizard:anna#2` is Anna's second console), because control belongs to
one console. The `source` of its inputs is the person (`wizard:anna`), for the record.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from time import monotonic, time
from unicodedata import normalize

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.suspend import suspended_seconds
from rise_engine.kernel.inputs import ControlChanged, ControlStatus, Note, OutcomeReport, Submit
from rise_engine.kernel.records import ActionRecord, AnyRecord, TaskRecord
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import SessionView
from rise_engine.run.engine.engine import Engine, ReplyCallback, versions
from rise_engine.run.protocol.client import ClientInput, ControlVerb, Rejected, Reply, Role, Update
from rise_engine.run.protocol.messages import VERSION, SessionSummary
from rise_engine.run.server.client_names import find_lookalike, name_problem

_LOG = logging.getLogger(__name__)

MAKES_SAFE = frozenset({"stopAll", "cancelOpenGoals"})
"""Functions that never wait, not even for the session's beginning."""
ALLOWED_WITHOUT_CONTROL = MAKES_SAFE | {"markMistake"}
"""Functions for every attached client: they start nothing. Every client may also add notes."""
STOPPING = frozenset({"stopCommunicationRobotAct", "stopInteractionRule", "stopRuleOfAct", "cancelTask"})
"""Functions that are harmless even when late."""
STANDSTILL_SECONDS = 5.0
"""After a longer standstill of this process, earlier requests start nothing. It is noted, for durations in the
record."""
MAX_BEHIND_SECONDS = 2.0
"""While the disk has recorded nothing for longer, nothing starts, because people would repeat their requests."""
SUSPENDED_SECONDS = 1.0
"""The same after a longer suspension of the computer. Session time stood still then."""
CLOCK_JUMP_SECONDS = 1.0
"""A larger step of the computer's clock is noted. Session time is not affected."""
OLD_SECONDS = 1.0
"""Seconds after a standstill in which requests may be older than it."""
ALIVE_SECONDS = 0.5
"""Interval between two calls of `SessionHub.note_alive`."""
POSSIBLY_REPEATED = "the engine stood still, and this may have been asked before"


class AttachedClient(Struct, frozen=True, eq=False):
    """An attached console or program."""

    name: str
    """Unique among the attached clients: `wizard:anna#2`."""
    source: str
    """The source of its inputs in the record: `wizard:anna`."""
    role: Role


class SessionHub:
    """The clients of one engine. All methods belong to the engine's thread, and none may be called inside a step."""

    def __init__(
        self,
        engine: Engine,
        folder: str = "",
        *,
        view: SessionView | None = None,
        end: Callable[[str], object] | None = None,
    ) -> None:
        """Make the hub before the engine starts, so that it misses no record.

        :param engine: whose session it is.
        :param folder: the session's; empty if nothing is stored.
        :param view: the state of a session that continues, before the first new record.
        :param end: ends the session with the given reason when a client requests it; by default, the engine does.
        """
        self.engine = engine
        self.folder = folder
        self.clients: dict[str, AttachedClient] = {}
        self._names_seen: dict[str, None] = {}
        """Names of all clients that have attached."""
        self._end_session = end or engine.end
        self.take_over: Callable[[str, ReplyCallback], object] | None = None
        """Begins to take over changed files of the scenario, for this source; None: impossible in this session."""
        self.on_wizards_gone: Callable[[], object] = lambda: None
        """Called when the last wizard has gone."""
        self.view = SessionView() if view is None else view
        """The present state, read-only."""
        self._all_tasks: list[TaskView] | None = None
        self._changing_tasks = {id for id, task in self.view.tasks.items() if _can_change(task)}
        self._listeners: list[Callable[[Update], object]] = []
        self._holder: AttachedClient | None = None
        self._requester: AttachedClient | None = None
        self._inputs_before = engine.inputs
        self._first_record_came = False
        self.ending = False
        """Whether the session is about to end: nothing starts any more."""
        self._alive_at: float | None = None
        """When `note_alive` was last called."""
        self._suspended = 0.0
        """`suspended_seconds` at that time."""
        self._clock_offset: float | None = None
        """The computer's clock minus the clock that counts suspensions, at that time."""
        self._old_until = 0.0
        """Until then, requests may be older than a standstill of this process or of the computer."""
        engine.subscribe(self._apply_record)
        engine.on_journal_status = self._notify_listeners

    def changing_tasks(self) -> list[TaskView]:
        """Return the view's tasks that can still change. Encode them before they do."""
        tasks = self.view.tasks
        return [tasks[id] for id in sorted(self._changing_tasks) if id in tasks]

    def all_tasks(self) -> list[TaskView]:
        """Return the view's tasks, kept until there is a new one: copying the view takes ten times as long."""
        if self._all_tasks is None:
            self._all_tasks = list(self.view.tasks.values())
        return self._all_tasks

    @property
    def has_wizard(self) -> bool:
        """Whether a wizard is attached, with or without control."""
        return any(client.role == "wizard" for client in self.clients.values())

    def subscribe(self, listener: Callable[[Update], object]) -> None:
        """Send every record, and every change of the recording's state, to a listener. It may be called in a step."""
        self._listeners.append(listener)

    # --- attaching and detaching --------------------------------------------------------------------------------

    def attach(self, name: str, role: Role, source: str | None = None) -> AttachedClient:
        """Admit a client. A wizard who attaches while nobody has control gets it.

        A session that waits for a wizard is an exception: the robot must not begin before the wizard has looked.

        :param name: the client's; a second one of the same name gets a number.
        :param role: what it may do.
        :param source: its source in the record instead of `role:name`, if it speaks for others (`ros:domain_task`).
        :raises Rejected: the name is invalid or looks like another's, or the session has ended.
        """
        name = normalize("NFC", name)
        before = [self.view.wizard] if self.view.wizard else []  # of a session that continues
        problem = name_problem(name)
        if not problem and (other := find_lookalike(name, [*self._names_seen, *before])):
            problem = f"{name!r} looks like {other!r}, a name in this session's record: use another name"
        if self.engine.ended:
            problem = "the session has ended"
        if problem:
            raise Rejected(problem)
        if source is None:
            source = f"{role}:{name}"
        unique = source
        number = 1
        while unique in self.clients:
            number += 1
            unique = f"{source}#{number}"
        client = self.clients[unique] = AttachedClient(unique, source, role)
        self._names_seen[name] = None
        is_free = self._holder is None and not self.engine.waits_for_wizard
        if role == "wizard" and is_free and self._has_begun:
            self._set_control("taken", client, client)
        return client

    def detach(self, client: AttachedClient) -> None:
        """Remove a client that has gone. Its control goes to the wizard who asked for it, or to nobody."""
        if self.clients.get(client.name) is not client:
            return
        del self.clients[client.name]
        if client is self._holder:
            next_holder = self._requester
            self._set_control("released" if next_holder is None else "given", client, next_holder)
        elif client is self._requester:
            self._set_control("released", client, self._holder)
        if client.role == "wizard" and not self.has_wizard:
            self.on_wizards_gone()

    def summary(self) -> SessionSummary:
        """Summarize the session, as far as it is known without the server."""
        engine, scenario, view = self.engine, self.engine.scenario, self.view
        return SessionSummary(
            version=VERSION,
            title=scenario.title,
            mode=scenario.mode,
            robot=scenario.robot.name,
            seed=engine.seed,
            scenario_folder=scenario.folder,
            scenario_hash=scenario.hash,
            folder=self.folder,
            t=round(max(engine.clock.now(), 0.0), 3),
            seq=view.seq,
            busy=bool(view.running or view.waiting),
            stopped=view.stop.latched,
            control=view.control,
            clients=list(self.clients),
            participant=view.session.participant if view.session is not None else "",
            condition=view.session.condition if view.session is not None else "",
            wizard=view.wizard,
            trouble=engine.journal_status.sentence,
            pid=os.getpid(),
            versions=versions(),
        )

    # --- requests of clients ------------------------------------------------------------------------------------

    def note_alive(self) -> None:
        """Note that this process runs. It must be called regularly, so that a standstill shows."""
        self.may_have_old_requests()
        self._alive_at, self._suspended = monotonic(), suspended_seconds()
        offset, before = time() - self._alive_at - self._suspended, self._clock_offset
        self._clock_offset = offset
        if before is not None and abs(offset - before) > CLOCK_JUMP_SECONDS:
            how = f"{'forward' if offset > before else 'back'} by {abs(offset - before):.0f} s"
            text = f"the clock of this computer was set {how}: times of day do not fit from here on"
            self.engine.post(Note(text=text))

    def may_have_old_requests(self) -> bool:
        """Whether this process or the computer has just stood still, so that requests may be older."""
        now, suspended = monotonic(), suspended_seconds()
        if self._alive_at is None:
            return False
        stood, slept = now - self._alive_at, suspended - self._suspended
        if stood > STANDSTILL_SECONDS or slept > SUSPENDED_SECONDS:
            self._alive_at, self._suspended, self._old_until = now, suspended, now + OLD_SECONDS
        if stood > STANDSTILL_SECONDS:
            text = f"the engine stood still for {stood:.0f} s: what happened then is recorded late"
            self.engine.post(Note(text=text, stood=round(stood, 3)))
        if slept > SUSPENDED_SECONDS:
            text = f"the computer was suspended for {slept:.0f} s: session time stood still"
            self.engine.post(Note(text=text, stood=round(slept, 3), suspended=True))
        return now < self._old_until

    def submit(self, client: AttachedClient, message: ClientInput, answer: ReplyCallback) -> None:
        """Pass an input on under the client's name; `answer` is called once."""
        problem = self._why_not_submit(client, message)
        if problem:
            answer(Reply(False, problem))
        else:
            self.engine.accept(replace(message, source=client.source, t=0.0), answer)

    def change_control(self, client: AttachedClient, verb: ControlVerb, answer: ReplyCallback) -> None:
        """Take control, ask for it, give it away or release it; `answer` is called once."""
        problem = "" if self._has_begun else "the session has not begun yet"
        if not problem and client.role == "observer":
            problem = "an observer never has control; attach as a wizard to have it"
        if not problem and client.role == "node":
            problem = "a program needs no control: it may submit at any time"
        if not problem and verb in ("take", "ask") and self.engine.waits_for_wizard:  # control lets acts begin
            problem = self._why_not_begin()
        if problem:
            answer(Reply(False, problem))
            return
        holder, requester = self._holder, self._requester
        match verb:
            case "take" | "ask" if holder is client:
                answer(Reply(True, "you already hold control"))
            case "ask" if requester is client:
                answer(Reply(True, "you have already asked"))
            case "ask" if holder is not None:
                self._set_control("asked", client, holder, answer)
            case "take" | "ask":
                self._set_control("taken", client, client, answer)
            case "give" | "release" if holder is not client and not (verb == "release" and requester is client):
                answer(Reply(False, f"you do not hold control: {self._holder_sentence()}"))
            case "give" if requester is None:
                answer(Reply(False, "nobody has asked for control; release it, so that others can take it"))
            case "give":
                self._set_control("given", client, requester, answer)
            case "release":  # or withdraw a request
                self._set_control("released", client, None if holder is client else holder, answer)

    def end_session(self, client: AttachedClient, reason: str, answer: ReplyCallback) -> None:
        """End the session; the answer confirms only that it begins to end."""
        problem = self._why_not_judge(client, "end the session")
        if problem:
            answer(Reply(False, problem))
        else:
            answer(Reply(True))
            self._end_session(reason or f"ended by {client.source}")

    def take_over_scenario(self, client: AttachedClient, answer: ReplyCallback) -> None:
        """Continue with the scenario's present files; `answer` is called once, when it is done or refused."""
        problem = "" if self._has_begun else "the session has not begun yet"
        problem = problem or self._why_not_judge(client, "take over changed files")
        if self.ending or self.engine.ended:
            problem = "the session is ending"
        elif self.take_over is None:
            problem = "this session has no folder, so it cannot take over changed files"
        if problem or self.take_over is None:
            answer(Reply(False, problem))
        else:
            self.take_over(client.source, answer)

    def _why_not_submit(self, client: AttachedClient, message: ClientInput) -> str:
        if isinstance(message, Submit) and message.function in MAKES_SAFE:
            return ""
        if not self._has_begun:
            return "the session has not begun yet"
        if isinstance(message, OutcomeReport):
            return self._why_not_judge(client, "say how the session counts")
        if not isinstance(message, Submit):
            reports = client.role != "observer" or isinstance(message, Note)
            return "" if reports else "an observer reports nothing; attach as a wizard or a program"
        if message.function in ALLOWED_WITHOUT_CONTROL:
            return ""
        if message.function not in STOPPING and (problem := self._why_not_begin()):
            return problem
        if self.ending:
            return "the session is ending"
        if client.role == "node":
            return self._why_not_release(client) if message.function in ("releaseStop", "releaseOpenGoals") else ""
        if client is self._holder:
            return ""
        if client.role == "observer":
            return "an observer only watches, adds notes and can stop everything; attach as a wizard to do more"
        return f"you do not hold control: {self._holder_sentence()}"

    def _why_not_begin(self) -> str:
        """Return why clients may not start anything now; empty: they may."""
        if self.may_have_old_requests():
            return f"{POSSIBLY_REPEATED}: ask again"
        if (behind := self.engine.journal_status.behind) > MAX_BEHIND_SECONDS:
            return f"the disk has not recorded anything for {behind:.0f} s: ask again once it records again"
        return ""

    def _why_not_judge(self, client: AttachedClient, what: str) -> str:
        """Return why a client may not decide about the whole session; empty: it may.

        The wizard who has control may, programs may, and any wizard may while nobody has control.
        """
        if client.role == "observer":
            return f"an observer cannot {what}"
        if client.role == "wizard" and self._holder not in (None, client):
            return f"only the wizard who holds control can {what}: {self._holder_sentence()}"
        return ""

    def _why_not_release(self, client: AttachedClient) -> str:
        """Return why a program may not release a stop or a held part. Only people and named programs may."""
        named = self.engine.scenario.may_release
        program = client.source.partition(":")[2]
        if program in named:
            return ""
        others = f"or {', '.join(named)}" if named else "or a program that scenario.toml names: [control] may_release"
        return f"{program} may not release a stop: only the wizard who holds control may, {others}"

    def _holder_sentence(self) -> str:
        holder = self._holder
        return f"{holder.name} does; ask for it, or take it" if holder is not None else "no wizard holds it; take it"

    # --- control ------------------------------------------------------------------------------------------------

    @property
    def _has_begun(self) -> bool:
        """Whether the engine has handled its first input. No client's input may come before."""
        return self.engine.inputs != self._inputs_before

    def _set_control(
        self,
        status: ControlStatus,
        by: AttachedClient,
        holder: AttachedClient | None,
        answer: ReplyCallback | None = None,
    ) -> None:
        """Give control to `holder`, because of `by`. It is effective immediately, before it is recorded.

        With `answer` it is a request, undone if it is rejected. Without, it is a fact (a client has gone), recorded
        later if necessary.
        """
        before = self._holder, self._requester
        after = self._holder, self._requester = holder, by if status == "asked" else None
        fact = ControlChanged(status=status, by=by.name, holder=holder.name if holder is not None else None)
        if answer is None:
            self.engine.post(fact)
            return
        answer_request = answer

        def undo_if_rejected(reply: Reply) -> None:
            if not reply.accepted and (self._holder, self._requester) == after:
                self._holder, self._requester = before
            answer_request(reply)

        self.engine.accept(fact, undo_if_rejected)

    def _assign_control_at_start(self) -> None:
        """Give control to a wizard who attached before the first record. A holder from before a crash loses it."""
        self._first_record_came = True
        if self._holder is not None:
            return
        wizard = next((client for client in self.clients.values() if client.role == "wizard"), None)
        if wizard is not None and not self.engine.waits_for_wizard:
            self._set_control("taken", wizard, wizard)
        elif self.view.control is not None:
            self.engine.post(ControlChanged(status="released", by=self.view.control, holder=None))

    # --- from the engine ----------------------------------------------------------------------------------------

    def _apply_record(self, record: AnyRecord) -> None:
        view = self.view
        if isinstance(record, TaskRecord) and record.id not in view.tasks:
            self._all_tasks = None
        view.apply(record)
        if isinstance(record, TaskRecord | ActionRecord):
            id = record.id if isinstance(record, TaskRecord) else record.task
            task = view.tasks.get(id)
            if task is not None and _can_change(task):
                self._changing_tasks.add(id)
            else:
                self._changing_tasks.discard(id)
        self._notify_listeners(record)
        if not self._first_record_came:
            self._assign_control_at_start()

    def _notify_listeners(self, update: Update) -> None:
        for listener in self._listeners:
            try:
                listener(update)
            except Exception:  # otherwise the engine would remove the whole hub
                _LOG.exception("a listener failed")


def _can_change(task: TaskView) -> bool:
    return task.ended is None or any(action.ended is None for action in task.actions.values())
