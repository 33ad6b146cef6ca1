"""Makes and checks the derived files of a bundle, and checks its inputs against its sessions.

`write_derived` makes tables, BIDS, the report and participants.csv from the bundle's sessions and study files alone:
when the bundle is made, and again to compare them (`compare_derived`). `check_inputs` reports whether the sessions used
this study.toml, these scenarios and this plan.csv. `check_bundle` checks the checksums.
"""

from __future__ import annotations

import csv
import io
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.text import pluralize
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.bundle.about import ABOUT_FILE, AboutBundle, BundleOptions
from rise_engine.results.bundle.contents import participants_text
from rise_engine.results.bundle.crate import METADATA, ManifestCheck, check_manifest, files_in
from rise_engine.results.export.format import ExportError, load_format
from rise_engine.results.export.writing import export_context
from rise_engine.results.report.making import make_study_report
from rise_engine.results.report.page import page_text
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, SCENARIO_COPY, read_info, speech_arguments
from rise_engine.session.labels import read_labels
from rise_engine.session.scenario_copies import copy_folders
from rise_engine.session.unfinished_files import private_folder
from rise_engine.study.labels import session_folders
from rise_engine.study.model import Study
from rise_engine.study.plan_file import PLAN_FILE
from rise_engine.study.planning import last_planned, plan_problem
from rise_engine.study.state import StudyStatus, read_state
from rise_engine.study.study_log import LOG_FILE
from rise_engine.study.study_scenarios import scenario_folder, scenario_of
from rise_engine.study.study_toml import STUDY_FILE
from rise_engine.study.traces import MANIFEST_FILE, PARTICIPANTS_FILE

FORMATS = ("tables", "bids")
"""Exports that every bundle contains."""
REPORT = "report"
"""The folder of the report page and the reporting sheet."""
DERIVED_FROM = {
    "tables": "sessions/, study.toml and the files of questionnaires",
    "bids": "sessions/, study.toml, participants.csv and the files of questionnaires",
    REPORT: "sessions/, study.toml, participants.csv, plan.csv and study.jsonl",
    PARTICIPANTS_FILE: "its own rows and study.toml",
}
"""The sources of each derived file, for people."""
_LONGEST = 60
"""Maximum length of a cell or line that a sentence quotes."""


class Difference(Struct, frozen=True):
    """A file that differs from what its sources give."""

    file: str
    what: str
    """Its first difference, in words."""

    def __str__(self) -> str:
        return f"{self.file}: {self.what} (it is made of {DERIVED_FROM[self.file.partition('/')[0]]})"


class DerivedCheck(Struct):
    """The result of making all derived files again."""

    files: int = 0
    """The number of equal files."""
    differences: list[Difference] = field(default_factory=list)
    not_compared: list[str] = field(default_factory=list)
    """Files of another version of the program that have no columns to compare."""


def write_derived(root: Path, target: Path, about: AboutBundle) -> list[tuple[str, str]]:
    """Write all derived files of a bundle.

    :param root: the bundle, with its sessions and the files of its study.
    :param target: the bundle itself, or an empty folder.
    :param about: the contents of `bundle.json`.
    :return: the exports' messages: the format and a sentence.
    :raises rise_engine.base.errors.RiseError: something cannot be read or made.
    :raises OSError: it cannot be written.
    """
    state = read_state(root)
    options, folders = about.options, sessions_in_order(root, state)
    study = with_license(state.study, options)
    warnings: list[tuple[str, str]] = []
    for name in FORMATS:
        context = export_context(folders, options.level)
        context.standing, context.study = state.standing, study
        sessions = read_sessions(folders, level=options.level, private=options.private)
        load_format(name).write(target / name, sessions, context)
        warnings += [(name, each) for each in context.warnings]
    made = make_study_report(root, options.level, options.private, omitted=about.rehearsals)
    (target / REPORT).mkdir(0o700)
    (target / REPORT / "report.html").write_text(page_text(made.document), "utf-8")
    (target / REPORT / "sheet.md").write_text(made.sheet, "utf-8")
    people = participants_text(state.study, state.participants, options.level)
    (target / PARTICIPANTS_FILE).write_text(people, "utf-8")
    return warnings


def sessions_in_order(root: Path, state: StudyStatus | None) -> list[Path]:
    """Return the sessions of a bundle in the order of their starts. Sessions of other studies come last.

    :param root: the bundle.
    :param state: its study; None: it cannot be read.
    """
    there = {path.name: path for path in session_folders(root)}
    known = [each.name for each in state.sessions if each.name in there] if state is not None else []
    return [there[name] for name in dict.fromkeys([*known, *sorted(there)])]


def with_license(study: Study, options: BundleOptions) -> Study:
    """Return the study with the bundle's licence, if it has one of its own."""
    return replace(study, report={**study.report, "license": options.license}) if options.license else study


def compare_derived(root: Path, about: AboutBundle, *, same_version: bool) -> DerivedCheck:
    """Make all derived files again, and compare them with those in the bundle.

    :param root: the bundle.
    :param about: the contents of `bundle.json`.
    :param same_version: whether this version of the program made it. From another version, only table columns with the
        same names are compared.
    :raises rise_engine.base.errors.RiseError: something cannot be read or made.
    :raises OSError: nothing can be written.
    """
    check = DerivedCheck()
    with private_folder(Path(tempfile.gettempdir(), "rise-derived")) as work:
        write_derived(root, work, about)
        old, new = _files(root), _files(work)
        for name in sorted(old | new):
            if name not in new:
                check.differences.append(Difference(name, "no file of the bundle gives this file"))
            elif name not in old:
                check.differences.append(Difference(name, "it is missing"))
            else:
                _compare(check, name, root / name, work / name, same_version)
    return check


def _files(root: Path) -> set[str]:
    return {name for name in files_in(root) if name.partition("/")[0] in DERIVED_FROM}


def _compare(check: DerivedCheck, name: str, old: Path, new: Path, same_version: bool) -> None:
    before, after = old.read_bytes(), new.read_bytes()
    separator = {".csv": ",", ".tsv": "\t"}.get(old.suffix)
    if before == after:
        check.files += 1
    elif separator is not None and (found := _table_difference(before, after, separator, same_version)) is not None:
        check.differences.append(Difference(name, found))
    elif not same_version and separator is not None:
        check.files += 1
    elif not same_version:
        check.not_compared.append(name)
    else:
        check.differences.append(Difference(name, _line_difference(before, after)))


def _table_difference(before: bytes, after: bytes, separator: str, same_version: bool) -> str | None:
    """Describe the first cell that differs. None: all cells are equal."""
    old, new = _rows(before, separator), _rows(after, separator)
    if not old or not new:
        return "it has no columns" if new else None
    if same_version and old[0] != new[0]:
        missing = [each for each in new[0] if each not in old[0]] or [each for each in old[0] if each not in new[0]]
        return f"its columns differ ({', '.join(missing) or 'in another order'})"
    shared = [(old[0].index(name), new[0].index(name), name) for name in new[0] if name in old[0]]
    for number, (row, again) in enumerate(zip(old[1:], new[1:], strict=False), start=2):
        for there, here, name in shared:
            found, follows = _at(row, there), _at(again, here)
            if found != follows:
                return f"line {number}, column {name}: the bundle has {_quoted(found)}, the new one {_quoted(follows)}"
    if len(old) != len(new):
        return f"the bundle has {len(old) - 1} rows, the new one {len(new) - 1}"
    return None


def _rows(data: bytes, separator: str) -> list[list[str]]:
    return list(csv.reader(io.StringIO(data.decode("utf-8", "replace"), newline=""), delimiter=separator))


def _at(row: Sequence[str], place: int) -> str:
    return row[place] if place < len(row) else ""


def _line_difference(before: bytes, after: bytes) -> str:
    old, new = (each.decode("utf-8", "replace").splitlines() for each in (before, after))
    for number, (line, again) in enumerate(zip(old, new, strict=False), start=1):
        if line != again:
            found, follows = _around(line, again)
            return f"line {number}: the bundle has {_quoted(found)}, the new one {_quoted(follows)}"
    return f"the bundle has {len(old)} lines, the new one {len(new)}"


def _around(line: str, again: str) -> tuple[str, str]:
    """Cut two long lines to begin shortly before their first difference."""
    at = next((n for n, (a, b) in enumerate(zip(line, again, strict=False)) if a != b), min(len(line), len(again)))
    begin = max(0, at - _LONGEST // 3)
    return line[begin:], again[begin:]


def _quoted(text: str) -> str:
    return f'"{text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"}"' if text else "nothing"


def check_bundle(root: Path) -> ManifestCheck:
    """Compare a bundle with its checksums.

    :param root: its folder.
    :raises ExportError: it is not a bundle, or cannot be read.
    """
    missing = [name for name in (METADATA, ABOUT_FILE, MANIFEST_FILE) if not (root / name).is_file()]
    if missing:
        raise ExportError(f"it is not a bundle: it has no {' and no '.join(missing)}")
    try:
        return check_manifest(root)
    except OSError as error:
        raise ExportError(f"it cannot be read: {error.strerror or error}") from None


ROBOTS = "robots"
"""The folder of a scenario's own robots."""


class InputsCheck(Struct):
    """The result of comparing the inputs with the sessions."""

    problems: list[str] = field(default_factory=list)
    """The differences, in sentences that begin with the file's name."""
    proved: list[str] = field(default_factory=list)
    """Facts that the sessions prove, in sentences."""
    open: list[str] = field(default_factory=list)
    """Facts that they cannot prove, in sentences."""


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
    hashed = [each for each in runs if each.labels.get("study_hash")]
    same = [each for each in hashed if each.labels["study_hash"] == study.hash]
    if not hashed:
        found.open.append(f"{STUDY_FILE}: no session says with which one it was run")
    elif not same and planned is not None and planned.get("design_hash") == study.design_hash:
        found.open.append(
            f"{STUDY_FILE}: no session was run with it; the parts that the plan fixes match {LOG_FILE}, but the rest "
            "(title, checks, robot, recording, ...) was changed after the last session, or in the bundle"
        )
    elif not same:
        found.problems.append(
            f"{STUDY_FILE}: no session was run with it: their hash is {hashed[-1].labels['study_hash'][:16]}..., and "
            f"its hash is {study.hash[:16]}...; it was changed after the last session, or in the bundle"
        )
    else:
        found.proved.append(
            f"{STUDY_FILE} is what it was in {_counted(same, hashed)} (study_hash); [wizards], [report], [retention], "
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
            how = {"robot": info.robot, "mode": info.mode, **speech_arguments(info)}
            hashes[key] = _scenario_hash(root / name, run.folder / SCENARIO_COPY, how)
        taken_over = (not _first_difference(root / name, copy) for copy in copy_folders(run.folder)[1:])
        if hashes[key] == run.labels.get("scenario_hash") or any(taken_over):
            same.append(run)
    if same:
        found.proved.append(f"{name}/ is the scenario of {_counted(same, runs)} (scenario_hash)")
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

    :param how: the arguments for loading it.
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


def _counted(same: Sequence[_Run], all: Sequence[_Run]) -> str:
    return (
        pluralize(len(all), "session") if len(same) == len(all) else f"{len(same)} of {pluralize(len(all), 'session')}"
    )
