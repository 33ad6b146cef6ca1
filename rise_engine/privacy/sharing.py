"""A session for others: it shows only what an export level shows, and it still replays.

Typed texts, people's names and private values are removed from the inputs. A fresh kernel makes the records again
(`rise_engine.privacy.changed_session`). At the level, these must equal the old records. A shared session therefore
shows no more than the level's exports do, apart from the scenario.

It has no times of day: `wall` is empty, and session.toml has no date, no paths and no machine.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import make_private_folder, write_private_file
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import AnyInput, Note, SessionStarted, Submit
from rise_engine.kernel.records import ENGINE, TaskRecord
from rise_engine.privacy.changed_session import ChangedSession, why_not_replayed
from rise_engine.privacy.levels import ExportLevel, LevelFilter, told_coded
from rise_engine.privacy.private_values import PrivateValues
from rise_engine.privacy.stand_ins import StandIns
from rise_engine.session.coded import CODED_FILE
from rise_engine.session.folder import (
    INFO,
    JOURNAL,
    SCENARIO_COPY,
    SessionInfo,
    load_scenario_copy,
    read_info,
    write_info,
)
from rise_engine.session.journal_format import (
    FORMAT,
    InputLine,
    JournalHeader,
    encode_line,
)
from rise_engine.session.journal_reader import JournalContents, read_journal
from rise_engine.session.media import list_bytes
from rise_engine.session.scenario_copies import copy_folders

_BY_NUMBER = frozenset(
    {"cancelTask", "moveTask", "markMistake", "goOn", "repeatAct", "stopRuleOfAct", "releaseStop"}
    | {"cancelOpenGoals", "releaseOpenGoals"}
)
"""Functions whose behaviour is the number of a task, or names of rules."""
_BY_NAME = frozenset(
    {
        "startCommunicationRobotAct",
        "stopCommunicationRobotAct",
        "startInteractionRule",
        "stopInteractionRule",
        "stepBack",
    }
)


class SharedSession(Struct):
    """The result of sharing a session."""

    people: dict[str, str] = field(default_factory=dict)
    """The code of each wizard and observer, by name."""
    changed: int = 0
    """The number of changed inputs."""
    own_values: list[str] = field(default_factory=list)
    """Private keys with a start value in the scenario's own files, which are shared unchanged."""


def share_session(
    folder: Path,
    target: Path,
    *,
    level: ExportLevel,
    private: Iterable[str] = (),
    wizards: Mapping[str, str] | None = None,
) -> SharedSession:
    """Write the session in `folder` to the new folder `target`, at an export level.

    :param level: `shared` or `public`.
    :param private: private memory keys in addition to the scenario's.
    :param wizards: the code of each wizard, by name.
    :raises SessionError: the session is damaged, does not replay, or would go differently without what is private.
        Nothing is left at `target` then.
    :raises OSError: it cannot be written.
    """
    return _Sharing(folder, level, tuple(private), wizards or {}).write(target)


class _Sharing:
    """The work of sharing one session."""

    def __init__(self, folder: Path, level: ExportLevel, private: tuple[str, ...], wizards: Mapping[str, str]) -> None:
        self._folder = folder
        try:
            self._info = read_info(folder)
            self._contents = read_journal(folder / JOURNAL)
            self._scenario = load_scenario_copy(folder, self._info)
        except SessionError as error:
            raise SessionError(str(error)) from None
        _refuse_damaged(self._contents)
        self._keys = private
        self._level = level
        values = PrivateValues(self._scenario, private)
        self._own_values = sorted(key for key in values.keys if self._scenario.memory.get(key) not in (None, ""))
        self._old = LevelFilter(level, values, wizards)
        self._rejected: set[int] = set()
        self._inputs: dict[int, AnyInput] = {}
        self._note_everything(values)
        self._private = values
        self._stand_ins = StandIns(values, self._scenario.known_keys)
        self._report = SharedSession(self._old.people, own_values=self._own_values)

    def _note_everything(self, values: PrivateValues) -> None:
        """Collect private values, people and rejected tasks, also from inputs that left no record."""
        self._old.note(self._contents.read_records())
        task: tuple[int, Submit] | None = None
        for _, _, found in self._contents.lines():
            if isinstance(found, InputLine):
                task = (found.n, found.input) if isinstance(found.input, Submit) else None
                if isinstance(found.input, SessionStarted):
                    for key, value in found.input.memory.items():
                        values.note_memory(key, value)
            elif isinstance(found, TaskRecord) and found.status == "REJECTED" and task is not None:
                number, asked = task
                if (found.source, found.function) == (asked.source, asked.function):
                    self._rejected.add(number)

    def write(self, target: Path) -> SharedSession:
        self._inputs = {
            line.n: self._shared_input(line) for _, _, line in self._contents.lines() if isinstance(line, InputLine)
        }
        new = self._new_filter()
        journal = b"".join(self._shared_lines(new))
        target.mkdir(0o700)
        try:
            self._write(target, journal)
            if why := why_not_replayed(target):
                raise SessionError(f"what would be shared is wrong: {why}")
        except BaseException:
            _remove(target)
            raise
        return self._report

    # --- the inputs ---

    def _shared_input(self, line: InputLine) -> AnyInput:
        body: dict[str, Any] = msgspec.json.decode(msgspec.json.encode(line.input))
        told = self._old.apply_to_input(body, rejected=line.n in self._rejected)
        private = self._without_private(line.input, told)
        if private == body:
            return line.input
        self._report.changed += 1
        try:
            shared: AnyInput = msgspec.convert(private, type(line.input))
        except msgspec.ValidationError as error:
            raise SessionError(f"an input would not be one any more ({error})") from None
        return shared

    def _without_private(self, input: AnyInput, body: dict[str, Any]) -> dict[str, Any]:
        if isinstance(input, SessionStarted):
            return {**body, "memory": self._stand_ins.replace_memory(body["memory"])}
        if isinstance(input, Submit):
            if self._is_name(input):
                return body
            if input.function == "assignValue":
                return {**body, "behavior": self._stand_ins.replace_assignment(body["behavior"])}
            return {**body, "behavior": self._stand_ins.replace(body["behavior"])}
        if isinstance(input, Note) and input.source == ENGINE:  # may quote what was typed before it became a value
            return {**body, "text": self._private.hide_fields({"kind": "note", **body})["text"]}
        fields = ("text", "reason", "detail", "value", "confirmed", "unconfirmed", "unstoppable")
        return {
            name: self._stand_ins.replace(each) if name in fields and isinstance(each, str | list) else each
            for name, each in body.items()
        }

    def _is_name(self, task: Submit) -> bool:
        """Whether a task's behaviour is a name from the scenario or a number, not a text."""
        if task.function in _BY_NUMBER:
            return True
        known = self._scenario.acts if "Act" in task.function else self._scenario.rules
        if task.function not in _BY_NAME:
            return False
        return task.behavior in known or task.behavior.lstrip().startswith("{")

    # --- is it the same session ---

    def _changed(self) -> ChangedSession:
        kernel = Kernel(self._scenario, self._info.seed)
        return ChangedSession(
            self._folder, kernel, self._contents, lambda _, line: self._inputs[line.n], self._difference
        )

    def _new_filter(self) -> LevelFilter:
        """Make the filter for the new records. It also hides what the old filter hides: where the scenario itself uses
        such a word, both hide it."""
        values = PrivateValues(self._scenario, self._keys)
        for record in self._contents.read_records():
            values.note(record)
        for slot, value in self._stand_ins.values():
            values.note_memory(slot[1:-1], value)
        people = self._old.people
        new = LevelFilter(self._level, values, {**people, **{name: name for name in people.values()}})
        new.note(self._contents.read_records())
        new.note(self._changed().records())
        return new

    def _shared_lines(self, new: LevelFilter) -> Iterator[bytes]:
        """Give the lines of the new journal. Raises SessionError if its records differ from the old at the level."""
        for _, _, line in self._changed().lines(self._old.apply, new.apply):
            if isinstance(line, JournalHeader):
                line = JournalHeader(FORMAT, f"rise-tui {self._info.versions.get('rise-tui', '')}".strip())
            elif not isinstance(line, InputLine):
                line.wall = ""
            yield encode_line(line)

    def _difference(self, _line: int, what: str) -> SessionError:
        if why := why_not_replayed(self._folder):
            return SessionError(f"{why}, so no replay can prove what happened without the private values")
        return SessionError(f"private values or typed words decided what happened: without them {what}")

    # --- files ---

    def _write(self, target: Path, journal: bytes) -> None:
        write_private_file(target / JOURNAL, journal)
        write_info(target / INFO, self._shared_info())
        for path in (path for copy in copy_folders(self._folder) for path in sorted(copy.rglob("*"))):
            if path.is_file() and not path.is_symlink():
                destination = target / path.relative_to(self._folder)
                make_private_folder(destination.parent)
                write_private_file(destination, path.read_bytes())
        (target / SCENARIO_COPY).mkdir(0o700, exist_ok=True)
        if told := told_coded(self._folder, self._old):
            write_private_file(target / CODED_FILE, list_bytes(told))
            self._report.people.update(self._old.people)

    def _shared_info(self) -> SessionInfo:
        info = self._info
        return replace(
            info,
            format=FORMAT,  # this version has written its journal
            scenario_folder="",
            started="",
            ros_args=(),
            wizard=self._old.people.get(info.wizard, "") if info.wizard else "",
            machine={},
        )


def _refuse_damaged(contents: JournalContents) -> None:
    if contents.torn or contents.damaged or contents.gaps or contents.header is None:
        raise SessionError("its journal is damaged, so no replay can prove what happened without the private values")
    if not contents.ended:
        raise SessionError("it has not ended")


def _remove(folder: Path) -> None:
    for path in sorted(folder.rglob("*"), reverse=True):
        path.rmdir() if path.is_dir() else path.unlink()
    folder.rmdir()
