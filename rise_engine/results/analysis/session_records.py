"""The records of one session at one level: the only source of a session's contents for exports and reports.

Unreadable parts are reported, and nothing is invented. Only one record is in memory at a time.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.kernel.records import AnyRecord, SessionRecord
from rise_engine.privacy.levels import ExportLevel, LevelFilter
from rise_engine.privacy.private_values import PrivateValues
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import INFO, JOURNAL, SCENARIO_COPY, SessionInfo, read_info
from rise_engine.session.journal_reader import JournalContents, read_journal
from rise_engine.session.scenario_copies import load_session_scenario
from rise_engine.study.labels import reassignment_of, refuse_relabelled

_KEPT_SCENARIOS = 4
_scenarios: dict[tuple[str, str, str, str], Scenario] = {}
"""The last loaded scenarios, by the hash of their files and the arguments. A study's sessions have one or two."""


class SessionRecords:
    """The readable part of a session's record at a level.

    >>> from tempfile import TemporaryDirectory
    >>> from rise_engine.kernel.records import NoteRecord
    >>> from rise_engine.session.journal_format import encode_header, encode_record, with_checksum
    >>> record = NoteRecord(seq=1, t=2.5, wall="2026-11-21T14:00:00+01:00", text="hello", source="engine")
    >>> with TemporaryDirectory() as folder:
    ...     lines = encode_header("example 1") + with_checksum(encode_record(record))
    ...     _ = (Path(folder) / "journal.jsonl").write_bytes(lines)
    ...     session = SessionRecords(Path(folder))
    ...     [each.text for each in session.read()], len(session.problems)  # there is no session.toml
    (['hello'], 1)
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

        :param folder: the session's folder.
        :param level: how much is shown (`rise_engine.privacy.levels`).
        :param private: private memory keys in addition to the scenario's.
        :param wizards: the code of each wizard below the level full, by name.
        :raises RelabelledError: session.toml or its study's log disagrees with the journal.
        :raises SessionError: nothing can be read, or, at a level below full, the scenario, which names the private
            keys.
        """
        self.folder = folder
        self.level = level
        self.contents = read_journal(folder / JOURNAL)
        refuse_relabelled(folder)
        self.moved = reassignment_of(folder)
        """The session's reassignment. None: its labels are those of the journal."""
        self.problems = _describe_unreadable(self.contents)
        """Sentences about unreadable parts."""
        self.scenario: Scenario | None = None
        """The session's scenario, once it was needed."""
        values = None if level == "full" else PrivateValues(self._scenario_or_refuse(), private)
        self.filter = LevelFilter(level, values, wizards)
        self.filter.note(self.contents.read_records())
        sessions = (each for each in self.contents.read_records() if isinstance(each, SessionRecord))
        self.begun: SessionRecord | None = next(sessions, None)
        """The first readable session record."""
        self.info: SessionInfo | None = None
        """The contents of session.toml. None: it is unreadable."""
        if (folder / INFO).exists():
            try:
                self.info = read_info(folder)
            except SessionError as error:
                self.problems.append(f"{error}; the mode was taken from the journal")
        else:
            self.problems.append(f"{folder} has no {INFO}; the mode was taken from the journal")
        self.mode = self.begun.mode if self.begun is not None else self.info.mode if self.info is not None else ""
        self.name = self._name()

    def __iter__(self) -> Iterator[AnyRecord]:
        return self.read()

    def read(self) -> Iterator[AnyRecord]:
        """Give each readable record in the journal's order. Raises SessionError if the journal cannot be read now."""
        for record in self._read_reassigned():
            if self.level == "full":
                yield record
                continue
            values: dict[str, Any] = self.filter.apply(msgspec.to_builtins(record))
            filtered: AnyRecord = msgspec.convert(values, type(record))
            yield filtered

    def _read_reassigned(self) -> Iterator[AnyRecord]:
        """Give each record, with the new labels if the study's log has reassigned the session."""
        for record in self.contents.read_records():
            if self.moved is not None and isinstance(record, SessionRecord) and record.participant:
                record = replace(record, **self.moved.labels)
            yield record

    def load_scenario(self) -> Scenario:
        """Load the scenario that the session ran. Raises SessionError if it cannot be loaded or was changed."""
        if self.scenario is None:
            self.scenario = _load_scenario(self.folder, read_info(self.folder))
        return self.scenario

    def _name(self) -> str:
        """Return the folder's name. Below full, run and attempt replace the date."""
        folder = self.folder.resolve().name
        name, labels = self.filter.session_name(folder), self.begun or self.info
        if name == folder or labels is None:
            return name
        attempt = labels.attempt
        if self.moved is not None:
            attempt = self.moved.attempt
            name = re.sub(rf"^{re.escape(labels.participant)}(?=_|$)", self.moved.participant, name)
        return f"{name}_run{labels.run}" + (f"-attempt{attempt}" if attempt > 1 else "") if labels.run else name

    def _scenario_or_refuse(self) -> Scenario:
        try:
            return self.load_scenario()
        except SessionError as error:
            raise SessionError(
                f"it is not known which memory keys are private: {error}. Only --level full can be exported"
            ) from None


def _load_scenario(folder: Path, info: SessionInfo) -> Scenario:
    """Load a scenario through a cache: loading takes a tenth of a second, and hundreds of sessions share it."""
    key = (_digest(folder / SCENARIO_COPY), info.scenario_hash, info.robot, info.mode)
    found = _scenarios.pop(key, None) if key[0] else None
    if found is None:
        found = load_session_scenario(folder, info, [])
    if key[0]:
        _scenarios[key] = found
        while len(_scenarios) > _KEPT_SCENARIOS:
            del _scenarios[next(iter(_scenarios))]
    return found


def _digest(copy: Path) -> str:
    """Hash the names and bytes of all files in a folder. Empty: there are none, or one cannot be read."""
    digest, files = hashlib.sha256(), 0
    try:
        for path in sorted(each for each in copy.rglob("*") if each.is_file()):
            data = path.read_bytes()
            name = str(path.relative_to(copy)).encode("utf-8", "surrogateescape")
            digest.update(b"%b\0%d\0%b" % (name, len(data), data))
            files += 1
    except OSError:
        return ""
    return digest.hexdigest() if files else ""


def _describe_unreadable(contents: JournalContents) -> list[str]:
    found = [f"{JOURNAL}: line {line} cannot be read: {why}" for line, why in contents.damaged.items()]
    found += [f"{JOURNAL}: {gap}" for gap in contents.gaps]
    if contents.torn:
        found.append(f"{JOURNAL} is torn at its end: the last {len(contents.torn)} bytes cannot be read")
    return found
