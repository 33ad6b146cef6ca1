"""Tables of texts for gettext's tools (Poedit, Weblate): one file a language, with stale translations as fuzzy."""

from __future__ import annotations

import re
from typing import Any

from rise_engine.author.texts.table import ReadRow, ReadTable, TextTable
from rise_engine.base.errors import ExchangeError

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
        file = polib.pofile(data.decode("utf-8-sig"))
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
