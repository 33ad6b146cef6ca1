"""Tables that people may have edited: columns by name, rows with places, and a search for personal data."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from unicodedata import combining, normalize

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.csv_reader import MAX_COLUMNS, CsvReader, TableRecord
from rise_engine.scenario.files.source_files import FileReader
from rise_engine.scenario.files.tree import FileTree, Held
from rise_engine.scenario.model import SourceLocation

MAX_BYTES, MAX_ROWS = 20_000_000, 200_000
_ENCODING_REMEDY = "in Excel or LibreOffice, save it as `CSV UTF-8`"


class CsvRow(Struct, frozen=True):
    """One row: its values by column name."""

    values: dict[str, str]
    record: TableRecord


class CsvTable:
    """The columns and rows of a file. Rows that differ in length from the header are reported and omitted."""

    def __init__(self, reader: CsvReader, header: TableRecord, columns: list[str], rows: list[CsvRow]) -> None:
        self.columns = columns
        self.rows = rows
        self.diagnostics = reader.diagnostics
        self._reader = reader
        self._header = header

    def column_location(self, column: str) -> SourceLocation:
        """Return the place of a column's name, or of the header if there is no such column."""
        at = self.columns.index(column) if column in self.columns else 0
        return self._reader.source.location(self._reader.value_at(self._header, at))

    def location(self, row: CsvRow, column: str) -> SourceLocation:
        """Return the place of a column's value in a row."""
        at = self.columns.index(column) if column in self.columns else 0
        return self._reader.source.location(self._reader.value_at(row.record, at))

    def report(self, row: CsvRow, column: str, code: str, message: str) -> None:
        self.diagnostics.error(code, self.location(row, column), message)

    def check_columns(self, needed: Iterable[str], allowed: Iterable[str], remedy: str) -> None:
        """Report missing and unknown columns.

        :param needed: the required columns.
        :param allowed: further allowed columns.
        :param remedy: the end of the message about an unknown column.
        """
        needed = list(needed)
        missing = [column for column in needed if column not in self.columns]
        known = [*needed, *allowed]
        for column in self.columns:
            if column not in known:
                near = did_you_mean(column, missing or known, limit=0)
                message = f"unknown column `{column}`{near or remedy}"
                self.diagnostics.error("unknown-column", self.column_location(column), message)
        if missing:
            message = f"the column {in_backquotes(missing)} is missing"
            if len(missing) > 1:
                message = f"the columns {in_backquotes(missing)} are missing"
            self.diagnostics.error("missing-column", self.column_location(""), message)


def read_csv(
    folder: Path, name: str, diagnostics: Diagnostics, held: Held | None = None, *, most_columns: int = MAX_COLUMNS
) -> CsvTable | None:
    """Read the table in a file of a study. Returns None, with diagnostics, if it has errors.

    Values are separated by comma, semicolon or tab. A byte order mark and line ends of Windows or Unix are accepted.
    """
    tree = FileTree(folder, held, closed=True)
    source = FileReader(folder, diagnostics, tree).read(folder / name, MAX_BYTES, remedy=_ENCODING_REMEDY)
    if source is None:
        return None
    reader = CsvReader(source, diagnostics)
    reader.most_columns = most_columns
    start = reader.find_separator()
    records = list(reader.read_records(start))
    if reader.has_problems():
        return None
    if not records:
        reader.report(start, "this file is empty; its first row has the names of the columns")
        return None
    header, *rest = records
    columns = reader.read_header(header, rest)
    is_wrong = reader.has_problems()
    if len(rest) > MAX_ROWS:
        reader.report(rest[MAX_ROWS].start, f"there are at most {MAX_ROWS:,} rows")
        return None
    rows = [
        CsvRow(dict(zip(columns, record.values, strict=False)), record)
        for record in rest
        if reader.check_length(record, len(columns))
    ]
    return None if is_wrong else CsvTable(reader, header, columns, rows)


# --- personal data ----------------------------------------------------------------------------------------------------

WHY = (
    "this folder knows people by their pseudonyms only, because it is copied, archived and shared; keep the list "
    "of their names somewhere else"
)

_WORDS: dict[str, str] = {
    "a name": "name names nombre nombres apellido apellidos nom noms prenom nome cognome sobrenome naam namn imie "
    "nazwisko initials initialen initiales",
    "a mail address": "mail mails email emails correo courriel epost emailadresse mailadresse",
    "a phone number": "phone phonenumber telephone telephon telefon telefonnummer telefonnr tel fon "
    "mobilnummer handy handynummer handynr cellphone fax whatsapp movil telefono",
    "a date of birth": "birth birthday birthdate dateofbirth dob geburtstag geburtsdatum geburt geb gebdat gebdatum "
    "naissance nacimiento nascita nascimento geboortedatum",
    "an address": "address addresses adresse adressen anschrift street strasse hausnummer hausnr plz postleitzahl "
    "postcode postalcode zip zipcode wohnort direccion indirizzo adres adress domicile",
    "a number of an identity card": "ssn passport ausweis ausweisnummer personalausweis matrikel matrikelnummer "
    "matrikelnr matriculation studentid steuerid steuernummer iban kontonummer dni nif",
}
_KIND_OF_WORD = {word: kind for kind, words in _WORDS.items() for word in words.split()}
_ENDINGS = {
    "name": "a name",
    "mail": "a mail address",
    "phone": "a phone number",
    "telefon": "a phone number",
    "birth": "a date of birth",
    "birthday": "a date of birth",
    "adresse": "an address",
    "address": "an address",
    "strasse": "an address",
}
"""Word endings that reveal the kind: Vorname, surname, Privatadresse."""
_MAIL = re.compile(r"[^\s@<>,;:]+@[^\s@<>,;:]+\.[^\s@<>,;:.]{2,}")
_HUMP = re.compile(r"(?<=[a-z])(?=[A-Z])")


def personal_column(column: str) -> str:
    """Return which personal data a column of that name seems to hold, or an empty text.

    >>> personal_column("Nachname"), personal_column("E-Mail"), personal_column("handedness")
    ('a name', 'a mail address', '')
    """
    words = re.findall(r"[a-z0-9]+", _HUMP.sub(" ", _plain(column)).casefold())
    joined = "".join(words)
    for word in [joined, *words]:
        if kind := _KIND_OF_WORD.get(word):
            return kind
        if ending := next((ending for ending in _ENDINGS if word.endswith(ending)), ""):
            return _ENDINGS[ending]
    return ""


def mail_address_in(text: str) -> str:
    """Return a part of the text that looks like a mail address, or an empty text.

    >>> mail_address_in("ask maria.m@uni.example first")
    'maria.m@uni.example'
    """
    found = _MAIL.search(text)
    return found.group() if found is not None else ""


def _plain(text: str) -> str:
    """Remove accents and umlauts' dots; `ß` becomes `ss`."""
    return "".join(each for each in normalize("NFD", text.replace("ß", "ss")) if not combining(each))
