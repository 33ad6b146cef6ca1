"""Sharing: writes a session that shows only what an export level shows, and still replays.

Typed texts, people's names and private values are removed from the inputs. A fresh kernel makes the records again
(`rise_engine.privacy.changed_session`). At the level, these must equal the old records. Apart from the scenario, a
shared session therefore shows no more than an export.

It has no times of day: `wall` is empty, and session.toml has no date, no paths and no machine.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import make_private_folder, write_private_file
from rise_engine.expression import Assignment, ExpressionError
from rise_engine.expression.environment import Environment
from rise_engine.expression.errors import EvaluationError
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import AnyInput, Note, SessionStarted, Submit
from rise_engine.kernel.records import ENGINE, TaskRecord
from rise_engine.privacy.changed_session import ChangedSession, why_not_replayed
from rise_engine.privacy.levels import ExportLevel, LevelFilter, coded_at_level
from rise_engine.privacy.private_values import PrivateValues
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
    run_as: str = "",
) -> SharedSession:
    """Write the session in `folder` to the new folder `target`, at an export level.

    :param level: `shared` or `public`.
    :param private: private memory keys in addition to the scenario's.
    :param wizards: the code of each wizard, by name.
    :param run_as: replaces the participant under whom it was run; empty: do not replace.
    :raises SessionError: the session is damaged, does not replay, or depends on private data. Then `target` is not left
        behind.
    :raises OSError: it cannot be written.
    """
    return _Sharing(folder, level, tuple(private), wizards or {}, run_as).write(target)


class _Sharing:
    """The work of sharing one session."""

    def __init__(
        self, folder: Path, level: ExportLevel, private: tuple[str, ...], wizards: Mapping[str, str], run_as: str
    ) -> None:
        self._folder = folder
        self._run_as = run_as
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
        """Collect private values, people and rejected tasks, also from inputs without a record."""
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
        filtered = self._old.apply_to_input(body, rejected=line.n in self._rejected)
        private = self._without_private(line.input, filtered)
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
            return {**self._without_person(body), "memory": self._stand_ins.replace_memory(body["memory"])}
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

    def _without_person(self, body: dict[str, Any]) -> dict[str, Any]:
        """Replace the participant in an input or a record, if they must not be named."""
        return {**body, "participant": self._run_as} if self._run_as and body.get("participant") else body

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
        """Make the filter for the new records. It also hides what the old filter hides: both hide such words in the
        scenario."""
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

        def old(values: dict[str, Any]) -> dict[str, Any]:
            return self._without_person(self._old.apply(values))

        for _, _, line in self._changed().lines(old, new.apply):
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
        if files := coded_at_level(self._folder, self._old):
            write_private_file(target / CODED_FILE, list_bytes(files))
            self._report.people.update(self._old.people)

    def _shared_info(self) -> SessionInfo:
        info = self._info
        return replace(
            info,
            format=FORMAT,  # written by this version
            participant=self._run_as or info.participant,
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


# --- stand-ins for private values -------------------------------------------------------------------------------------

# Equal values get equal stand-ins, so that conditions that only compare them have the same result.


_FIRST_NUMBER = 90_001
"""Five digits, so that it is also found within longer words (`private_values.MIN_DIGITS_WITHIN`)."""
_LITERAL = re.compile(r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|(?<![\w.])(?:\d+\.\d+|\d{2,})(?!\w)""")
"""A text, or a number of at least two digits, in an expression."""
_NO_NAME = re.compile(r"[^A-Za-z0-9]+")


class StandIns:
    """A table of stand-ins: each value of a private key always has the same one."""

    def __init__(self, private: PrivateValues, known_keys: Collection[str]) -> None:
        """`private`: has collected all values of the keys. `known_keys`: all keys of the scenario."""
        self._private = private
        self._known_keys = known_keys
        self._given: dict[tuple[bool, str], tuple[str, str | int]] = {}

    def values(self) -> list[tuple[str, str | int]]:
        """Return all stand-ins, each with its key as `{person_name}`."""
        return list(self._given.values())

    def replace(self, value: Any) -> Any:
        """Replace private values in the texts and numbers of a JSON value."""
        return self._private.replace_values(value, self._replace_value)

    def replace_memory(self, memory: dict[str, Any]) -> dict[str, Any]:
        """Replace private values in memory, given by key."""
        return {key: self._replace_all(key, value) for key, value in memory.items()}

    def replace_assignment(self, behavior: str) -> str:
        """Replace values in the behaviour of assignValue: `person_name = "Anna"`, also if it cannot be read."""
        try:
            assignments = Assignment.parse_all(behavior)
        except ExpressionError:
            named = [
                key for key in sorted(self._private.keys) if re.search(rf"(?<![\w.]){re.escape(key)}(?!\w)", behavior)
            ]
            if named:
                return "; ".join(f"{key} = {{{key}}}" for key in named)
            return str(self.replace(behavior))
        if not any(self._private.is_hidden(each.key) for each in assignments):
            return str(self.replace(behavior))
        if behavior.lstrip().startswith("{"):
            values = {each.key: self._replace_all(each.key, each.literal) for each in assignments}
            return json.dumps(values, ensure_ascii=False)
        (assignment,) = assignments
        left, equals, _ = behavior.partition("=")
        word = assignment.bare_word
        if word is not None:  # an unquoted text, unless it is a key: then no value was typed
            return behavior if word in self._known_keys else f"{left}{equals} {self._replace_all(assignment.key, word)}"
        value = _constant(assignment)
        if value is None:
            return self._replace_literals(f"{{{assignment.key}}}", str(self.replace(behavior)), len(left))
        return f"{left}{equals} {json.dumps(self._replace_all(assignment.key, value[0]), ensure_ascii=False)}"

    def _replace_literals(self, slot: str, text: str, start: int) -> str:
        """Replace the literals in an expression that also reads memory, or cannot be computed."""

        def replace(found: re.Match[str]) -> str:
            written = found[0]
            if written[0] in "\"'":
                return (
                    f"{written[0]}{self._replace_value(slot, written[1:-1])}{written[0]}" if written[1:-1] else written
                )
            return str(self._replace_value(slot, float(written)))

        return text[:start] + _LITERAL.sub(replace, text[start:])

    def _replace_all(self, key: str, value: Any) -> Any:
        """Replace the whole value of a private key. In other keys, replace the former values of private keys."""
        if not self._private.is_hidden(key):
            return self.replace(value)
        slot = f"{{{key.partition('.')[0].partition('[')[0]}}}"
        return self._hide(slot, value)

    def _hide(self, slot: str, value: Any) -> Any:
        if isinstance(value, dict):
            return {name: self._hide(slot, each) for name, each in value.items()}
        if isinstance(value, list):
            return [self._hide(slot, each) for each in value]
        if value is None or value == "":
            return value  # an empty value does not identify anybody
        if isinstance(value, bool):
            return self._replace_value(slot, json.dumps(value))
        return self._replace_value(slot, value)

    def _replace_value(self, slot: str, found: str | int | float) -> str | int:
        """Return the stand-in. A number gets a number, with which a scenario can compute; a changed result is noticed.
        Each word of a text gets a word, so that a first name has the same stand-in alone and in the full name."""
        if isinstance(found, str):
            return " ".join(str(self._assign(slot, word.casefold(), number=False)) for word in found.split())
        return self._assign(slot, f"{found:g}", number=True)

    def _assign(self, slot: str, found: str, *, number: bool) -> str | int:
        known = (number, found)
        if known not in self._given:
            count = len(self._given)
            value = _FIRST_NUMBER + count if number else f"{_NO_NAME.sub('', slot).upper()}{count + 1}"
            self._given[known] = (slot, value)
        return self._given[known][1]


def _constant(assignment: Assignment) -> tuple[Any] | None:
    """Return the value of a right side that reads nothing. None: it reads memory, so no value was typed."""
    expression = assignment.expression
    if expression is not None and (expression.keys or expression.draws):
        return None
    try:
        return (assignment.evaluate(Environment({})),)
    except EvaluationError:
        return None
