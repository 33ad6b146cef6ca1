"""Who is attached to a session, who of them holds control, and what each may do. No sockets in here.

One member at most holds control: the wizard who may act. Everybody else watches, adds notes, and can stop everything.
What changes about control goes through the engine like any other input, so that it is in the record.

Two names: a member's own name is unique (`wizard:anna#2` is Anna's second console), because control belongs to one
console; the `source` of what it submits is the person (`wizard:anna`), because the record asks who did it.
"""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import Callable
from unicodedata import normalize

from msgspec.structs import replace

from rise_engine.engine.engine import Engine, ReplyCallback, versions
from rise_engine.errors import RiseError
from rise_engine.kernel.inputs import ControlChanged, ControlStatus, Submit
from rise_engine.kernel.records import ActionRecord, AnyRecord, SessionRecord, TaskRecord
from rise_engine.kernel.view import SessionView, TaskView
from rise_engine.protocol.client import ClientInput, ControlVerb, Reply, Role, Update
from rise_engine.protocol.messages import VERSION, SessionSummary
from rise_engine.server.client_names import find_lookalike, name_problem

_LOG = logging.getLogger(__name__)

END_SECONDS = 6.0
"""Real seconds that the robot gets to confirm the last stop before the session ends without it."""

ALLOWED_WITHOUT_CONTROL = frozenset({"stopAll", "markMistake"})
"""What everybody who is attached may ask for: it starts nothing. So may notes be added."""


class NotAdmitted(RiseError):
    """Somebody cannot attach; the text says why, for a person."""


class AttachedClient:
    """Somebody who is attached."""

    __slots__ = ("name", "role", "source")

    def __init__(self, name: str, source: str, role: Role) -> None:
        self.name = name
        self.source = source
        self.role = role


class SessionHub:
    """The audience of one engine. All methods belong to the engine's thread, and none may be called inside a step."""

    def __init__(
        self,
        engine: Engine,
        folder: str = "",
        *,
        view: SessionView | None = None,
        end: Callable[[str], object] | None = None,
    ) -> None:
        """Make it before the engine starts, so that it misses no record.

        `view`: the state of a session that goes on, before the first new record. `end`: what ends the session when a
        member asks for it; without it, the engine is asked, and told again after `END_PATIENCE`.
        """
        self.engine = engine
        self.folder = folder
        self.clients: dict[str, AttachedClient] = {}
        self._names_seen: dict[str, None] = {}
        """Of all who have attached so far."""
        self.end_reason = ""
        """Why the session ended, once it has."""
        self._end_session = end or self._end_engine
        self._view = SessionView() if view is None else view
        self._all_tasks: list[TaskView] | None = None
        self._changing_tasks = {id for id, task in self._view.tasks.items() if _can_change(task)}
        self._listeners: list[Callable[[Update], object]] = []
        self._holder: AttachedClient | None = None
        self._requester: AttachedClient | None = None
        self._inputs_before = engine.inputs
        self._first_record_came = False
        engine.subscribe(self._apply_record)
        engine.on_journal_status = self._notify_listeners

    @property
    def view(self) -> SessionView:
        """The present state, for looking only."""
        return self._view

    def tasks(self) -> tuple[list[TaskView], list[TaskView]]:
        """The view's tasks that can still change, which are to be looked at now; and all, of which the others never do.

        Made once for all who ask before there is another task: a copy of the whole view would be ten times as dear.
        """
        tasks = self._view.tasks
        if self._all_tasks is None:
            self._all_tasks = list(tasks.values())
        return [tasks[id] for id in sorted(self._changing_tasks) if id in tasks], self._all_tasks

    def subscribe(self, listener: Callable[[Update], object]) -> None:
        """Let `listener` have every record, and every change of how recording stands. It may be called in a step."""
        self._listeners.append(listener)

    # --- coming and going ---------------------------------------------------------------------------------------

    def attach(self, name: str, role: Role, source: str | None = None) -> AttachedClient:
        """Raises NotAdmitted. A wizard who comes while nobody holds control gets it.

        `source`: what the record names instead of `role:name`, for one who speaks for others (`ros:domain_task`).
        """
        name = normalize("NFC", name)
        problem = name_problem(name)
        if not problem and (other := find_lookalike(name, [*self._names_seen, *self._names_in_record()])):
            problem = f"{name!r} looks like {other!r}, who is in this session's record: take another name"
        if self.engine.ended:
            problem = "the session has ended"
        if problem:
            raise NotAdmitted(problem)
        if source is None:
            source = f"{role}:{name}"
        unique = source
        number = 1
        while unique in self.clients:
            number += 1
            unique = f"{source}#{number}"
        member = self.clients[unique] = AttachedClient(unique, source, role)
        self._names_seen[name] = None
        if role == "wizard" and self._holder is None and self._has_begun:
            self._set_control("taken", member, member)
        return member

    def _names_in_record(self) -> list[str]:
        """Of the wizard before an engine that had gone: the record goes on with what they did."""
        return [self._view.wizard] if self._view.wizard else []

    def detach(self, member: AttachedClient) -> None:
        """Somebody has gone. Control that they held goes to who asked for it, or to nobody."""
        if self.clients.get(member.name) is not member:
            return
        del self.clients[member.name]
        if member is self._holder:
            heir = self._requester
            self._set_control("released" if heir is None else "given", member, heir)
        elif member is self._requester:
            self._set_control("released", member, self._holder)

    def summary(self) -> SessionSummary:
        engine, scenario, view = self.engine, self.engine.scenario, self._view
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
            trouble=engine.journal_status.trouble,
            pid=os.getpid(),
            versions=versions(),
        )

    # --- what members do ----------------------------------------------------------------------------------------

    def submit(self, member: AttachedClient, message: ClientInput, answer: ReplyCallback) -> None:
        """Pass an input on, in the member's name; `answer` is called once."""
        problem = self._why_not_submit(member, message)
        if problem:
            answer(Reply(False, problem))
        else:
            self.engine.accept(replace(message, source=member.source, t=0.0), answer)

    def change_control(self, member: AttachedClient, verb: ControlVerb, answer: ReplyCallback) -> None:
        """Take control, ask for it, give it away or release it; `answer` is called once."""
        problem = "" if self._has_begun else "the session has not begun yet"
        if not problem and member.role == "observer":
            problem = "an observer never has control; attach as a wizard to have it"
        if not problem and member.role == "node":
            problem = "a program needs no control: it may submit at any time"
        if problem:
            answer(Reply(False, problem))
            return
        holder, asker = self._holder, self._requester
        match verb:
            case "take" | "ask" if holder is member:
                answer(Reply(True, "you hold control already"))
            case "ask" if asker is member:
                answer(Reply(True, "you have asked already"))
            case "ask" if holder is not None:
                self._set_control("asked", member, holder, answer)
            case "take" | "ask":
                self._set_control("taken", member, member, answer)
            case "give" | "release" if holder is not member and not (verb == "release" and asker is member):
                answer(Reply(False, f"you do not hold control: {self._holder_sentence()}"))
            case "give" if asker is None:
                answer(Reply(False, "nobody has asked for control; release it, and anybody can take it"))
            case "give":
                self._set_control("given", member, asker, answer)
            case "release":  # also of one who asked and does not want it any more
                self._set_control("released", member, None if holder is member else holder, answer)

    def end_session(self, member: AttachedClient, reason: str, answer: ReplyCallback) -> None:
        """End the session; the answer says that it begins to end."""
        problem = ""
        if member.role == "observer":
            problem = "an observer cannot end the session"
        elif member.role == "wizard" and self._holder not in (None, member):
            problem = f"only who holds control can end the session: {self._holder_sentence()}"
        if problem:
            answer(Reply(False, problem))
        else:
            answer(Reply(True))
            self._end_session(reason or f"ended by {member.source}")

    def _why_not_submit(self, member: AttachedClient, message: ClientInput) -> str:
        if not self._has_begun:
            return "the session has not begun yet"
        if not isinstance(message, Submit) or message.function in ALLOWED_WITHOUT_CONTROL:
            return ""
        if member.role == "node":
            return self._why_not_release(member) if message.function == "releaseStop" else ""
        if member is self._holder:
            return ""
        if member.role == "observer":
            return "an observer only watches, adds notes and can stop everything; attach as a wizard to do more"
        return f"you do not hold control: {self._holder_sentence()}"

    def _why_not_release(self, member: AttachedClient) -> str:
        """A stop is not undone by whatever program happens to run: by a person, or by one that the study names."""
        named = self.engine.scenario.may_release
        who = member.source.partition(":")[2]
        if who in named:
            return ""
        others = f"or {', '.join(named)}" if named else "or a program that scenario.toml names: [control] may_release"
        return f"{who} may not release a stop: only who holds control may, {others}"

    def _holder_sentence(self) -> str:
        holder = self._holder
        return f"{holder.name} does; ask for it, or take it" if holder is not None else "nobody does; take it"

    # --- control ------------------------------------------------------------------------------------------------

    @property
    def _has_begun(self) -> bool:
        """The engine has taken its first input; none of ours may come before."""
        return self.engine.inputs != self._inputs_before

    def _set_control(
        self,
        status: ControlStatus,
        by: AttachedClient,
        holder: AttachedClient | None,
        answer: ReplyCallback | None = None,
    ) -> None:
        """Counts from now on, although the record of it may still be on its way to the disk.

        Without `answer` it is no wish but a fact: it is recorded later if it cannot be now.
        """
        before = self._holder, self._requester
        after = self._holder, self._requester = holder, by if status == "asked" else None
        fact = ControlChanged(status=status, by=by.name, holder=holder.name if holder is not None else None)
        if answer is None:
            self.engine.post(fact)
            return
        asks_back = answer

        def answered(reply: Reply) -> None:
            if not reply.accepted and (self._holder, self._requester) == after:
                self._holder, self._requester = before
            asks_back(reply)

        self.engine.accept(fact, answered)

    def _assign_control_at_start(self) -> None:
        """With the first record: who came before it gets control, and who held it before a crash does not."""
        self._first_record_came = True
        if self._holder is not None:
            return
        wizard = next((member for member in self.clients.values() if member.role == "wizard"), None)
        if wizard is not None:
            self._set_control("taken", wizard, wizard)
        elif self._view.control is not None:
            self.engine.post(ControlChanged(status="released", by=self._view.control, holder=None))

    # --- from the engine ----------------------------------------------------------------------------------------

    def _apply_record(self, record: AnyRecord) -> None:
        view = self._view
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
        elif isinstance(record, SessionRecord) and record.status == "ended":
            self.end_reason = record.reason
        self._notify_listeners(record)
        if not self._first_record_came:
            self._assign_control_at_start()

    def _notify_listeners(self, update: Update) -> None:
        for listener in self._listeners:
            try:
                listener(update)
            except Exception:  # the engine would let go of the whole hub
                _LOG.exception("a listener failed")

    def _end_engine(self, reason: str) -> None:
        self.engine.end(reason)
        asyncio.get_running_loop().call_later(END_SECONDS, self.engine.end_now, reason)


def _can_change(task: TaskView) -> bool:
    return task.ended is None or any(action.ended is None for action in task.actions.values())
