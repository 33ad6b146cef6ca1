"""Export: the records of a session for whoever analyses it, as JSON lines or as a table.

Everything that can be read is exported, also from a session that is running, torn or damaged; what could not be read is
said, and never made up.
"""

from __future__ import annotations

import csv
from codecs import getwriter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Literal, TypeAlias

import msgspec

from rise_engine.json_codec import encode
from rise_engine.kernel.records import AnyRecord, SessionRecord
from rise_engine.session.folder import INFO, JOURNAL, SessionError, read_info
from rise_engine.session.journal_format import encode_record
from rise_engine.session.journal_reader import JournalContents, read_journal
from rise_engine.session.levels import ExportLevel, LevelFilter
from rise_engine.session.private_values import PrivateValues
from rise_engine.session.replay import load_session_scenario

ExportFormat: TypeAlias = Literal["jsonl", "csv"]

COLUMNS = (
    *("session", "mode", "seq", "t", "wall", "kind"),
    *("status", "reason", "source"),  # several kinds
    *("id", "function", "behavior", "calling_type", "position", "ref"),  # task
    *("task", "act", "action", "type", "parameters", "sent_as"),  # action
    *("name", "state", "previous", "trigger", "transition", "priority"),  # rule
    *("topic", "taken_by"),  # event
    *("rule", "expression", "values", "result", "error", "missing"),  # condition; state too
    *("key", "value", "old", "created", "deleted"),  # memory
    "detail",  # robot
    *("confirmed", "unconfirmed"),  # stop
    *("by", "holder"),  # control
    "text",  # note
    *("scenario", "scenario_hash", "robot", "seed", "versions"),  # session
    *("participant", "condition"),  # session
    "since",  # cue
    "mark",  # mistake
    *("cue_at", "key_at", "accepted_at", "started_at", "robot_at", "ended_at"),  # timing
    "seconds",  # countdown, kept; transition, topic and rule too
    *("study", "study_hash", "slot", "run", "attempt", "purpose", "factors"),  # session
    *("path", "bytes"),  # recording
    *("number", "medium"),  # sync
    *("filler", "voice_at"),  # timing; source too
    "downtime",  # session
    *("at", "within"),  # sync
)
"""Of the table: always all of them, in this order. New ones may only come at the end."""


class SessionExport:
    """The records of a session, whatever of them can be read, to be written to a file.

    >>> from io import BytesIO
    >>> from tempfile import TemporaryDirectory
    >>> from rise_engine.kernel.records import NoteRecord
    >>> from rise_engine.session.journal_format import encode_header, encode_record, with_checksum
    >>> record = NoteRecord(seq=1, t=2.5, wall="2026-11-21T14:00:00+01:00", text="hello", source="engine")
    >>> out = BytesIO()
    >>> with TemporaryDirectory() as folder:
    ...     lines = encode_header("example 1") + with_checksum(encode_record(record))
    ...     _ = (Path(folder) / "journal.jsonl").write_bytes(lines)
    ...     export = SessionExport(Path(folder))
    ...     export.write("jsonl", out)
    >>> out.getvalue()
    b'{"kind":"note","seq":1,"t":2.5,"wall":"2026-11-21T14:00:00+01:00","text":"hello","source":"engine"}\\n'
    >>> len(export.problems)  # there is no session.toml
    1
    """

    def __init__(
        self,
        folder: Path,
        *,
        level: ExportLevel = "full",
        private: Iterable[str] = (),
        wizards: Mapping[str, str] | None = None,
    ) -> None:
        """Read the session in `folder`.

        `level`: how much is told (`rise_engine.session.levels`). `private`: further private memory keys, beside those
        that the session's scenario names. `wizards`: what to call each at the other levels.

        Raises SessionError when nothing can be read, and, for less than everything, when the session's scenario cannot:
        it says which keys are private.
        """
        contents = self._contents = read_journal(folder / JOURNAL)
        self.problems = _describe_unreadable(contents)
        """What could not be read, in sentences."""
        self._filter = LevelFilter(level, _private_values(folder, level, private), wizards)
        self.name = self._filter.session_name(folder.resolve().name)
        self._filter.note(contents.read_records())
        self.mode = ""
        if (folder / INFO).exists():
            try:
                self.mode = read_info(folder).mode
            except SessionError as error:
                self.problems.append(f"{error}; the mode was taken from the journal")
        else:
            self.problems.append(f"{folder} has no {INFO}; the mode was taken from the journal")
        if not self.mode:
            self.mode = next((r.mode for r in contents.read_records() if isinstance(r, SessionRecord) and r.mode), "")

    def write(self, format: ExportFormat, out: BinaryIO) -> None:
        """Write the records to `out`, any binary file that is open for writing; it is flushed and not closed.

        `format`: `jsonl`, one record in a line as the journal has it but without check sums, or `csv`, a table with
        COLUMNS (RFC 4180, UTF-8; times in seconds). Raises OSError when `out` does not take it.
        """
        if format == "csv":
            self._write_table(out)
        else:
            for record in self._contents.read_records():
                out.write(self._line(record) + b"\n")
        out.flush()

    def _write_table(self, out: BinaryIO) -> None:
        rows = csv.writer(getwriter("utf-8")(out))  # as RFC 4180 has it: commas, CR LF, quotes doubled
        rows.writerow(COLUMNS)
        for record in self._contents.read_records():
            rows.writerow(self._row(record))

    def _line(self, record: AnyRecord) -> bytes:
        line = encode_record(record)
        return line if self._filter.level == "full" else encode(self._filter.apply(msgspec.json.decode(line)))

    def _row(self, record: AnyRecord) -> list[str]:
        values: dict[str, Any] = self._filter.apply(msgspec.json.decode(encode_record(record)))
        values["session"], values["mode"] = self.name, self.mode
        return [table_cell(values.get(column)) for column in COLUMNS]


def _private_values(folder: Path, level: ExportLevel, private: Iterable[str]) -> PrivateValues | None:
    if level == "full":
        return None
    try:
        scenario = load_session_scenario(folder, read_info(folder), [])
    except SessionError as error:
        raise SessionError(
            f"nobody can say which memory keys are private: {error}. Only --level full can be exported"
        ) from None
    return PrivateValues(scenario, private)


def table_cell(value: Any) -> str:
    """A JSON value in a table: texts as they are, null (like what is not there) empty, everything else as JSON."""
    if value is None:
        return ""
    return value if isinstance(value, str) else msgspec.json.encode(value).decode()


def _describe_unreadable(contents: JournalContents) -> list[str]:
    found = [f"{JOURNAL}: line {line} cannot be read: {why}" for line, why in contents.damaged.items()]
    found += [f"{JOURNAL}: {gap}" for gap in contents.gaps]
    if contents.torn:
        found.append(f"{JOURNAL} is torn at its end: the last {len(contents.torn)} bytes cannot be read")
    return found
