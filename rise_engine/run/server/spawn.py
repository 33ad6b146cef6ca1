"""Starts an engine in the background, without a terminal, and reads its report whether it serves."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from select import select
from typing import TypeAlias

import msgspec
from msgspec import Struct

from rise_engine.base import exit_status
from rise_engine.base.json_codec import encode
from rise_engine.base.text import restore_all_surrogates
from rise_engine.run.protocol.registry import RegistryError, runtime_folder
from rise_engine.run.protocol.session_options import SessionOptions

SILENCE_SECONDS = 30.0
"""Maximum silence in seconds of an engine before it serves. A recovery reports its progress."""


class StartupProgress(Struct, frozen=True, tag="progress"):
    """The progress of an engine's slow start."""

    sentence: str


class EngineStarted(Struct, frozen=True, tag="started"):
    """The last message of a process that serves."""

    name: str
    """The session's name, for `SocketClient`."""
    folder: str
    lines: list[str] = []
    """Sentences about a recovery."""
    recovered: bool = False
    """Whether a session that did not end continues."""


class EngineRefused(Struct, frozen=True, tag="refused"):
    """The last message of a process that does not serve: nothing was started."""

    code: int
    """The exit status."""
    lines: list[str]
    unfinished: list[tuple[str, str]] = []
    """Sessions that could be recovered: folder, and a sentence about it."""
    others: list[tuple[str, str]] = []
    """Unfinished sessions of other participants or conditions than the named ones."""
    socket: str = ""
    """The socket of a session that already runs, if its name does not lead there."""


StartOutcome: TypeAlias = EngineStarted | EngineRefused

ReportStartup: TypeAlias = Callable[[StartupProgress | StartOutcome], None]
"""Takes an engine's progress, and finally whether it serves."""


class EngineProcess:
    """An engine that starts while the caller can do something else."""

    def __init__(self, options: SessionOptions) -> None:
        """Start the engine. `wait` returns the outcome, also if the start failed."""
        self._process: subprocess.Popen[bytes] | None = None
        self._problem = ""
        self._report_pipe, ready = os.pipe()
        try:
            self._log = runtime_folder() / "engine.log"
            log = os.open(self._log, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600)
            self._logged = os.fstat(log).st_size
        except (OSError, RegistryError) as error:
            self._problem = str(error)
            os.close(ready)
            return
        encoded = encode(options).decode()
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "rise_engine.run.server.process_main", encoded, str(ready)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                pass_fds=(ready,),
                start_new_session=True,
                close_fds=True,
            )
        except OSError as error:
            self._problem = f"the engine's process cannot be started: {error.strerror or error}"
        finally:
            os.close(ready)
            os.close(log)

    def wait(self, on_progress: Callable[[str], object] = lambda sentence: None) -> StartOutcome:
        """Wait (blocking) until the engine serves or refuses, or is silent for too long.

        :param on_progress: gets sentences about the progress.
        """
        outcome = self._read_outcome(on_progress) if self._process is not None else None
        os.close(self._report_pipe)
        if outcome is None or self._process is None:
            return self._refusal_from_log()
        if isinstance(outcome, EngineStarted):
            self._process.returncode = 0  # detached: no warning that it still runs
        else:
            self._process.wait()
        return outcome

    def _read_outcome(self, on_progress: Callable[[str], object]) -> StartOutcome | None:
        """Return its last message; None: it has gone, or is silent for too long."""
        text = b""
        while True:
            if not select([self._report_pipe], [], [], SILENCE_SECONDS)[0]:
                self._problem = f"the engine said nothing within {SILENCE_SECONDS:g} s"
                return None
            chunk = os.read(self._report_pipe, 65_536)
            if not chunk:
                return None
            *lines, text = (text + chunk).split(b"\n")
            for line in lines:
                message: StartupProgress | StartOutcome = msgspec.convert(
                    restore_all_surrogates(msgspec.json.decode(line)), StartupProgress | EngineStarted | EngineRefused
                )
                if not isinstance(message, StartupProgress):
                    return message
                on_progress(message.sentence)

    def _refusal_from_log(self) -> EngineRefused:
        """Make a refusal from its log, because it sent no report."""
        if self._process is None:
            return EngineRefused(exit_status.FAILED, [self._problem])
        if self._problem:
            self._process.kill()
        code = self._process.wait()
        with self._log.open("rb") as log:
            log.seek(self._logged)
            lines = log.read().decode("utf-8", "replace").splitlines()
        ended = f"the engine ended before it served (its log is {self._log})"
        return EngineRefused(code if code > 0 else exit_status.FAILED, [self._problem or ended, *lines[-20:]])


def start_engine(options: SessionOptions, on_progress: Callable[[str], object] = lambda sentence: None) -> StartOutcome:
    """Start an engine and wait (blocking) until it serves or refuses.

    :param options: what to run.
    :param on_progress: gets sentences about the progress.
    """
    return EngineProcess(options).wait(on_progress)
