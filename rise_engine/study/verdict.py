"""The outcome, checks and recoveries of a session, read from its journal."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

from rise_engine.kernel.inputs import AnyInput, CheckReport, OutcomeReport
from rise_engine.kernel.records import AnyRecord, SessionRecord
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import InputLine, JournalHeader, LineError, read_line
from rise_engine.session.labels import downtime_by_clock

_BLOCK = 1 << 16
_OUTCOME, _CHECK, _RECOVERED = b'"input":"outcome"', b'"input":"check"', b'"input":"session_recovered"'
_BEFORE = 1 << 16
"""Bytes before a recovery in which the last record before it is searched."""
_BEFORE_INPUT = 64
"""Maximum bytes between the start of an input's line and the searched bytes in it."""


class Verdict(NamedTuple):
    """The outcome of a session according to its journal."""

    report: OutcomeReport | None
    """None: there is no outcome."""
    seconds: float
    """Session time of the last known input or record."""


def read_verdict(path: Path) -> Verdict:
    """Read a session's outcome, the last one in its journal, and its length.

    Reads from the end of the journal, only as far as needed. Torn or damaged lines are skipped.

    :param path: the session's folder.
    """
    try:
        with (path / JOURNAL).open("rb") as file:
            outcomes = (each for each in _inputs_from_end(file, _OUTCOME) if isinstance(each, OutcomeReport))
            return Verdict(next(outcomes, None), _last_time(file))
    except OSError:
        return Verdict(None, 0.0)


def read_checks(path: Path, ids: Collection[str]) -> dict[str, CheckReport]:
    """Read the last report of some checks in a session, by id.

    :param path: the session's folder.
    :param ids: the ids of the checks.
    """
    found: dict[str, CheckReport] = {}
    for report in _check_reports(path):
        if report.id in ids:
            found.setdefault(report.id, report)
    return found


def check_results(path: Path) -> dict[str, frozenset[str]]:
    """Return all results of each check that was reported in a session, by id.

    :param path: the session's folder.
    """
    found: dict[str, set[str]] = {}
    for report in _check_reports(path):
        found.setdefault(report.id, set()).add(report.result)
    return {id: frozenset(results) for id, results in found.items()}


def _check_reports(path: Path) -> Iterator[CheckReport]:
    with suppress(OSError), (path / JOURNAL).open("rb") as file:
        yield from (each for each in _inputs_from_end(file, _CHECK) if isinstance(each, CheckReport))


class Recovery(NamedTuple):
    """The recovery of a session by another engine."""

    t: float
    """Session time."""
    downtime: float
    """The recorded number of seconds without an engine."""
    by_clock: float
    """The same by the wall clock of the records before and after it."""


def read_recoveries(path: Path, speed: float) -> list[Recovery]:
    """Return the recoveries of a session whose record has both times, the last one first.

    :param path: the session's folder.
    :param speed: session seconds in a second of the wall clock.
    """
    found: list[Recovery] = []
    with suppress(OSError), (path / JOURNAL).open("rb") as file:
        for position in _positions_from_end(file, _RECOVERED):
            begin = max(0, position - _BEFORE)
            file.seek(begin)
            before = _records_in(file.read(position - begin).splitlines())
            file.readline()
            after = _records_in([file.readline()])
            if before and after and isinstance(after[0], SessionRecord) and after[0].downtime is not None:
                by_clock = downtime_by_clock(before[-1], after[0], speed)
                if by_clock is not None:
                    found.append(Recovery(after[0].t, after[0].downtime, max(0.0, by_clock)))
    return found


def _records_in(lines: Iterable[bytes]) -> list[AnyRecord]:
    found: list[AnyRecord] = []
    for line in lines:
        with suppress(LineError):
            read = read_line(line.removesuffix(b"\n"))
            if not isinstance(read, JournalHeader | InputLine):
                found.append(read)
    return found


def _inputs_from_end(file: BinaryIO, wanted: bytes) -> Iterator[AnyInput]:
    """Give the inputs whose lines contain some bytes, the last one first."""
    for position in _positions_from_end(file, wanted):
        begin = max(0, position - _BEFORE_INPUT)
        file.seek(begin)
        begin += file.read(position - begin).rfind(b"\n") + 1
        file.seek(begin)
        with suppress(LineError):
            found = read_line(file.readline().removesuffix(b"\n"))
            if isinstance(found, InputLine):
                yield found.input


def _last_time(file: BinaryIO) -> float:
    """Return the session time of the last known input or record."""
    for position in _positions_from_end(file, b"\n{"):
        file.seek(position + 1)
        with suppress(LineError):
            found = read_line(file.readline().removesuffix(b"\n"))
            if not isinstance(found, JournalHeader):
                return found.input.t if isinstance(found, InputLine) else found.t
    return 0.0


def _positions_from_end(file: BinaryIO, wanted: bytes) -> Iterator[int]:
    """Give the positions of some bytes in a file, the last first. Only one block is in memory at a time."""
    at, rest = file.seek(0, os.SEEK_END), b""
    while at:
        size = min(_BLOCK, at)
        at -= size
        file.seek(at)
        block = file.read(size) + rest
        position = block.rfind(wanted)
        while position >= 0:
            yield at + position
            position = block.rfind(wanted, 0, position + len(wanted) - 1)
        rest = block[: len(wanted) - 1]
