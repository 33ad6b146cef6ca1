"""All texts of a study as one table: a row for each, with its translations (docs/reference/languages.md)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Literal, TypeAlias
from zlib import crc32

from msgspec import Struct

from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import Act, Action, Scenario
from rise_engine.scenario.parameters import fill_parameters
from rise_engine.scenario.reading.translations import LanguageTexts
from rise_engine.scenario.speech.spoken import MESSAGE
from rise_engine.scenario.speech.spoken_texts import SpokenText, TableText
from rise_engine.scenario.speech.template import MissingValueError

FIXED_COLUMNS = ("id", "act", "no.", "when", "with", "text", "note", "seconds", "place", "of", "check")
"""All columns except those of the languages, which follow `text`."""
NOTHING = "-"
"""In `check`: there was no translation."""
Only: TypeAlias = Literal["missing", "stale"]


class TextRow(Struct, frozen=True):
    """One text."""

    id: str
    """The id of the text, `R_Praise/2/1`."""
    act: str
    number: str
    """The action and the wording, `2 (1)`, so that no spreadsheet takes it for a date."""
    when: str
    """`at once`, or what it waits for: `after 3, 4`."""
    beside: str
    """What the robot does at the same time: `Animation: enthusiastic`."""
    text: str
    translations: dict[str, str]
    """By language; empty if there is none."""
    note: str
    """For translators: which translation belongs to an earlier text."""
    seconds: float | None
    """Estimated seconds of saying it; None: it is in a table."""
    place: str
    """`acts/feedback.xml:8`."""
    stale: frozenset[str] = frozenset()
    """Languages whose translation belongs to an earlier text."""

    @property
    def check(self) -> str:
        """Check sums that show an import whether a translation has changed since: `de:3f2a9c01 fr:-`."""
        return " ".join(f"{language}:{text_check(text)}" for language, text in self.translations.items())

    def cells(self) -> list[str]:
        """Return the cells in the order of `TextTable.columns`."""
        before = [_id_cell(self.id), self.act, self.number, self.when, self.beside, self.text]
        seconds = "" if self.seconds is None else f"{self.seconds:.1f}"
        behind = [self.note, seconds, self.place, self.text, self.check]
        return [*before, *self.translations.values(), *behind]


class TextTable(Struct, frozen=True):
    """All texts, or those that lack something."""

    languages: tuple[str, ...]
    """The languages of the translations."""
    rows: tuple[TextRow, ...]
    language: str = ""
    """The language of the acts; empty: unknown."""

    @property
    def columns(self) -> list[str]:
        return [*FIXED_COLUMNS[:6], *self.languages, *FIXED_COLUMNS[6:]]


def make_table(loaded: LoadResult, languages: Sequence[str] = (), only: Only | None = None) -> TextTable:
    """Make the table of a scenario's texts.

    :param loaded: the scenario, loaded in no language and without errors.
    :param languages: the translations to show, also new ones; empty: all existing ones.
    :param only: only texts with a missing translation, or with a stale one.
    """
    scenario = loaded.scenario
    assert scenario is not None
    known = {each.lower(): each for each in loaded.translations}
    shown = tuple(dict.fromkeys(known.get(each.lower(), each) for each in languages)) or tuple(loaded.translations)
    files = [loaded.translations.get(each) or LanguageTexts(each, "") for each in shown]
    rows = [
        _make_row(text, scenario, files)
        for text in loaded.texts
        if only is None or any((each.missing if only == "missing" else each.stale)([text]) for each in files)
    ]
    rows += [
        _make_table_row(text, shown)
        for text in loaded.table_texts
        if only is None or (only == "missing" and not all(map(text.translation, shown)))
    ]
    return TextTable(shown, tuple(rows), scenario.language)


def text_check(text: str) -> str:
    """Return a short check sum of a text, which shows a change."""
    return f"{crc32(text.encode('utf-8', 'surrogatepass')):08x}" if text else NOTHING


def _make_row(text: SpokenText, scenario: Scenario, files: Sequence[LanguageTexts]) -> TextRow:
    act, action, location = scenario.acts[text.act], text.action, text.action.location
    number = action.id if len(action.calls) == 1 else f"{action.id} ({text.variant + 1})"
    given = {each.language: each.texts.get(text.id) for each in files}
    notes = [
        f"{language}: the text has changed since this translation; it was “{each.of}”"
        for language, each in given.items()
        if each is not None and each.of != text.text
    ]
    if text.parameter != MESSAGE:
        notes.insert(0, f"{text.call.type}: {text.parameter}")
    return TextRow(
        text.id,
        text.act,
        number,
        f"after {', '.join(action.wait_for)}" if action.wait_for else "at once",
        _beside(act, action),
        text.text,
        {language: translation.template.text if translation else "" for language, translation in given.items()},
        "; ".join(notes),
        _seconds(text, scenario),
        f"{location.file}:{location.line}",
        frozenset(language for language, each in given.items() if each is not None and each.of != text.text),
    )


def _make_table_row(text: TableText, languages: Sequence[str]) -> TextRow:
    file = text.table.location.file
    translations = {language: text.translation(language) for language in languages}
    return TextRow(text.id, "", "", "", "", text.text, translations, f"{text.table.name}, {text.column}", None, file)


def _beside(act: Act, action: Action) -> str:
    """Describe in a word or two each what begins at the same time as an action."""
    said = []
    for other in act.actions:
        if other.id == action.id or set(other.wait_for) != set(action.wait_for):
            continue
        call = other.calls[0]
        value = call.parameters.get("value")
        said.append(f"{call.type}: {value.text}" if value is not None else call.type)
    return ", ".join(said)


def _seconds(text: SpokenText, scenario: Scenario) -> float:
    spec = scenario.robot.actions[text.call.type]
    try:
        parameters = fill_parameters(text.call, spec, {**scenario.memory, **scenario.table_memory})
    except (MissingValueError, ValueError):
        parameters = {text.parameter: text.text}
    return expected_seconds(spec, parameters)


def _id_cell(id: str) -> str:
    """Write an id as a cell; one that could look like a date or a formula gets the word `act` before it."""
    return id if id[:1].isalpha() else f"act {id}"


def id_of_cell(cell: str, known: Collection[str]) -> str:
    """Return the id that a cell names."""
    cell = cell.strip()
    return cell.removeprefix("act ") if cell not in known else cell


class ReadRow(Struct, frozen=True):
    """A row of a file."""

    line: int
    """Its number in the file, for messages."""
    values: dict[str, str]
    """By column."""
    confirmed: frozenset[str] = frozenset()
    """Languages in which somebody has confirmed the translation (gettext: it is not fuzzy)."""


class ReadTable(Struct, frozen=True):
    columns: tuple[str, ...]
    rows: tuple[ReadRow, ...]
    what: str = "row"
    """The word for a row in messages."""
