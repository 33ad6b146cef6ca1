"""The inputs of a bundle's sessions: whether study.toml, the scenarios and plan.csv are those that the sessions and
study.jsonl name."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from rise_engine.base.errors import SessionError
from rise_engine.base.text import pluralize
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, SCENARIO_COPY, read_info, spoken_as
from rise_engine.session.labels import read_labels
from rise_engine.session.scenario_copies import copy_folders
from rise_engine.session.unfinished_files import private_folder
from rise_engine.study.model import Study
from rise_engine.study.plan_file import PLAN_FILE
from rise_engine.study.planning import last_planned, plan_problem
from rise_engine.study.state import StudyStatus
from rise_engine.study.study_log import LOG_FILE
from rise_engine.study.study_scenarios import scenario_folder, scenario_of
from rise_engine.study.study_toml import STUDY_FILE
from rise_engine.study.traces import PARTICIPANTS_FILE

ROBOTS = "robots"
"""The folder of a scenario's own robots."""


class InputsCheck(Struct):
    """The result of comparing the inputs with the sessions."""

    problems: list[str] = field(default_factory=list)
    """The differences, in sentences that begin with the file's name."""
    proved: list[str] = field(default_factory=list)
    """What the sessions prove, in sentences."""
    open: list[str] = field(default_factory=list)
    """What they cannot prove, in sentences."""


class _Run(Struct, frozen=True):
    """A session with its labels."""

    folder: Path
    labels: Mapping[str, Any]


def check_inputs(root: Path, state: StudyStatus, folders: Sequence[Path]) -> InputsCheck:
    """Compare the inputs with the sessions.

    :param root: the folder of a study or a bundle.
    :param state: its study.
    :param folders: its sessions.
    """
    found = InputsCheck()
    runs = [_Run(each, read_labels(each / JOURNAL) or {}) for each in folders]
    own = [each for each in runs if each.labels.get("study") == state.study.id]
    _check_study(found, state, own)
    _check_plan(found, root, state)
    _check_participants(found, state, folders)
    for name in dict.fromkeys(_scenario_of(state.study, each) for each in own):
        theirs = [each for each in own if _scenario_of(state.study, each) == name]
        if (root / name).is_dir():
            _check_scenario(found, root, state, name, theirs)
    return found


def _check_study(found: InputsCheck, state: StudyStatus, runs: Sequence[_Run]) -> None:
    study, planned = state.study, last_planned(state.log)
    told = [each for each in runs if each.labels.get("study_hash")]
    same = [each for each in told if each.labels["study_hash"] == study.hash]
    if not told:
        found.open.append(f"{STUDY_FILE}: no session says with which one it was run")
    elif not same and planned is not None and planned.get("design_hash") == study.design_hash:
        found.open.append(
            f"{STUDY_FILE}: no session was run with it; what the plan fixes is as {LOG_FILE} says, and the rest "
            "(title, checks, robot, recording, ...) was changed after the last session, or in the bundle"
        )
    elif not same:
        found.problems.append(
            f"{STUDY_FILE}: no session was run with it: they say {told[-1].labels['study_hash'][:16]}..., and it is "
            f"{study.hash[:16]}...; it was changed after the last session, or in the bundle"
        )
    else:
        found.proved.append(
            f"{STUDY_FILE} is what it was in {_of(same, told)} (study_hash); [wizards], [report], [retention], "
            "[participants] and comments may have been written later"
        )


def _check_plan(found: InputsCheck, root: Path, state: StudyStatus) -> None:
    planned = last_planned(state.log)
    if planned is None or not (root / PLAN_FILE).is_file():
        return
    if problem := plan_problem(state.study, planned, state.plan_hash):
        found.problems.append(f"{PLAN_FILE}: {problem}")
    else:
        found.proved.append(f"{PLAN_FILE} is the plan that study.jsonl names")


def _check_participants(found: InputsCheck, state: StudyStatus, folders: Sequence[Path]) -> None:
    there = {folder.name for folder in folders}
    names = {each.entry.participant for each in state.sessions if each.name in there}
    missing = [name for name in state.standing.unlisted if name in names]
    if missing:
        found.problems.append(f"{PARTICIPANTS_FILE}: it has no row for {', '.join(missing)}, whose session is here")
    elif names - {""}:
        found.proved.append(f"{PARTICIPANTS_FILE} has a row for everyone with a counted session here")


def _scenario_of(study: Study, run: _Run) -> str:
    """Return the folder of the session's scenario, relative to the study."""
    named = scenario_of(study, run.labels.get("factors") or {})
    folder = Path(scenario_folder(study, named))
    return folder.relative_to(study.folder).as_posix() if folder.is_relative_to(study.folder) else named


def _check_scenario(found: InputsCheck, root: Path, state: StudyStatus, name: str, runs: Sequence[_Run]) -> None:
    hashes: dict[str, str] = {}
    same = []
    for run in runs:
        try:
            info = read_info(run.folder)
        except SessionError:
            continue
        key = str((info.robot, info.mode, info.language, info.allow_untranslated))
        if key not in hashes:
            how = {"robot": info.robot, "mode": info.mode, **spoken_as(info)}
            hashes[key] = _scenario_hash(root / name, run.folder / SCENARIO_COPY, how)
        taken_over = (not _first_difference(root / name, copy) for copy in copy_folders(run.folder)[1:])
        if hashes[key] == run.labels.get("scenario_hash") or any(taken_over):
            same.append(run)
    if same:
        found.proved.append(f"{name}/ is the scenario of {_of(same, runs)} (scenario_hash)")
        return
    planned, study = last_planned(state.log), state.study
    how = {"robot": study.robot or None, "mode": study.mode}
    digest = _scenario_hash(root / name, runs[-1].folder / SCENARIO_COPY, how)
    if planned is not None and digest and digest in (planned.get("scenarios") or {}).values():
        found.open.append(f"{name}/: no session ran this scenario; it is the one of the last plan in {LOG_FILE}")
        return
    file = _first_difference(root / name, runs[-1].folder / SCENARIO_COPY)
    found.problems.append(
        f"{name}/{file}: no session ran this scenario: {runs[-1].folder.name} has another copy of it. It was changed "
        "after the last session, or in the bundle"
    )


def _scenario_hash(folder: Path, copy: Path, how: Mapping[str, Any]) -> str:
    """Return the hash of the scenario together with the robots of the session's copy. Empty: it does not load.

    :param how: how it is loaded.
    """
    with private_folder(Path(tempfile.gettempdir(), "rise-scenario")) as work:
        whole = work / "scenario"
        shutil.copytree(folder, whole)
        for robot in (copy / ROBOTS).glob("*.toml"):
            if not (whole / ROBOTS / robot.name).exists():
                (whole / ROBOTS).mkdir(exist_ok=True)
                shutil.copyfile(robot, whole / ROBOTS / robot.name)
        loaded = load(whole, **how)
    return loaded.scenario.hash if loaded.scenario is not None else ""


def _first_difference(folder: Path, copy: Path) -> str:
    """Return the first file of a scenario that differs from the session's copy."""
    files = sorted(path.relative_to(copy) for path in copy.rglob("*") if path.is_file()) if copy.is_dir() else []
    for path in files:
        if path.parts[0] == ROBOTS and not (folder / path).exists():
            continue  # one of the program's own robots
        if not (folder / path).is_file() or (folder / path).read_bytes() != (copy / path).read_bytes():
            return path.as_posix()
    further = sorted(
        path.relative_to(folder) for path in folder.rglob("*.xml") if path.relative_to(folder) not in files
    )
    return further[0].as_posix() if further else ""


def _of(same: Sequence[_Run], all: Sequence[_Run]) -> str:
    return (
        pluralize(len(all), "session") if len(same) == len(all) else f"{len(same)} of {pluralize(len(all), 'session')}"
    )
