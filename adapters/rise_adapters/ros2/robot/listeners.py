"""The programs that listen to a topic: which have one of our orders, and which have received its reset.

A topic gives no answer, and the middleware notices a lost connection late. So a program keeps an order until it has
received the reset and listened for another LEASE_SECONDS. A program that disappears earlier is away with its order. It
gets the reset when it returns, as does every new listener. Until then the reset is *owed*, unless another program has
replaced it: one with the same node, or both without a node. The replacement appeared later than the missing program,
and at most LEASE_SECONDS before that one was missed, because a dead program stays visible for a while. (A restarted
program is a different one. A tool that begins to listen is no replacement for a base.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

LEASE_SECONDS = 30.0
"""A program that disappears so soon after a reset may have missed it (Cyclone DDS notices after 10 s, Fast DDS after
20)."""
FINDING_SECONDS = 0.5
"""Seconds until a new listener receives everything. It gets earlier messages again."""
_UNKNOWN_PROGRAM = b"somebody"
"""The programs that have an order of an earlier engine. Their nodes are unknown."""


class Listeners:
    """The programs that listen to one topic (`RemoteEndpoint.program`), or their numbers while the middleware does not
    list them. All times are session times in seconds."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._since: dict[bytes, float] = {}
        """The present listeners, and since when each listens."""
        self._ordered: set[bytes] = set()
        """The programs that have the last order and may not have received its reset."""
        self._reset_at: dict[bytes, float] = {}
        """The listeners that have received the reset, and when."""
        self._missed: dict[bytes, float] = {}
        """The programs that have the last order but do not listen, and since when."""
        self._came: dict[bytes, float] = {}
        """When each program was first seen."""
        self._nodes: dict[bytes, frozenset[str]] = {}
        """All known nodes of each program."""
        self._away: set[bytes] = set()
        """The programs that disappeared with an earlier order. They are owed no reset, but get it when they return."""

    @property
    def present(self) -> frozenset[bytes]:
        return frozenset(self._since)

    def update(self, found: Mapping[bytes, str], *, stands: bool, latched: bool) -> None:
        """Process the present listeners and nodes. `stands`: the last order is in force; `latched`: late listeners get
        it, too."""
        now = self._now()
        self._note_nodes(found)
        self._take_listed(found)
        self._since = {each: self._since.get(each, now) for each in found}
        self._came = self._since | self._came
        self._missed = {each: self._missed.get(each, now) for each in self._ordered - self._since.keys()}
        self._reset_at = {each: at for each, at in self._reset_at.items() if each in self._since}
        back = self._since.keys() if stands and latched else self._away & self._since.keys()
        self._ordered |= back
        self._away -= back
        if not (stands or self.owes_reset) and all(now >= at + LEASE_SECONDS for at in self._reset_at.values()):
            self.excuse_absent()

    def order(self, found: Mapping[bytes, str], *, stands: bool) -> None:
        """Note that the found programs get an order. `stands`: it replaces one that some of them may have missed."""
        self._note_nodes(found)
        if not stands:
            self.excuse_absent()
        self._came = dict.fromkeys(found, self._now()) | self._came
        self._ordered.update(found)
        self._reset_at.clear()

    def adopt(self) -> None:
        """Note that an earlier engine has published an order."""
        self._ordered.add(_UNKNOWN_PROGRAM)
        self._missed[_UNKNOWN_PROGRAM] = self._came[_UNKNOWN_PROGRAM] = -inf

    def note_reset(self) -> None:
        """Note that the reset is published."""
        now = self._now()
        for each, since in self._since.items():
            if now >= since + FINDING_SECONDS:
                self._reset_at.setdefault(each, now)

    def note_other_order(self) -> None:
        """Note that other programs may have published an order."""
        self._reset_at.clear()

    def excuse_absent(self) -> None:
        """Stop owing the reset to absent programs. (They get it if they ever return.)"""
        self._away |= self._ordered - self._since.keys()
        self._ordered.clear()
        self._missed.clear()

    @property
    def have_order(self) -> bool:
        """Whether any program, listening or not, may have an order."""
        return bool(self._ordered) or _UNKNOWN_PROGRAM in self._away

    @property
    def lacks_reset(self) -> bool:
        """Whether any listener has not received the reset."""
        return bool(self._since.keys() - self._reset_at.keys())

    @property
    def owes_reset(self) -> bool:
        """Whether a program has an order, has not received its reset, and no other program has replaced it."""
        missing, received = self._ordered - self._reset_at.keys(), self._reset_at.keys()
        if _UNKNOWN_PROGRAM in missing and not any(self._replaces(each, _UNKNOWN_PROGRAM) for each in received):
            return True
        if any(missed not in self._missed for missed in missing):
            return True
        instead = received | self._missed.keys()
        for missed in sorted(missing - {_UNKNOWN_PROGRAM}, key=self._replaceable_from, reverse=True):
            found = next((each for each in sorted(instead) if self._replaces(each, missed)), None)
            if found is None:
                return True
            instead -= {found}  # it replaces only one program
        return False

    def _note_nodes(self, found: Mapping[bytes, str]) -> None:
        for each, nodes in found.items():
            self._nodes[each] = self._nodes.get(each, frozenset()) | frozenset(nodes.split())

    def _take_listed(self, found: Mapping[bytes, str]) -> None:
        """Pass the order from numbered programs to those that the middleware lists only now: they are the same."""
        unlisted = {each for each in self._ordered - found.keys() - self._missed.keys() if each.isdigit()}
        listed = {each for each in found.keys() - self._since.keys() if not each.isdigit()}
        if unlisted and listed:
            self._ordered = self._ordered - unlisted | listed

    def _replaceable_from(self, missed: bytes) -> float:
        """The earliest time at which a replacement of a missing program may have appeared."""
        return max(self._came[missed], self._missed[missed] - LEASE_SECONDS)

    def _replaces(self, each: bytes, missed: bytes) -> bool:
        """Whether a program may have replaced a missing one. (A tool of ROS always has a name.)"""
        nodes, others = (self._nodes.get(one, frozenset()) for one in (missed, each))
        is_same = missed == _UNKNOWN_PROGRAM or bool(nodes & others) or not (nodes or others)
        return is_same and self._came[each] > self._came[missed] and self._came[each] >= self._replaceable_from(missed)
