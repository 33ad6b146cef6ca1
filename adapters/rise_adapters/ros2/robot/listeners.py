"""Who listens to a topic: which programs have an order of ours, and which have heard its reset.

A topic gives no answer, and middleware notices a cut late. So a program that listened to an order has it until it has
listened to the reset, and gone on listening for LEASE_SECONDS. One that goes before counts as away with its order. It
is told again when it is back, however late, and so is whatever else comes to listen. Until then, the reset is *owed*,
unless a program with the same node (or none, as it) has come instead: after it, and at most a lease before it was
missed. (A program that is started again is another one, and the dead one is seen for a while. A tool that begins to
listen is no base.)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

LEASE_SECONDS = 30.0
"""Whoever goes so many seconds after a reset may have been cut off before (Cyclone DDS notices after 10 s, Fast DDS
after 20 s)."""
FINDING_SECONDS = 0.5
"""Seconds that a listener needs until it hears everything. What it is told before, it is told again."""
_SOMEBODY = b"somebody"
"""Stands for the programs that have an order of an earlier engine. Nobody knows their nodes."""


class Listeners:
    """The programs that listen to one topic (`RemoteEndpoint.program`), or their numbers while the middleware does not
    list them. All times are session times in seconds."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._since: dict[bytes, float] = {}
        """Those that listen, and since when."""
        self._ordered: set[bytes] = set()
        """Those that have the last order, and are not known to have heard its reset."""
        self._told: dict[bytes, float] = {}
        """Those that have listened since a reset, and its time."""
        self._missed: dict[bytes, float] = {}
        """Those that have the last order and do not listen, and since when they do not."""
        self._came: dict[bytes, float] = {}
        """When a program was first seen."""
        self._nodes: dict[bytes, frozenset[str]] = {}
        """The nodes of a program, as far as they were ever told."""
        self._away: set[bytes] = set()
        """Those that are away with an earlier order. They hold nothing, and are told when they are back."""

    @property
    def present(self) -> frozenset[bytes]:
        return frozenset(self._since)

    def update(self, found: Mapping[bytes, str], *, stands: bool, latched: bool) -> None:
        """Take in who listens now, with their nodes. `stands`: the last order is still meant. `latched`: late listeners
        get it, too."""
        now = self._now()
        self._note_nodes(found)
        self._take_listed(found)
        self._since = {each: self._since.get(each, now) for each in found}
        self._came = self._since | self._came
        self._missed = {each: self._missed.get(each, now) for each in self._ordered - self._since.keys()}
        self._told = {each: at for each, at in self._told.items() if each in self._since}
        back = self._since.keys() if stands and latched else self._away & self._since.keys()
        self._ordered |= back
        self._away -= back
        if not (stands or self.is_owed) and all(now >= at + LEASE_SECONDS for at in self._told.values()):
            self.write_off()

    def order(self, found: Mapping[bytes, str], *, stands: bool) -> None:
        """Note that those who are found get an order. `stands`: instead of another one, which they may have missed."""
        self._note_nodes(found)
        if not stands:
            self.write_off()
        self._came = dict.fromkeys(found, self._now()) | self._came
        self._ordered.update(found)
        self._told.clear()

    def adopt(self) -> None:
        """Note that an earlier engine has published an order."""
        self._ordered.add(_SOMEBODY)
        self._missed[_SOMEBODY] = self._came[_SOMEBODY] = -inf

    def tell(self) -> None:
        """Note that a reset is published."""
        now = self._now()
        for each, since in self._since.items():
            if now >= since + FINDING_SECONDS:
                self._told.setdefault(each, now)

    def forget_told(self) -> None:
        """Note that others may have published an order."""
        self._told.clear()

    def write_off(self) -> None:
        """From now on, those that are away are not owed the reset. (They are told if they ever come back.)"""
        self._away |= self._ordered - self._since.keys()
        self._ordered.clear()
        self._missed.clear()

    @property
    def have_order(self) -> bool:
        """Whether there may be somebody with an order, listening or not."""
        return bool(self._ordered) or _SOMEBODY in self._away

    @property
    def untold(self) -> bool:
        """Whether somebody listens that has not heard the reset."""
        return bool(self._since.keys() - self._told.keys())

    @property
    def is_owed(self) -> bool:
        """Whether somebody has an order and has not heard its reset, and nobody has come instead."""
        untold, told = self._ordered - self._told.keys(), self._told.keys()
        if _SOMEBODY in untold and not any(self._replaces(each, _SOMEBODY) for each in told):
            return True
        if any(missed not in self._missed for missed in untold):
            return True
        instead = told | self._missed.keys()
        for missed in sorted(untold - {_SOMEBODY}, key=self._replaceable_from, reverse=True):
            found = next((each for each in sorted(instead) if self._replaces(each, missed)), None)
            if found is None:
                return True
            instead -= {found}  # it has come instead of one
        return False

    def _note_nodes(self, found: Mapping[bytes, str]) -> None:
        for each, nodes in found.items():
            self._nodes[each] = self._nodes.get(each, frozenset()) | frozenset(nodes.split())

    def _take_listed(self, found: Mapping[bytes, str]) -> None:
        """Note that who is listed only now was there before, as a number, and has the order."""
        unlisted = {each for each in self._ordered - found.keys() - self._missed.keys() if each.isdigit()}
        listed = {each for each in found.keys() - self._since.keys() if not each.isdigit()}
        if unlisted and listed:
            self._ordered = self._ordered - unlisted | listed

    def _replaceable_from(self, missed: bytes) -> float:
        """Since when a program may have come instead of one that is missed."""
        return max(self._came[missed], self._missed[missed] - LEASE_SECONDS)

    def _replaces(self, each: bytes, missed: bytes) -> bool:
        """Whether a program may have come instead of one that is missed. (A tool of ROS always has a name.)"""
        nodes, others = (self._nodes.get(one, frozenset()) for one in (missed, each))
        is_same = missed == _SOMEBODY or bool(nodes & others) or not (nodes or others)
        return is_same and self._came[each] > self._came[missed] and self._came[each] >= self._replaceable_from(missed)
