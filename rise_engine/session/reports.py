"""What `rise-engine replay` and `rise-engine export` print."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rise_engine.session.folder import INFO, JOURNAL, SessionError, sessions_folder
from rise_engine.terminal import write_json
from rise_engine.text import clean

if TYPE_CHECKING:
    from rise_engine.session.export import Format
    from rise_engine.session.replay import Comparison

OK, DIFFERENT, PARTIAL, UNUSABLE, BROKEN_PIPE = 0, 1, 1, 2, 141
"""Exit statuses (docs/reference/sessions.md)."""


def find_session(text: str) -> Path:
    """The folder of the session that somebody means: by its path, or by its name in the sessions folder.

    Raises SessionError, with the nearest right name.
    """
    from rise_engine.nearest_name import suggestion

    if not text:
        raise SessionError(f"name a session: its folder, or its name in {sessions_folder()}")
    path = Path(text)
    if path.name in (JOURNAL, INFO) and path.is_file():
        path = path.parent
    if _is_session(path):
        return path
    root = sessions_folder()
    plain = text.rstrip("/")
    named = plain != "" and Path(plain).name == plain and plain not in (".", "..")
    if named and _is_session(root / plain):
        return root / plain
    if os.path.lexists(path):
        raise SessionError(f"{text} is no session: it is no folder with a {JOURNAL} or {INFO} in it")
    if not named:
        raise SessionError(f"there is no folder {text}")
    known = []
    with suppress(OSError):
        known = sorted((entry.name for entry in root.iterdir() if _is_session(entry)), reverse=True)
    raise SessionError(f"there is no session `{text}` in {root}{suggestion(text, known)}")


def play_report(session: str, speed: float) -> int:
    """Play a session in real time; the exit status. In a terminal, the console takes over this process."""
    import time
    from importlib.util import find_spec

    from rise_engine.account import Account
    from rise_engine.session.reading import read_journal

    try:
        folder = find_session(session)
        if sys.stdin.isatty() and sys.stdout.isatty() and find_spec("rise_tui") is not None:
            console = [sys.executable, "-m", "rise_tui", "--replay", str(folder), "--speed", repr(speed)]
            os.execv(sys.executable, console)
        contents = read_journal(folder / JOURNAL)
    except SessionError as error:
        _complain(f"error: {error}")
        return UNUSABLE
    account, began = Account(), time.monotonic()
    try:
        for _, record in contents.placed():
            line = account.line(record)
            if line is not None:
                time.sleep(max(0.0, record.t / speed - (time.monotonic() - began)))
                sys.stdout.write(clean(line) + "\n")
                sys.stdout.flush()
    except BrokenPipeError:
        return _nobody_reads()
    return OK


def replay_report(session: str, *, scenario: str | None, as_json: bool) -> int:
    """Print whether a session repeats, or where it first does not; the exit status."""
    from rise_engine.session.replay import compare

    try:
        folder = find_session(session)
        found = compare(folder, None if scenario is None else Path(scenario))
    except SessionError as error:
        _complain(f"error: {error}")
        return UNUSABLE
    if as_json:
        _print_json(folder, found)
    else:
        sys.stdout.write("\n".join(_account(found)) + "\n")
    return OK if found.identical else DIFFERENT


def export_report(session: str, format: Format, out: str | None) -> int:
    """Write a session's records to the file `out`, or to standard output; the exit status."""
    from rise_engine.session.disk import sentence
    from rise_engine.session.export import Export

    try:
        reader = Export(find_session(session))
    except SessionError as error:
        _complain(f"error: {error}")
        return UNUSABLE
    try:
        if out is None or out == "-":
            sys.stdout.flush()
            reader.write(format, sys.stdout.buffer)
        else:
            with Path(out).open("xb") as file:
                reader.write(format, file)
    except FileExistsError:
        _complain(f"error: {out} is there already, and nothing is ever written over: name another file")
        return UNUSABLE
    except FileNotFoundError:
        _complain(f"error: {out} cannot be made: there is no folder {Path(str(out)).parent}")
        return UNUSABLE
    except BrokenPipeError:
        return _nobody_reads()
    except OSError as error:
        where = "standard output" if out is None or out == "-" else out
        _complain(f"error: {where} could not be written: {sentence(error)}")
        return UNUSABLE
    for problem in reader.problems:
        _complain(f"warning: {problem}")
    if reader.problems:
        _complain("Everything else was exported.")
    return PARTIAL if reader.problems else OK


def _account(found: Comparison) -> list[str]:
    lines = [f"note: {note}" for note in found.notes]
    if found.difference is not None:
        lines.append(f"different: {found.difference}")
        lines.append(f"({_count(found.records, 'record')} before it {'is' if found.records == 1 else 'are'} identical)")
        return lines
    same = f"{_count(found.inputs, 'input')}, {_count(found.records, 'record')}, {found.seconds:.1f} s of session time"
    if found.identical:
        return [*lines, f"identical: {same}"]
    lines += [f"different: {JOURNAL}:{line} cannot be read: {why}" for line, why in found.damaged.items()]
    if found.missing:
        lines.append(f"different: {_count(found.missing, 'record')} of the replay cannot be read in the journal")
    return [*lines, f"(all else is identical: {same})"]


def _print_json(folder: Path, found: Comparison) -> None:
    import msgspec

    from rise_engine.json_codec import encode

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
    write_json(msgspec.json.format(encode(document), indent=2).decode())


def _is_session(path: Path) -> bool:
    return (path / JOURNAL).is_file() or (path / INFO).is_file()


def _nobody_reads() -> int:
    """Standard output is closed: what is still buffered, and the flush at exit, go nowhere."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return BROKEN_PIPE


def _complain(text: str) -> None:
    sys.stderr.write(clean(text) + "\n")


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
