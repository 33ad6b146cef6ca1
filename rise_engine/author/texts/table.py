"""All texts of a study as one table: a row for each, with its translations (docs/reference/languages.md).

The table is a file for other programs: CSV, Excel, or gettext (Poedit, Weblate).
"""

from __future__ import annotations

import csv
import io
import locale
import re
from collections.abc import Collection, Sequence
from contextlib import suppress
from typing import Any, Literal, TypeAlias
from zipfile import BadZipFile, ZipFile
from zlib import crc32

from msgspec import Struct

from rise_engine.base.errors import ExchangeError
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import Act, Action, Scenario
from rise_engine.scenario.parameters import MESSAGE, fill_parameters
from rise_engine.scenario.reading.translations import LanguageTexts
from rise_engine.scenario.speech.spoken_texts import SpokenText, TableText
from rise_engine.scenario.speech.template import MissingValueError

FIXED_COLUMNS = ("id", "act", "no.", "when", "with", "text", "note", "seconds", "place", "of", "check")
"""All columns except those of the languages, which follow `text`."""
NOTHING = "-"
"""In `check`: there was no translation."""
EntryFilter: TypeAlias = Literal["missing", "stale"]


class TextRow(Struct, frozen=True):
    """One text."""

    id: str
    """The id of the text, `R_Praise/2/1`."""
    act: str
    number: str
    """The action and the wording, `2 (1)`, so that no spreadsheet takes it for a date."""
    when: str
    """`at once`, or the awaited actions: `after 3, 4`."""
    beside: str
    """The robot's simultaneous actions: `Animation: enthusiastic`."""
    text: str
    translations: dict[str, str]
    """By language; empty: there is none."""
    note: str
    """A note for translators: the translations of an earlier text."""
    seconds: float | None
    """Estimated seconds of speaking it; None: it is in a table."""
    place: str
    """`acts/feedback.xml:8`."""
    stale: frozenset[str] = frozenset()
    """Languages with a translation of an earlier text."""

    @property
    def check(self) -> str:
        """Checksums that show an import whether a translation has changed since: `de:3f2a9c01 fr:-`."""
        return " ".join(f"{language}:{text_check(text)}" for language, text in self.translations.items())

    def cells(self) -> list[str]:
        """Return the cells in the order of `TextTable.columns`."""
        before = [_id_cell(self.id), self.act, self.number, self.when, self.beside, self.text]
        seconds = "" if self.seconds is None else f"{self.seconds:.1f}"
        behind = [self.note, seconds, self.place, self.text, self.check]
        return [*before, *self.translations.values(), *behind]


class TextTable(Struct, frozen=True):
    """All texts, or those with missing parts."""

    languages: tuple[str, ...]
    """The languages of the translations."""
    rows: tuple[TextRow, ...]
    language: str = ""
    """The language of the acts; empty: unknown."""

    @property
    def columns(self) -> list[str]:
        return [*FIXED_COLUMNS[:6], *self.languages, *FIXED_COLUMNS[6:]]


def make_table(loaded: LoadResult, languages: Sequence[str] = (), only: EntryFilter | None = None) -> TextTable:
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
    """Return a short checksum of a text, which detects changes."""
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
    """Describe in a word or two each action that begins at the same time."""
    parts = []
    for other in act.actions:
        if other.id == action.id or set(other.wait_for) != set(action.wait_for):
            continue
        call = other.calls[0]
        value = call.parameters.get("value")
        parts.append(f"{call.type}: {value.text}" if value is not None else call.type)
    return ", ".join(parts)


def _seconds(text: SpokenText, scenario: Scenario) -> float:
    spec = scenario.robot.actions[text.call.type]
    try:
        parameters = fill_parameters(text.call, spec, {**scenario.memory, **scenario.table_memory})
    except (MissingValueError, ValueError):
        parameters = {text.parameter: text.text}
    return expected_seconds(spec, parameters)


def _id_cell(id: str) -> str:
    """Write an id as a cell, with the word `act` before it if it could look like a date or a formula."""
    return id if id[:1].isalpha() else f"act {id}"


def id_of_cell(cell: str, known: Collection[str]) -> str:
    """Return the id in a cell."""
    cell = cell.strip()
    return cell.removeprefix("act ") if cell not in known else cell


class ReadRow(Struct, frozen=True):
    """A row of a file."""

    line: int
    """Its number in the file, for messages."""
    values: dict[str, str]
    """By column."""
    confirmed: frozenset[str] = frozenset()
    """Languages with a confirmed translation (gettext: not fuzzy)."""


class ReadTable(Struct, frozen=True):
    columns: tuple[str, ...]
    rows: tuple[ReadRow, ...]
    what: str = "row"
    """The word for a row in messages."""


# --- CSV: RFC 4180 in UTF-8 with a byte order mark, as Excel expects it -----------------------------------------------

_SEPARATORS = ";,\t"
_LARGEST_CELL = 1_000_000


def write_csv(table: TextTable, separator: str = "") -> bytes:
    """Write the table as a file.

    :param separator: between cells; empty: the usual one of the locale (`usual_separator`).
    """
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, delimiter=separator or usual_separator(), lineterminator="\r\n")
    writer.writerow(table.columns)
    writer.writerows(row.cells() for row in table.rows)
    return b"\xef\xbb\xbf" + stream.getvalue().encode("utf-8")


def usual_separator() -> str:
    """Return `;` if the locale writes a decimal comma, as spreadsheets do; otherwise `,`."""
    before = locale.setlocale(locale.LC_NUMERIC)
    try:
        with suppress(locale.Error):
            locale.setlocale(locale.LC_NUMERIC, "")
        return ";" if locale.localeconv()["decimal_point"] == "," else ","
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


def read_csv(data: bytes) -> ReadTable:
    """Read a file from any program, with any of the usual separators, in UTF-8 or UTF-16.

    :raises ExchangeError: it has another encoding, or is not a table.
    """
    text = _decode(data)
    first = text.partition("\n")[0]
    if first.lower().startswith("sep="):
        separator, text = first[4:5], text.partition("\n")[2]
    else:
        separator = max(_SEPARATORS, key=first.count)
    limit = csv.field_size_limit(_LARGEST_CELL)
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator or ";", strict=True)
        lines: list[tuple[int, list[str]]] = []
        line = 1
        for cells in reader:
            lines.append((line, cells))
            line = reader.line_num + 1
    except csv.Error as error:
        raise ExchangeError(f"this is no CSV file: {error}; save it from the spreadsheet as `CSV UTF-8`") from None
    finally:
        csv.field_size_limit(limit)
    if not lines:
        raise ExchangeError("this file is empty")
    columns = [each.strip() for each in lines[0][1]]
    rows = [ReadRow(line, dict(zip(columns, cells, strict=False))) for line, cells in lines[1:]]
    return ReadTable(tuple(columns), tuple(rows))


def _decode(data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        with suppress(UnicodeDecodeError):
            return data.decode("utf-16")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ExchangeError(
            f"this file is not UTF-8 (byte 0x{data[error.start]:02X}), so letters such as ä are lost; save it again "
            "as `CSV UTF-8` (Excel) or with the encoding `Unicode (UTF-8)` (LibreOffice), or as .xlsx"
        ) from None


# --- Excel: every cell is a text, so `=1`, `1/2` and `3.10` stay unchanged --------------------------------------------

_WIDTHS = {"id": 22, "act": 18, "when": 14, "with": 26, "note": 30, "place": 24, "of": 30, "check": 12}
_TEXT_WIDTH = 60
MAX_BYTES = 100_000_000
"""Maximum unpacked size of a file: many times the texts of the largest study."""


def write_xlsx(table: TextTable) -> bytes:
    """Write the table as a file. :raises ExchangeError: openpyxl is missing, or no cell allows a text's character."""
    openpyxl = _openpyxl()
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.title = "texts"
    sheet.freeze_panes = "B2"
    wrapped = openpyxl.styles.Alignment(wrap_text=True, vertical="top")
    for number, values in enumerate([table.columns, *(row.cells() for row in table.rows)], start=1):
        for column, value in enumerate(values, start=1):
            cell = sheet.cell(number, column)
            try:
                cell.value = value or None
            except ValueError:
                message = f"`{table.rows[number - 2].id}` has a character that no Excel file can hold; take CSV instead"
                raise ExchangeError(message) from None
            cell.number_format, cell.alignment = "@", wrapped
            if value:
                cell.data_type = "s"  # also for a text that looks like a formula
            if number == 1:
                cell.font = openpyxl.styles.Font(bold=True)
    for column, name in enumerate(table.columns, start=1):
        letter = openpyxl.utils.get_column_letter(column)
        texts = name == "text" or name in table.languages
        sheet.column_dimensions[letter].width = _TEXT_WIDTH if texts else _WIDTHS.get(name, 10)
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


def read_xlsx(data: bytes) -> ReadTable:
    """Read the first sheet. :raises ExchangeError: openpyxl is missing, it is not an Excel file, or it is too large."""
    openpyxl = _openpyxl()
    try:
        with ZipFile(io.BytesIO(data)) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > MAX_BYTES:
            raise ExchangeError(f"this file becomes {size:,} bytes when it is opened; no table of texts has that many")
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        lines = [[_cell_text(value) for value in row] for row in book.worksheets[0].iter_rows(values_only=True)]
    except (BadZipFile, KeyError, ValueError, OSError, IndexError) as error:
        raise ExchangeError(f"this is no Excel file: {error}") from None
    if not lines:
        raise ExchangeError("this file is empty")
    columns = [each.strip() for each in lines[0]]
    rows = [ReadRow(number, dict(zip(columns, cells, strict=False))) for number, cells in enumerate(lines[1:], start=2)]
    return ReadTable(tuple(columns), tuple(rows))


def _cell_text(value: Any) -> str:
    """Return the text of a cell. Spreadsheets convert some texts to numbers."""
    if value is None:
        return ""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value)


def _openpyxl() -> Any:
    try:
        import openpyxl  # in the extra `tables`
        import openpyxl.styles
        import openpyxl.utils
    except ImportError:
        raise ExchangeError('Excel files need openpyxl: pip install "rise-tui[tables]"; CSV needs nothing') from None
    return openpyxl


# --- gettext: one file for each language, with stale translations as fuzzy --------------------------------------------

_CHECK = re.compile(r"check: (\S+)\s*\Z")


def write_po(table: TextTable) -> bytes:
    """Write the table as a file. :raises ExchangeError: polib is not installed, or there are several languages."""
    polib = _polib()
    if len(table.languages) != 1:
        raise ExchangeError("a .po file is for one language: name it with --language")
    language = table.languages[0]
    file = polib.POFile(wrapwidth=110)
    file.metadata = {
        "MIME-Version": "1.0",
        "Content-Type": "text/plain; charset=UTF-8",
        "Content-Transfer-Encoding": "8bit",
        "Language": language.replace("-", "_"),
    }
    for row in table.rows:
        path, _, line = row.place.rpartition(":")
        entry = polib.POEntry(
            msgctxt=row.id,
            msgid=row.text,
            msgstr=row.translations[language],
            occurrences=[(path or line, line if path else "")],
            comment=f"{row.when}{'; with ' if row.beside else ''}{row.beside}\ncheck: {row.check}",
        )
        if language in row.stale:
            entry.flags.append("fuzzy")
            entry.tcomment = row.note
        file.append(entry)
    return str(file).encode("utf-8")


def read_po(data: bytes, language: str = "") -> ReadTable:
    """Read a file.

    :param language: of its translations; without it, the file's own.
    :raises ExchangeError: polib is not installed, it is not a .po file, or its language is unknown.
    """
    polib = _polib()
    try:
        # With another line end, because polib takes a text that is a path for that file.
        file = polib.pofile(data.decode("utf-8-sig") + "\n")
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise ExchangeError(f"this is no .po file: {error}") from None
    language = language or str(file.metadata.get("Language", "")).replace("_", "-")
    if not language:
        raise ExchangeError("the file does not say its language: name it with --language")
    rows = []
    for entry in file:
        if entry.obsolete:
            continue
        check = _CHECK.search(entry.comment or "")
        values = {"id": entry.msgctxt or "", "of": entry.msgid, "check": check[1] if check else ""}
        if not entry.fuzzy:
            values[language] = entry.msgstr
        is_said = bool(entry.msgstr) and not entry.fuzzy
        rows.append(ReadRow(entry.linenum, values, frozenset({language} if is_said else ())))
    return ReadTable(("id", "of", "check", language), tuple(rows), "entry in line")


def _polib() -> Any:
    try:
        import polib  # in the extra `tables`
    except ImportError:
        raise ExchangeError('files of gettext need polib: pip install "rise-tui[tables]"; CSV needs nothing') from None
    return polib
