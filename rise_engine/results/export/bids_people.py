"""The participants of a BIDS export: their labels, and their data from the study and participants.csv."""

from __future__ import annotations

import re

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.privacy.levels import MAX_SHOWN_AGE, cut_age
from rise_engine.results.export.bids_tables import ENTITIES, Columns
from rise_engine.results.export.table_schema import Column
from rise_engine.study.model import Participant, Study

UNNAMED = "unnamed"
"""Replaces a participant that the session does not name."""
_NO_LABEL = re.compile(r"[^A-Za-z0-9]+")
_SEXES = {"male", "m", "female", "f", "other", "o", "MALE", "M", "FEMALE", "F", "OTHER", "O", "n/a"}
_HANDEDNESS = {"left", "l", "right", "r", "ambidextrous", "a", "n/a", "LEFT", "L", "RIGHT", "R", "AMBIDEXTROUS", "A"}


class Person(Struct, frozen=True):
    """A row of the participants table."""

    label: str
    group: str
    participant: Participant | None
    """Their row in participants.csv. None: they are not in it."""


_COLUMNS = {
    column.name: column
    for column in (
        Column("participant_id", "The pseudonym of the participant, after sub-.", lambda person: f"sub-{person.label}"),
        Column("age", f"Age in years; {MAX_SHOWN_AGE} also stands for everybody older.", unit="year"),
        Column("group", "The condition between participants: levels joined by +.", lambda person: person.group),
    )
}


def label_of(text: str) -> str:
    """Convert a text to a BIDS label, which has letters and digits only.

    >>> label_of("P-07 b")
    'P07b'
    """
    return _NO_LABEL.sub("", text)


class Labels:
    """Gives each participant a unique label."""

    def __init__(self) -> None:
        self._labels: dict[str, str] = {}

    def label(self, participant: str) -> str:
        """Return a participant's label after `sub-`."""
        if participant not in self._labels:
            plain = label_of(participant) or UNNAMED
            taken = {each.casefold() for each in self._labels.values()}
            found = plain
            number = 2
            while found.casefold() in taken:  # `P-1` and `P1`; case-insensitive file systems would also confuse `p1`
                found, number = f"{plain}x{number}", number + 1
            self._labels[participant] = found
        return self._labels[participant]

    def changed(self) -> dict[str, str]:
        """Return the participants whose label differs from their pseudonym, with the label."""
        return {name: label for name, label in self._labels.items() if name != label}

    def items(self) -> list[tuple[str, str]]:
        """Return every participant with their label, sorted by label."""
        return sorted(self._labels.items(), key=lambda item: item[1])


def participants_table(
    labels: Labels, groups: dict[str, str], study: Study | None, people: tuple[Participant, ...]
) -> tuple[Columns, list[Person], list[str]]:
    """Return the columns of participants.tsv, its rows, and sentences for the person who exports.

    :param labels: the labels of the participants in the export.
    :param groups: the between condition of each; empty: there is none.
    :param study: their study.
    :param people: the rows of participants.csv.
    """
    known = {each.participant: each for each in people}
    strata = study.strata if study is not None else {}
    further = study.columns if study is not None else ()
    columns = {"participant_id": _COLUMNS["participant_id"]}
    warnings: list[str] = []
    for name in [*strata, *(each for each in further if each not in strata)] if known else []:
        own = [_value(known[each], name) for each, _ in labels.items() if each in known]
        column = name if _fits(name, own) else f"{name}_as_written"
        if column != name:
            warnings.append(f"BIDS has its own rules for the column {name!r}, which yours does not follow: {column}")
        described = study.descriptions.get(name, "") if study is not None else ""
        columns[column] = _column_of(column, name, tuple(strata.get(name, ())), described)
    if any(groups.values()):
        columns["group"] = _COLUMNS["group"]
    rows = [Person(label, groups.get(participant, ""), known.get(participant)) for participant, label in labels.items()]
    return columns, rows, warnings


def _value(person: Participant, name: str) -> str:
    return person.strata.get(name) or person.columns.get(name, "")


def _column_of(column: str, name: str, levels: tuple[str, ...], about: str) -> Column:
    described = _COLUMNS.get(column, Column(name, f"{name}, as participants.csv has it."))
    return replace(
        described,
        about=about or described.about,
        value=lambda person: person.participant and cut_age(name, _value(person.participant, name)),
        levels={level: level for level in levels},
    )


def _fits(name: str, values: list[str]) -> bool:
    """Whether a column that BIDS defines has values that BIDS allows."""
    filled = [each for each in values if each]
    match name:
        case "age":
            return all(_number(each) is not None for each in filled)
        case "sex":
            return all(each in _SEXES for each in filled)
        case "handedness":
            return all(each in _HANDEDNESS for each in filled)
        case "participant_id" | "group" | "species" | "strain" | "strain_rrid" | "HED":
            return False
    return name not in ENTITIES


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
