"""Programs that checks run: a study's own, `run = ["./check-tracker.sh"]`, and children of this program.

A program gets no shell, no input and a time limit. It leads its own process group, which is ended at the limit, or when
the caller gives up. All functions block; `rise_engine.checks.runner` calls them.

A child makes a check that talks to robots or takes long, so that a hang or a crash does not affect the program that
started it. It (`rise_engine.checks.devices`) reads one request from standard input and writes one `Finding` to standard
output.
"""

from __future__ import annotations

import errno
import os
import selectors
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Event
from time import monotonic
from typing import IO

import msgspec
from msgspec import Struct

from rise_engine.base.json_codec import encode
from rise_engine.base.text import clean
from rise_engine.checks.outcome import CheckContext, Finding
from rise_engine.ports.bridge import RosConnection
from rise_engine.scenario.model import Mode
from rise_engine.study.checks import program_problem
from rise_engine.study.model import RecordingSettings
from rise_engine.study.participants import SessionKind

TICK_SECONDS = 0.05
"""Interval for noticing that the program has ended while another process still holds its output open."""
GRACE_SECONDS = 1.0
"""Seconds between the request to end (SIGTERM) and the forced end (SIGKILL)."""
KEPT_BYTES = 65_536
"""Maximum bytes of stored output. Further output is read and dropped, so that the program does not block."""
SHOWN_CHARACTERS = 200
"""Maximum length of a line that becomes the value of a check."""


class ProgramEnd(Struct, frozen=True):
    """How a program ended."""

    status: int | None
    """The exit status; negative: the signal that ended it; None: it exceeded its limit, or the caller gave up."""
    output: bytes = b""
    errors: bytes = b""
    problem: str = ""
    """Why it could not be started, in a sentence."""


def run_program(
    arguments: Sequence[str],
    folder: Path,
    limit: float,
    *,
    environment: Mapping[str, str] | None = None,
    given: bytes = b"",
    cancelled: Event | None = None,
) -> ProgramEnd:
    """Run a program and wait (blocking) for its end, for `limit` seconds at most and a little longer.

    Processes that it leaves running when it ends by itself continue: it may have started what it checks.

    :param arguments: the program and its arguments; a path is relative to the folder.
    :param folder: its working directory.
    :param limit: seconds after which its process group is ended.
    :param environment: added to this process' own.
    :param given: its standard input, at most what a pipe holds (64 KiB on Linux, 16 KiB elsewhere).
    :param cancelled: set by another thread when the caller gives up.
    """
    until = monotonic() + limit
    try:
        process = subprocess.Popen(
            arguments,
            cwd=folder,
            env={**os.environ, **(environment or {})},
            stdin=subprocess.PIPE if given else subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
    except (OSError, ValueError) as error:
        return ProgramEnd(None, problem=_start_problem(arguments[0], folder, error))
    if process.stdin is not None:
        with suppress(OSError):
            process.stdin.write(given)
            process.stdin.close()
    assert process.stdout is not None and process.stderr is not None
    pipes = _Pipes(process.stdout, process.stderr)
    try:
        while not pipes.all_closed and process.poll() is None and _may_go_on(until, cancelled):
            pipes.read(TICK_SECONDS)
        while process.poll() is None and _may_go_on(until, cancelled):  # it has closed its output but still runs
            with suppress(subprocess.TimeoutExpired):
                process.wait(TICK_SECONDS)
        status = process.poll()
        if status is None:
            _end_group(process)
        pipes.read_rest()
        return ProgramEnd(status, bytes(pipes.kept[0]), bytes(pipes.kept[1]))
    finally:
        pipes.close()


def _may_go_on(until: float, cancelled: Event | None) -> bool:
    return monotonic() < until and not (cancelled is not None and cancelled.is_set())


class _Pipes:
    """The stored output of a program."""

    def __init__(self, *streams: IO[bytes]) -> None:
        self._streams = streams
        self.kept = [bytearray() for _ in streams]
        self._selector = selectors.DefaultSelector()
        for index, stream in enumerate(streams):
            os.set_blocking(stream.fileno(), False)
            self._selector.register(stream, selectors.EVENT_READ, index)

    @property
    def all_closed(self) -> bool:
        return not self._selector.get_map()

    def read(self, timeout: float) -> bool:
        """Read the available output, or wait for it. Returns whether there was any."""
        events = self._selector.select(timeout)
        for key, _ in events:
            with suppress(BlockingIOError):
                chunk = os.read(key.fd, KEPT_BYTES)
                kept = self.kept[key.data]
                kept += chunk[: KEPT_BYTES - len(kept)]
                if not chunk:
                    self._selector.unregister(key.fileobj)
        return bool(events)

    def read_rest(self) -> None:
        """Read the rest of the output after the program's end, but not what other processes still write."""
        for _ in range(64):
            if self.all_closed or not self.read(0):
                return

    def close(self) -> None:
        self._selector.close()
        for stream in self._streams:
            stream.close()


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """End a program with all processes of its group: first politely, then by force."""
    _signal_group(process.pid, signal.SIGTERM)
    with suppress(subprocess.TimeoutExpired):
        process.wait(GRACE_SECONDS)
    _signal_group(process.pid, signal.SIGKILL)  # also the processes that ignored SIGTERM
    with suppress(subprocess.TimeoutExpired):  # a process that hangs in the kernel stays
        process.wait(GRACE_SECONDS)


def _signal_group(group: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, number)


# --- the programs of a study ----------------------------------------------------------------------------------------


def run_program_check(
    arguments: Sequence[str], context: CheckContext, limit: float, cancelled: Event | None = None
) -> Finding:
    """Run a study's own check (blocking). Exit status 0 passes; the first line of output is the value."""
    study = context.study
    if problem := program_problem(arguments, study.folder):
        return Finding(False, reason=problem)
    environment = {
        "RISE_PARTICIPANT": context.participant,
        "RISE_RUN": str(context.run) if context.run else "",
        "RISE_STUDY": study.id,
    }
    end = run_program(arguments, Path(study.folder), limit, environment=environment, cancelled=cancelled)
    name = arguments[0]
    value = first_line(end.output)
    if end.problem:
        return Finding(False, reason=end.problem)
    if end.status is None:
        return Finding(False, value, f"{name} did not end within {limit:g} s, and was ended")
    if end.status == 0:
        return Finding(True, value)
    how = (
        f"{name} ended with exit status {end.status}" if end.status > 0 else f"{_signal_name(-end.status)} ended {name}"
    )
    first = first_line(end.errors)
    if value or not first:
        return Finding(False, value, how if value else f"{how}, and it said nothing")
    return Finding(False, reason=f"{how}: {first}")


def first_line(output: bytes) -> str:
    """Return the first non-empty line, safe to show; empty: there is none."""
    for line in output.decode("utf-8", "replace").splitlines():
        if text := clean(line).strip():
            return text if len(text) <= SHOWN_CHARACTERS else f"{text[: SHOWN_CHARACTERS - 1]}…"
    return ""


def _start_problem(name: str, folder: Path, error: OSError | ValueError) -> str:
    """Return why the system did not start a program."""
    if isinstance(error, ValueError):
        return f"{name} cannot be started: {error}"
    if not folder.is_dir():
        return f"{name} cannot be started: there is no folder {folder}"
    if error.errno == errno.ENOEXEC:
        return f"{name} cannot be started: its first line must name an interpreter, such as #!/bin/sh"
    return f"{name} cannot be started: {error.strerror or error}"


def _signal_name(number: int) -> str:
    with suppress(ValueError):
        return signal.Signals(number).name
    return f"signal {number}"


# --- checks in a process of their own ---------------------------------------------------------------------------------


KINDS = frozenset({"robot", "sound", "replay", "recorder", "explored"})


class ChildRequest(Struct, frozen=True):
    """The request for a child."""

    kind: str
    """One of KINDS."""
    scenario: str = ""
    robot: str | None = None
    mode: Mode = "debug"
    ros: RosConnection = RosConnection()
    sessions: str = ""
    """For `replay`: the study's folder of sessions."""
    study: str = ""
    session: SessionKind | None = None
    """For `explored`: the kind of the session that will begin; None: every kind."""
    recording: RecordingSettings | None = None
    """For `recorder`: the recorders."""
    task: str = ""
    """The study's id."""


def run_in_child(request: ChildRequest, limit: float, cancelled: Event | None = None) -> Finding:
    """Run a check in a child and return its finding (blocking).

    :param request: the request.
    :param limit: seconds after which the child is ended.
    :param cancelled: set by another thread when the caller gives up.
    """
    arguments = [sys.executable, "-m", "rise_engine.checks.devices"]
    # In a checkout, this process' folder is the one in which the program is found.
    end = run_program(arguments, Path.cwd(), limit, given=encode(request), cancelled=cancelled)
    if end.problem:
        return Finding(False, reason=end.problem)
    if end.status is None:
        return Finding(False, reason=f"there was no answer within {limit:g} s")
    try:
        return msgspec.json.decode(end.output, type=Finding)
    except msgspec.DecodeError:
        last = last_line(end.errors)
        how = f"the check itself failed (exit status {end.status})"
        return Finding(False, reason=": ".join(filter(None, (how, last))))


def last_line(output: bytes) -> str:
    """Return the last non-empty line, safe to show; for a traceback, the error."""
    return next((text for line in reversed(output.splitlines()) if (text := first_line(line))), "")
