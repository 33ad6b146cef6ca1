"""Reader and writer of plan.csv. It is never overwritten, and all errors in an edited one are reported."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from msgspec import Struct

from rise_engine.base.errors import StudyError
from rise_engine.base.files import Disk, error_message
from rise_engine.base.nearest_name import did_you_mean, in_backquotes, limited_comparisons
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.session.unfinished_files import move_new
from rise_engine.study.chance import SEEDS
from rise_engine.study.csv_table import CsvRow, CsvTable, read_csv
from rise_engine.study.model import Slot, Study
from rise_engine.study.plan import factors_of, runs, slot_seed

PLAN_FILE = "plan.csv"
NEW_PLAN_FILE = "plan.csv.new"
"""A new plan before it is renamed to plan.csv."""


class PlanLoad(Struct, frozen=True):
    slots: tuple[Slot, ...] | None
    """None: there is no plan, or it has errors."""
    diagnostics: list[Diagnostic]
    hash: str = ""
    """SHA-256 of the file. Empty: there is none."""

    @property
    def errors(self) -> list[Diagnostic]:
        return [diagnostic for diagnostic in self.diagnostics if diagnostic.severity == "error"]


def columns_of_plan(study: Study) -> list[str]:
    """Return the columns of a study's plan in the order in which they are written."""
    strata = () if study.assignment.between == "minimise" else study.assignment.strata
    return ["slot", *strata, *(factor.name for factor in factors_of(study, "between")), "order", "seed"]


def plan_text(study: Study, slots: Sequence[Slot]) -> str:
    """Return the contents of plan.csv."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = columns_of_plan(study)
    writer.writerow(columns)
    for slot in slots:
        values = {"slot": slot.slot, **slot.strata, **slot.levels, "order": " ".join(slot.order), "seed": slot.seed}
        writer.writerow([values.get(column, "") for column in columns])
    return text.getvalue()


def text_hash(text: str) -> str:
    """Return the SHA-256 of a text in UTF-8, equal to that of a file with this text."""
    return sha256(text.encode()).hexdigest()


def write_new_plan(folder: Path, text: str, disk: Disk | None = None) -> None:
    """Write a new plan beside plan.csv. `put_new_plan` moves it into place.

    :param folder: the study's folder.
    :param text: the contents.
    :param disk: for tests that let it fail.
    :raises StudyError: it cannot be written.
    """
    disk = disk or Disk()
    new = folder / NEW_PLAN_FILE
    try:
        disk.write_new(new, text.encode())
        disk.sync_folder(folder)
    except OSError as error:
        with suppress(OSError):
            new.unlink(missing_ok=True)
        raise StudyError(f"{new} cannot be written: {error_message(error)}") from None


def put_new_plan(folder: Path, disk: Disk | None = None) -> None:
    """Rename the new plan to plan.csv atomically. It never replaces a plan.

    :param folder: the study's folder.
    :param disk: for tests that let it fail.
    :raises StudyError: there is a plan already, or the file cannot be renamed.
    """
    disk = disk or Disk()
    new, path = folder / NEW_PLAN_FILE, folder / PLAN_FILE
    try:
        move_new(new, path)
        disk.sync_folder(folder)
    except FileExistsError:
        raise StudyError(f"{path} exists already; a plan is never overwritten") from None
    except OSError as error:
        raise StudyError(f"{path} cannot be written: {error_message(error)}") from None


def set_plan_aside(folder: Path) -> str:
    """Rename plan.csv to make room for a new plan. Returns the new name.

    :param folder: the study's folder.
    :raises StudyError: it cannot be renamed.
    """
    number = 1
    while (aside := folder / f"plan-{number}.csv").exists():
        number += 1
    try:
        (folder / PLAN_FILE).rename(aside)
    except OSError as error:
        raise StudyError(f"{folder / PLAN_FILE} cannot be renamed to {aside.name}: {error_message(error)}") from None
    return aside.name


def plan_hash(folder: Path, name: str = PLAN_FILE) -> str:
    """Return the SHA-256 of a plan's file. Empty: there is none.

    :raises StudyError: it cannot be read.
    """
    try:
        return sha256((folder / name).read_bytes()).hexdigest()
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise StudyError(f"{folder / name} cannot be read: {error.strerror or error}") from None


def read_plan(study: Study, only: frozenset[int] | None = None) -> PlanLoad:
    """Read and check plan.csv.

    :param study: the study, which defines its columns, levels and runs.
    :param only: the slots to read; None: all.
    :return: the rows in their order, or all errors in them. A missing file is not an error.
    """
    folder = Path(study.folder)
    if not (folder / PLAN_FILE).exists():
        return PlanLoad(None, [])
    diagnostics = Diagnostics()
    with limited_comparisons():
        table = read_csv(folder, PLAN_FILE, diagnostics)
        slots = _PlanReader(study, table).read(only) if table is not None else []
    found = diagnostics.sorted()
    digest = sha256((folder / PLAN_FILE).read_bytes()).hexdigest() if table is not None else ""
    return PlanLoad(None if diagnostics.errors else tuple(slots), found, digest)


class _PlanReader:
    def __init__(self, study: Study, table: CsvTable) -> None:
        self.study = study
        self.table = table
        self.is_list = study.assignment.between == "list"
        self.runs = runs(study)
        self.numbers: dict[int, int] = {}
        """The line of each slot read so far."""

    def read(self, only: frozenset[int] | None) -> list[Slot]:
        columns = columns_of_plan(self.study)
        optional = ["slot", "seed", *(["order"] if self.runs == [""] else [])] if self.is_list else []
        needed = [column for column in columns if column not in optional]
        known = ", ".join(columns)
        self.table.check_columns(needed, optional, f"; the columns of this study's plan are {known}")
        rows = list(enumerate(self.table.rows, start=1))
        if only is not None:
            rows = [(at, row) for at, row in rows if row.values.get("slot", str(at)) in map(str, only)]
        slots = [self.read_row(row, at) for at, row in rows]
        if not slots:
            location = self.table.column_location("")
            self.table.diagnostics.error(
                "missing-value", location, "this plan has no rows; each is what a participant gets"
            )
        return slots

    def read_row(self, row: CsvRow, at: int) -> Slot:
        study = self.study
        number = self.read_number(row, "slot", at, 1)
        line = self.table.location(row, "slot").line
        if number is not None and (before := self.numbers.setdefault(number, line)) != line:
            self.table.report(row, "slot", "duplicate-name", f"the slot {number} is in line {before} already")
        number = number or at
        seed = self.read_number(row, "seed", slot_seed(study, number), 0)
        strata = () if study.assignment.between == "minimise" else study.assignment.strata
        levels = {
            factor.name: self.read_name(row, factor.name, tuple(level.name for level in factor.levels))
            for factor in factors_of(study, "between")
        }
        return Slot(
            slot=number,
            strata={column: self.read_name(row, column, study.strata[column]) for column in strata},
            levels={} if study.assignment.between == "minimise" else levels,
            order=self.read_order(row),
            seed=seed if seed is not None else 0,
        )

    def read_number(self, row: CsvRow, column: str, otherwise: int, least: int) -> int | None:
        """Read a whole number. If the list lacks this column, return `otherwise`; None, with a diagnostic: an error."""
        if column not in self.table.columns:
            return otherwise
        text = row.values[column]
        if text.isascii() and text.isdigit() and len(text) < 16 and least <= int(text) < SEEDS:
            return int(text)
        self.table.report(row, column, "wrong-value", f"`{column}` is a whole number from {least} on, not `{text}`")
        return None

    def read_name(self, row: CsvRow, column: str, known: tuple[str, ...]) -> str:
        """Read a level or the value of a stratum."""
        name = row.values.get(column, "")
        if column not in self.table.columns:
            return name
        is_factor = column not in self.study.strata
        if is_factor and self.study.assignment.between == "minimise":
            if name:
                message = f"`{column}` is empty here: with `minimise` it is drawn when somebody takes the slot"
                self.table.report(row, column, "wrong-value", message)
        elif name not in known:
            near = did_you_mean(name, known, limit=0) if name else ""
            message = f"`{column}` is one of {in_backquotes(known)}, not `{name}`{near}"
            self.table.report(row, column, "wrong-value", message)
        return name

    def read_order(self, row: CsvRow) -> tuple[str, ...]:
        text = row.values.get("order", "")
        if self.runs == [""]:
            if text:
                message = "`order` is empty in this study: it has no within factor"
                self.table.report(row, "order", "wrong-value", message)
            return ("",)
        named = text.split()
        if "order" not in self.table.columns or Counter(named) == Counter(self.runs):
            return tuple(named)
        unknown = next((name for name in named if name not in self.runs), None)
        twice = next((name for name in named if named.count(name) > 1), None)
        if unknown is not None:
            problem = f"there is no `{unknown}`{did_you_mean(unknown, self.runs, limit=0)}"
        elif twice is not None:
            problem = f"`{twice}` is listed {named.count(twice)} times"
        else:
            problem = f"{in_backquotes(run for run in self.runs if run not in named)} is missing"
        message = f"`order` has each of {in_backquotes(self.runs)} once, with blanks between them: {problem}"
        self.table.report(row, "order", "wrong-value", message)
        return tuple(named)
