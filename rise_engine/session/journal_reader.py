"""Reads a journal: its inputs and records, its torn end, and damaged or missing lines before that.

Each whole line has a checksum and a number (`n` of inputs, `seq` of records). So changed, lost, doubled and moved lines
are found. `recovery` repairs them.

A session of three hours has a million lines, so they are never all in memory. `read_journal` reads the file once for
its contents and faults. Callers that need the lines read it again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import takewhile
from os import SEEK_END
from pathlib import Path
from time import monotonic
from typing import IO, Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.base.errors import SessionError
from rise_engine.kernel.inputs import SessionEnded
from rise_engine.kernel.records import AnyRecord, SessionRecord
from rise_engine.session.journal_format import (
    INPUT_START,
    InputLine,
    JournalHeader,
    JournalLine,
    LineError,
    read_line,
)

ProgressCallback = Callable[[str], object]
"""Gets a sentence about the progress, about twice a second."""

StepInput: TypeAlias = tuple[int, InputLine]
"""An input, with its place among the lines of its block, from 0."""
_BLOCK_BYTES = 2**14
"""Bytes of lines that `read_steps` yields together."""
_PROGRESS_LINES = 1_000
"""Lines between two checks of the clock."""
PROGRESS_SECONDS = 0.5
"""Seconds between two sentences."""
_MISPLACED_LINE = "its number was there before: it is here a second time, or in the wrong place"


class ReadingProgress:
    """Progress reports of a long read."""

    def __init__(self, on_progress: ProgressCallback | None = None) -> None:
        self._on_progress = on_progress
        self._next = monotonic() + PROGRESS_SECONDS

    def report(self, sentence: Callable[[], str]) -> None:
        """Report the progress if it is due; only then is `sentence` called. Call this often."""
        if self._on_progress is not None and monotonic() > self._next:
            self._on_progress(sentence())
            self._next = monotonic() + PROGRESS_SECONDS


class NumberGap(Struct, frozen=True):
    """Missing numbers before later numbers."""

    what: Literal["input", "record"]
    first: int
    last: int
    before: int
    """The line with the next number."""
    damaged: tuple[int, ...]
    """Unreadable lines in this place; empty: lines were removed."""

    def __str__(self) -> str:
        """Return a sentence without its end: `line 17 is damaged, and it was input 6`."""
        numbers = f"{self.what} {self.first}"
        if self.last > self.first:
            numbers = f"{self.what}s {self.first} to {self.last}"
        match self.damaged:
            case ():
                return f"before line {self.before} {numbers} {'is' if self.first == self.last else 'are'} missing"
            case (line,):
                return f"line {line} is damaged, and it was {numbers}"
            case lines:
                return f"lines {lines[0]} to {lines[-1]} are damaged, and {numbers} were there"


class JournalContents(Struct):
    """The contents of a journal, as far as they can be read. The lines themselves stay in the file."""

    path: Path
    header: JournalHeader | None = None
    """None: the first line is damaged, but later ones are valid."""
    inputs: int = 0
    """The number of readable inputs."""
    records: int = 0
    """The number of readable records."""
    last_input: int = 0
    """The highest input number; equal to `inputs` if none is missing."""
    last_seq: int = 0
    """The highest record number."""
    size: int = 0
    """Bytes up to the end of the last valid line."""
    torn: bytes = b""
    """The bytes after that: an incomplete line, or damaged lines without a valid one after them."""
    damaged: dict[int, str] = field(default_factory=dict)
    """Unreadable lines before the last valid one, with the reason, by line number."""
    gaps: list[NumberGap] = field(default_factory=list)
    """Missing inputs and records in the order of the file, without those torn off its end."""
    last_record: AnyRecord | None = None
    input_t: float = 0.0
    """Session time of the last input."""
    ended: bool = False
    """Whether the session ended in order."""

    @property
    def seconds(self) -> float:
        """Session time of the last known input or record."""
        return max(self.input_t, self.last_record.t if self.last_record is not None else 0.0)

    def read_records(self) -> Iterator[AnyRecord]:
        """Yield each readable record in the order of the file. Raises SessionError if the file cannot be read now."""
        return (found for _, _, found in self.lines() if not isinstance(found, JournalHeader | InputLine))

    def lines(self) -> Iterator[tuple[int, bytes, JournalLine]]:
        """Yield each readable line: its number, the line without its end, its content. Raises as `read_records`."""
        with _open_journal(self.path) as file:
            yield from _read_valid_lines(file, self.size, JournalContents(self.path))

    @property
    def next_line(self) -> int:
        """The number of the next line, as long as every line was valid."""
        return 1 + (self.header is not None) + self.inputs + self.records

    def read_steps(self, on_progress: ProgressCallback | None = None) -> Iterator[tuple[list[bytes], list[StepInput]]]:
        """Yield all lines of many steps together, with their ends, and the places of the inputs.

        This is for a caller that knows the records, which are not decoded here. It takes each block by `take_steps`,
        and may leave the last one. Ends before the last step, and before any line that is not a valid input in its
        place. `follow` continues after the taken blocks.
        """
        progress = ReadingProgress(on_progress)
        with _open_journal(self.path) as file:
            end = file.seek(0, SEEK_END)
            file.seek(0)
            try:
                header = read_line((line := file.readline())[:-1])
                if not isinstance(header, JournalHeader):
                    return
                self.header, self.size = header, len(line)
                lines: list[bytes] = []
                while more := file.readlines(_BLOCK_BYTES):
                    lines += more
                    starts = [at for at, line in enumerate(lines) if line.startswith(INPUT_START)]
                    inputs = [
                        (at, found)
                        for number, at in enumerate(starts[:-1], self.last_input + 1)
                        if isinstance(found := read_line(lines[at][:-1]), InputLine) and found.n == number
                    ]
                    if starts[:1] != [0] or len(inputs) < len(starts) - 1:
                        return
                    if inputs:
                        yield lines[: starts[-1]], inputs
                        del lines[: starts[-1]]
                    progress.report(lambda: _progress_text(self.size, end))
            except LineError:
                return

    def take_steps(self, lines: Sequence[bytes], inputs: Sequence[StepInput], records: Sequence[AnyRecord]) -> None:
        """Count a block of `read_steps`, with the records of its lines, as read."""
        self.size += sum(map(len, lines))
        self.inputs += len(inputs)
        self.last_input += len(inputs)
        self.records += len(records)
        self.last_seq += len(records)
        self.last_record = records[-1] if records else self.last_record
        last = inputs[-1][1].input
        self.input_t, self.ended = last.t, isinstance(last, SessionEnded)

    def follow(self, on_progress: ProgressCallback | None = None) -> Iterator[tuple[int, bytes, JournalLine]]:
        """Yield the lines that were not read before. The other fields are updated on the way, and are complete after
        the last line. Parameters and errors as in `read_journal`."""
        progress = ReadingProgress(on_progress)
        with _open_journal(self.path) as file:
            end = file.seek(0, SEEK_END)
            if not end:
                raise SessionError(f"{self.path} is empty: nothing was ever recorded")
            file.seek(self.size)
            for number, line, found in _read_valid_lines(file, end, self):
                yield number, line, found
                if number % _PROGRESS_LINES == 0:
                    progress.report(lambda: _progress_text(self.size, end))
            file.seek(self.size)
            self.torn = file.read(end - self.size)
        if self.size == 0:
            first, whole, _ = self.torn.partition(b"\n")
            reason = "its first line is not the header of a journal" if whole else "not even its first line is whole"
            if first.endswith(b"\r"):
                reason = "its lines end with CR LF, so another program has changed it"
            raise SessionError(f"{self.path} holds nothing that can be read: {reason}")
        last = self.last_record
        self.ended = self.ended or (isinstance(last, SessionRecord) and last.status == "ended")
        if self.header is None and 1 not in self.damaged:
            self.damaged = {1: "it is not the header of a journal", **self.damaged}


def read_journal(path: Path, on_progress: ProgressCallback | None = None) -> JournalContents:
    """Read the journal in the file `path` once, for its contents and faults.

    `on_progress` gets a sentence about the progress about twice a second, if this takes long. Returns counts, the
    damaged, missing or torn parts, and methods to read the lines again. The file is not changed, so the session may
    still run. Raises SessionError if there is no journal, it cannot be read, nothing in it is valid, or a newer version
    wrote it.

        >>> from tempfile import TemporaryDirectory
        >>> from rise_engine.kernel.inputs import Note
        >>> from rise_engine.kernel.records import NoteRecord
        >>> from rise_engine.session.journal_format import encode_header, encode_input, encode_record, with_checksum
        >>> record = NoteRecord(seq=1, t=2.5, wall="2026-11-21T14:00:00+01:00", text="hello", source="engine")
        >>> lines = encode_header("example 1") + encode_input(1, Note(t=2.5, text="hello"))
        >>> with TemporaryDirectory() as folder:
        ...     path = Path(folder) / "journal.jsonl"
        ...     _ = path.write_bytes(lines + with_checksum(encode_record(record)) + b'{"kind":"no')
        ...     contents = read_journal(path)
        ...     [each.text for each in contents.read_records()]
        ['hello']
        >>> contents.inputs, contents.records, contents.seconds, contents.ended, contents.torn
        (1, 1, 2.5, False, b'{"kind":"no')
    """
    contents = JournalContents(path)
    for _ in contents.follow(on_progress):
        pass
    return contents


@contextmanager
def _open_journal(path: Path) -> Iterator[IO[bytes]]:
    """Open a journal. Raises SessionError if there is none or it cannot be read."""
    try:
        with path.open("rb") as file:
            yield file
    except FileNotFoundError:
        raise SessionError(f"there is no journal {path}: nothing was ever recorded, or somebody moved it") from None
    except OSError as error:
        raise SessionError(f"{path} cannot be read: {error.strerror or error}") from None


def _read_valid_lines(file: IO[bytes], end: int, contents: JournalContents) -> Iterator[tuple[int, bytes, JournalLine]]:
    """Yield the valid lines of a journal before the offset `end`: number, line without its end, content.

    `contents` is updated up to the yielded line, with the damaged and missing lines before it.
    """
    suspect: dict[int, str] = {}
    """Unreadable lines without a valid line after them so far."""
    offset, input_line, record_line = contents.size, 0, 0
    for number, line in enumerate(file, contents.next_line):
        offset += len(line)
        if offset > end or not line.endswith(b"\n"):
            break  # an incomplete line
        line = line[:-1]
        try:
            found = read_line(line)
        except LineError as error:
            if error.newer:
                raise SessionError(f"{contents.path}:{number}: {error}: install that version") from None
            suspect[number] = str(error)
            continue
        if isinstance(found, InputLine):
            problem = _MISPLACED_LINE if found.n <= contents.last_input else ""
        elif isinstance(found, JournalHeader):
            problem = "it is a second header" if number > 1 else ""
        else:
            problem = _MISPLACED_LINE if found.seq <= contents.last_seq else ""
        if problem:
            suspect[number] = problem
            continue
        if suspect:
            contents.damaged.update(suspect)
            suspect.clear()
        contents.size = offset
        if isinstance(found, InputLine):
            if found.n != contents.last_input + 1:
                _note_gap(contents, "input", contents.last_input + 1, found.n - 1, input_line, number)
            contents.last_input, input_line = found.n, number
            contents.inputs += 1
            contents.input_t = found.input.t
            contents.ended = isinstance(found.input, SessionEnded)
        elif isinstance(found, JournalHeader):
            contents.header = found
        else:
            if found.seq != contents.last_seq + 1:
                _note_gap(contents, "record", contents.last_seq + 1, found.seq - 1, record_line, number)
            contents.last_seq, record_line = found.seq, number
            contents.records += 1
            contents.last_record = found
        yield number, line, found


def _progress_text(read: int, size: int) -> str:
    return f"reading the record: {read / 1e6:,.0f} of {size / 1e6:,.0f} MB"


def _note_gap(
    contents: JournalContents, what: Literal["input", "record"], first: int, last: int, since: int, before: int
) -> None:
    """Note that the numbers `first` to `last` are missing between the lines `since` and `before`."""
    damaged = takewhile(lambda number: number > since, reversed(contents.damaged))
    contents.gaps.append(NumberGap(what, first, last, before, tuple(damaged)[::-1]))
