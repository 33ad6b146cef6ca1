"""Tables of texts as CSV: RFC 4180 in UTF-8 with a byte order mark, as Excel expects it."""

from __future__ import annotations

import csv
import io
import locale
from contextlib import suppress

from rise_engine.author.texts.table import ReadRow, ReadTable, TextTable
from rise_engine.base.errors import ExchangeError

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
