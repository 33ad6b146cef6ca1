"""Consoles on a day of a study that are killed while sessions begin, run and end.

    python -m tests.faults.study_consoles --kills 100

Somebody at a console begins the next session, or ends the one that runs; after a random time the console is killed, and
another one is opened. Its engines live on. After every kill `tests.study.invariants` must hold, and in the end every
participant is done.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import tempfile
import threading
from contextlib import suppress
from pathlib import Path
from shutil import rmtree

from rise_engine.study.state import read_state
from tests.study.invariants import check_day
from tests.study.studies import DESIGN, HEAD, write_study
from tests.tui.terminals import Terminal, kill_engines

SMALL = (80, 24)
RIGHT = b"\x1b[C"
LONGEST = 7.0
"""Seconds after which a console is killed at the latest; beginning and ending a session takes less."""


class Killed(Exception):
    """The console has gone in the midst of what was done with it."""


def step(it: Terminal) -> None:
    """Begin the next session if none runs, else end the one that does."""
    while "PARTICIPANTS" not in it.text and "LIVE" not in it.text:
        assert it.read(60.0), "it ended"
    if "PARTICIPANTS" in it.text:
        it.until_screen("next: ")
        it.still()
        it.press(b"\r")
        it.until_screen("enter: begin the session")
        it.still(0.8)  # an Enter that is held down counts once
        it.press(b"\r")
    it.until_screen("LIVE")
    it.still()
    it.press(b"\x03")
    it.until_screen("End the session (ctrl+x)")
    it.press(b"\x18")
    it.until_screen("Type end and press enter")
    it.press(RIGHT)
    it.until_screen("● complete")
    for keys in (b"\r", b"\r", b"end\r"):
        it.press(keys)
        it.still()
    it.until_screen(": complete")


def console(folder: Path, home: str, after: float | None) -> bool:
    """One console, killed after so many seconds; whether it had done its work before."""
    it = Terminal("--config", str(folder), "--wizard", "anna", home=home, size=SMALL)
    killed = threading.Event()

    def kill() -> None:
        killed.set()
        with suppress(ProcessLookupError):
            os.kill(it.process.pid, signal.SIGKILL)

    timer = threading.Timer(after, kill) if after is not None else None
    if timer is not None:
        timer.start()
    try:
        step(it)
    except (AssertionError, OSError) as error:
        if not killed.is_set():
            raise
        raise Killed from error
    finally:
        if timer is not None:
            timer.cancel()
        it.process.kill()
        it.process.wait()
        os.close(it.master)
    return True


def run(kills: int, seed: int, home: str) -> dict[str, int]:
    """Studies, one after the other, until so many consoles were killed; how many were, and what was done.

    :raises AssertionError: a slot was taken twice or lost.
    """
    dice = random.Random(seed)
    counts = {"kills": 0, "studies": 0, "sessions": 0}
    people = HEAD + "P01,2026-11-01,,\nP02,2026-11-01,,\nP03,2026-11-01,,\n"
    while counts["kills"] < kills:
        counts["studies"] += 1
        folder = Path(home, f"study-{counts['studies']}")
        write_study(folder, DESIGN.replace('mode = "real"', 'mode = "real"\nrobot = "generic"'), people)
        while any(each.state != "complete" for each in read_state(folder).standing.participants):
            spared = counts["kills"] >= kills or dice.random() < 0.2
            try:
                console(folder, home, None if spared else dice.uniform(0.2, LONGEST))
            except Killed:
                counts["kills"] += 1
            check_day(folder)
        standing = read_state(folder).standing
        assert [each.slot for each in standing.participants] == [1, 2, 3]
        assert all(len(each.sessions) == 2 for each in standing.participants), "a session was begun twice"
        counts["sessions"] += sum(len(each.sessions) for each in standing.participants)
    return counts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**6))
    options = parser.parse_args()
    print(f"seed {options.seed}", flush=True)
    home = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    os.environ["RISE_RUNTIME"] = str(Path(home, "run"))
    try:
        print(json.dumps(run(options.kills, options.seed, home)))
    finally:
        kill_engines(home)
    rmtree(home)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
