"""`anonymous.csv`: what is kept of people who have withdrawn and agreed that it may be, without who they were.

A row for each of their sessions, under an id that was drawn when they withdrew and stands nowhere else. The rows are
sorted by it, so that not even their order says who it was.
"""

from __future__ import annotations

import csv
import io
import secrets
from collections.abc import Mapping, Sequence
from pathlib import Path

from rise_engine.base.files import Disk

FILE = "anonymous.csv"
CONSENT = "anonymous"
"""`consent_anonymous` in participants.csv is the day on which somebody agreed to it."""
ID = "id"


def new_id() -> str:
    """An id that says nothing."""
    return f"A{secrets.token_hex(4)}"


def add_rows(study: Path, rows: Sequence[Mapping[str, str]], disk: Disk) -> None:
    """Put rows into the study's file, unless their ids are there already: so it can be said again after a kill.

    :param study: the study's folder.
    :param rows: each with an `id`.
    :raises OSError: it cannot be written; then the file is as it was.
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
    """The file's columns and rows; none where there is no file. Raises OSError."""
    try:
        text = (study / FILE).read_text("utf-8")
    except FileNotFoundError:
        return [], []
    reader = csv.DictReader(io.StringIO(text))
    return list(reader.fieldnames or ()), [dict(row) for row in reader]
