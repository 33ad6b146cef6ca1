"""Replay: the recorded inputs once more, through a fresh kernel. What comes out must be what was recorded.

`compare` is what `rise-engine replay` shows; `replay` serves recovery too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.kernel import Kernel
from rise_engine.kernel.commands import CancelTimer, SetTimer
from rise_engine.kernel.inputs import TimerElapsed
from rise_engine.kernel.records import AnyRecord
from rise_engine.scenario import load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import JOURNAL, SessionError, SessionInfo, load_copy, read_info
from rise_engine.session.lines import record_bytes
from rise_engine.session.reading import Contents, Step, read_journal

NO_RECORD = "(no record)"
"""Stands for a field when a whole record is there on one side only."""


LOST = (
    "What happened from there on cannot be worked out again, so the session cannot be recovered or replayed. "
    "Everything that can be read, before and after, can be exported (rise-engine export)"
)


class Difference(Struct, frozen=True):
    """The first place where a replay is not what was recorded."""

    file: str
    line: int
    """Of the record."""
    seq: int
    input: int
    """The number of the input that caused it, as far as that is known."""
    kind: str
    field: str
    recorded: Any
    """As JSON has it."""
    replayed: Any

    @property
    def place(self) -> str:
        return f"{self.file}:{self.line}"

    def __str__(self) -> str:
        where = f"{self.place}: record {self.seq} (of input {self.input}, kind {self.kind})"
        if self.field == NO_RECORD:
            return f"{where} is in the journal, but the replay does not give it"
        return f"{where}: `{self.field}` is {_shown(self.recorded)}, but the replay gives {_shown(self.replayed)}"


class Comparison(Struct, frozen=True):
    """What came of a replay."""

    inputs: int
    """How many were replayed."""
    records: int
    """How many were compared, up to the difference if there is one."""
    seconds: float
    """Session time of the last input or record."""
    difference: Difference | None = None
    damaged: dict[int, str] = {}
    """Lines that could not be compared because they cannot be read."""
    missing: int = 0
    """Records that the replay gives and the journal does not have, those torn off its end not counted."""
    notes: list[str] = []
    """What else there is to know: an unfinished session, a torn end, another scenario."""

    @property
    def identical(self) -> bool:
        return self.difference is None and not self.damaged and not self.missing


def compare(folder: Path, scenario: Path | None = None) -> Comparison:
    """Replay a session, with another scenario if one is named. Raises SessionError when it cannot be replayed."""
    info = read_info(folder)
    path = folder / JOURNAL
    contents = read_journal(path)
    require_inputs(path, contents)
    notes: list[str] = []
    model = session_scenario(folder, info, notes) if scenario is None else _other(scenario, info, notes)
    if not contents.ended:
        notes.append("the session has not ended in order: it is running, or its engine went away")
    if contents.torn:
        notes.append(f"the last {len(contents.torn)} bytes of {JOURNAL} are torn and were left out")

    done = replay(Kernel(model, info.seed), path, contents)
    if done.unwritten and done.difference is None:
        first, last = done.unwritten[0].seq, done.unwritten[-1].seq
        which = f"record {first}" if first == last else f"records {first} to {last}"
        notes.append(f"the journal ends before {which}, which the last input caused")
    return Comparison(
        inputs=len(done.steps),
        records=done.compared,
        seconds=contents.seconds,
        difference=done.difference,
        damaged=contents.damaged,
        missing=len(done.missing),
        notes=notes,
    )


# --- what recovery needs too ----------------------------------------------------------------------------------------


def require_inputs(path: Path, contents: Contents) -> None:
    """Raises SessionError when an input in the middle is not there."""
    if contents.lost_inputs:
        raise SessionError(f"{path}: {contents.lost_inputs[0]}. {LOST}")


def session_scenario(folder: Path, info: SessionInfo, notes: list[str]) -> Scenario:
    """The scenario that the session ran: its copy, or else the scenario's own folder while that is still the same."""
    try:
        return load_copy(folder, info)
    except SessionError as error:
        loaded = load(info.scenario_folder, robot=info.robot, mode=info.mode)
        found = loaded.scenario
        if found is None or found.hash != info.scenario_hash:
            raise SessionError(
                f"{error}. The scenario's own folder ({info.scenario_folder}) does not help: "
                + ("it cannot be loaded" if found is None else "it was changed since")
            ) from None
        notes.append(
            f"the session's copy of the scenario is missing or was changed; {info.scenario_folder} is still the same "
            "and was used"
        )
        return replace(found, title=info.title, folder=info.scenario_folder)


class MadeStep(Struct, frozen=True):
    """A step as the replay gives it."""

    step: Step
    records: list[AnyRecord]
    """With the `wall` that was recorded, where it was."""
    lines: list[int]
    """Where each stands in the journal; 0: nowhere."""


class Replayed(Struct):
    """What a replay gave, up to the first difference."""

    steps: list[MadeStep] = []
    compared: int = 0
    difference: Difference | None = None
    missing: list[AnyRecord] = []
    """Records that the journal does not have although later lines are there."""
    unwritten: list[AnyRecord] = []
    """Records of the last input that were never written, or torn off."""
    timers: dict[int, float] = {}
    """Timers that are set, and when they are due (session time)."""


def replay(kernel: Kernel, path: Path, contents: Contents) -> Replayed:
    """Feed the inputs to a fresh kernel and compare what it gives, by number. Raises SessionError."""
    there = {record.seq: (line, record) for line, record in contents.placed()}
    written = max(there, default=0)
    done = Replayed()
    wall = ""
    for step in contents.steps:
        records = _handle(kernel, path, step, done.timers)
        made = MadeStep(step, records, [])
        done.steps.append(made)
        # What has to be made again is of the same moment as its siblings, or else of the moment before.
        wall = next((there[record.seq][1].wall for record in records if record.seq in there), wall)
        for record in records:
            line, recorded = there.get(record.seq, (0, None))
            made.lines.append(line)
            record.wall = wall if recorded is None else recorded.wall
            if recorded is not None:
                done.difference = _differ(path, step, line, recorded, record)
                if done.difference is not None:
                    return done
                done.compared += 1
            elif record.seq < written or step is not contents.steps[-1]:
                done.missing.append(record)
            else:
                done.unwritten.append(record)
    if written > kernel.core.seq:
        done.difference = _first_beyond(path, contents, kernel.core.seq)
    return done


def _handle(kernel: Kernel, path: Path, step: Step, timers: dict[int, float]) -> list[AnyRecord]:
    """The records of a step; what it does about timers goes into `timers`."""
    if isinstance(step.input, TimerElapsed):
        timers.pop(step.input.timer, None)
    try:
        records, commands = kernel.handle(step.input)
    except Exception as error:
        raise SessionError(
            f"{path}:{step.line}: input {step.n} makes the engine fail, which is a mistake in this program "
            f"({type(error).__name__}: {error}). What was recorded can be exported (rise-engine export)"
        ) from error
    for command in commands:
        if isinstance(command, SetTimer):
            timers[command.timer] = command.at
        elif isinstance(command, CancelTimer):
            timers.pop(command.timer, None)
    return records


def _differ(path: Path, step: Step, line: int, recorded: AnyRecord, replayed: AnyRecord) -> Difference | None:
    before, after = record_bytes(recorded), record_bytes(replayed)
    if before == after:
        return None
    old, new = msgspec.json.decode(before), msgspec.json.decode(after)  # what JSON cannot hold is null in both
    for name in dict.fromkeys([*old, *new]):
        if name not in old or name not in new or msgspec.json.encode(old[name]) != msgspec.json.encode(new[name]):
            return Difference(path.name, line, recorded.seq, step.n, old["kind"], name, old.get(name), new.get(name))
    return None


def _first_beyond(path: Path, contents: Contents, last: int) -> Difference:
    """The first recorded record after `last`, where the replay ends.

    Raises SessionError when a damaged line may be the input that caused it: no number after it tells.
    """
    line, record = next((line, record) for line, record in contents.placed() if record.seq > last)
    since, n = (contents.steps[-1].line, contents.steps[-1].n) if contents.steps else (0, 0)
    suspects = [number for number in contents.damaged if since < number < line]
    if suspects:
        raise SessionError(f"{path}: line {suspects[-1]} is damaged, and it was an input. {LOST}")
    value = to_json(record)
    return Difference(path.name, line, record.seq, n, value["kind"], NO_RECORD, value, None)


def to_json(record: AnyRecord) -> dict[str, Any]:
    """A record as JSON has it."""
    value: dict[str, Any] = msgspec.json.decode(record_bytes(record))
    return value


# --- small things --------------------------------------------------------------------------------------------------


def _other(path: Path, info: SessionInfo, notes: list[str]) -> Scenario:
    """A scenario that was asked for. It is compared by what it does, so it goes under the recorded one's name."""
    loaded = load(path, robot=info.robot, mode=info.mode)
    if loaded.scenario is None:
        raise SessionError(f"the scenario {path} does not load: {loaded.errors[0]}")
    if loaded.scenario.hash != info.scenario_hash:
        notes.append(f"{path} is not what this session ran: something in it is different")
    return replace(loaded.scenario, title=info.title, folder=info.scenario_folder, hash=info.scenario_hash)


def _shown(value: Any) -> str:
    text = msgspec.json.encode(value).decode()
    return text if len(text) <= 120 else f"{text[:117]}..."
