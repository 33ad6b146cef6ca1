"""Derived files of a bundle: tables, BIDS, the report, and participants.csv as the level shows it.

`write_derived` makes all of them from the bundle's sessions and study files alone: when the bundle is made, and again
to check that they still follow (`compare_derived`). `check_bundle` checks the checksums.
"""

from __future__ import annotations

import csv
import io
import tempfile
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.bundle.about import ABOUT_FILE, AboutBundle, BundleOptions
from rise_engine.results.bundle.crate import METADATA
from rise_engine.results.bundle.manifest import ManifestCheck, check_manifest, files_in
from rise_engine.results.bundle.study_files import participants_text
from rise_engine.results.export.format import ExportError, load_format
from rise_engine.results.export.writing import export_context
from rise_engine.results.report.making import make_study_report
from rise_engine.results.report.page import page_text
from rise_engine.session.unfinished_files import private_folder
from rise_engine.study.copies import session_folders
from rise_engine.study.model import Study
from rise_engine.study.state import StudyStatus, read_state
from rise_engine.study.traces import MANIFEST_FILE, PARTICIPANTS_FILE

FORMATS = ("tables", "bids")
"""Exports that every bundle has."""
REPORT = "report"
"""The folder of the report page and the reporting sheet."""
MADE_OF = {
    "tables": "sessions/, study.toml and the files of questionnaires",
    "bids": "sessions/, study.toml, participants.csv and the files of questionnaires",
    REPORT: "sessions/, study.toml, participants.csv, plan.csv and study.jsonl",
    PARTICIPANTS_FILE: "its own rows and study.toml",
}
"""The sources of each, for people."""
_LONGEST = 60
"""The most characters of a cell or line that a sentence quotes."""


class Difference(Struct, frozen=True):
    """A file that does not follow from the others."""

    file: str
    what: str
    """Its first difference, in words."""

    def __str__(self) -> str:
        return f"{self.file}: {self.what} (it is made of {MADE_OF[self.file.partition('/')[0]]})"


class DerivedCheck(Struct):
    """The result of making all derived files again."""

    files: int = 0
    """The number of equal files."""
    differences: list[Difference] = field(default_factory=list)
    not_compared: list[str] = field(default_factory=list)
    """Files from another version of the program that have no columns to compare."""


def write_derived(root: Path, target: Path, about: AboutBundle) -> list[tuple[str, str]]:
    """Write everything that follows from the files of a bundle.

    :param root: the bundle, with its sessions and the files of its study.
    :param target: the bundle itself, or an empty folder.
    :param about: how the bundle is made.
    :return: the exports' messages: the format and a sentence.
    :raises rise_engine.base.errors.RiseError: something cannot be read or made.
    :raises OSError: it cannot be written.
    """
    state = read_state(root)
    options, folders = about.options, sessions_in_order(root, state)
    study = with_license(state.study, options)
    said: list[tuple[str, str]] = []
    for name in FORMATS:
        context = export_context(folders, options.level)
        context.standing, context.study = state.standing, study
        sessions = read_sessions(folders, level=options.level, private=options.private)
        load_format(name).write(target / name, sessions, context)
        said += [(name, each) for each in context.warnings]
    made = make_study_report(root, options.level, options.private, left_out=about.rehearsals)
    (target / REPORT).mkdir(0o700)
    (target / REPORT / "report.html").write_text(page_text(made.document), "utf-8")
    (target / REPORT / "sheet.md").write_text(made.sheet, "utf-8")
    people = participants_text(state.study, state.participants, options.level)
    (target / PARTICIPANTS_FILE).write_text(people, "utf-8")
    return said


def sessions_in_order(root: Path, state: StudyStatus | None) -> list[Path]:
    """Return the sessions of a bundle in the order in which they began. Sessions of other studies come last.

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
    :param about: how it was made.
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
    return {name for name in files_in(root) if name.partition("/")[0] in MADE_OF}


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
        return f"its columns are others ({', '.join(missing) or 'in another order'})"
    shared = [(old[0].index(name), new[0].index(name), name) for name in new[0] if name in old[0]]
    for number, (row, again) in enumerate(zip(old[1:], new[1:], strict=False), start=2):
        for there, here, name in shared:
            found, follows = _at(row, there), _at(again, here)
            if found != follows:
                return f"line {number}, column {name}: {_quoted(found)} is there, and {_quoted(follows)} follows"
    if len(old) != len(new):
        return f"it has {len(old) - 1} rows, and {len(new) - 1} follow"
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
            return f"line {number}: {_quoted(found)} is there, and {_quoted(follows)} follows"
    return f"it has {len(old)} lines, and {len(new)} follow"


def _around(line: str, again: str) -> tuple[str, str]:
    """Cut two long lines to begin shortly before the first character that differs."""
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
