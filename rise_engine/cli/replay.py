"""What `rise-engine replay` prints."""

from __future__ import annotations

import os
import sys
import time
from importlib.util import find_spec
from pathlib import Path

from rise_engine.cli.terminal import discard_rest, write_json
from rise_engine.cli.transcript import Transcript
from rise_engine.exit_status import BROKEN_PIPE, DIFFERENT, OK, USAGE
from rise_engine.session.errors import SessionError
from rise_engine.session.folder import JOURNAL, find_session
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.labels import RelabelledError
from rise_engine.session.replay import ReplayComparison, compare_replay
from rise_engine.study.labels import refuse_relabelled
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
        refuse_relabelled(folder)
        found = compare_replay(folder, None if scenario is None else Path(scenario))
    except RelabelledError as error:
        _print_error(f"error: {error}")
        return DIFFERENT
    except SessionError as error:
        _print_error(f"error: {error}")
        return USAGE
    if as_json:
        _print_json(folder, found)
    else:
        sys.stdout.write("\n".join(_comparison_lines(found)) + "\n")
    return OK if found.identical else DIFFERENT


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
