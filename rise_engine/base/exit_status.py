"""The exit statuses of both programs, in one place (docs/reference/rise-engine.md has them for each command).

From 64 on they are those of sysexits.h, from 128 on a shell's for signals.
"""

from __future__ import annotations

OK = 0

REFUSED = 1
"""Nothing was started or written: the scenario has errors, or the robot cannot be had."""
DIFFERENT = 1
"""`replay`: what came out is not what was recorded."""
PARTIAL = 1
"""`export`: something could not be read, and the rest was exported."""
NO_SUCH_SESSION = 1
"""`stop`, `sessions`: there is none, or several could be meant."""

USAGE = 2
"""The command line cannot be used, or what it names cannot be read."""

TASK_FAILED = 3
"""`run --strict`: a task was rejected or aborted."""
ENDLESS = 4
"""`run`: it would never have ended."""

ALREADY_RUNNING = 3
"""`serve`: a session of the scenario runs already."""
UNFINISHED = 4
"""`serve`: an earlier session did not end, and nobody said what is to become of it."""
UNRECOVERABLE = 5
"""`serve`: it cannot be recovered."""
STILL_RUNNING = 6
"""`serve`, `run`: the session has ended, and the robot may still be doing what it was given."""

FAILED = 70
"""The program itself failed, or did not end in time (EX_SOFTWARE)."""
NOT_WRITTEN = 74
"""Not everything could be recorded or printed (EX_IOERR)."""
INTERRUPTED = 130
"""By SIGINT or SIGTERM."""
BROKEN_PIPE = 141
"""Nobody reads the output any more."""
