"""All texts of a scenario that people hear or read, in its acts and its tables.

The id of an act's text in translations and tables is `ACT/ID`. The number of the wording follows if there are several
(`R_Praise/2/3`), then the parameter unless it is `message` (`R_Sing/1/words`). A column of a table is translated if it
has a translation (`text.de` beside `text`), or if a text of an act names it: `{items[i].text}`
(docs/reference/languages.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from msgspec import Struct

from rise_engine.expression.nodes import Key, Literal, Part
from rise_engine.scenario.model import Act, Action, ActionCall, ActionSpec, RobotProfile, SourceLocation, Table
from rise_engine.scenario.parameters import LANGUAGE, MESSAGE, spoken_parameters
from rise_engine.scenario.speech.languages import language_fits
from rise_engine.scenario.speech.ssml import plain_words
from rise_engine.scenario.speech.template import Template


class SpokenText(Struct, frozen=True):
    """One text."""

    act: str
    key: str
    """The key of the text within its act: `2`, `2/3`, `2/3/words`."""
    action: Action
    variant: int
    """The number of this wording, from 0, if there are several."""
    parameter: str
    template: Template
    is_needed: bool
    """Whether it needs a translation: it has words, in the language of the acts."""

    @property
    def id(self) -> str:
        return f"{self.act}/{self.key}"

    @property
    def text(self) -> str:
        """As written, on one line."""
        return self.template.text

    @property
    def call(self) -> ActionCall:
        return self.action.calls[self.variant]


def text_key(action: str, variant: int | None, parameter: str) -> str:
    """The key of a text within its act.

    :param variant: the number of the wording, from 0; None: there is only one.
    """
    parts = [action, *([] if variant is None else [str(variant + 1)]), *([] if parameter == MESSAGE else [parameter])]
    return "/".join(parts)


def spoken_texts(acts: Iterable[Act], robot: RobotProfile, language: str = "") -> Iterator[SpokenText]:
    """Yield all texts, in the order of the acts and of their actions.

    :param language: the language of the acts; empty: unknown.
    """
    for act in acts:
        for action in act.actions:
            several = len(action.calls) > 1
            for variant, call in enumerate(action.calls):
                spec = robot.actions[call.type]
                for parameter in spoken_parameters(spec):
                    template = call.parameters.get(parameter)
                    if template is None or not template.text:
                        continue
                    key = text_key(action.id, variant if several else None, parameter)
                    needed = _has_words(template) and not _is_in_other_language(call, spec, language)
                    yield SpokenText(act.name, key, action, variant, parameter, template, needed)


def _has_words(template: Template) -> bool:
    """Whether a text has a letter or a digit outside memory values, so that it may differ in another language."""
    pieces = (
        part if isinstance(part, str) else f"{part.before}{part.after}{part.fallback or ''}" for part in template.parts
    )
    return any(character.isalnum() for character in plain_words("".join(pieces)))


def _is_in_other_language(call: ActionCall, spec: ActionSpec, language: str) -> bool:
    """Whether the author gives an action its own language, which it keeps in every session."""
    own = own_language(call, spec)
    return own is not None and not (language and (language_fits(language, own) or language_fits(own, language)))


def own_language(call: ActionCall, spec: ActionSpec) -> str | None:
    """The author's language for a single action; None: none, or one from the memory."""
    given = call.parameters.get(LANGUAGE) if LANGUAGE in spec.parameters else None
    return (given.constant or "").strip() or None if given is not None else None


# --- texts in tables --------------------------------------------------------------------------------------------------


_LISTED = 5
"""Maximum number of rows in a sentence."""


class TableText(Struct, frozen=True):
    """A text in a table."""

    table: Table
    row: int
    """From 0."""
    column: str

    @property
    def id(self) -> str:
        """In the form of an expression: `items[2].text`."""
        return f"{self.table.name}[{self.row}].{self.column}"

    @property
    def text(self) -> str:
        """On one line."""
        return _on_one_line(self.table.rows[self.row][self.table.columns.index(self.column)])

    def translation(self, language: str) -> str:
        """Its translation into another language; empty: it is not translated."""
        found = self.table.translations.get(language, {}).get(self.column)
        return _on_one_line(found.values[self.row]) if found is not None else ""


def _on_one_line(value: object) -> str:
    return " ".join(value.split()) if isinstance(value, str) else ""


def table_texts(tables: Mapping[str, Table], spoken: Iterable[SpokenText]) -> Iterator[TableText]:
    """Yield the texts of all translated columns, except those without a letter or a digit.

    :param spoken: the texts of the acts, which can name columns.
    """
    spoken_columns = set(_spoken_columns(spoken))
    for table in tables.values():
        translated = {column for columns in table.translations.values() for column in columns}
        for at, column in enumerate(table.columns):
            # Without any translated column, the table's own columns may have different languages.
            can_be_said = bool(translated) and (table.name, "") in spoken_columns
            is_sentence = can_be_said and any(len(str(row[at]).split()) > 1 for row in table.rows)
            if column in translated or (table.name, column) in spoken_columns or is_sentence:
                for number, row in enumerate(table.rows):
                    value = row[at]
                    if isinstance(value, str) and any(character.isalnum() for character in value):
                        yield TableText(table, number, column)


def _spoken_columns(texts: Iterable[SpokenText]) -> Iterator[tuple[str, str]]:
    """Yield the columns in texts of acts, each with its table. Empty: a computed column, which may be any with
    sentences."""
    for text in texts:
        for slot in text.template.slots:
            match slot.part.root if slot.part is not None else None:
                case Part(Key(name), (_, str(column) | Literal(str(column)))):
                    yield name, column
                case Part(Key(name), (_, _)):
                    yield name, ""


def missing_sentences(texts: Iterable[TableText], language: str) -> Iterator[tuple[SourceLocation, str]]:
    """Yield a place and a sentence for each column that is not completely translated."""
    missing: dict[tuple[str, str], list[TableText]] = {}
    for text in texts:
        if not text.translation(language):
            missing.setdefault((text.table.name, text.column), []).append(text)
    for (name, column), found in missing.items():
        table = found[0].table
        given = table.translations.get(language, {}).get(column)
        if given is None:
            what = f"the table `{name}` is not translated into `{language}`: it has no column `{column}.{language}`"
            yield table.location, f"{what} beside `{column}`, which is spoken"
            continue
        rows = ", ".join(f"{each.row + 1} (“{each.text[:30]}”)" for each in found[:_LISTED])
        more = ", ..." if len(found) > _LISTED else ""
        word = "row" if len(found) == 1 else "rows"
        yield given.location, f"the table `{name}` has no `{column}.{language}` in {word} {rows}{more}"
