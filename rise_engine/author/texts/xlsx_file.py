"""Tables of texts as Excel files. Every cell is a text: `=1`, `1/2` and `3.10` stay unchanged."""

from __future__ import annotations

import io
from typing import Any
from zipfile import BadZipFile, ZipFile

from rise_engine.author.texts.table import ReadRow, ReadTable, TextTable
from rise_engine.base.errors import ExchangeError

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
