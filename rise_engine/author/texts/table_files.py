"""Tables of texts as files of other programs: CSV, Excel, and gettext (Poedit, Weblate)."""

from __future__ import annotations

import csv
import io
import locale
import re
from contextlib import suppress
from typing import Any
from zipfile import BadZipFile, ZipFile

from rise_engine.author.texts.table import ReadRow, ReadTable, TextTable
from rise_engine.base.errors import ExchangeError

# --- CSV: RFC 4180 in UTF-8 with a byte order mark, as Excel expects it -----------------------------------------------

_SEPARATORS = ";,\t"
_LARGEST_CELL = 1_000_000


def write_csv(table: TextTable, separator: str = "") -> bytes:
    """Write the table as a file.

    :param separator: between cells; empty: the one that a spreadsheet expects here (`usual_separator`).
    """
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, delimiter=separator or usual_separator(), lineterminator="\r\n")
    writer.writerow(table.columns)
    writer.writerows(row.cells() for row in table.rows)
    return b"\xef\xbb\xbf" + stream.getvalue().encode("utf-8")


def usual_separator() -> str:
    """Return `;` where the locale writes a decimal comma, as spreadsheets do; otherwise `,`."""
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
            f"this file is not UTF-8 (byte 0x{data[error.start]:02X}), so letters such as ä are lost; save it anew "
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
    """Return the text of a cell. A number was a text before the spreadsheet converted it."""
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
        # With a line end more, because polib opens a text that is a path as that file.
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
