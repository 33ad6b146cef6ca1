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

from rise_engine.engine import Answer, Engine, versions
from rise_engine.errors import RiseError
from rise_engine.kernel.inputs import ControlChanged, ControlStatus, Submit
from rise_engine.kernel.records import ActionRecord, AnyRecord, SessionRecord, TaskRecord
from rise_engine.link.client import ClientInput, Reply, Role, Update, Verb
from rise_engine.link.messages import VERSION, About
from rise_engine.link.names import looks_like, name_problem
from rise_engine.view import TaskView, View

_LOG = logging.getLogger(__name__)

END_SECONDS = 6.0
"""Real seconds that the robot gets to confirm the last stop before the session ends without it."""

FOR_ALL = frozenset({"stopAll", "markMistake"})
"""What everybody who is attached may ask for: it starts nothing. So may notes be added."""


class NotAdmitted(RiseError):
    """Somebody cannot attach; the text says why, for a person."""


class Member:
    """Somebody who is attached."""

    __slots__ = ("name", "role", "source")

    def __init__(self, name: str, source: str, role: Role) -> None:
        self.name = name
        self.source = source
        self.role = role


class Room:
    """The audience of one engine. All methods belong to the engine's thread, and none may be called inside a step."""

    def __init__(
        self,
        engine: Engine,
        folder: str = "",
        *,
        view: View | None = None,
        end: Callable[[str], object] | None = None,
    ) -> None:
        """Make it before the engine starts, so that it misses no record.

        `view`: the state of a session that goes on, before the first new record. `end`: what ends the session when a
        member asks for it; without it, the engine is asked, and told again after `END_SECONDS`.
        """
        self.engine = engine
        self.folder = folder
        self.members: dict[str, Member] = {}
        self._names: dict[str, None] = {}
        """Of all who have attached so far."""
        self.end_reason = ""
        """Why the session ended, once it has."""
        self._end = end or self._end_engine
        self._view = View() if view is None else view
        self._all: list[TaskView] | None = None
        self._open = {id for id, task in self._view.tasks.items() if _changes_still(task)}
        self._listeners: list[Callable[[Update], object]] = []
        self._holder: Member | None = None
        self._asker: Member | None = None
        self._inputs_before = engine.inputs
        self._opened = False
        engine.subscribe(self._record)
        engine.when_journaling = self._tell

    @property
    def view(self) -> View:
        """The present state, for looking only."""
        return self._view

    def tasks(self) -> tuple[list[TaskView], list[TaskView]]:
        """The view's tasks that can still change, which are to be looked at now; and all, of which the others never do.

        Made once for all who ask before there is another task: a copy of the whole view would be ten times as dear.
        """
        tasks = self._view.tasks
        if self._all is None:
            self._all = list(tasks.values())
        return [tasks[id] for id in sorted(self._open) if id in tasks], self._all

    def subscribe(self, listener: Callable[[Update], object]) -> None:
        """Let `listener` have every record, and every change of how recording stands. It may be called in a step."""
        self._listeners.append(listener)

    # --- coming and going ---------------------------------------------------------------------------------------

    def attach(self, name: str, role: Role, source: str | None = None) -> Member:
        """Raises NotAdmitted. A wizard who comes while nobody holds control gets it.

        `source`: what the record names instead of `role:name`, for one who speaks for others (`ros:domain_task`).
        """
        name = normalize("NFC", name)
        problem = name_problem(name)
        if not problem and (other := looks_like(name, [*self._names, *self._names_in_record()])):
            problem = f"{name!r} looks like {other!r}, who is in this session's record: take another name"
        if self.engine.ended:
            problem = "the session has ended"
        if problem:
            raise NotAdmitted(problem)
        if source is None:
            source = f"{role}:{name}"
        unique = source
        number = 1
        while unique in self.members:
            number += 1
            unique = f"{source}#{number}"
        member = self.members[unique] = Member(unique, source, role)
        self._names[name] = None
        if role == "wizard" and self._holder is None and self._begun:
            self._change("taken", member, member)
        return member

    def _names_in_record(self) -> list[str]:
        """Of the wizard before an engine that had gone: the record goes on with what they did."""
        return [self._view.wizard] if self._view.wizard else []

    def leave(self, member: Member) -> None:
        """Somebody has gone. Control that they held goes to who asked for it, or to nobody."""
        if self.members.get(member.name) is not member:
            return
        del self.members[member.name]
        if member is self._holder:
            heir = self._asker
            self._change("released" if heir is None else "given", member, heir)
        elif member is self._asker:
            self._change("released", member, self._holder)

    def about(self) -> About:
        engine, scenario, view = self.engine, self.engine.scenario, self._view
        return About(
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
            clients=list(self.members),
            participant=view.session.participant if view.session is not None else "",
            condition=view.session.condition if view.session is not None else "",
            wizard=view.wizard,
            trouble=engine.journaling.trouble,
            pid=os.getpid(),
            versions=versions(),
        )

    # --- what members do ----------------------------------------------------------------------------------------

    def send(self, member: Member, message: ClientInput, answer: Answer) -> None:
        """Pass an input on, in the member's name; `answer` is called once."""
        problem = self._may_not(member, message)
        if problem:
            answer(Reply(False, problem))
        else:
            self.engine.accept(replace(message, source=member.source, t=0.0), answer)

    def control(self, member: Member, verb: Verb, answer: Answer) -> None:
        """Take control, ask for it, give it away or release it; `answer` is called once."""
        problem = "" if self._begun else "the session has not begun yet"
        if not problem and member.role == "observer":
            problem = "an observer never has control; attach as a wizard to have it"
        if not problem and member.role == "node":
            problem = "a program needs no control: it may submit at any time"
        if problem:
            answer(Reply(False, problem))
            return
        holder, asker = self._holder, self._asker
        match verb:
            case "take" | "ask" if holder is member:
                answer(Reply(True, "you hold control already"))
            case "ask" if asker is member:
                answer(Reply(True, "you have asked already"))
            case "ask" if holder is not None:
                self._change("asked", member, holder, answer)
            case "take" | "ask":
                self._change("taken", member, member, answer)
            case "give" | "release" if holder is not member and not (verb == "release" and asker is member):
                answer(Reply(False, f"you do not hold control: {self._who_holds()}"))
            case "give" if asker is None:
                answer(Reply(False, "nobody has asked for control; release it, and anybody can take it"))
            case "give":
                self._change("given", member, asker, answer)
            case "release":  # also of one who asked and does not want it any more
                self._change("released", member, None if holder is member else holder, answer)

    def end(self, member: Member, reason: str, answer: Answer) -> None:
        """End the session; the answer says that it begins to end."""
        problem = ""
        if member.role == "observer":
            problem = "an observer cannot end the session"
        elif member.role == "wizard" and self._holder not in (None, member):
            problem = f"only who holds control can end the session: {self._who_holds()}"
        if problem:
            answer(Reply(False, problem))
        else:
            answer(Reply(True))
            self._end(reason or f"ended by {member.source}")

    def _may_not(self, member: Member, message: ClientInput) -> str:
        if not self._begun:
            return "the session has not begun yet"
        if not isinstance(message, Submit) or message.function in FOR_ALL:
            return ""
        if member.role == "node":
            return self._may_not_release(member) if message.function == "releaseStop" else ""
        if member is self._holder:
            return ""
        if member.role == "observer":
            return "an observer only watches, adds notes and can stop everything; attach as a wizard to do more"
        return f"you do not hold control: {self._who_holds()}"

    def _may_not_release(self, member: Member) -> str:
        """A stop is not undone by whatever program happens to run: by a person, or by one that the study names."""
        named = self.engine.scenario.may_release
        who = member.source.partition(":")[2]
        if who in named:
            return ""
        others = f"or {', '.join(named)}" if named else "or a program that scenario.toml names: [control] may_release"
        return f"{who} may not release a stop: only who holds control may, {others}"

    def _who_holds(self) -> str:
        holder = self._holder
        return f"{holder.name} does; ask for it, or take it" if holder is not None else "nobody does; take it"

    # --- control ------------------------------------------------------------------------------------------------

    @property
    def _begun(self) -> bool:
        """The engine has taken its first input; none of ours may come before."""
        return self.engine.inputs != self._inputs_before

    def _change(self, status: ControlStatus, by: Member, holder: Member | None, answer: Answer | None = None) -> None:
        """Counts from now on, although the record of it may still be on its way to the disk.

        Without `answer` it is no wish but a fact: it is recorded later if it cannot be now.
        """
        before = self._holder, self._asker
        after = self._holder, self._asker = holder, by if status == "asked" else None
        fact = ControlChanged(status=status, by=by.name, holder=holder.name if holder is not None else None)
        if answer is None:
            self.engine.post(fact)
            return
        asks_back = answer

        def answered(reply: Reply) -> None:
            if not reply.accepted and (self._holder, self._asker) == after:
                self._holder, self._asker = before
            asks_back(reply)

        self.engine.accept(fact, answered)

    def _open_room(self) -> None:
        """With the first record: who came before it gets control, and who held it before a crash does not."""
        self._opened = True
        if self._holder is not None:
            return
        wizard = next((member for member in self.members.values() if member.role == "wizard"), None)
        if wizard is not None:
            self._change("taken", wizard, wizard)
        elif self._view.control is not None:
            self.engine.post(ControlChanged(status="released", by=self._view.control, holder=None))

    # --- from the engine ----------------------------------------------------------------------------------------

    def _record(self, record: AnyRecord) -> None:
        view = self._view
        if isinstance(record, TaskRecord) and record.id not in view.tasks:
            self._all = None
        view.apply(record)
        if isinstance(record, TaskRecord | ActionRecord):
            id = record.id if isinstance(record, TaskRecord) else record.task
            task = view.tasks.get(id)
            if task is not None and _changes_still(task):
                self._open.add(id)
            else:
                self._open.discard(id)
        elif isinstance(record, SessionRecord) and record.status == "ended":
            self.end_reason = record.reason
        self._tell(record)
        if not self._opened:
            self._open_room()

    def _tell(self, update: Update) -> None:
        for listener in self._listeners:
            try:
                listener(update)
            except Exception:  # the engine would let go of the whole room
                _LOG.exception("a listener failed")

    def _end_engine(self, reason: str) -> None:
        self.engine.end(reason)
        asyncio.get_running_loop().call_later(END_SECONDS, self.engine.end_now, reason)


def _changes_still(task: TaskView) -> bool:
    return task.ended is None or any(action.ended is None for action in task.actions.values())
