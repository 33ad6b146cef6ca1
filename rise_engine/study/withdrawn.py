"""What remains of withdrawn participants: a salted hash in study.jsonl, and rows of `anonymous.csv` if they agreed.

The hash only tells whether a new participant has withdrawn before. With the salt, somebody could find the pseudonym by
trying all. So the salt stays in the study's folder and is removed from every study.jsonl for others (`without_salts`).
"""

from __future__ import annotations

import csv
import hashlib
import io
import secrets
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.files import Disk
from rise_engine.study.study_log import LogEntry

PREFIX = "withdrawn:"
"""The start of the hash that replaces a pseudonym in the log. No pseudonym has a colon."""


def new_salt() -> str:
    """Return a salt that nobody can guess."""
    return secrets.token_hex(16)


def hash_pseudonym(participant: str, salt: str) -> str:
    """Return the salted hash in hexadecimal digits."""
    return hashlib.sha256(f"{salt}/{participant}".encode()).hexdigest()


def is_withdrawn(participant: str, log: Iterable[LogEntry]) -> bool:
    """Whether a participant has withdrawn.

    :param participant: a pseudonym, or its replacement in the log.
    :param log: all entries of study.jsonl.
    """
    if participant.startswith(PREFIX):
        return True
    entries = [each for each in log if each.kind == "withdrawn"]
    return any(hash_pseudonym(participant, str(each.get("salt"))) == each.get("hash") for each in entries)


class Withdrawn(Struct, frozen=True):
    """The number of withdrawn participants. Nothing else is known of them."""

    count: int = 0
    begun: int = 0
    """The number of those who had taken a slot."""


def withdrawn_of(log: Iterable[LogEntry]) -> Withdrawn:
    """Count the withdrawn participants in the log."""
    entries = [each for each in log if each.kind == "withdrawn"]
    return Withdrawn(len(entries), sum(each.get("slot") is not None for each in entries))


def without_salts(log: Sequence[LogEntry]) -> list[LogEntry]:
    """Return the log for others, without the salts that would allow trying all pseudonyms."""
    return [
        replace(each, fields={name: value for name, value in each.fields.items() if name != "salt"}) for each in log
    ]


# --- rows that stay ---------------------------------------------------------------------------------------------------

FILE = "anonymous.csv"
CONSENT = "anonymous"
"""The column `consent_anonymous` of participants.csv has the day on which somebody agreed to it."""
ID = "id"


def new_id() -> str:
    """Return an id that reveals nothing."""
    return f"A{secrets.token_hex(4)}"


def add_rows(study: Path, rows: Sequence[Mapping[str, str]], disk: Disk) -> None:
    """Add rows to the study's file, except those with a known id, so that a call can be repeated after a kill.

    :param study: the study's folder.
    :param rows: each with an `id`.
    :raises OSError: it cannot be written; then the file is unchanged.
    """
    columns, kept = read_rows(study)
    known = {row.get(ID) for row in kept}
    added = [dict(row) for row in rows if row[ID] not in known]
    if not added:
        return
    columns = list(dict.fromkeys([ID, *columns, *(name for row in added for name in row)]))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(sorted([*kept, *added], key=lambda row: (row.get(ID, ""), row.get("run", ""))))
    disk.write_whole(study / FILE, text.getvalue().encode())


def read_rows(study: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Read the file's columns and rows. Empty where there is no file. Raises OSError."""
    try:
        text = (study / FILE).read_text("utf-8")
    except FileNotFoundError:
        return [], []
    reader = csv.DictReader(io.StringIO(text))
    return list(reader.fieldnames or ()), [dict(row) for row in reader]
