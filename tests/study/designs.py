"""Study folders made in a test from a few texts."""

from __future__ import annotations

from pathlib import Path

from rise_engine.study.model import AssignmentSettings, BetweenMethod, Factor, Level, Study, WithinMethod
from rise_engine.study.plan import with_hashes
from rise_engine.study.study_toml import StudyLoad, load_study
from tests.scenario.folders import SPEECH, act, folder

TELL = "{hesitation}, {noise}, {mood}, {person.age|three}, {later}"
SCENARIO: dict[str, str | bytes] = {
    "scenario/scenario.toml": 'title = "Lamps"\n',
    "scenario/acts/a.xml": act(SPEECH),
    "scenario/acts/tell.xml": act(SPEECH.replace("Hello", TELL)).replace('name="A"', 'name="Tell"'),
    "scenario/memory.json": '{"hesitation": false, "noise": 1, "mood": "calm", "person": {"age": 3}, "later": null, '
    '"unread": 0}',
}
DESIGN = """\
title = "Lamps"
id = "lamps"
seed = 7
n = 8
mode = "debug"

[factors.hesitation]
kind = "between"
levels.yes.memory = { hesitation = true }
levels.no.memory = { hesitation = false }

[factors.noise]
kind = "within"
levels.quiet = {}
levels.loud.memory = { noise = 3 }
labels = { quiet = "A", loud = "B" }

[assignment]
block = [1, 2]
strata = ["language"]

[strata]
language = ["de", "en"]

[consent]
needed = ["study"]
"""
HEADER = "participant,language,consent_study,status,comment\n"


def study_folder(path: Path, toml: str = DESIGN, participants: str = HEADER, **more: str) -> Path:
    """A study with one small scenario, in `path`; `more` are further files, `__` in their names is a slash."""
    files = {name.replace("__", "/").replace("_csv", ".csv"): text for name, text in more.items()}
    return folder(path, {**SCENARIO, "study.toml": toml, "participants.csv": participants, **files})


def loaded_study(path: Path, toml: str = DESIGN) -> StudyLoad:
    return load_study(study_folder(path, toml))


def make_study(
    between: list[int],
    within: list[int] | None = None,
    *,
    n: int = 8,
    seed: int = 1,
    strata: list[int] | None = None,
    block: tuple[int, ...] = (1,),
    method: BetweenMethod = "blocks",
    orders: WithinMethod = "williams",
    spare: float = 0.25,
) -> Study:
    """A study of so many levels for each factor and so many values for each stratum; it is in no folder."""
    sizes = [("between", size) for size in between] + [("within", size) for size in within or []]
    factors = tuple(
        Factor(f"f{at}", kind, tuple(Level(f"{'abcdefghij'[level]}{at}") for level in range(size)))  # type: ignore[arg-type]
        for at, (kind, size) in enumerate(sizes)
    )
    columns = {f"s{at}": tuple(f"v{value}" for value in range(size)) for at, size in enumerate(strata or [])}
    settings = AssignmentSettings(method, block, tuple(columns), orders, spare)
    study = Study("/nowhere", "Study", "study", seed, n, "scenario", "debug", factors, settings, columns)
    return with_hashes(study, {})
