"""`rise-engine replay`: compares a session with its replay, or plays it in real time."""

from __future__ import annotations

import os
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import click

from rise_engine.base.exit_status import DIFFERENT, OK, USAGE
from rise_engine.base.text import pluralize
from rise_engine.cli.options import JSON, SESSION, number, resolve_scenario
from rise_engine.cli.session.transcript import Transcript
from rise_engine.cli.terminal import exit_with_usage, print_lines, refusing, show
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.labels import RelabelledError
from rise_engine.session.replay import ReplayComparison, compare_replay
from rise_engine.study.labels import refuse_relabelled


@click.command("replay")
@SESSION
@click.option(
    "--scenario", metavar="DIR", type=click.Path(), help="Use this scenario instead of the session's own copy."
)
@JSON
@click.option(
    "--speed",
    metavar="N",
    type=number("--speed", "a number above 0, up to 1000", 1000, above=0),
    help="Play it into a console, N times as fast.",
)
@refusing(USAGE)
def replay_session(session: Path, scenario: str | None, as_json: bool, speed: float | None) -> int:
    """Feed the inputs of SESSION to a new engine, and compare the result with the record.

    SESSION is a session's folder, or its name in the sessions folder ($RISE_SESSIONS, or ~/rise-sessions).

    With --speed, it plays the session instead: into a console (rise-tui --replay), or as readable text if standard
    output is not a terminal.

    Exit status: 0 identical; 1 different; 2 if it cannot be read.
    """
    if speed is not None:
        if scenario is not None or as_json:
            exit_with_usage("--speed plays what was recorded: it goes with neither --scenario nor --json")
        _play(session, speed)
        return OK
    with refusing(DIFFERENT, of=RelabelledError):
        refuse_relabelled(session)
        found = compare_replay(session, None if scenario is None else Path(resolve_scenario(scenario)))
    document = {
        "session": str(session),
        "identical": found.identical,
        "inputs": found.inputs,
        "records": found.records,
        "seconds": found.seconds,
        "difference": found.difference,
        "damaged": [{"line": line, "reason": why} for line, why in found.damaged.items()],
        "missing": found.missing,
        "notes": found.notes,
    }
    show(_comparison_lines(found), document, as_json=as_json)
    return OK if found.identical else DIFFERENT


def _play(folder: Path, speed: float) -> None:
    """Play a session in real time. In a terminal, the console takes over this process."""
    if sys.stdin.isatty() and sys.stdout.isatty() and find_spec("rise_tui") is not None:
        console = [sys.executable, "-m", "rise_tui", "--replay", str(folder), "--speed", repr(speed)]
        os.execv(sys.executable, console)
    transcript, began = Transcript(), time.monotonic()
    for record in read_journal(folder / JOURNAL).read_records():
        line = transcript.line_for(record)
        if line is not None:
            time.sleep(max(0.0, record.t / speed - (time.monotonic() - began)))
            print_lines(line)


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
