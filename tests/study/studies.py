"""Small studies for tests: their files, their plan, and session folders as engines leave them."""

from __future__ import annotations

import shutil
from datetime import datetime
from itertools import count
from pathlib import Path

from rise_engine.kernel.inputs import AnyInput, SessionEnded, SessionStarted
from rise_engine.session.folder import JOURNAL, SessionInfo, write_info
from rise_engine.session.journal_format import encode_header, encode_input
from rise_engine.study.model import Study
from rise_engine.study.planning import plan_study
from rise_engine.study.study_toml import load_study

DESIGN = """title = "Hesitation"
id = "hesitation"
seed = 20261122
n = 4
scenario = "scenario"
mode = "real"

[factors.hesitation]
kind = "between"
levels.yes.memory = { hesitation = true }
levels.no.memory = { hesitation = false }

[factors.noise]
kind = "within"
levels.quiet.memory = { noise = 0 }
levels.loud.memory = { noise = 3 }

[assignment]
between = "blocks"
within = "williams"
spare = 0.5

[consent]
needed = ["study"]
"""
SCENARIO = """title = "Sample"
robot = "generic"
"""
READING = '<Dialog name="Tell"><Speech><actionID>1</actionID><message>{hesitation}, {noise}</message></Speech></Dialog>'
GREET = '<Dialog name="Greet"><Speech><actionID>1</actionID><message>Hello!</message></Speech></Dialog>'
MEMORY = '{"WorkingMemory": [{"hesitation": false, "noise": 1}]}'
PEOPLE = "".join(f"P{number:02},2026-11-0{number % 9 + 1},,\n" for number in range(1, 9))
HEAD = "participant,consent_study,status,comment\n"
_seconds = count()


def write_study(folder: Path, design: str = DESIGN, people: str = HEAD + PEOPLE, *, plan: bool = True) -> Study:
    """A study's folder, with its plan unless told otherwise; the checked design."""
    (folder / "scenario" / "acts").mkdir(parents=True)
    (folder / "scenario" / "rules").mkdir()
    (folder / "scenario" / "acts" / "greet.xml").write_text(GREET, "utf-8")
    (folder / "scenario" / "acts" / "tell.xml").write_text(READING, "utf-8")
    (folder / "scenario" / "memory.json").write_text(MEMORY, "utf-8")
    (folder / "scenario" / "scenario.toml").write_text(SCENARIO, "utf-8")
    (folder / "study.toml").write_text(design, "utf-8")
    (folder / "participants.csv").write_text(people, "utf-8")
    loaded = load_study(folder)
    assert loaded.study is not None, loaded.diagnostics
    if plan:
        plan_study(loaded.study, loaded.scenarios)
    return loaded.study


def session_folder(folder: Path, started: SessionStarted, *, mode: str = "real") -> Path:
    """A session's folder before its journal."""
    number = next(_seconds)
    at = datetime.fromtimestamp(1_795_000_000 + number).astimezone()
    path = folder / "sessions" / f"{at:%Y-%m-%d_%H%M%S}_{started.participant}_{number}"
    path.mkdir(parents=True)
    info = SessionInfo(
        title="Sample",
        mode=mode,  # type: ignore[arg-type]
        robot="generic",
        seed=1,
        scenario_hash="0" * 64,
        scenario_folder=str(folder / "scenario"),
        started=at.isoformat(timespec="milliseconds"),
        participant=started.participant,
        condition=started.condition,
        study=started.study,
        slot=started.slot or 0,
        run=started.run,
        attempt=started.attempt,
        purpose=started.purpose,
        factors=dict(started.factors),
    )
    write_info(path / "session.toml", info)
    return path


def write_journal(path: Path, *inputs: AnyInput) -> None:
    """A journal with these inputs and no records."""
    lines = [encode_input(number, each) for number, each in enumerate(inputs, 1)]
    (path / JOURNAL).write_bytes(encode_header("rise-tui test") + b"".join(lines))


def remove(path: Path) -> None:
    """As somebody does who tidies up."""
    shutil.rmtree(path)


ENDED = SessionEnded(t=60.0, reason="done")
