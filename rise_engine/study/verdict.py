"""How a session was judged and checked while it ran, from the end of its journal."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

from rise_engine.kernel.inputs import AnyInput, CheckReport, OutcomeReport
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import InputLine, JournalHeader, LineError, read_line

_BLOCK = 1 << 20
_OUTCOME, _CHECK = b'"input":"outcome"', b'"input":"check"'
_BEFORE_INPUT = 64
"""The largest number of bytes before that in an input's line."""


class Verdict(NamedTuple):
    """The outcome of a session according to its journal."""

    report: OutcomeReport | None
    """None: there is no outcome."""
    seconds: float
    """Session time of the last known input or record."""


def read_verdict(path: Path) -> Verdict:
    """Read how a session was judged while it ran, and its length. The last outcome counts.

    Reads from the end of the journal, only as far as needed. Torn or damaged lines are skipped.

    :param path: the session's folder.
    """
    try:
        with (path / JOURNAL).open("rb") as file:
            return Verdict(_last_outcome(file), _last_time(file))
    except OSError:
        return Verdict(None, 0.0)


def read_checks(path: Path, ids: Collection[str]) -> dict[str, CheckReport]:
    """Read the reports of some checks in a session, by id. The last one of each counts.

    :param path: the session's folder.
    :param ids: the ids of the checks.
    """
    found: dict[str, CheckReport] = {}
    with suppress(OSError), (path / JOURNAL).open("rb") as file:
        for input in _inputs_from_end(file, _CHECK):
            if isinstance(input, CheckReport) and input.id in ids:
                found.setdefault(input.id, input)
    return found


def _last_outcome(file: BinaryIO) -> OutcomeReport | None:
    return next((each for each in _inputs_from_end(file, _OUTCOME) if isinstance(each, OutcomeReport)), None)


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
    """Find bytes in a file and give their places, the last first. Only one block is in memory at a time."""
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
