"""Time: the possible readings of several clocks at once, as difference bound matrices.

Each running act or timer has a clock that began with it. For each pair of clocks, a zone limits how far one can be
ahead of the other. Clock 0 always shows 0, so row and column 0 are the bounds of single clocks. All values are whole
milliseconds. Zones are closed: no bound could be lower without losing a possible time. Source: D. Dill, Timing
assumptions and verification of finite-state concurrent systems, 1989. UPPAAL does the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

Zone: TypeAlias = tuple[tuple[int, ...], ...]
"""`zone[i][j]` is the maximum of clock i minus clock j, in ms."""

NO_CLOCKS: Zone = ((0,),)


def narrow(zone: Zone, clock: int, least: int, most: int) -> Zone | None:
    """Return the part of a zone in which a clock shows from `least` to `most`; None: it is empty."""
    if zone[clock][0] < least or -zone[0][clock] > most:
        return None
    size = range(len(zone))
    if -zone[0][clock] < least:
        to_clock = [zone[i][0] - least for i in size]  # i minus clock, through 0
        from_clock = zone[clock]
        zone = tuple([tuple([min(row[j], to_clock[i] + from_clock[j]) for j in size]) for i, row in enumerate(zone)])
    if zone[clock][0] > most:
        to_zero = [zone[i][clock] + most for i in size]
        from_zero = zone[0]
        zone = tuple([tuple([min(row[j], to_zero[i] + from_zero[j]) for j in size]) for i, row in enumerate(zone)])
    return zone


def carry(zone: Zone, clocks: Sequence[int | None]) -> Zone:
    """Return the zone of other clocks: each is the old clock of this number, or a new one that begins at 0."""
    sources = [0, *[0 if clock is None else clock for clock in clocks]]
    rows = [zone[i] for i in sources]
    return tuple([tuple([row[j] for j in sources]) for row in rows])


def elapse(zone: Zone, limits: Sequence[int]) -> Zone:
    """Let time pass until a clock reaches its limit."""
    from_zero = zone[0]
    passed = [from_zero]
    for row in zone[1:]:
        top = min([limit + ahead for limit, ahead in zip(limits, row[1:], strict=True)])
        passed.append(tuple([min(bound, top + before) for bound, before in zip(row, from_zero, strict=True)]))
        passed[-1] = (top, *passed[-1][1:])
    return tuple(passed)


def includes(large: Zone, small: Zone) -> bool:
    """Return whether one zone contains all times of another."""
    return all(
        most >= bound for row, other in zip(large, small, strict=True) for most, bound in zip(row, other, strict=True)
    )


def hull(one: Zone, other: Zone) -> Zone:
    """Return the smallest zone that contains both."""
    return tuple(tuple(map(max, row, also)) for row, also in zip(one, other, strict=True))


def widen(known: Zone, zone: Zone, limits: Sequence[int]) -> Zone:
    """Return a zone that contains both, in which each bound that grew is as large as possible."""
    rows = [
        [largest if bound > before else before for before, bound, largest in zip(*rows, strict=True)]
        for rows in zip(known, zone, widest(limits), strict=True)
    ]
    size = range(len(rows))
    for middle in size:  # close it: R. Floyd, Algorithm 97: shortest path, 1962
        through = rows[middle]
        for row in rows:
            ahead = row[middle]
            for j in size:
                if ahead + through[j] < row[j]:
                    row[j] = ahead + through[j]
    return tuple(map(tuple, rows))


def widest(limits: Sequence[int]) -> Zone:
    """Return all possible times: each clock from 0 to its limit."""
    tops = [0, *limits]
    return tuple(tuple(0 if i == j else tops[i] for j in range(len(tops))) for i in range(len(tops)))
