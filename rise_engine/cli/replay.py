"""What `rise-engine replay` and `rise-engine export` print."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import BinaryIO

from rise_engine.cli.terminal import discard_rest, write_json
from rise_engine.cli.transcript import Transcript
from rise_engine.exit_status import BROKEN_PIPE, DIFFERENT, OK, PARTIAL, USAGE
from rise_engine.session.disk import error_message
from rise_engine.session.errors import SessionError
from rise_engine.session.export import ExportFormat, SessionExport
from rise_engine.session.folder import JOURNAL, find_session, read_info
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.levels import ExportLevel
from rise_engine.session.replay import ReplayComparison, compare_replay
from rise_engine.study.study_log import LockedLog, StudyLogError
from rise_engine.study.traces import study_of_session, wizard_names
from rise_engine.text import clean, pluralize


def play_report(session: str, speed: float) -> int:
    """Play a session in real time; the exit status. In a terminal, the console takes over this process."""
    try:
        folder = find_session(session)
        if sys.stdin.isatty() and sys.stdout.isatty() and find_spec("rise_tui") is not None:
            console = [sys.executable, "-m", "rise_tui", "--replay", str(folder), "--speed", repr(speed)]
            os.execv(sys.executable, console)
        contents = read_journal(folder / JOURNAL)
    except SessionError as error:
        _print_error(f"error: {error}")
        return USAGE
    transcript, began = Transcript(), time.monotonic()
    try:
        for record in contents.read_records():
            line = transcript.line_for(record)
            if line is not None:
                time.sleep(max(0.0, record.t / speed - (time.monotonic() - began)))
                sys.stdout.write(clean(line) + "\n")
                sys.stdout.flush()
    except BrokenPipeError:
        discard_rest(sys.stdout)
        return BROKEN_PIPE
    return OK


def replay_report(session: str, *, scenario: str | None, as_json: bool) -> int:
    """Print whether a session repeats, or where it first does not; the exit status."""
    try:
        folder = find_session(session)
        found = compare_replay(folder, None if scenario is None else Path(scenario))
    except SessionError as error:
        _print_error(f"error: {error}")
        return USAGE
    if as_json:
        _print_json(folder, found)
    else:
        sys.stdout.write("\n".join(_comparison_lines(found)) + "\n")
    return OK if found.identical else DIFFERENT


def export_report(
    session: str, format: ExportFormat, out: str | None, level: ExportLevel = "full", private: Sequence[str] = ()
) -> int:
    """Write a session's records to the file `out`, or to standard output; the exit status.

    Of a session of a study, its log says what was exported to which file, before anything is written there.
    """
    try:
        folder = find_session(session)
        study = study_of_session(folder)
        exporter = SessionExport(folder, level=level, private=private, wizards=wizard_names(study))
    except SessionError as error:
        _print_error(f"error: {error}")
        return USAGE
    try:
        if out is None or out == "-":
            sys.stdout.flush()
            exporter.write(format, sys.stdout.buffer)
        else:
            with _open_new_file(Path(out)) as file:
                _note_export(study, folder, Path(out), format, level)
                exporter.write(format, file)
    except FileExistsError:
        _print_error(f"error: {out} is there already, and nothing is ever written over: name another file")
        return USAGE
    except FileNotFoundError:
        _print_error(f"error: {out} cannot be made: there is no folder {Path(str(out)).parent}")
        return USAGE
    except BrokenPipeError:
        discard_rest(sys.stdout)
        return BROKEN_PIPE
    except OSError as error:
        where = "standard output" if out is None or out == "-" else out
        _print_error(f"error: {where} could not be written: {error_message(error)}")
        return USAGE
    for problem in exporter.problems:
        _print_error(f"warning: {problem}")
    if exporter.problems:
        _print_error("Everything else was exported.")
    return PARTIAL if exporter.problems else OK


def _open_new_file(path: Path) -> BinaryIO:
    """Only its owner can read it. Raises OSError, FileExistsError when there is one."""
    return os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600), "wb")


def _note_export(study: Path | None, folder: Path, out: Path, format: ExportFormat, level: ExportLevel) -> None:
    """So that a participant who withdraws is taken out of the file, too."""
    if study is None:
        return
    path = out.resolve()
    named = str(path.relative_to(study)) if path.is_relative_to(study) else str(path)
    try:
        participant = read_info(folder).participant
        with LockedLog(study) as log:
            log.append(
                "exported", path=named, format=format, level=level, sessions=[folder.name], participants=[participant]
            )
    except (SessionError, StudyLogError) as error:
        _print_error(f"warning: the study does not know of {out}, so a withdrawal will not erase it: {error}")


def _comparison_lines(found: ReplayComparison) -> list[str]:
    lines = [f"note: {note}" for note in found.notes]
    if found.difference is not None:
        lines.append(f"different: {found.difference}")
        lines.append(
            f"({pluralize(found.records, 'record')} before it {'is' if found.records == 1 else 'are'} identical)"
        )
        return lines
    inputs, records = pluralize(found.inputs, "input"), pluralize(found.records, "record")
    same = f"{inputs}, {records}, {found.seconds:.1f} s of session time"
    if found.identical:
        return [*lines, f"identical: {same}"]
    lines += [f"different: {JOURNAL}:{line} cannot be read: {why}" for line, why in found.damaged.items()]
    if found.missing:
        lines.append(f"different: {pluralize(found.missing, 'record')} of the replay cannot be read in the journal")
    return [*lines, f"(all else is identical: {same})"]


def _print_json(folder: Path, found: ReplayComparison) -> None:
    document = {
        "session": str(folder),
        "identical": found.identical,
        "inputs": found.inputs,
        "records": found.records,
        "seconds": found.seconds,
        "difference": found.difference,
        "damaged": [{"line": line, "reason": why} for line, why in found.damaged.items()],
        "missing": found.missing,
        "notes": found.notes,
    }
    write_json(document)


def _print_error(text: str) -> None:
    sys.stderr.write(clean(text) + "\n")
