"""Replay: a fresh kernel gets the recorded inputs and must give the same records.

`rise-engine replay` shows the result of `compare_replay`. Recovery also uses `Replay`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.text import pluralize
from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import CancelTimer, SetTimer
from rise_engine.kernel.inputs import TimerElapsed
from rise_engine.kernel.records import AnyRecord
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import JOURNAL, SessionInfo, read_info, speech_arguments
from rise_engine.session.journal_format import InputLine, JournalHeader, encode_record, with_checksum
from rise_engine.session.journal_reader import JournalContents, ProgressCallback
from rise_engine.session.scenario_copies import load_session_scenario, offer_changed

NO_RECORD = "(no record)"
"""Stands for the field if a whole record exists on one side only."""


CANNOT_REPLAY = (
    "The rest of the session cannot be computed from there, so it cannot be recovered or replayed. "
    "Everything that can be read, before and after, can be exported (rise-engine export)"
)


class ReplayDifference(Struct, frozen=True):
    """The first record that differs between the recording and the replay."""

    file: str
    line: int
    """The record's line."""
    seq: int
    input: int
    """The number of the input that caused the record, as far as known."""
    kind: str
    field: str
    recorded: Any
    """As a JSON value."""
    replayed: Any

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}: record {self.seq} (of input {self.input}, kind {self.kind})"
        if self.field == NO_RECORD:
            return f"{where} is in the journal, but the replay does not give it"
        recorded, replayed = _short_json(self.recorded), _short_json(self.replayed)
        return f"{where}: `{self.field}` is {recorded}, but the replay gives {replayed}"


class ReplayComparison(Struct, frozen=True):
    """The result of a replay."""

    inputs: int
    """The number of replayed inputs."""
    records: int
    """The number of compared records, up to the difference if there is one."""
    seconds: float
    """Session time of the last input or record."""
    difference: ReplayDifference | None = None
    damaged: dict[int, str] = {}
    """Unreadable lines, which were not compared, with the reason."""
    missing: int = 0
    """The number of replayed records missing in the journal, without those torn off its end."""
    notes: list[str] = []
    """Further remarks: an unfinished session, a torn end, another scenario."""
    other_scenario: str = ""
    """A sentence about the scenario that was used; empty: the session's own copy."""

    @property
    def identical(self) -> bool:
        return self.difference is None and not self.damaged and not self.missing

    @property
    def why(self) -> str:
        """The differences in words; empty: none."""
        if self.difference is not None:
            return str(self.difference)
        found = [f"line {line} cannot be read ({reason})" for line, reason in self.damaged.items()]
        found += [f"{pluralize(self.missing, 'record')} cannot be read"] if self.missing else []
        return "; ".join(found)


def compare_replay(folder: Path, scenario: Path | None = None) -> ReplayComparison:
    """Replay the inputs of the session in `folder` and compare the records with the recorded ones, byte for byte.

    `scenario`: a scenario folder to use instead of the session's own copy. Returns how much was compared, and the first
    difference, if any. The folder is not changed, and the session may still run. Raises SessionError if the session
    cannot be replayed: there is no session, an input is lost, or the scenario does not load.

        comparison = compare_replay(find_session("2026-11-21_141503_lablinking_debug"))
        print("identical" if comparison.identical else comparison.difference)
    """
    info = read_info(folder)
    notes: list[str] = []
    model = (
        load_session_scenario(folder, info, notes) if scenario is None else _load_other_scenario(scenario, info, notes)
    )
    other_scenario = "; ".join(notes)
    replay = Replay(Kernel(model, info.seed), folder / JOURNAL)
    for _ in replay.steps():
        pass
    contents = replay.contents
    if not contents.ended:
        notes.append("the session has not ended properly: it is running, or its engine went away")
    if contents.torn:
        notes.append(f"the last {len(contents.torn)} bytes of {JOURNAL} are torn and were left out")
    if replay.unwritten and replay.difference is None:
        first, last = replay.unwritten[0].seq, replay.unwritten[-1].seq
        which = f"record {first}" if first == last else f"records {first} to {last}"
        notes.append(f"the journal ends before {which}, which the last input caused")
    return ReplayComparison(
        inputs=replay.inputs,
        records=replay.compared,
        seconds=contents.seconds,
        difference=replay.difference,
        damaged=contents.damaged,
        missing=replay.missing,
        notes=notes,
        other_scenario=other_scenario,
    )


# --- also used by recovery ------------------------------------------------------------------------------------------


def require_inputs(contents: JournalContents) -> None:
    """Raise SessionError if an input in the middle of the journal is missing."""
    lost = next((gap for gap in contents.gaps if gap.what == "input"), None)
    if lost is not None:
        raise SessionError(f"{contents.path}: {lost}. {CANNOT_REPLAY}")


class RecordedLine(Struct, frozen=True):
    """A record in the journal."""

    line: int
    """The line number."""
    text: bytes
    """The line without its end."""
    record: AnyRecord


class ReplayedStep(Struct, frozen=True):
    """A step of the replay."""

    n: int
    line: bytes
    """The input's line with its end."""
    records: list[AnyRecord]
    """The step's records, with the recorded `wall` if there is one."""
    written: list[bytes | None]
    """The recorded line of each record, with its end; None: missing in the journal."""


class Replay:
    """A replay of a journal's inputs through a fresh kernel, step by step, up to the first difference.

    Iterate over `steps` to the end. Only some steps are in memory at a time.
    """

    def __init__(self, kernel: Kernel, path: Path, on_progress: ProgressCallback | None = None) -> None:
        self._kernel = kernel
        self._folder = path.parent
        self._on_progress = on_progress
        self.contents = JournalContents(path)
        """The contents of the journal, complete after the last step."""
        self._ahead: deque[list[AnyRecord] | SessionError] = deque()
        """The results of the next inputs, which were replayed already."""
        self.inputs = 0
        """The number of replayed inputs."""
        self.compared = 0
        """The number of equal records, before the difference if there is one."""
        self.difference: ReplayDifference | None = None
        self.missing = 0
        """The number of records missing in the journal before later lines."""
        self.unwritten: list[AnyRecord] = []
        """Records of the last input that were torn off or never written."""
        self.timers: dict[int, float] = {}
        """The running timers, with the session times at which they are due."""

    def steps(self) -> Iterator[ReplayedStep]:
        """Replay each step and compare its records by number. Raises SessionError, also if an input is missing."""
        yield from self._exact_steps()
        contents = self.contents
        tape = _JournalTape(contents, self._on_progress)
        wall, line = contents.last_record.wall if contents.last_record is not None else "", 0
        while self.difference is None and (found := tape.next_input()) is not None:
            line, text, input = found
            self.missing += len(self.unwritten)  # a later input exists, so these are not a torn end
            self.unwritten = []
            result = self._ahead.popleft() if self._ahead else self._handle(line, input)
            if isinstance(result, SessionError):
                raise result
            self.inputs += 1
            written = [tape.record(record.seq) for record in result]
            # A missing record gets the `wall` of the same step, or of the step before.
            wall = next((recorded.record.wall for recorded in written if recorded is not None), wall)
            for record, recorded in zip(result, written, strict=True):
                record.wall = wall if recorded is None else recorded.record.wall
                if recorded is None:
                    self.unwritten.append(record)
                    continue
                self.difference = _first_difference(contents, input.n, recorded, record)
                if self.difference is not None:
                    break
                self.compared += 1
            else:
                lines = [recorded.text + b"\n" if recorded is not None else None for recorded in written]
                yield ReplayedStep(input.n, text + b"\n", result, lines)
        tape.read_rest()
        lost = [record for record in self.unwritten if record.seq < contents.last_seq]
        self.missing += len(lost)
        self.unwritten = self.unwritten[len(lost) :]
        if self.difference is None and contents.last_seq > self._kernel.seq:
            self.difference = _first_beyond(contents, tape, line)

    def _exact_steps(self) -> Iterator[ReplayedStep]:
        """Replay and compare many steps together without decoding their records, up to the first block of lines that
        differs from the replay. For a million records, this saves a third of the time."""
        contents = self.contents
        for lines, inputs in contents.read_steps(self._on_progress):
            first = contents.next_line
            for at, input in inputs:
                try:
                    self._ahead.append(self._handle(first + at, input))
                except SessionError as error:
                    self._ahead.append(error)
                    return
            expected: list[bytes] = []
            steps, replayed = [], []
            for (at, input), records in zip(inputs, self._ahead, strict=True):
                assert not isinstance(records, SessionError)
                wall = _read_wall(lines[at + 1]) if at + 1 < len(lines) else ""
                for record in records:
                    record.wall = wall  # all records of a step have one time
                written = [with_checksum(encode_record(record)) for record in records]
                expected += (lines[at], *written)
                replayed += records
                steps.append(ReplayedStep(input.n, lines[at], records, [*written]))
            if expected != lines:
                return
            self._ahead.clear()
            contents.take_steps(lines, inputs, replayed)
            self.inputs += len(inputs)
            self.compared += len(replayed)
            yield from steps

    def _handle(self, line: int, input: InputLine) -> list[AnyRecord]:
        """Replay one input and return its records. Updates `timers`."""
        timers = self.timers
        if isinstance(input.input, TimerElapsed):
            timers.pop(input.input.timer, None)
        offer_changed(self._kernel, self._folder, input.input)
        try:
            records, commands = self._kernel.handle(input.input)
        except Exception as error:  # any failure: the owner of this journal must learn the remedy
            raise SessionError(
                f"{self.contents.path}:{line}: input {input.n} makes the engine fail, which is a mistake in this "
                f"program ({type(error).__name__}: {error}). What was recorded can be exported (rise-engine export)"
            ) from error
        for command in commands:
            if isinstance(command, SetTimer):
                timers[command.timer] = command.at
            elif isinstance(command, CancelTimer):
                timers.pop(command.timer, None)
        return records


class _JournalTape:
    """The inputs in order and the records by ascending number, from one pass through the journal.

    A record usually follows its input. If lines were moved, the tape reads on to the wanted line and keeps those
    before.
    """

    def __init__(self, contents: JournalContents, on_progress: ProgressCallback | None) -> None:
        self._contents = contents
        self._lines = contents.follow(on_progress)
        self._inputs: deque[tuple[int, bytes, InputLine]] = deque()
        self._records: deque[RecordedLine] = deque()

    def next_input(self) -> tuple[int, bytes, InputLine] | None:
        """Return the next input with its line number and line. Raises SessionError if an earlier input is missing."""
        while not self._inputs:
            if not self._read():
                return None
        return self._inputs.popleft()

    def record(self, seq: int) -> RecordedLine | None:
        """Take the record `seq`, if the journal has it. Request records in ascending order."""
        found = self.peek_record()
        return self._records.popleft() if found is not None and found.record.seq == seq else None

    def peek_record(self) -> RecordedLine | None:
        """Return the next record without taking it."""
        while not self._records:
            if not self._read():
                return None
        return self._records[0]

    def read_rest(self) -> None:
        """Read to the end of the journal, so that its contents are complete."""
        for _ in self._lines:
            pass

    def _read(self) -> bool:
        number, text, found = next(self._lines, (0, b"", None))
        if isinstance(found, InputLine):
            self._inputs.append((number, text, found))
        elif found is not None and not isinstance(found, JournalHeader):
            self._records.append(RecordedLine(number, text, found))
        if self._contents.gaps:
            require_inputs(self._contents)
        return found is not None


def _first_difference(
    contents: JournalContents, n: int, written: RecordedLine, replayed: AnyRecord
) -> ReplayDifference | None:
    after = encode_record(replayed)
    if with_checksum(after)[:-1] == written.text:
        return None
    before = encode_record(written.record)  # not the line: another release may have written the same record differently
    if before == after:
        return None
    old, new = msgspec.json.decode(before), msgspec.json.decode(after)  # null on both sides for values outside of JSON
    for name in dict.fromkeys([*old, *new]):
        if name not in old or name not in new or msgspec.json.encode(old[name]) != msgspec.json.encode(new[name]):
            return ReplayDifference(
                contents.path.name, written.line, written.record.seq, n, old["kind"], name, old.get(name), new.get(name)
            )
    return None


def _first_beyond(contents: JournalContents, tape: _JournalTape, since: int) -> ReplayDifference:
    """Return the first recorded record without a replayed one. `since`: the line of the last input.

    Raises SessionError if a damaged line may be the missing input, because no later number excludes it.
    """
    written = tape.peek_record()
    assert written is not None
    suspects = [number for number in contents.damaged if since < number < written.line]
    if suspects:
        raise SessionError(f"{contents.path}: line {suspects[-1]} is damaged, and it was an input. {CANNOT_REPLAY}")
    value = msgspec.json.decode(encode_record(written.record))
    return ReplayDifference(
        contents.path.name, written.line, written.record.seq, contents.last_input, value["kind"], NO_RECORD, value, None
    )


# --- small things --------------------------------------------------------------------------------------------------


def _load_other_scenario(path: Path, info: SessionInfo, notes: list[str]) -> Scenario:
    """Load a scenario that the caller named. It keeps the recorded name, because only its behaviour is compared."""
    loaded = load(path, robot=info.robot, mode=info.mode, **speech_arguments(info))
    if loaded.scenario is None:
        raise SessionError(f"the scenario {path} does not load: {loaded.errors[0]}")
    if loaded.scenario.hash != info.scenario_hash:
        notes.append(f"{path} is not what this session ran: something in it is different")
    return replace(loaded.scenario, title=info.title, folder=info.scenario_folder, hash=info.scenario_hash)


def _read_wall(line: bytes) -> str:
    """The `wall` of a record's line."""
    return line.partition(b'"wall":"')[2].partition(b'"')[0].decode(errors="replace")


def _short_json(value: Any) -> str:
    text = msgspec.json.encode(value).decode()
    return text if len(text) <= 120 else f"{text[:117]}..."
