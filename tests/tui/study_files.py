"""A small study on the disk, for consoles that are started as people start them."""

from __future__ import annotations

import shutil
from pathlib import Path

from rise_engine.study.model import Study
from rise_engine.study.planning import plan_study
from rise_engine.study.study_toml import load_study
from tests.tui.fake import DEMO

DESIGN = """title = "Side of the fork"
id = "forks"
seed = 7
n = 4
scenario = "scenario"
mode = "real"
robot = "generic"

[factors.side]
kind = "between"
levels.left.memory = { side = "left" }
levels.right.memory = { side = "right" }

[consent]
needed = ["study"]

[wizards]
anna = "W1"

[[check]]
id = "consent"
auto = "consent"

[[check]]
id = "lamp"
ask = "The lamp is on"

[[check]]
id = "debrief"
ask = "They were debriefed"
when = "after"
"""
PEOPLE = "participant,consent_study,status,comment\nP01,2026-11-02,,\nP02,2026-11-03,,\nP03,,,\nP04,2026-11-04,,\n"


def write_study(folder: Path, design: str = DESIGN, people: str = PEOPLE, *, planned: bool = True) -> Study:
    """The demo scenario as a study of four; the third has not consented."""
    shutil.copytree(DEMO, folder / "scenario")
    (folder / "study.toml").write_text(design, "utf-8")
    (folder / "participants.csv").write_text(people, "utf-8")
    loaded = load_study(folder)
    assert loaded.study is not None, [str(each) for each in loaded.errors]
    if planned:
        plan_study(loaded.study, loaded.scenarios)
    return loaded.study
