"""Commands of `rise-engine` in a Python that has started with a certain environment.

What a start decides (encodings, standard streams that are closed) is that of one process, of which each command is a
fork. The commands are the arguments, with `NEXT` between two; their results go to the file that RESULTS names.
"""

from __future__ import annotations

import gc
import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.forked import load_program
from tests.patience import PATIENCE

NEXT = "--next--"
RESULTS = "RISE_TEST_RESULTS"
ROOT = Path(__file__).parents[2]


def run_all(environment: dict[str, str], *commands: tuple[object, ...]) -> list[subprocess.CompletedProcess[bytes]]:
    """The results of the commands, all with this environment."""
    arguments = [each for command in commands for each in (NEXT, *map(str, command))][1:]
    with tempfile.NamedTemporaryFile() as results:
        subprocess.run(
            [sys.executable, "-m", "tests.cli.started_anew", *arguments],
            env={**os.environ, **environment, RESULTS: results.name},
            cwd=ROOT,
            timeout=PATIENCE,
            check=True,
        )
        found = pickle.loads(results.read())
    return [subprocess.CompletedProcess(command, *each) for command, each in zip(commands, found, strict=True)]


def _run(arguments: list[str]) -> tuple[int, bytes, bytes]:
    from rise_engine.cli import main

    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
        child = os.fork()
        if child == 0:
            os.dup2(out.fileno(), 1)
            os.dup2(errors.fileno(), 2)
            sys.argv = ["rise-engine", *arguments]
            main()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        return status, os.pread(out.fileno(), 2**24, 0), os.pread(errors.fileno(), 2**24, 0)


def _main() -> None:
    commands: list[list[str]] = [[]]
    for argument in sys.argv[1:]:
        if argument == NEXT:
            commands.append([])
        else:
            commands[-1].append(argument)
    load_program()
    gc.freeze()
    results = [_run(each) for each in commands]
    Path(os.environ[RESULTS]).write_bytes(pickle.dumps(results))


if __name__ == "__main__":
    _main()
