"""Reader of study.toml: the design of a study, checked as a whole (docs/reference/study.md)."""

from __future__ import annotations

import os
import re
from pathlib import Path

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean, limited_comparisons, nearest_name
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.source_files import MAX_TOML_BYTES, FileReader
from rise_engine.scenario.files.study_paths import STUDY_FILE as STUDY_FILE
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable, is_integer, read_toml
from rise_engine.scenario.files.tree import FileTree, Held
from rise_engine.scenario.model import Mode, Scenario, SourceLocation
from rise_engine.scenario.settings import names_in
from rise_engine.study.checks import DAY, parse_length, read_checks
from rise_engine.study.csv_table import WHY, personal_column
from rise_engine.study.model import AssignmentSettings, BetweenMethod, Study, WithinMethod
from rise_engine.study.plan import PLAN_COLUMNS, cells, rows_wanted, runs, with_hashes
from rise_engine.study.publishing import read_report
from rise_engine.study.questionnaires import read_questionnaires
from rise_engine.study.recording_table import read_choice, read_recording
from rise_engine.study.settings import STUDY_TABLES
from rise_engine.study.study_scenarios import check_levels, load_scenarios, read_factors

TOP_KEYS = tuple(names_in(STUDY_TABLES, ""))
_ASSIGNMENT_KEYS = tuple(names_in(STUDY_TABLES, "assignment"))
BETWEEN: tuple[BetweenMethod, ...] = ("blocks", "minimise", "random", "list")
WITHIN: tuple[WithinMethod, ...] = ("williams", "latin", "all", "fixed", "random")
MAX_PARTICIPANTS, MAX_SEED, MAX_BLOCK, MAX_SPARE = 10_000, 2**53, 20, 10.0
MAX_CELLS, MAX_RUNS, MAX_RUNS_ALL, MAX_STRATA, MAX_ROWS = 100, 24, 6, 64, 50_000
_ID = re.compile(r"[A-Za-z0-9]+\Z")
COLUMN_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
"""The allowed names of columns of participants.csv, factors and consents."""
RESERVED_COLUMNS = ("participant", "status", "comment")
"""Columns of participants.csv that every study has."""
CONSENT_PREFIX = "consent_"
_RETAINED = tuple(names_in(STUDY_TABLES, "retention"))


class StudyLoad(Struct, frozen=True):
    """The result of reading a study. `study` is None exactly when a diagnostic is an error."""

    study: Study | None
    diagnostics: list[Diagnostic]
    """Diagnostics of study.toml in reading order, then those of the scenarios."""
    scenarios: dict[str, Scenario] = {}
    """The study's scenarios without errors, by absolute folder."""
    draft: Study | None = None
    """What could be read despite errors, for checks of other files. None: nothing."""
    n_location: SourceLocation = SourceLocation(STUDY_FILE)
    """The place of the number of participants in study.toml."""
    unsure: frozenset[str] = frozenset()
    """The keys and tables of study.toml that have errors, so that their meaning is unknown."""

    @property
    def errors(self) -> list[Diagnostic]:
        return [diagnostic for diagnostic in self.diagnostics if diagnostic.severity == "error"]


def is_study(path: str | os.PathLike[str]) -> bool:
    """Whether a folder is a study's: it contains study.toml."""
    return (Path(path) / STUDY_FILE).is_file()


def load_study(folder: str | os.PathLike[str], *, check_scenarios: bool = True, held: Held | None = None) -> StudyLoad:
    """Read and check a study's design.

    :param folder: the study's folder, or the study.toml in it.
    :param check_scenarios: also load its scenarios, and compare their memory with the levels'. This takes up to half a
        second for each.
    :param held: contents that are used instead of the files on the disk, by file name.
    :return: the checked study with its warnings, or no study and all errors, each with file, line, column and a
        sentence. Neither the contents of files nor unreadable files raise an exception.
    """
    path = Path(folder)
    path = path.parent if path.name == STUDY_FILE else path
    with limited_comparisons():
        path = Path(os.path.abspath(path))  # noqa: PTH100  # keeps symbolic links
        return _load(path, held, check_scenarios=check_scenarios)


def _load(folder: Path, held: Held | None, *, check_scenarios: bool) -> StudyLoad:
    diagnostics = Diagnostics()
    if not (folder / STUDY_FILE).exists() and STUDY_FILE not in (held or {}):
        message = "there is no such folder" if not folder.is_dir() else f"there is no {STUDY_FILE} in this folder"
        message += "; `rise-engine study new` makes a study"
        diagnostics.error("unreadable", SourceLocation(str(folder)), message)
        return StudyLoad(None, diagnostics.sorted())
    tree = FileTree(folder, held, closed=True)
    source = FileReader(folder, diagnostics, tree).read(folder / STUDY_FILE, MAX_TOML_BYTES)
    file = read_toml(source, diagnostics) if source is not None else None
    if source is None or file is None:
        return StudyLoad(None, diagnostics.sorted())
    reader = _StudyReader(file, diagnostics)
    study = with_hashes(reader.read(folder), file.values)
    unsure = _tables_with_errors(reader.table, diagnostics.sorted())
    scenarios: dict[str, Scenario] = {}
    others: list[Diagnostic] = []
    if check_scenarios:
        scenarios, others = load_scenarios(study, reader.table)
        check_levels(study, reader.table, scenarios)
    found = [*diagnostics.sorted(), *others]
    failed = any(diagnostic.severity == "error" for diagnostic in found)
    return StudyLoad(None if failed else study, found, scenarios, study, reader.table.value_location("n"), unsure)


def _tables_with_errors(table: TomlTable, found: list[Diagnostic]) -> frozenset[str]:
    """Return the top-level keys that have errors. A misspelt key counts as the intended one."""
    starts: dict[int, str] = {}
    for key, value in table.values.items():
        meant = key if key in TOP_KEYS else nearest_name(key, TOP_KEYS) or key
        inner = value if isinstance(value, dict) else {}
        for path in [(key,), *((key, name) for name in inner)]:
            starts.setdefault(table.key_location(*path).line, meant)
    unsure: set[str] = set()
    for diagnostic in found:
        before = [line for line in starts if line <= diagnostic.location.line]
        if diagnostic.severity == "error" and before:
            unsure.add(starts[max(before)])
    return frozenset(unsure)


class _StudyReader:
    """Reader of one study.toml. A wrong value gives a diagnostic and is replaced by the default."""

    def __init__(self, file: TomlFile, diagnostics: Diagnostics) -> None:
        self.table = TomlTable(file, (), file.values, diagnostics)
        self.diagnostics = diagnostics
        self.is_whole = not diagnostics.errors
        """Whether every line could be read as TOML."""

    def read(self, folder: Path) -> Study:
        table = self.table
        table.report_unknown_keys(TOP_KEYS)
        identity = self.read_text("id", required=True)
        if identity and not _ID.match(identity):
            table.report_value(
                "bad-name", "id", f"`id` has letters and digits only (it is a part of file names), not `{identity}`"
            )
        strata = self.read_strata()
        factors = read_factors(table.section("factors"), (*PLAN_COLUMNS, *strata))
        assignment = self.read_assignment(strata)
        study = Study(
            folder=str(folder),
            title=self.read_text("title", required=True),
            id=identity,
            seed=self.read_integer("seed", 0, MAX_SEED, 0, "a whole number that you choose: the plan is drawn from it"),
            n=self.read_integer("n", 1, MAX_PARTICIPANTS, 1, "how many complete participants you want"),
            scenario=self.read_text("scenario", usual="scenario"),
            mode=self.read_mode(),
            robot=self.read_text("robot"),
            factors=factors,
            assignment=assignment,
            strata=strata,
            consent=self.read_consent(),
            checks=read_checks(table, folder),
            columns=tuple(columns := self.read_columns(strata)),
            descriptions={name: text for name, text in columns.items() if text},
            wizards=self.read_wizards(),
            retention=self.read_retention(),
            recording=read_recording(table, folder),
            report=read_report(table),
            questionnaires=read_questionnaires(table, folder),
        )
        self.check_size(study)
        return study

    def read_text(self, key: str, usual: str = "", *, required: bool = False) -> str:
        text = self.table.read(key, str, usual, form=f': {key} = "..."').strip()
        if key in self.table.values and isinstance(self.table.values[key], str) and not text:
            self.table.report_value("missing-value", key, f"`{key}` is empty")
        elif key not in self.table.values and required:
            self.report_missing(key, f'{key} = "..."')
        return str(text or usual)

    def report_missing(self, key: str, form: str) -> None:
        """Report a missing key, unless a misspelt one is already reported."""
        unknown = [name for name in self.table.values if name not in TOP_KEYS]
        if self.is_whole and not any(nearest_name(name, TOP_KEYS) == key for name in unknown):
            self.diagnostics.error("missing-value", SourceLocation(STUDY_FILE), f"`{key}` is missing; write {form}")

    def read_integer(self, key: str, least: int, most: int, usual: int, what: str) -> int:
        value = self.table.values.get(key)
        if value is None:
            self.report_missing(key, f"{key} = ... ({what})")
        elif not is_integer(value):
            self.table.report_value("wrong-type", key, f"`{key}` is {what}")
        elif not least <= value <= most:
            self.table.report_value("out-of-range", key, f"`{key}` is from {least} to {most}")
        else:
            return int(value)
        return usual

    def read_mode(self) -> Mode:
        mode = self.table.read("mode", str, "real", form=': mode = "real"')
        if mode not in ("debug", "real"):
            self.table.report_value("wrong-value", "mode", '`mode` is "debug" or "real"')
        return "debug" if mode == "debug" else "real"

    def read_strata(self) -> dict[str, tuple[str, ...]]:
        table = self.table.section("strata")
        strata: dict[str, tuple[str, ...]] = {}
        for column in table.values:
            if not self.check_column(table, column):
                continue
            values = table.read_texts(column, ())
            if problem := _values_problem(values):
                table.report_value("wrong-value", column, f"`{column}` {problem}")
            strata[column] = values
        return strata

    def check_column(self, table: TomlTable, column: str) -> bool:
        """Whether participants.csv can have a further column of that name."""
        if not COLUMN_NAME.match(column):
            message = f"a column has a name of letters, digits and `_`, beginning with a letter, not `{column}`"
            table.report_key("bad-name", message, column)
        elif column in RESERVED_COLUMNS or column.startswith(CONSENT_PREFIX):
            table.report_key("bad-name", f"participants.csv has a column `{column}` of another meaning", column)
        elif column in PLAN_COLUMNS:
            table.report_key("bad-name", f"plan.csv has a column `{column}` of another meaning", column)
        else:
            return True
        return False

    def read_assignment(self, strata: dict[str, tuple[str, ...]]) -> AssignmentSettings:
        table = self.table.section("assignment", _ASSIGNMENT_KEYS)
        usual = AssignmentSettings()
        named = table.read_texts("strata", ())
        described = self.table.section("strata").values  # also those with errors
        for at, column in enumerate(named):
            if column not in described:
                message = f"[strata] has no `{column}`: {column} = [...] says which values it can have"
                message += did_you_mean(column, strata)
                self.diagnostics.error("unknown-name", table.value_location("strata", str(at)), message)
            elif column in named[:at]:
                location = table.value_location("strata", str(at))
                self.diagnostics.error("duplicate-name", location, f"`{column}` is listed twice")
        misspelt = any(nearest_name(key, ("strata",)) for key in table.values if key not in _ASSIGNMENT_KEYS)
        for column in strata:
            if column not in named and not misspelt:
                message = (
                    f"`{column}` is in [strata], and [assignment] strata does not name it: nothing is balanced in it"
                )
                self.diagnostics.warning("unused-stratum", self.table.key_location("strata", column), message)
        spare = table.read_number("spare", usual.spare)
        if spare is None or not 0 <= spare <= MAX_SPARE:
            table.report_value(
                "out-of-range", "spare", "`spare` is a part of `n`, from 0 to 10: 0.25 is a quarter more rows"
            )
            spare = usual.spare
        return AssignmentSettings(
            between=read_choice(table, "between", BETWEEN, usual.between),
            block=self.read_block(table),
            strata=tuple(column for column in dict.fromkeys(named) if column in strata),
            within=read_choice(table, "within", WITHIN, usual.within),
            spare=float(spare),
            hidden=table.read("hidden", bool, False),
        )

    def read_block(self, table: TomlTable) -> tuple[int, ...]:
        value = table.values.get("block", [1])
        sizes = [value] if is_integer(value) else value
        if (
            not isinstance(sizes, list)
            or not sizes
            or not all(is_integer(each) and 1 <= each <= MAX_BLOCK for each in sizes)
        ):
            message = (
                f"`block` is a list of whole numbers from 1 to {MAX_BLOCK}: how often each cell comes in a block; "
                "one of them is drawn for each block: block = [1, 2]"
            )
            table.report_value("wrong-type", "block", message)
            return (1,)
        return tuple(sizes)

    def read_consent(self) -> tuple[str, ...]:
        table = self.table.section("consent", names_in(STUDY_TABLES, "consent"))
        needed = table.read_texts("needed", ())
        for at, name in enumerate(needed):
            location = table.value_location("needed", str(at))
            if name.startswith(CONSENT_PREFIX):
                message = f"write `{name.removeprefix(CONSENT_PREFIX)}`: the column is called {name}"
                self.diagnostics.error("bad-name", location, message)
            elif not COLUMN_NAME.match(name):
                message = f"a consent has a name of letters, digits and `_`, not `{name}`"
                self.diagnostics.error("bad-name", location, message)
            elif name in needed[:at]:
                self.diagnostics.error("duplicate-name", location, f"`{name}` is listed twice")
        return tuple(dict.fromkeys(needed))

    def read_columns(self, strata: dict[str, tuple[str, ...]]) -> dict[str, str]:
        """Return the further columns with their descriptions, which are empty if `columns` is a list."""
        table = self.table.section("participants", names_in(STUDY_TABLES, "participants"))
        described = table.values.get("columns")
        if isinstance(described, dict):
            inner = table.section("columns")
            columns = tuple(described)
            about = {name: inner.read(name, str, "", form=f': {name} = "what it holds"').strip() for name in columns}
        else:
            columns = table.read_texts("columns", ())
            about = dict.fromkeys(columns, "")
        for at, column in enumerate(columns):
            key = str(at) if not isinstance(described, dict) else column
            location = table.value_location("columns", key)
            if kind := personal_column(column):
                self.diagnostics.error("personal-data", location, f"`{column}` seems to hold {kind}: {WHY}")
            known = column in RESERVED_COLUMNS or column.startswith(CONSENT_PREFIX) or column in strata
            if known or column in columns[:at]:
                self.diagnostics.error("duplicate-name", location, f"participants.csv has a column `{column}` already")
        return about

    def read_wizards(self) -> dict[str, str]:
        table = self.table.section("wizards")
        wizards: dict[str, str] = {}
        for name in table.values:
            alias = table.read(name, str, "", form=f': their code in exports: {name} = "W1"')
            if isinstance(table.values[name], str) and not _ID.match(alias):
                table.report_value("bad-name", name, f"the code of `{name}` in exports has letters and digits: W1")
            elif alias and (other := next((each for each in wizards if wizards[each] == alias), None)) is not None:
                table.report_value("duplicate-name", name, f"`{other}` is called `{alias}` already")
            wizards[name] = alias
        return wizards

    def read_retention(self) -> dict[str, float]:
        table = self.table.section("retention", _RETAINED)
        kept: dict[str, float] = {}
        for name in table.values:
            text = table.read(name, str, "", form=f': {name} = "365 d"')
            if not text or name not in _RETAINED:
                continue
            seconds = parse_length(text)
            if seconds is None or seconds <= 0:
                message = f"`{text}` is not a length of time; write 365 d, 52 w or 10 y"
                table.report_value("wrong-value", name, message)
            else:
                kept[name] = seconds / DAY
        return kept

    def check_size(self, study: Study) -> None:
        """Report a study that is too large for a plan."""
        each = len(runs(study))
        method = study.assignment.within
        if len(cells(study)) > MAX_CELLS:
            message = f"the between factors make {len(cells(study))} cells; at most {MAX_CELLS} can be planned"
            self.table.report_key("out-of-range", message, "factors")
        most = MAX_RUNS_ALL if method == "all" else MAX_RUNS
        if each > most:
            message = (
                f'the within factors make {each} runs for each participant; with within = "{method}" at most {most}'
            )
            self.table.report_key("out-of-range", message, "factors")
        number = 1
        for column in study.assignment.strata:
            number *= max(1, len(study.strata[column]))
        if number > MAX_STRATA:
            message = f"these make {number} strata; at most {MAX_STRATA} can be planned"
            self.table.report_key("out-of-range", message, "assignment", "strata")
        elif (rows := rows_wanted(study) * number) > MAX_ROWS:
            message = (
                f"the plan would have {rows:,} rows, for {study.n} participants in each stratum and the spare ones; "
            )
            message += f"at most {MAX_ROWS:,} can be planned"
            self.table.report_key("out-of-range", message, "n")


def _values_problem(values: tuple[str, ...]) -> str:
    """Return what is wrong with the values of a stratum, as the end of a sentence, or an empty text."""
    for at, value in enumerate(values):
        if value != value.strip() or not value.isprintable() or "/" in value or "=" in value:
            return f"has the value `{value}`; a value has no `/` and no `=` in it, and no blanks around it"
        if value in values[:at]:
            return f"has the value `{value}` twice"
    return "" if len(values) > 1 else 'has two values or more: language = ["de", "en"]'
