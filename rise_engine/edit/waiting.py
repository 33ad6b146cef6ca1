"""Changes that wait until a person chooses: own ones that somebody else's stand in the way of, and proposed ones.

One that is made waits no more, and when its step is taken back it waits again. One that was given up can still be made
until the editor is closed, so that no choice loses anything.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Literal, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.edit.changes import Change, diff_of
from rise_engine.edit.drafts import DraftChange
from rise_engine.edit.history import changed_names
from rise_engine.edit.plan import EditRefused, Files, Plan, apply_plan
from rise_engine.edit.planning import StudyState, plan
from rise_engine.edit.proposals import ProposalFiles

Origin: TypeAlias = Literal["yours", "proposed"]
"""Whose it is: an own one that was set aside, or one that a program or another person has proposed."""


class WaitingChange(Struct, frozen=True):
    """A change that waits."""

    number: int
    """By which it is named; never another's, as long as the editor is open."""
    change: Change
    origin: Origin = "yours"
    batch: str = ""
    """Of a proposed one: the file in which it was proposed (`ProposalFiles`)."""
    given_up: bool = False


class Outlook(Struct, frozen=True):
    """What would come of a change that waits, as the files are now."""

    waiting: WaitingChange
    says: tuple[str, ...]
    """What it does, in words, from what the files say now."""
    noticed: tuple[str, ...] = ()
    why_not: str = ""
    """Why it cannot be made now; empty: it can."""
    before: Files = {}
    after: Files = {}
    """The files with it; what differs is what is to be compared."""

    @property
    def diff(self) -> str:
        """What it would change, as `diff -u` has it."""
        return diff_of(self.before, self.after)


class WaitingChanges:
    """The list of them, with the files in which some were proposed."""

    def __init__(self, proposals: ProposalFiles) -> None:
        self._proposals = proposals
        self._kept: dict[str, tuple[DraftChange, ...]] = {}
        """What stands in the files of proposals, by their names."""
        self._all: dict[int, WaitingChange] = {}
        self._made: dict[int, Change] = {}
        """The steps that were made of some."""
        self._next = 0

    def add(self, change: Change, origin: Origin = "yours", batch: str = "", *, given_up: bool = False) -> int:
        """One more, at the end; gives its number."""
        number, self._next = self._next, self._next + 1
        self._all[number] = WaitingChange(number, change, origin, batch, given_up)
        if batch:
            self._kept.setdefault(batch, ())
        return number

    def left(self, done: Iterable[Change]) -> tuple[WaitingChange, ...]:
        """Those that still wait, and those that were given up.

        :param done: the changes of all steps that are made now.
        """
        made = {id(change) for change in done}
        return tuple(each for number, each in self._all.items() if id(self._made.get(number)) not in made)

    def give_up(self, number: int, *, given_up: bool = True) -> None:
        """It is not to be made, or after all it waits."""
        if number in self._all:
            self._all[number] = replace(self._all[number], given_up=given_up)

    def note_made(self, number: int, change: Change) -> None:
        """This step was made of it."""
        self._made[number] = change

    def drop(self, numbers: Iterable[int]) -> None:
        """They wait no more, whatever comes."""
        for number in [*numbers]:
            self._all.pop(number, None)
            self._made.pop(number, None)

    def forget_steps(self, done: Iterable[Change]) -> None:
        """The steps from before can no longer be taken back: what they have made waits no more.

        :param done: the changes of those whose work stands in the files; what was taken back goes on waiting.
        """
        made = {id(change) for change in done}
        self.drop([number for number, change in self._made.items() if id(change) in made])

    def follow(self, before: Change, after: Change) -> None:
        """A step that was made of one is another now: it was made again on files that somebody has changed."""
        self._made = {number: after if change is before else change for number, change in self._made.items()}

    def source_of(self, change: Change) -> str:
        """Of which one a step was made: `yours`, or the name of a file of proposals; empty: of none."""
        found = next((self._all[number] for number, made in self._made.items() if made is change), None)
        return (found.batch or "yours") if found is not None else ""

    def restore(self, change: Change, source: str) -> None:
        """A step of a draft was made of one, as `source_of` has said.

        It may still stand in its file of proposals, when the editor was killed before it was taken out.
        """
        known = (each for each in self._all.values() if each.batch == source and each.change.edits == change.edits)
        number = next((each.number for each in known if each.number not in self._made), None)
        if number is None:
            number = self.add(change, "yours") if source == "yours" else self.add(change, "proposed", source)
        self.note_made(number, change)

    def notice_proposals(self) -> int:
        """Look whether changes were proposed meanwhile; how many."""
        new = self._proposals.read(list(self._kept))
        for name, proposal in new.items():
            self._kept[name] = proposal.changes
            for each in proposal.changes:
                self.add(Change(each.edits, each.says, each.noticed), "proposed", name, given_up=each.given_up)
        return sum(len(proposal.changes) for proposal in new.values())

    def keep_proposals(self, left: Iterable[WaitingChange]) -> None:
        """Take out of the files of proposals what waits no more, if the disk takes it."""
        left = [*left]
        for name, before in self._kept.items():
            now = tuple(kept_change(each) for each in left if each.batch == name)
            if now != before:
                with suppress(OSError):
                    self._proposals.keep(name, now)
                    self._kept[name] = now


def kept_change(waiting: WaitingChange) -> DraftChange:
    """One that waits, as a draft or a file of proposals has it."""
    change = waiting.change
    return DraftChange(change.edits, change.says, change.noticed, given_up=waiting.given_up)


def outlook_of(waiting: WaitingChange, state: StudyState, plan_all: Callable[[], tuple[Files, Change]]) -> Outlook:
    """What would come of a change, as the files are now.

    :param plan_all: plans the change when it is of several edits; may raise EditRefused.
    """
    change = waiting.change
    if not change.edits:
        why = "this was a step back over a save, and what it would take back was changed since; change it by hand"
        return Outlook(waiting, change.says, why_not=why)
    try:
        if len(change.edits) == 1:  # planned, and not checked: there may be many
            planned: Plan = plan(change.edits[0], state)
            after, says, noticed = apply_plan(state.files, planned), planned.says, planned.noticed
        else:
            after, made = plan_all()
            says, noticed = made.says, made.noticed
    except EditRefused as refused:
        return Outlook(waiting, change.says, why_not=str(refused))
    if not changed_names(state.files, after):
        return Outlook(waiting, change.says, why_not="the files say so already")
    return Outlook(waiting, says or change.says, noticed, "", state.files, after)
