"""The participants of a BIDS export: what each is called, and what study and participants.csv say about them."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from rise_engine.export.bids_columns import Description
from rise_engine.export.bids_rows import Row
from rise_engine.study.model import Participant, Study

UNNAMED = "unnamed"
"""Who took part where the session does not say it."""
OLDEST = 89
"""Years: BIDS has participants who are older at this age, so that nobody is known by it."""
_NO_LABEL = re.compile(r"[^A-Za-z0-9]+")
_SEXES = {"male", "m", "female", "f", "other", "o", "MALE", "M", "FEMALE", "F", "OTHER", "O", "n/a"}
_HANDS = {"left", "l", "right", "r", "ambidextrous", "a", "n/a", "LEFT", "L", "RIGHT", "R", "AMBIDEXTROUS", "A"}
_DESCRIPTIONS: dict[str, Description] = {
    "participant_id": {"LongName": "Participant", "Description": "The pseudonym of the participant, after sub-."},
    "age": {"LongName": "Age", "Description": f"In years; {OLDEST} stands for whoever is older, too.", "Units": "year"},
    "sex": {"LongName": "Sex", "Description": "As participants.csv has it."},
    "handedness": {"LongName": "Handedness", "Description": "As participants.csv has it."},
    "group": {"LongName": "Group", "Description": "The condition between participants: levels joined by +."},
}


def label_of(text: str) -> str:
    """A text as BIDS has labels: letters and digits only.

    >>> label_of("P-07 b")
    'P07b'
    """
    return _NO_LABEL.sub("", text)


class Labels:
    """Gives each participant a label of their own."""

    def __init__(self) -> None:
        self._labels: dict[str, str] = {}

    def label(self, participant: str) -> str:
        """What a participant is called behind `sub-`; always the same, and nobody else's."""
        if participant not in self._labels:
            plain = label_of(participant) or UNNAMED
            taken = {each.casefold() for each in self._labels.values()}
            found = plain
            number = 2
            while found.casefold() in taken:  # `P-1` and `P1`; file systems without capitals would mix `p1` in, too
                found, number = f"{plain}x{number}", number + 1
            self._labels[participant] = found
        return self._labels[participant]

    def changed(self) -> dict[str, str]:
        """Participants whose label is not their pseudonym, and the label."""
        return {name: label for name, label in self._labels.items() if name != label}

    def items(self) -> list[tuple[str, str]]:
        """Every participant with their label, by label."""
        return sorted(self._labels.items(), key=lambda item: item[1])


def participants_table(
    labels: Labels, groups: dict[str, str], study: Study | None, people: tuple[Participant, ...]
) -> tuple[dict[str, Description], list[Row], list[str]]:
    """The columns of participants.tsv with what they mean, its rows, and sentences for whoever exports.

    :param labels: of whoever is in the export.
    :param groups: the between condition of each; empty where there is none.
    :param study: the one they took part in.
    :param people: as participants.csv has them.
    """
    known = {each.participant: each for each in people}
    strata = study.strata if study is not None else {}
    further = study.columns if study is not None else ()
    columns: dict[str, Description] = {"participant_id": _DESCRIPTIONS["participant_id"]}
    values: dict[str, Callable[[Participant], str]] = {}
    warnings: list[str] = []
    for name in [*strata, *(each for each in further if each not in strata)] if known else []:
        own = [_value(known[each], name) for each, _ in labels.items() if each in known]
        column = name if _fits(name, own) else f"{name}_as_written"
        if column != name:
            warnings.append(f"BIDS has its own rules for the column {name!r}, which yours does not follow: {column}")
        columns[column] = _describe(column, name, tuple(strata.get(name, ())))
        values[column] = lambda person, name=name: _cut_age(name, _value(person, name))  # type: ignore[misc]
    if any(groups.values()):
        columns["group"] = _DESCRIPTIONS["group"]
    rows: list[Row] = []
    for participant, label in labels.items():
        person = known.get(participant)
        row: dict[str, Any] = {"participant_id": f"sub-{label}", "group": groups.get(participant, "")}
        rows.append({**row, **({name: read(person) for name, read in values.items()} if person else {})})
    return columns, rows, warnings


def _value(person: Participant, name: str) -> str:
    return person.strata.get(name) or person.columns.get(name, "")


def _describe(column: str, name: str, levels: tuple[str, ...]) -> Description:
    described = _DESCRIPTIONS.get(column, {"LongName": name, "Description": f"{name}, as participants.csv has it."})
    return {**described, "Levels": {level: level for level in levels}} if levels else described


def _fits(name: str, values: list[str]) -> bool:
    """Whether a column that BIDS defines holds what BIDS wants there."""
    said = [each for each in values if each]
    match name:
        case "age":
            return all(_number(each) is not None for each in said)
        case "sex":
            return all(each in _SEXES for each in said)
        case "handedness":
            return all(each in _HANDS for each in said)
        case "participant_id" | "group" | "species" | "strain" | "strain_rrid" | "HED":
            return False
    return True


def _cut_age(name: str, value: str) -> str:
    years = _number(value) if name == "age" else None
    return str(OLDEST) if years is not None and years > OLDEST else value


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
