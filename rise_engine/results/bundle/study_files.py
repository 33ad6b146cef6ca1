"""The files of a study in a bundle: study.toml, participants.csv, plan.csv, study.jsonl, scenarios."""

from __future__ import annotations

import csv
import io
import re
import shutil
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from rise_engine.base.files import make_private_folder
from rise_engine.base.json_codec import encode
from rise_engine.privacy.levels import ExportLevel, LevelFilter, cut_age, without_dates_and_places
from rise_engine.results.export.format import ExportError
from rise_engine.study.checks import AUTOMATIC
from rise_engine.study.model import Participant, Study
from rise_engine.study.study_log import WITHDRAWN_PREFIX, LogEntry
from rise_engine.study.study_scenarios import scenario_folder
from rise_engine.study.traces import is_withdrawn, without_salts
from rise_engine.study.withdrawal_work import EXPORTED

GIVEN = "1900-01-01"
"""Replaces the date of a consent where the level shows no dates. Nobody can have consented on it."""
_TABLE = re.compile(r"^\s*\[wizards\]")
_NEXT_TABLE = re.compile(r"^\s*\[")
_INLINE = re.compile(r"^\s*wizards\s*[.=]")
_DATE = re.compile(r"^\d{4}-\d{2}-\d{2}_\d{6}_")


def study_text(text: str, people: Mapping[str, str], level: ExportLevel) -> str:
    """Return study.toml, at levels below full without the names of wizards.

    :param text: its text.
    :param people: the code of each wizard in the bundle, by name.
    :raises ExportError: the names cannot be removed.
    """
    if level == "full" or "wizards" not in tomllib.loads(text):
        return text
    kept: list[str] = []
    within = False
    for line in text.splitlines(keepends=True):
        within = bool(_TABLE.match(line)) or (within and not _NEXT_TABLE.match(line))
        if not within and not _INLINE.match(line):
            kept.append(line)
    new = "".join(kept).rstrip("\n") + "\n"
    names = dict.fromkeys(people.values())
    if names:
        new += "\n[wizards]\n" + "".join(f'"{name}" = "{name}"\n' for name in names)
    try:
        before, after = tomllib.loads(text), tomllib.loads(new)
    except tomllib.TOMLDecodeError:  # the names are still there
        before, after = {}, {"wizards": {}}
    if before | {"wizards": {}} != after | {"wizards": {}} or not before:
        raise ExportError(
            "the names of wizards in study.toml cannot be taken out: write [wizards] as a table of its own"
        )
    return new


def participants_text(study: Study, people: Iterable[Participant], level: ExportLevel) -> str:
    """Write participants.csv without comments, at levels below full also without dates and ages above 89."""
    consents = [f"consent_{name}" for name in study.consent]
    columns = ["participant", *study.strata, *consents, "status", *study.columns]
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(columns)
    for person in people:
        given = [person.consent.get(name, "") for name in study.consent]
        further = [person.columns.get(name, "") for name in study.columns]
        if level != "full":  # as in BIDS
            further = [cut_age(name, value) for name, value in zip(study.columns, further, strict=True)]
        rows.writerow(
            [
                person.participant,
                *(person.strata.get(name, "") for name in study.strata),
                *(each if level == "full" or not each else GIVEN for each in given),
                person.status,
                *further,
            ]
        )
    return text.getvalue()


def log_text(log: Iterable[LogEntry], names: Mapping[str, str], people: Mapping[str, str], level: ExportLevel) -> str:
    """Write study.jsonl without salts, and without lines about participants who have withdrawn. An earlier version of
    the program wrote such lines when one of their sessions came back.

    Levels below full also lack dates, names, typed texts, paths of exports, and rehearsals that are not in the bundle.

    :param log: its entries.
    :param names: the names of sessions in the bundle, by their folders' names.
    :param people: the codes of wizards.
    :param level: how much is shown.
    """
    entries = list(log)
    names_of = {str(each.get("participant") or "") for each in entries}
    gone = {name for name in names_of if not name.startswith(WITHDRAWN_PREFIX) and is_withdrawn(name, entries)}
    entries = without_salts([each for each in entries if each.get("participant") not in gone])
    if level == "full":
        return _lines((each.at, each.kind, each.fields) for each in entries)
    count = LevelFilter(level, None).count_typed_words
    told = []
    not_counted = {
        str(each.get("folder"))
        for each in entries
        if each.kind == "session" and each.get("purpose") != "counted" and each.get("folder") not in names
    }
    for each in entries:
        about = {str(each.get("folder")), str(each.get("session"))}
        if each.kind in EXPORTED or about & not_counted:
            continue
        fields = _told_fields(each.fields, each.kind == "checked", people, count)
        for name in ("folder", "session"):
            if isinstance(folder := fields.get(name), str):
                fields[name] = told_name(folder, names, level)
        if "started" in fields:
            fields["started"] = ""
        told.append(("", each.kind, fields))
    return _lines(told)


def told_name(folder: str, names: Mapping[str, str], level: ExportLevel) -> str:
    """Return the name of a session in the log of a bundle.

    :param folder: its folder's name in the study.
    :param names: the names of sessions in the bundle, by their folders' names.
    """
    return folder if level == "full" else names.get(folder, _DATE.sub("", folder))


def _lines(entries: Iterable[tuple[str, str, dict[str, Any]]]) -> str:
    return "".join(encode({"kind": kind, "at": at, **fields}).decode() + "\n" for at, kind, fields in entries)


def _told_fields(
    fields: Mapping[str, Any], of_check: bool, people: Mapping[str, str], count: Callable[[str], str]
) -> dict[str, Any]:
    """Remove names, dates and typed texts from the fields of an entry, or of a check within an entry."""
    told: dict[str, Any] = {}
    for name, value in fields.items():
        if isinstance(value, list):
            told[name] = [
                _told_fields(each, name == "checks", people, count) if isinstance(each, dict) else each
                for each in value
            ]
        elif not isinstance(value, str):
            told[name] = value
        elif name == "reason" or (name == "value" and not of_check):
            told[name] = count(value)
        elif name == "value" and fields.get("text") == AUTOMATIC["wizard"]:
            told[name] = people.get(value, "W") if value else ""
        elif name in ("value", "text"):
            told[name] = without_dates_and_places(value)
        else:
            told[name] = _without_people(value, people)
    return told


def _without_people(value: str, people: Mapping[str, str]) -> str:
    """Replace the name in a source such as `wizard:anna`."""
    kind, colon, name = value.partition(":")
    return f"{kind}:{people.get(name, 'W')}" if colon and kind in ("wizard", "observer") else value


def copy_scenarios(study: Study, root: Path) -> tuple[list[str], list[str]]:
    """Copy the scenarios in the study's folder. Returns their paths in the bundle, and sentences about the others."""
    named = [study.scenario, *(level.scenario for factor in study.factors for level in factor.levels)]
    copied, left_out = [], []
    for name in dict.fromkeys(filter(None, named)):
        source = Path(scenario_folder(study, name))
        if not source.is_dir():
            continue
        if not source.is_relative_to(study.folder) or source == Path(study.folder):
            left_out.append(f"the scenario in {name} lies outside of the study: each session has its own copy of it")
            continue
        where = source.relative_to(study.folder)
        if (root / where).exists():
            continue  # it is inside one that was copied
        for path in sorted(source.rglob("*")):
            hidden = any(part.startswith(".") for part in path.relative_to(source).parts)
            if path.is_file() and not path.is_symlink() and not hidden:
                target = root / where / path.relative_to(source)
                make_private_folder(target.parent)
                shutil.copyfile(path, target)
        copied.append(f"{where.as_posix()}/")
    return copied, left_out
