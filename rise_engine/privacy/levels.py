"""The export levels: everything (full), data that researchers may share (shared), or public data (public).

full     everything, as it was recorded
shared   no times of day and dates, no notes and reasons that people typed, `{person_name}` for private keys,
         speech with private values as in its act, W1, W2, ... for wizards, no paths of recordings; for what
         participants said, and for comments in annotations, only the number of words
public   as shared, and only the number of words for what wizards said freely
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal, TypeAlias

from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.text import pluralize
from rise_engine.kernel.records import ENGINE, AnyRecord
from rise_engine.kernel.speech import SAY
from rise_engine.privacy.private_values import NAMES_FIELDS, PrivateValues
from rise_engine.scenario.parameters import LANGUAGE
from rise_engine.session.coded import CodedFile, read_coded, read_spans
from rise_engine.session.coded_formats import CodedClock, CodedSpan

ExportLevel: TypeAlias = Literal["full", "shared", "public"]
LEVELS: tuple[ExportLevel, ...] = ("full", "shared", "public")
_STARTED = re.compile(r"^\d{4}-\d{2}-\d{2}_\d{6}_")
_PERSON = re.compile(r"^(wizard|observer):(.*)$", re.DOTALL)
_NON_PERSONS = frozenset({"command-line"})
_COUNTED = re.compile(r"\[(?:note|free text|free speech), \d+ words?\]")
"""Texts that are already counted, in a shared session."""
_TYPED = {"note": "text", "cue": "text", "check": "reason", "outcome": "reason", "recording": "reason"}
"""The field with people's typed text, for each kind of record."""
_WRITTEN_BY_PROGRAM = frozenset({"check", "note", "session", "recording", "robot"})
"""Kinds of records whose sentences can contain a date (such as that of a plan) or a file's path."""
_SENTENCES = ("text", "value", "reason", "detail")
_DATE = re.compile(
    r"\b\d{4}-\d{2}-\d{2}(?:[T _]\d{2}:?\d{2}(?::?\d{2}(?:[.,]\d+)?)?(?:\s?(?:UTC|Z|[+-]\d{2}:?\d{2})\b)?)?(?!\d)"
)
_PLACE = re.compile(
    r"file:[^\s,;\"'`]+|(?<![\w/.])(?:~|[A-Za-z]:\\|/(?:home|Users|root|mnt|media|tmp|var|data|srv|run|opt|private|Volumes)\b)"
    r"[^\s,;\"'`]*"
)
"""The path of a file. ROS names have the same form, so only paths in the usual top folders match."""
MAX_SHOWN_AGE = 89
"""Maximum age in years. BIDS replaces higher ages by it, so that age does not identify anybody."""
_AGES = frozenset({"age", "alter", "edad"})
"""Names of age columns in lower case."""


class LevelFilter:
    """A filter that shows a session's records at a level. First `note` every record, then `apply` it to each."""

    def __init__(
        self, level: ExportLevel, private: PrivateValues | None, wizards: Mapping[str, str] | None = None
    ) -> None:
        """`private`: of the session's scenario; not needed for `full`. `wizards`: the code of each wizard, by name."""
        self.level = level
        self._private = private
        self._people: dict[str, str] = {}
        self._given = dict(wizards or {})
        self._names: re.Pattern[str] | None = None

    def session_name(self, folder: str) -> str:
        """Return the session's name for a table, without its date at the levels below full."""
        return folder if self.level == "full" else _STARTED.sub("", folder)

    @property
    def people(self) -> dict[str, str]:
        """The code of each wizard and observer, by name. Complete after `note`."""
        return dict(self._people)

    def name_of_coder(self, name: str) -> str:
        """Return the name or code of a person who annotated the session."""
        if self.level == "full" or not name:
            return name
        self._note_person("coder", name)
        return self._people.get(name, name)

    def count_typed_words(self, text: str) -> str:
        """Return a typed text that is in no record (such as a reason in the study's log) as this level allows."""
        return text if self.level == "full" or not text else count_words("free text", text)

    def note(self, records: Iterable[AnyRecord]) -> None:
        """Collect private values and people from all records."""
        if self._private is None or self.level == "full":
            return
        for record in records:
            self._private.note(record)
            for name in ("source", "by", "holder"):
                if found := _PERSON.match(str(getattr(record, name, None) or "")):
                    self._note_person(found[1], found[2].partition("#")[0])
        if self._people:
            longest = sorted(self._people, key=len, reverse=True)
            self._names = re.compile(rf"(?<!\w)(?:{'|'.join(map(re.escape, longest))})(?!\w)(?:#\d+)?")

    def apply(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return a record as JSON at this level."""
        if self._private is None or self.level == "full":
            return values
        values = _without_typed(values["kind"], values)
        if self.level == "public":
            values = _without_free_speech(values)
        values = {name: self._hide_people(name, each) for name, each in values.items()}
        return {**self._private.hide_fields(values), "wall": ""}

    def apply_to_input(self, values: dict[str, Any], *, rejected: bool = False) -> dict[str, Any]:
        """Return an input as JSON without typed texts and people's names. Private values stay (`PrivateValues`).

        :param values: the input's fields.
        :param rejected: whether it is a task that was rejected.
        """
        if self.level == "full":
            return values
        kind = values["input"]
        values = _without_typed("task" if kind == "submit" else kind, values)
        if self.level == "public" and kind == "submit":
            filtered = _without_free_speech(
                {**values, "kind": "task", "status": "REJECTED" if rejected else "", "reason": ""}
            )
            values = {**values, "behavior": filtered["behavior"]}
        return {name: self._hide_people(name, each) for name, each in values.items()}

    def _note_person(self, role: str, name: str) -> None:
        if not name or name in _NON_PERSONS or name in self._people:
            return
        letter = {"wizard": "W", "coder": "C"}.get(role, "O")
        numbers = (f"{letter}{number}" for number in range(1, 10_000))
        taken = {*self._people.values(), *self._given.values()}
        self._people[name] = self._given.get(name) or next(each for each in numbers if each not in taken)

    def _hide_people(self, field: str, value: Any) -> Any:
        if isinstance(value, str) and field in ("source", "by", "holder"):
            if found := _PERSON.match(value):
                name, mark, number = found[2].partition("#")
                return f"{found[1]}:{self._people.get(name, name)}{mark}{number}"
            return value
        if field in NAMES_FIELDS or self._names is None:
            return value
        return self._replace_people(value)

    def _replace_people(self, value: Any) -> Any:
        if isinstance(value, str) and self._names is not None:
            return self._names.sub(lambda found: self._people[found[0].partition("#")[0]], value)
        if isinstance(value, list):
            return [self._replace_people(each) for each in value]
        if isinstance(value, dict):
            return {key: self._replace_people(each) for key, each in value.items()}
        return value


def _without_typed(kind: str, values: dict[str, Any]) -> dict[str, Any]:
    """Remove typed texts from a record, or from an input whose fields have the same names."""
    typed = _TYPED.get(kind, "")
    if typed and values.get(typed) and _is_typed(kind, values["source"]):
        values = {**values, typed: count_words("note" if kind == "note" else "free text", values[typed])}
    if kind == "task" and values["function"] == "markCue" and values["behavior"]:
        values = {**values, "behavior": count_words("free text", values["behavior"])}
    if kind == "recording":
        values = {**values, "path": ""}
    if kind in _WRITTEN_BY_PROGRAM:
        sentences = {
            name: without_dates_and_places(values[name]) for name in _SENTENCES if isinstance(values.get(name), str)
        }
        values = {**values, **sentences}
    return values


def without_dates_and_places(sentence: str) -> str:
    """Replace dates, with their times of day, and files' paths in a sentence of the program."""
    return _DATE.sub("[date]", _PLACE.sub("[place]", sentence))


def _is_typed(kind: str, source: str) -> bool:
    """Whether a text may be typed. Programs' notes may contain what they heard; the engine's own are never typed."""
    return source != ENGINE if kind in ("note", "cue") else _PERSON.match(source) is not None


def _without_free_speech(values: dict[str, Any]) -> dict[str, Any]:
    match values["kind"]:
        case "task" if values["function"] == SAY:
            return {**values, "behavior": count_words("free speech", values["behavior"])}
        case "task" if values["status"] == "REJECTED" and _PERSON.match(values["source"]):
            counted = count_words("free text", values["behavior"])
            return {**values, "behavior": counted, "reason": "rejected"}
        case "action" if values["act"] == SAY:
            parameters = {
                name: count_words("free speech", each) if isinstance(each, str) and name != LANGUAGE else each
                for name, each in values["parameters"].items()
            }
            return {**values, "parameters": parameters}
    return values


def count_words(what: str, text: str) -> str:
    """Replace a typed text by its number of words. A text that is already counted stays.

    >>> count_words("note", "she looks away"), count_words("free text", "[note, 3 words]")
    ('[note, 3 words]', '[note, 3 words]')
    """
    return text if _COUNTED.fullmatch(text) else f"[{what}, {pluralize(len(text.split()), 'word')}]"


def coded_at_level(folder: Path, level: LevelFilter) -> list[CodedFile]:
    """Return a session's annotations for coded.json of a shared session. Empty: they cannot be read.

    :param folder: the session's folder.
    :param level: the filter of a level below full.
    """
    files: list[CodedFile] = []
    try:
        for number, file in enumerate(read_coded(folder), 1):
            spans = tuple(span_at_level(each, file, level) for each in read_spans(folder, file))
            files.append(
                CodedFile(
                    name=str(number),
                    sha256="",
                    clock=CodedClock(),
                    clock_by=file.clock_by,
                    tiers=file.tiers,
                    speech=file.speech,
                    spans=spans,
                )
            )
    except SessionError:
        return []
    return files


def span_at_level(span: CodedSpan, file: CodedFile, level: LevelFilter) -> CodedSpan:
    """Return an annotation at a level: participants' speech and comments become their number of words."""
    return replace(
        span,
        annotator=level.name_of_coder(span.annotator),
        value=level.count_typed_words(span.value) if span.tier in file.speech else span.value,
        comment=level.count_typed_words(span.comment),
    )


def cut_age(column: str, value: str) -> str:
    """Limit a value of participants.csv for shared data: ages above MAX_SHOWN_AGE become MAX_SHOWN_AGE.

    >>> [cut_age("age", "91"), cut_age("Alter", "89.5"), cut_age("age", "34"), cut_age("stage", "91")]
    ['89', '89', '34', '91']
    """
    if column.casefold() not in _AGES:
        return value
    try:
        return str(MAX_SHOWN_AGE) if float(value) > MAX_SHOWN_AGE else value
    except ValueError:
        return value
