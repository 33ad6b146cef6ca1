"""Import of a table of texts: its changes become edits, one for each text (docs/reference/languages.md).

It compares each row with the state at the export (`of`, `check`) and with the study's present state. It takes changes
of the table, keeps changes of the study, and refuses rows that both have changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec import Struct

from rise_engine.author.edit.edits import AddAct, AddColumn, AddLanguage, AnyEdit, SetCell, SetTranslation
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.read_outline import read_outline
from rise_engine.author.edit.translations import edit_of_original
from rise_engine.author.texts.table import FIXED_COLUMNS, ReadRow, ReadTable, id_of_cell, text_check
from rise_engine.base.errors import ExchangeError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import pluralize
from rise_engine.expression.errors import shorten
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.reading.ssml_checks import find_ssml_problems
from rise_engine.scenario.reading.translations import LanguageTexts, slot_problem
from rise_engine.scenario.speech.spoken_texts import SpokenText, TableText
from rise_engine.scenario.speech.template import Template, TemplateError, parse_template

_SHOWN = 60


class RefusedRow(Struct, frozen=True):
    """A part of a table that the import refuses."""

    line: int
    what: str
    """The text, or the content in its place."""
    why: str

    def __str__(self) -> str:
        return f"{self.what}: {self.why}"


class TextImport(Struct, frozen=True):
    """The changes of a table."""

    edits: tuple[AnyEdit, ...]
    refused: tuple[RefusedRow, ...]
    noticed: tuple[str, ...] = ()
    rows: int = 0
    """The number of compared rows."""


def import_table(
    table: ReadTable, loaded: LoadResult, languages: Sequence[str] = (), *, new: bool = False
) -> TextImport:
    """Compare a table with the study.

    :param table: the file's content.
    :param loaded: the scenario, loaded in no language.
    :param languages: further languages to read, in addition to those of the study's translations.
    :param new: whether rows without an id become acts.
    :raises ExchangeError: the table does not have the necessary columns.
    """
    return _Importer(table, loaded, languages, new).run()


class _Importer:
    def __init__(self, table: ReadTable, loaded: LoadResult, languages: Sequence[str], new: bool) -> None:
        self.table = table
        self.loaded = loaded
        self.outline = read_outline(loaded.parts)
        self.new = new
        self.texts: dict[str, SpokenText | TableText] = {text.id: text for text in loaded.texts}
        self.texts |= {text.id: text for text in loaded.table_texts}
        known = {each.lower(): each for each in (*languages, *loaded.translations)}
        by_column = {column.lower(): column for column in table.columns}
        self.languages = {by_column[tag]: name for tag, name in known.items() if tag in by_column}
        """By column."""
        self.edits: list[AnyEdit] = []
        self.translated: list[AnyEdit] = []
        self.refused: list[RefusedRow] = []
        self.seen: dict[str, int] = {}

    def run(self) -> TextImport:
        self._check_columns()
        for row in self.table.rows:
            id = id_of_cell(row.values.get("id", ""), self.texts.keys())
            if not id and not any(row.values.get(column, "").strip() for column in ("act", "text", *self.languages)):
                continue  # without a text: a person's notes below the table
            if not id:
                self._read_new(row)
            elif id in self.seen:
                self._refuse(row, id, f"this text is already in {self.table.what} {self.seen[id]}")
            else:
                self.seen[id] = row.line
                self._read_row(row, id)
        edits = (*self.edits, *self._new_columns(), *self.translated)  # of the new originals
        return TextImport(edits, tuple(self.refused), tuple(self._notices()), len(self.seen))

    def _new_columns(self) -> Iterator[AnyEdit]:
        """Yield the columns of tables, and the languages, that translations need."""
        cells = [edit for edit in self.translated if isinstance(edit, SetCell)]
        files = {edit.language for edit in self.translated if isinstance(edit, SetTranslation)}
        languages = dict.fromkeys(edit.column.rpartition(".")[2] for edit in cells)
        yield from (AddLanguage(each) for each in languages if each not in self.loaded.translations.keys() | files)
        for table, column in dict.fromkeys((edit.table, edit.column) for edit in cells):
            base, _, language = column.rpartition(".")
            found = self.loaded.draft.tables[table]
            if base not in found.translations.get(language, {}):
                yield AddColumn(table, column)

    def _check_columns(self) -> None:
        columns = self.table.columns
        for column in ("id", "of"):
            if column not in columns:
                near = did_you_mean(column, [each for each in columns if each], limit=0)
                raise ExchangeError(
                    f"the table has no column `{column}`{near or ';'} it says what each row is about and which text "
                    "it was made from: export the table again, and copy your texts into it"
                )
        for column in ("text", *self.languages):
            if columns.count(column) > 1:
                raise ExchangeError(f"the table has several columns `{column}`; leave one of them")

    def _notices(self) -> Iterator[str]:
        known = {*FIXED_COLUMNS, *self.languages, ""}
        if further := [each for each in self.table.columns if each not in known]:
            yield (
                f"not read: the {'column' if len(further) == 1 else 'columns'} "
                f"{', '.join(f'`{each}`' for each in further)}; for a new language, add --language TAG"
            )
        if not self.languages and "text" not in self.table.columns:
            yield "the table has no column that is read: `text`, or a language"

    def _refuse(self, row: ReadRow, id: str, why: str) -> None:
        self.refused.append(
            RefusedRow(row.line, f"{self.table.what} {row.line}, {id}" if id else f"{self.table.what} {row.line}", why)
        )

    # --- existing texts ---------------------------------------------------------------------------------------------

    def _read_row(self, row: ReadRow, id: str) -> None:
        text = self.texts.get(id)
        of, check = _normal(row.values.get("of", "")), _checks(row.values.get("check", ""))
        new_text = _normal(row.values.get("text", of))
        changed = [
            column
            for column, language in self.languages.items()
            if column in row.values and text_check(_normal(row.values[column])) != check.get(language, "")
        ]
        if text is None:
            near = did_you_mean(id, self.texts, limit=0)
            self._refuse(row, id, f"there is no such text any more{near}")
        elif not of:
            self._refuse(row, id, "its cell `of` is empty, so its original text is unknown")
        elif of != text.text:
            if new_text != of or any(self._is_other(row, text, column) for column in changed):
                now = shorten(text.text, _SHOWN)
                why = (
                    f"the text was changed since the table was made: it is “{now}” now, and was “{shorten(of, _SHOWN)}”"
                )
                self._refuse(row, id, why)
        else:
            template = text.template if isinstance(text, SpokenText) else None
            if new_text != of:
                template = self._change_text(row, text, new_text) or template
            for column, language in self.languages.items():
                if column in row.values:
                    self._change_translation(row, text, template, column, language, check.get(language))

    def _is_other(self, row: ReadRow, text: SpokenText | TableText, column: str) -> bool:
        """Return whether a row's translation differs from the study's."""
        given = _normal(row.values[column])
        return bool(given) and given != self._translation(text, self.languages[column])

    def _translation(self, text: SpokenText | TableText, language: str) -> str:
        if isinstance(text, TableText):
            return text.translation(language)
        found = (self.loaded.translations.get(language) or LanguageTexts(language, "")).texts.get(text.id)
        return found.template.text if found is not None else ""

    def _change_text(self, row: ReadRow, text: SpokenText | TableText, new_text: str) -> Template | None:
        """Change the original text and return it; None: it is refused, or is in a table."""
        if not new_text:
            self._refuse(row, text.id, "the text is empty; write a text, or remove the action from the act")
            return None
        if isinstance(text, TableText):
            self.edits.append(SetCell(text.table.name, text.row, text.column, new_text))
            return None
        template, problem = _read_template(new_text)
        if template is None:
            self._refuse(row, text.id, problem)
            return None
        try:
            edit = edit_of_original(text, new_text, self.outline)
        except EditRefused as refused:
            where = text.action.location
            self._refuse(row, text.id, f"{refused}; change it in {where.file}, line {where.line}")
            return None
        self.edits.append(edit)
        return template

    def _change_translation(
        self,
        row: ReadRow,
        text: SpokenText | TableText,
        template: Template | None,
        column: str,
        language: str,
        check: str | None,
    ) -> None:
        given, now = _normal(row.values[column]), self._translation(text, language)
        edit: AnyEdit
        if isinstance(text, TableText):
            edit = SetCell(text.table.name, text.row, f"{text.column}.{language}", given)
        else:
            edit = SetTranslation(language, text.act, text.key, given)
        if given == now:
            if given and language in row.confirmed and self._is_stale(text, language):
                self.translated.append(edit)
            return
        if check is not None and text_check(given) == check:
            return  # only the study has changed it
        if not given:
            self._refuse(row, text.id, f"the cell `{column}` is empty; the text stays “{shorten(now, _SHOWN)}”")
        elif check is None and now:
            why = f"the table does not say (in `check`) what `{column}` was; it is “{shorten(now, _SHOWN)}” now"
            self._refuse(row, text.id, f"{why}, and not changed")
        elif check is not None and text_check(now) != check:
            why = f"`{column}` was changed in the study, too, since the table was made: “{shorten(now, _SHOWN)}” there"
            self._refuse(row, text.id, f"{why}, “{shorten(given, _SHOWN)}” here")
        else:
            translated, problem = _read_template(given) if template is not None else (None, "")
            if template is not None and translated is not None:
                problem = problem or slot_problem(template, translated)
            if problem:
                self._refuse(row, text.id, f"`{column}`: {problem}")
            else:
                self.translated.append(edit)

    def _is_stale(self, text: SpokenText | TableText, language: str) -> bool:
        return isinstance(text, SpokenText) and bool(self.loaded.translations[language].stale([text]))

    # --- new texts --------------------------------------------------------------------------------------------------

    def _read_new(self, row: ReadRow) -> None:
        act, new_text = row.values.get("act", "").strip(), _normal(row.values.get("text", ""))
        if not self.new:
            self._refuse(row, act, "this row has no id; with --new it becomes an act, called as its cell `act` says")
            return
        if not act or not new_text:
            self._refuse(row, act, f"a new act needs {'a name, in `act`' if not act else 'a text, in `text`'}")
            return
        taken = next((edit for edit in self.edits if isinstance(edit, AddAct) and edit.name == act), None)
        template, problem = _read_template(new_text)
        if self.outline.act(act) is not None or taken is not None:
            self._refuse(row, act, "there is an act of this name already")
        elif template is None:
            self._refuse(row, act, problem)
        else:
            self.edits.append(AddAct(act, new_text))
            for column, language in self.languages.items():
                if given := _normal(row.values.get(column, "")):
                    self.translated.append(SetTranslation(language, act, "1", given))


def _read_template(text: str) -> tuple[Template | None, str]:
    """Parse a text with memory values; for an invalid one, return None and the problem."""
    try:
        template = parse_template(text)
    except TemplateError as error:
        return None, str(error)
    problems = [problem.text for problem in find_ssml_problems(template) if problem.is_error]
    return (None, problems[0]) if problems else (template, "")


def _normal(cell: str) -> str:
    """Normalise a cell like a text: on one line."""
    return " ".join(cell.split())


def _checks(cell: str) -> dict[str, str]:
    """Return the checksums of the translations at the export, by language."""
    return {tag: value for tag, _, value in (each.rpartition(":") for each in cell.split()) if tag}


def summary(found: TextImport) -> str:
    """Summarize the changes of a table in a sentence."""
    changed = f"{pluralize(len(found.edits), 'change')} in {pluralize(found.rows, 'text')}"
    return f"{changed}; {pluralize(len(found.refused), 'row')} refused" if found.refused else changed
