"""Reading a journal: its inputs and records, what is torn off its end, and what is damaged or missing in between.

Every whole line has a check sum and a number of its own kind (`n` of inputs, `seq` of records), so a line that was
changed, lost, doubled or moved is noticed. Nothing is repaired here (`recovery` does that).
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from msgspec import Struct, field

from rise_engine.kernel.inputs import AnyInput, SessionEnded
from rise_engine.kernel.records import AnyRecord, SessionRecord
from rise_engine.session.folder import SessionError
from rise_engine.session.lines import FutureFormat, Header, InputLine, LineError, read_line


class Step(Struct):
    """An input with the records that follow it."""

    n: int
    line: int
    """The line number of the input."""
    input: AnyInput
    records: list[AnyRecord] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    """The line number of each record."""


class Gap(Struct, frozen=True):
    """Numbers that are not there although later ones are."""

    what: Literal["input", "record"]
    first: int
    last: int
    before: int
    """The line that has the next number."""
    damaged: tuple[int, ...]
    """Unreadable lines where it was; none when lines were taken out."""

    def __str__(self) -> str:
        """As a sentence without its end: `line 17 is damaged, and it was input 6`."""
        numbers = f"{self.what} {self.first}"
        if self.last > self.first:
            numbers = f"{self.what}s {self.first} to {self.last}"
        match self.damaged:
            case ():
                return f"before line {self.before} {numbers} {'is' if self.first == self.last else 'are'} missing"
            case (line,):
                return f"line {line} is damaged, and it was {numbers}"
            case lines:
                return f"lines {lines[0]} to {lines[-1]} are damaged, and {numbers} stood there"


class Contents(Struct):
    """A journal as far as it can be read."""

    header: Header | None
    """None: the first line is damaged, but later ones are not."""
    steps: list[Step]
    """When an input is missing, records that it caused stand in the step before."""
    size: int
    """Bytes up to the end of the last valid line."""
    torn: bytes
    """What comes after that: an incomplete line, or damaged ones without anything valid after them."""
    damaged: dict[int, str]
    """Unreadable lines that have valid ones after them: what is wrong with each, by line number."""
    gaps: list[Gap]
    """Missing inputs and records, in the order of the file. None for those that were torn off the end."""
    orphans: list[AnyRecord] = field(default_factory=list)
    """Records before the first input: its line is damaged or missing."""
    orphan_lines: list[int] = field(default_factory=list)

    @property
    def ended(self) -> bool:
        """Whether the session came to its end in order."""
        last = self.last_record
        if isinstance(last, SessionRecord) and last.status == "ended":
            return True
        return bool(self.steps) and isinstance(self.steps[-1].input, SessionEnded)

    @property
    def last_record(self) -> AnyRecord | None:
        for step in reversed(self.steps):
            if step.records:
                return step.records[-1]
        return self.orphans[-1] if self.orphans else None

    @property
    def seconds(self) -> float:
        """Session time of the last thing that is known."""
        last = self.last_record
        return max(self.steps[-1].input.t if self.steps else 0.0, last.t if last is not None else 0.0)

    @property
    def lost_inputs(self) -> list[Gap]:
        return [gap for gap in self.gaps if gap.what == "input"]

    def placed(self) -> Iterator[tuple[int, AnyRecord]]:
        """Every record that can be read, with its line number."""
        yield from zip(self.orphan_lines, self.orphans, strict=True)
        for step in self.steps:
            yield from zip(step.lines, step.records, strict=True)


def read_journal(path: Path) -> Contents:
    """Raises SessionError when there is no journal in it at all, or a newer one."""
    data = read_bytes(path)
    if not data:
        raise SessionError(f"{path} is empty: nothing was ever recorded")
    collecting = gc.isenabled()
    gc.disable()  # all that reading makes is kept; looking for garbage meanwhile takes as long again
    try:
        return _read(path, data)
    finally:
        if collecting:
            gc.enable()


def read_bytes(path: Path) -> bytes:
    """Raises SessionError."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise SessionError(f"there is no journal {path}: nothing was ever recorded, or somebody moved it") from None
    except OSError as error:
        raise SessionError(f"{path} cannot be read: {error.strerror or error}") from None


def _read(path: Path, data: bytes) -> Contents:
    lines = data.split(b"\n")
    lines.pop()  # what stands after the last line end: nothing, or the beginning of a line
    header: Header | None = None
    steps: list[Step] = []
    step = Step(0, 0, SessionEnded())  # for records before any input
    orphans, orphan_lines = records, places = step.records, step.lines
    damaged: dict[int, str] = {}
    suspect: dict[int, str] = {}
    """Unreadable lines with nothing valid after them so far."""
    gaps: list[Gap] = []
    n = seq = n_line = seq_line = offset = size = 0

    def gap(what: Literal["input", "record"], first: int, last: int, since: int) -> None:
        gaps.append(Gap(what, first, last, number, tuple(line for line in damaged if line > since)))

    for number, line in enumerate(lines, 1):
        offset += len(line) + 1
        try:
            found = read_line(line)
        except FutureFormat as error:
            raise SessionError(f"{path}:{number}: {error}: install that version") from None
        except LineError as error:
            suspect[number] = str(error)
            continue
        kind = type(found)
        place = n if kind is InputLine else seq
        if kind is Header:
            if number > 1:
                suspect[number] = "it is a second header"
                continue
            header = found  # type: ignore[assignment]
        elif (found.n if kind is InputLine else found.seq) <= place:  # type: ignore[union-attr]
            suspect[number] = "its number was there before: it stands here a second time, or in the wrong place"
            continue
        if suspect:
            damaged.update(suspect)
            suspect.clear()
        size = offset
        if kind is InputLine:
            assert isinstance(found, InputLine)
            if found.n != n + 1:
                gap("input", n + 1, found.n - 1, n_line)
            n, n_line = found.n, number
            step = Step(n, number, found.input)
            records, places = step.records, step.lines
            steps.append(step)
        elif kind is not Header:
            if found.seq != seq + 1:  # type: ignore[union-attr]
                gap("record", seq + 1, found.seq - 1, seq_line)  # type: ignore[union-attr]
            seq, seq_line = found.seq, number  # type: ignore[union-attr]
            records.append(found)  # type: ignore[arg-type]
            places.append(number)
    torn = data[size:]
    if size == 0:
        whole = b"\n" in torn
        reason = "its first line is no header of a journal" if whole else "not even its first line is whole"
        raise SessionError(f"{path} holds nothing that can be read: {reason}")
    if header is None and 1 not in damaged:
        damaged = {1: "it is no header of a journal", **damaged}
    return Contents(header, steps, size, torn, damaged, gaps, orphans, orphan_lines)
