"""Recovery: restores an unfinished session from its journal's inputs, to the state in which its engine stopped.

The folder changes only after all computations and checks. Removed and rewritten parts stay beside the journal
(`journal.torn-1`, `journal.damaged-1.jsonl`, ...), so nothing is lost. The journal is locked before it is read, so that
no engine runs the session meanwhile.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.base.files import BLOCK, Disk, error_message
from rise_engine.kernel import Kernel
from rise_engine.kernel.view import SessionView
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import JOURNAL, SessionInfo, has_ended, read_info
from rise_engine.session.journal_format import encode_header, encode_record, with_checksum
from rise_engine.session.journal_reader import JournalContents, ProgressCallback, read_journal
from rise_engine.session.lock import JournalLock
from rise_engine.session.replay import Replay
from rise_engine.session.scenario_copies import load_session_scenario

CLOCK = "clock"
_LATEST = 1e9
"""Maximum seconds in a clock file (about 30 years). A larger value is damaged."""


class RecoveredSession(Struct):
    """Everything that an engine needs to continue a session."""

    scenario: Scenario
    info: SessionInfo
    kernel: Kernel
    view: SessionView
    t: float
    """Session time to continue from: the last known one."""
    timers: dict[int, float]
    """The kernel's timers, with the session times at which they are due."""
    inputs: int
    """The number of inputs. The next input gets the next number."""
    size: int
    """The journal's size in bytes, all valid."""
    unwritten_lines: bytes
    """Records of the last input that are missing in the journal. Append them first."""
    report: list[str]
    """Findings and repairs, in sentences for a person."""
    last_wall: str = ""
    """The wall-clock label of the last known record; empty: none."""
    last_t: float = 0.0
    """That record's session time."""


def recover(
    folder: Path,
    disk: Disk | None = None,
    *,
    lock: JournalLock | None = None,
    on_progress: ProgressCallback | None = None,
) -> RecoveredSession:
    """Restore the unfinished session in `folder` to its last state, and repair its journal.

    `disk`: writes; tests replace it. `lock`: the journal's lock, for a caller that continues the session; without it,
    the journal is locked during the call only. `on_progress` gets a sentence on the progress about twice a second, if
    recovery takes long. Returns the kernel and the view after the last input, the session time in seconds, the timers
    that still run, and a report in sentences. Raises SessionError if the session runs (JournalLockedError), has ended
    or cannot be recovered. The journal is then unchanged.

        recovered = recover(find_session("2026-11-21_141503_lablinking_debug"))
        print(*recovered.report, sep="\\n")
    """
    if lock is not None:
        return _recover(folder, disk or Disk(), lock, on_progress)
    read_info(folder)  # raises if this is not a session
    lock = JournalLock(folder / JOURNAL)
    try:
        return _recover(folder, disk or Disk(), lock, on_progress)
    finally:
        lock.release()


def _recover(folder: Path, disk: Disk, lock: JournalLock, on_progress: ProgressCallback | None) -> RecoveredSession:
    path = folder / JOURNAL
    info = read_info(folder)
    if has_ended(folder) and (known := read_journal(path, on_progress)).ended:  # saves the replay
        raise _nothing_to_recover(folder, known)
    report: list[str] = []
    scenario = load_session_scenario(folder, info, report)
    kernel = Kernel(scenario, info.seed)
    replay = Replay(kernel, path, on_progress)
    view = SessionView()
    for step in replay.steps():
        for record in step.records:
            view.apply(record)
    contents = replay.contents
    if contents.ended:
        raise _nothing_to_recover(folder, contents)
    if not contents.inputs:
        raise SessionError(f"{path} has no input: nothing happened in this session, so start a new one")
    if replay.difference is not None:
        raise SessionError(
            f"the session {folder.name} does not repeat: {replay.difference}. Either the journal or session.toml was "
            f"changed, or another version of this program wrote it ({_versions_text(info)}): recover it with that "
            "version. It can be exported with this one (rise-engine export)"
        )
    fresh_replay = Replay(Kernel(scenario, info.seed), path, on_progress)
    try:
        size = _repair_journal(contents, replay, fresh_replay, info, disk, lock, report)
    except OSError as error:
        raise SessionError(f"{path} cannot be repaired: {error_message(error)}") from None
    if replay.unwritten:
        count = len(replay.unwritten)
        what = "record of the last input was" if count == 1 else "records of the last input were"
        report.append(f"{count} {what} not in the journal and {'is' if count == 1 else 'are'} added to it now.")
    return RecoveredSession(
        scenario=kernel.scenario,
        info=info,
        kernel=kernel,
        view=view,
        t=max(contents.input_t, read_clock(folder)),
        timers=replay.timers,
        inputs=contents.inputs,
        size=size,
        unwritten_lines=b"".join(with_checksum(encode_record(record)) for record in replay.unwritten),
        last_wall=contents.last_record.wall if contents.last_record is not None else "",
        last_t=contents.last_record.t if contents.last_record is not None else 0.0,
        report=[text if text.endswith(".") else f"{text[:1].upper()}{text[1:]}." for text in report],
    )


def _nothing_to_recover(folder: Path, contents: JournalContents) -> SessionError:
    last = contents.last_record
    when = f"at {last.wall}" if last is not None and last.wall else f"after {contents.seconds:.1f} s"
    return SessionError(f"the session {folder.name} ended properly {when}: there is nothing to recover")


def _repair_journal(
    contents: JournalContents,
    replay: Replay,
    fresh_replay: Replay,
    info: SessionInfo,
    disk: Disk,
    lock: JournalLock,
    report: list[str],
) -> int:
    """Repair a torn or damaged journal, and return its new size. Raises OSError.

    `replay`: the finished replay, which shows the missing lines. `fresh_replay`: a new one, which makes them again.
    """
    path = contents.path
    if contents.torn:
        kept = _save_aside(path, "torn-{}", [contents.torn], disk)
        report.append(
            f"The end of {path.name} was torn: its last {len(contents.torn)} bytes cannot be read, because "
            f"the engine or the computer went away while they were written. They are kept in {kept}."
        )
    if contents.damaged or replay.missing:
        with path.open("rb") as before:
            kept = _save_aside(path, "damaged-{}.jsonl", iter(lambda: before.read(BLOCK), b""), disk)
        size = _replace_journal(path, _intact_lines(contents, replay, fresh_replay, info), disk, lock)
        if contents.damaged:
            places = ", ".join(map(str, contents.damaged))
            lines = f"line {places} was" if len(contents.damaged) == 1 else f"lines {places} were"
            found = f"{lines} damaged"
        else:
            found = f"{replay.missing} of its records were missing"
        report.append(
            f"In {path.name}, {found}. What is recorded there follows from the inputs, which are whole: it was made "
            f"again. The journal as it was is kept in {kept}."
        )
        return size
    if contents.torn:
        descriptor = disk.open(path, create=False)
        try:
            os.ftruncate(descriptor, contents.size)
            disk.sync(descriptor)
        finally:
            disk.close(descriptor)
    return contents.size


def _intact_lines(
    contents: JournalContents, replay: Replay, fresh_replay: Replay, info: SessionInfo
) -> Iterator[bytes]:
    """Yield the lines of the repaired journal: valid lines unchanged, the others made again."""
    if contents.header is None:
        program = " ".join(("rise-tui", info.versions.get("rise-tui", ""))).strip()
        yield encode_header(program)
    else:
        with contents.path.open("rb") as file:
            yield file.readline()
    unwritten = {record.seq for record in replay.unwritten}
    for step in fresh_replay.steps():
        yield step.line
        for record, written in zip(step.records, step.written, strict=True):
            if written is not None:
                yield written
            elif record.seq not in unwritten:
                yield with_checksum(encode_record(record))


def _replace_journal(path: Path, lines: Iterable[bytes], disk: Disk, lock: JournalLock) -> int:
    """Replace the journal by one of these lines, and return its size."""
    fresh = path.with_name(f"{path.name}.new")
    fresh.unlink(missing_ok=True)  # from an interrupted repair
    size = disk.write_new(fresh, lines)
    with lock.move_to(fresh):
        fresh.replace(path)
    disk.sync_folder(path.parent)
    return size


def _save_aside(journal: Path, name: str, data: Iterable[bytes], disk: Disk) -> str:
    """Write `data` durably to a new file beside the journal, and return its name."""
    number = 1
    while (kept := journal.with_name(f"{journal.stem}.{name.format(number)}")).exists():
        number += 1
    disk.write_new(kept, data)
    disk.sync_folder(journal.parent)
    return kept.name


def read_clock(folder: Path) -> float:
    """Read the session time that the engine last noted; 0 if it cannot be read."""
    try:
        noted = float((folder / CLOCK).read_bytes())
    except (OSError, ValueError):
        return 0.0
    return noted if 0 <= noted <= _LATEST else 0.0


def _versions_text(info: SessionInfo) -> str:
    return ", ".join(f"{name} {version}" for name, version in info.versions.items()) or "version unknown"
