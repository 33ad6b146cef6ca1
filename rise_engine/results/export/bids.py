"""Sessions as a data set of BIDS 1.11.1, the Brain Imaging Data Structure, modality `beh`.

    dataset_description.json  README.md  CHANGES
    participants.tsv          participants.json
    phenotype/NAME.tsv        phenotype/NAME.json     the answers to a questionnaire
        task-ID_events.json       task-ID_beh.json        the meaning of the columns
        sub-P07/sub-P07_scans.tsv                         a row for each session
        sub-P07/beh/sub-P07_task-ID_run-1_events.tsv      everything that has a time
        sub-P07/beh/sub-P07_task-ID_run-1_beh.tsv         a row for each act, with the parts of its latency
        sourcedata/rise/sub-P07/...                       the source of all this, as far as the level shows it

https://bids-specification.readthedocs.io/en/v1.11.1/modality-specific-files/behavioral-experiments.html
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from msgspec import Struct, field

from rise_engine import __version__
from rise_engine.base.files import make_private_folder
from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.export.bids_people import Labels, label_of, participants_table
from rise_engine.results.export.bids_tables import (
    ACT_COLUMNS,
    EVENT_COLUMNS,
    NOTHING,
    Columns,
    cells,
    event_rows,
    session_columns,
    sidecar,
    table_text,
    trial_columns,
)
from rise_engine.results.export.course_tables import ACTS
from rise_engine.results.export.format import ExportContext, ExportError, ExportFormat, new_file
from rise_engine.results.export.session_tables import factor_column
from rise_engine.results.export.table_schema import UNSAFE, Column, Row
from rise_engine.results.export.trial_tables import answers_at_level
from rise_engine.session.coded import coded_paths
from rise_engine.session.folder import INFO, JOURNAL
from rise_engine.session.journal_format import encode_record
from rise_engine.session.media import MEDIA_FILE
from rise_engine.session.scenario_copies import copy_folders
from rise_engine.study.model import Participant
from rise_engine.study.participants import load_participants
from rise_engine.study.publishing import authors_of

VERSION = "1.11.1"
"""The version of BIDS."""
DEVICE_VALUES = {"SamplingFrequency": 1_000_000, "PowerLineFrequency": "n/a"}
"""Values for every device that the report of mne-bids requires: clock steps per second, and no mains."""
_NO_TASK = "session"
"""The task's label if there is no title."""


class _Person(Struct):
    """The sessions of one participant so far."""

    rows: list[dict[str, str]] = field(default_factory=list)
    """Their cells in the table of sessions."""
    group: str = ""


class _Dataset:
    """A data set to which sessions are added one after the other."""

    def __init__(self, root: Path, context: ExportContext) -> None:
        self._root = root
        self._context = context
        self._labels = Labels()
        self._people: dict[str, _Person] = {}
        self._names: set[str] = set()
        self._tasks: dict[str, list[SessionFacts]] = {}
        self._factors: list[str] = []
        self._media = False
        self._sessions: list[SessionFacts] = []
        further = trial_columns(context.trial_columns) if context.trial_columns is not None else {}
        self._event_columns: Columns = {**EVENT_COLUMNS, **further}

    def add(self, data: SessionData) -> None:
        """Write the files of one session."""
        facts = data.facts
        self._sessions.append(facts)
        label = self._labels.label(facts.participant)
        person = self._people.setdefault(facts.participant, _Person())
        task = label_of(facts.study) or label_of(facts.title) or _NO_TASK
        facts_of_task = self._tasks.setdefault(task, [])
        if not any(each.versions == facts.versions for each in facts_of_task):
            facts_of_task.append(facts)
        name = self._file_name(facts, label, task, len(person.rows) + 1)
        folder = self._root / f"sub-{label}"
        self._write_table(folder / "beh" / f"{name}_events.tsv", self._event_columns, event_rows(data))
        self._write_table(folder / "beh" / f"{name}_beh.tsv", ACT_COLUMNS, ACTS.rows(data))
        columns = self._session_columns(facts.factors)
        row = Row(data, len(person.rows) + 1, facts, f"beh/{name}_events.tsv")
        person.rows.append(dict(zip(columns, cells(columns, row), strict=True)))
        person.group = person.group or self._group(facts)
        self._factors += [each for each in facts.factors if each not in self._factors]
        self._media = self._media or bool(data.media or data.recordings)
        self._write_source(data, self._root / "sourcedata" / "rise" / f"sub-{label}", name)

    def close(self) -> None:
        """Write the files about all sessions. Raises ExportError if there is no session."""
        if not self._people:
            raise ExportError("there is no session that could be exported")
        columns = self._session_columns(self._factors)
        for participant, label in self._labels.items():
            stem = self._root / f"sub-{label}" / f"sub-{label}_scans"
            rows = ([row.get(name, NOTHING) for name in columns] for row in self._people[participant].rows)
            self._write(stem.with_suffix(".tsv"), table_text(columns, rows))
            self._write_json(stem.with_suffix(".json"), sidecar(columns))
        for task, facts in sorted(self._tasks.items()):
            about = self._task_description(task, facts)
            self._write_json(self._root / f"task-{task}_events.json", {**about, **sidecar(self._event_columns)})
            self._write_json(self._root / f"task-{task}_beh.json", {**about, **DEVICE_VALUES, **sidecar(ACT_COLUMNS)})
        self._write_participants()
        self._write_questionnaires()
        self._write_json(self._root / "dataset_description.json", self._description())
        self._write(self._root / "README.md", self._readme())
        self._write(self._root / "CHANGES", f"1.0.0\n  - Exported by rise-tui {__version__}.\n")

    # --- names ---

    def _file_name(self, facts: SessionFacts, label: str, task: str, number: int) -> str:
        """Make a file name from BIDS entities. `acq` marks rehearsals and repeated attempts."""
        rehearsal = facts.purpose if facts.purpose not in ("", "counted") else ""
        again = f"attempt{facts.attempt}" if facts.attempt > 1 else ""
        run = facts.run or number
        for extra in ("", *(f"n{each}" for each in range(2, 10_000))):
            acquisition = f"_acq-{rehearsal}{again}{extra}" if rehearsal or again or extra else ""
            name = f"sub-{label}_task-{task}{acquisition}_run-{run}"
            if name not in self._names:
                break
        self._names.add(name)
        return name

    def _group(self, facts: SessionFacts) -> str:
        study = self._context.study
        between = [each.name for each in study.factors if each.kind == "between"] if study is not None else []
        return "+".join(str(facts.factors[name]) for name in between if name in facts.factors)

    def _session_columns(self, factors: Iterable[str]) -> Columns:
        columns = [factor_column(name, self._context.study) for name in factors]
        return session_columns(columns, dated=self._context.level == "full")

    # --- what is about all ---

    def _write_participants(self) -> None:
        study, context = self._context.study, self._context
        people: tuple[Participant, ...] = load_participants(study).participants if study is not None else ()
        groups = {name: person.group for name, person in self._people.items()}
        columns, rows, warnings = participants_table(self._labels, groups, study, people)
        context.warnings += warnings
        changed = [f"{name or 'nobody'}: sub-{label}" for name, label in self._labels.changed().items()]
        if changed:
            context.warnings.append(
                "BIDS has letters and digits only in a participant's name, so some have others there: "
                + ", ".join(changed)
            )
        self._write_table(self._root / "participants.tsv", columns, rows)
        self._write_json(self._root / "participants.json", sidecar(columns))

    def _write_questionnaires(self) -> None:
        """Write the answers. BIDS has one row per participant, so answers after each run have a table for each run."""
        context = self._context
        participant = Column(
            "participant_id",
            "The participant, as in participants.tsv.",
            lambda answers: f"sub-{self._labels.label(answers.participant)}",
        )
        for questionnaire in answers_at_level(context.study, context.level, self._sessions, context.warnings):
            columns = {column.name: column for column in (participant, *questionnaire.columns)}
            for run in sorted({answers.run or 0 for _, answers in questionnaire.rows}):
                rows = (cells(columns, answers) for _, answers in questionnaire.rows if (answers.run or 0) == run)
                stem = self._root / "phenotype" / (f"{questionnaire.name}_run{run}" if run else questionnaire.name)
                about = questionnaire.settings.about or questionnaire.about
                about = f"{about.rstrip('.')}. Asked after run {run}." if run else about
                self._write(stem.with_suffix(".tsv"), table_text(columns, rows))
                self._write_json(
                    stem.with_suffix(".json"), {"MeasurementToolMetadata": {"Description": about}, **sidecar(columns)}
                )

    def _description(self) -> dict[str, Any]:
        study = self._context.study
        report = study.report if study is not None else {}
        titles = dict.fromkeys(each.title for facts in self._tasks.values() for each in facts)
        description: dict[str, Any] = {
            "Name": study.title if study is not None else ", ".join(titles) or "RISE sessions",
            "BIDSVersion": VERSION,
            "DatasetType": "raw",
            "GeneratedBy": [
                {
                    "Name": "rise-tui",
                    "Version": __version__,
                    "Description": f"rise-engine export --format bids --level {self._context.level}",
                }
            ],
            "SourceDatasets": [{"URL": "bids::sourcedata/rise"}],
        }
        if report.get("license"):
            description["License"] = report["license"]
        description["Authors"] = [each.name for each in authors_of(report)]
        for key, name in (("EthicsApprovals", "ethics"), ("Funding", "funding")):
            if report.get(name):
                description[key] = [report[name]]
        missing = [name for name in ("authors", "license") if not report.get(name)]
        if missing:
            self._context.warnings.append(
                f"dataset_description.json does not say {' and '.join(missing)}: write them there, or in study.toml "
                '([report] authors = "Doe, J.; Roe, M." and license = "CC-BY-4.0") and export again'
            )
        return description

    def _task_description(self, task: str, facts: list[SessionFacts]) -> dict[str, Any]:
        study = self._context.study
        report = study.report if study is not None else {}
        versions = dict.fromkeys(each.versions.get("rise-tui", "") for each in facts)
        systems = dict.fromkeys(each.versions.get("system", "") for each in facts)
        return {
            "TaskName": task,
            "TaskDescription": report.get("story") or ", ".join(dict.fromkeys(each.title for each in facts)),
            "Instructions": report.get("instructions") or "n/a",
            "InstitutionName": report.get("institution") or "n/a",
            "InstitutionAddress": report.get("institution_address") or "n/a",
            "InstitutionalDepartmentName": report.get("department") or "n/a",
            "StimulusPresentation": {
                "OperatingSystem": ", ".join(filter(None, systems)) or "n/a",
                "SoftwareName": "rise-tui",
                "SoftwareVersion": ", ".join(filter(None, versions)) or "n/a",
            },
        }

    def _readme(self) -> str:
        sessions = sum(len(person.rows) for person in self._people.values())
        what = {
            "full": "Everything is included as it was recorded, also notes and times of day.",
            "shared": "There are no dates, no notes and no names of wizards; private values are shown as the names of "
            "their keys.",
            "public": "There are no dates, no notes, no names of wizards, and no words that wizards said freely; "
            "private values are shown as the names of their keys.",
        }[self._context.level]
        study = self._context.study
        lines = [
            f"# {study.title if study is not None else 'Sessions with a robot'}",
            "",
            f"{sessions} sessions of {len(self._people)} participants with a robot, recorded and exported by rise-tui "
            f"{__version__}.",
            "",
            f"Level `{self._context.level}`: {what}",
            "",
            "- `sub-*/beh/*_events.tsv`: everything that has a time. Onsets are seconds since the session began.",
            "- `sub-*/beh/*_beh.tsv`: a row for each act of the robot, with the parts of its latency.",
            "- `sub-*/*_scans.tsv`: a row for each session: condition, factors, outcome.",
            *(["- `phenotype/`: the answers to questionnaires."] if study is not None and study.questionnaires else []),
            "- `*.json`: what every column means.",
            "- `sourcedata/rise`: "
            + (
                "the session folders themselves, which rise-tui replays."
                if self._context.level == "full"
                else "the records of the sessions, one JSON object a line, at this level."
            ),
        ]
        lines += ["", UNSAFE]
        if self._media:
            lines += [
                "",
                "Recordings are not in here: in `beh` BIDS has no place for them yet (BEP047).",
            ]
        return "\n".join([*lines, ""])

    # --- files ---

    def _write_source(self, data: SessionData, folder: Path, name: str) -> None:
        """Write the source: the session itself at level full, else its records at the level."""
        if data.level != "full":
            records = b"".join(encode_record(record) + b"\n" for record in data.records)
            self._write_bytes(folder / f"{name}_records.jsonl", records)
            return
        target = folder / data.facts.session
        for each in (INFO, JOURNAL, MEDIA_FILE):
            if (data.folder / each).is_file():
                self._copy(data.folder / each, target / each)
        for path in coded_paths(data.folder):
            self._copy(path, target / path.relative_to(data.folder))
        for path in (path for copy in copy_folders(data.folder) for path in sorted(copy.rglob("*"))):
            if path.is_file() and not path.is_symlink():
                self._copy(path, target / path.relative_to(data.folder))

    def _copy(self, source: Path, target: Path) -> None:
        make_private_folder(target.parent)
        with source.open("rb") as file, new_file(target) as copy:
            shutil.copyfileobj(file, copy)

    def _write_table(self, path: Path, columns: Columns, rows: Iterable[Any]) -> None:
        self._write(path, table_text(columns, (cells(columns, row) for row in rows)))

    def _write_json(self, path: Path, value: dict[str, Any]) -> None:
        self._write(path, json.dumps(value, indent=2, ensure_ascii=False) + "\n")

    def _write(self, path: Path, text: str) -> None:
        self._write_bytes(path, text.encode("utf-8", "replace"))

    def _write_bytes(self, path: Path, data: bytes) -> None:
        make_private_folder(path.parent)
        with new_file(path) as file:
            file.write(data)


def write_bids(folder: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    """Write a data set of BIDS.

    :param folder: the new folder.
    :param sessions: one after the other; none is kept.
    :param context: the level, and the study if there is one; its `warnings` gets sentences about remaining tasks.
    :raises ExportError: there is no session.
    """
    folder.mkdir(0o700)
    dataset = _Dataset(folder, context)
    for data in sessions:
        dataset.add(data)
    dataset.close()


FORMAT = ExportFormat(
    name="bids",
    about="a data set of BIDS 1.11.1 (behaviour): events, acts, participants",
    shape="folder",
    suffix="",
    write=write_bids,
)
