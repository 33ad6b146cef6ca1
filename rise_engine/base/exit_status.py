"""The exit statuses of both programs (docs/reference/rise-engine.md lists them for each command).

Those from 64 on are from sysexits.h, those from 128 on are shell statuses for signals.
"""

from __future__ import annotations

OK = 0

REFUSED = 1
"""Nothing was started or written: the scenario has errors, or the robot cannot be used."""
DIFFERENT = 1
"""`replay`: the result differs from the record."""
PARTIAL = 1
"""`export`: some parts could not be read; the rest was exported."""
NO_SUCH_SESSION = 1
"""`stop`, `sessions`: there is no such session, or several match."""

USAGE = 2
"""The command line is wrong, or a named file cannot be read."""

TASK_FAILED = 3
"""`run --strict`: a task was rejected or aborted."""
ENDLESS = 4
"""`run`: the session would never end."""

ALREADY_RUNNING = 3
"""`serve`: a session of the scenario is already running."""
UNFINISHED = 4
"""`serve`: an earlier session did not end, and the command line does not say whether to recover it."""
UNRECOVERABLE = 5
"""`serve`: the session cannot be recovered."""
STILL_RUNNING = 6
"""`serve`, `run`: the session has ended, but the robot may still be executing a task."""

FAILED = 70
"""The program itself failed, or did not end in time (EX_SOFTWARE)."""
NOT_WRITTEN = 74
"""Some output could not be recorded or printed (EX_IOERR)."""
INTERRUPTED = 130
"""SIGINT or SIGTERM ended the program."""
BROKEN_PIPE = 141
"""The reader of the output has gone."""
