"""A whole study in every export format: 200 sessions of an hour, 1,200 records each.

The command writes each format in a separate process, whose CPU seconds and maximum memory are measured. The floor is a
process that only reads the lines of all journals.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path

from measure import Report

from rise_engine.kernel.inputs import Note, OutcomeReport, SessionStarted
from rise_engine.results.export.format import format_names
from rise_engine.session.journal_reader import read_journal
from rise_engine.study.plan import runs_of
from rise_engine.study.planning import plan_study
from rise_engine.study.state import OpenStudy, read_state
from rise_engine.study.study_toml import load_study
from tests.results.analysis.samples import (
    BEGAN,
    DESIGN,
    WIZARD,
    Script,
    act,
    play_session,
    sessions_of,
    task,
    write_scenario,
)

PARTICIPANTS = 100
RECORDS = 1_200
HOUR = 3_600.0
SECONDS = 60.0
MEGABYTES = 300.0
_READ = "from pathlib import Path; import sys; from rise_engine.session.journal_reader import read_journal\n"
_FLOOR = (
    _READ + "print(sum(1 for p in Path(sys.argv[1]).glob('*/journal.jsonl') for _ in read_journal(p).read_records()))"
)
_LAUNCH = """
import os, sys
child = os.posix_spawn(sys.argv[1], sys.argv[1:], os.environ)
_, status, usage = os.wait4(child, 0)
print("used", usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status))
"""
"""Starts a process and prints its memory. The system adds the parent's memory, so this parent is small."""


def hour(late: float) -> Script:
    """An hour of turns, one every 145 s. `late`: the seconds until the wizard answers."""
    script: list[tuple[float, object]] = [(1.0, task("startInteractionRule", "Visit", pressed=0.9))]
    for number in range(24):
        at = 20.0 + 145 * number
        script += [
            (at, task("markCue", pressed=at)),
            act("Hm", at + 0.8),
            act("Answer", at + 1.5 + late),
            act("Nod", at + 3.0),
            (at + 20, task("raiseEventTopic", "/tea")),
            (at + 30, task("assignValue", f"noise = {number}")),
            act("Ask", at + 40),
            act("Thanks", at + 41),
            (at + 60, Note(text=f"looks at the robot, {number}", source=WIZARD)),
        ]
    script.append((HOUR - 1, OutcomeReport(status="complete", source=WIZARD)))
    return script  # type: ignore[return-value]


def make_study(folder: Path) -> None:
    """A study of PARTICIPANTS with two sessions each."""
    folder.mkdir()
    write_scenario(folder / "scenario")
    (folder / "study.toml").write_text(DESIGN.replace("n = 3", f"n = {PARTICIPANTS}"), "utf-8")
    names = [f"P{number:03}" for number in range(1, PARTICIPANTS + 1)]
    people = "".join(f"{name},2026-11-01,,\n" for name in names)
    (folder / "participants.csv").write_text(f"participant,consent_study,status,comment\n{people}", "utf-8")
    study = load_study(folder).study
    assert study is not None
    plan_study(study, load_study(folder).scenarios)
    number = 0
    for slot, name in zip(read_state(folder).plan, names, strict=False):
        for run in runs_of(study, slot):
            first = SessionStarted(
                participant=name,
                condition=run.condition,
                factors=run.factors,
                study=study.id,
                study_hash=study.hash,
                slot=run.slot,
                run=run.run,
                attempt=1,
                purpose="counted",
            )
            began = BEGAN + timedelta(hours=2 * number)
            script = hour(0.1 * (number % 13))
            play_session(
                folder / "sessions", script, scenario=folder / "scenario", started=first, began=began, until=HOUR
            )
            number += 1
    with OpenStudy(folder):
        """Writes what the folders say into the log."""


def measured(command: Sequence[str]) -> tuple[float, float, float]:
    """Seconds of a process that must succeed, its CPU seconds, and its maximum memory in MB."""
    start = time.perf_counter()
    launch = [sys.executable, "-I", "-S", "-c", _LAUNCH, *command]
    process = subprocess.run(launch, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - start
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} ended with {process.returncode}: {process.stderr}")
    used, memory = map(float, process.stdout.rpartition("used")[2].split())
    return seconds, used, memory / (1024 * 1024 if sys.platform == "darwin" else 1024)


def main() -> bool:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "study"
        make_study(folder)
        sessions = sessions_of(folder)
        records = read_journal(sessions[0] / "journal.jsonl").records
        report = Report(
            f"Exports of a study: {len(sessions)} sessions of an hour, {records:,} records each", "CPU time and memory"
        )
        report.target("records in a session", records, RECORDS, at_least=True)
        _, seconds, memory = measured([sys.executable, "-c", _FLOOR, str(folder / "sessions")])
        report.row("floor: reading all journals", f"{seconds:.1f} s", f"{memory:.0f} MB")
        export = [sys.executable, "-m", "rise_engine", "export", str(folder)]
        for format in format_names():
            for level in ("full", "shared"):
                out = Path(name) / f"{format}-{level}"
                _, seconds, memory = measured([*export, "--format", format, "--level", level, "-o", str(out)])
                report.target(f"{format}, {level}: seconds", seconds, SECONDS, at_least=False)
                report.target(f"{format}, {level}: megabytes", memory, MEGABYTES, at_least=False)
                shutil.rmtree(out) if out.is_dir() else out.unlink()
        out = Path(name) / "bundle.zip"
        for what, *command in (
            ("bundle", "study", "bundle", str(folder), "-o", str(out)),
            ("reproduce", "reproduce", str(out)),
        ):
            _, seconds, memory = measured([sys.executable, "-m", "rise_engine", *command])
            report.row(what, f"{seconds:.1f} s", f"{memory:.0f} MB")
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
