"""A session whose inputs are changed: what a fresh kernel makes of them, beside what was recorded.

Redaction and sharing take something from the inputs. Each record that the kernel makes of what is left must be the
recorded one, under a mask. So whatever decides anything (a condition, the length of a text) is noticed at the first
record that differs.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

from rise_engine.base.errors import SessionError
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import AnyInput
from rise_engine.kernel.records import ENGINE, AnyRecord, MemoryRecord
from rise_engine.session.journal_format import InputLine, JournalHeader, JournalLine, encode_record
from rise_engine.session.journal_reader import JournalContents
from rise_engine.session.replay import compare_replay
from rise_engine.session.scenario_copies import offer_changed

_OWN_SENTENCES = frozenset({"reason", "error"})
"""Fields of records in which the program says something about what happened, and quotes what was asked for."""

ChangeInput: TypeAlias = Callable[[bytes, InputLine], AnyInput]
"""From an input's line in the journal to what takes its place; the same input when nothing changes."""
Mask: TypeAlias = Callable[[dict[str, Any]], dict[str, Any]]
"""From a record as JSON has it to what of it must stay the same."""
Explain: TypeAlias = Callable[[int, str], SessionError]
"""From a line of the journal, and what is different there, to the error."""


class ChangedSession:
    """A session in `folder` whose inputs are changed.

    :param kernel: a fresh one.
    :param contents: the whole journal, without damage.
    :param change: makes the new inputs.
    :param explain: makes the error when something else would have happened.
    """

    def __init__(
        self, folder: Path, kernel: Kernel, contents: JournalContents, change: ChangeInput, explain: Explain
    ) -> None:
        self._folder = folder
        self._kernel = kernel
        self._contents = contents
        self._change = change
        self._explain = explain

    def records(self) -> Iterator[AnyRecord]:
        """What the kernel makes, not compared. Raises SessionError: an input cannot be carried out."""
        for number, line, found in self._contents.lines():
            if isinstance(found, InputLine):
                yield from self._handle(number, InputLine(found.n, self._change(line, found)))

    def lines(self, before: Mask, after: Mask) -> Iterator[tuple[bytes, JournalLine, JournalLine]]:
        """Each line of the journal, without its end; what it holds, and what it holds now.

        :param before: what must stay the same of a recorded record.
        :param after: the same of a new one.
        :raises SessionError: there is another record, or an input cannot be carried out.
        """
        waiting: deque[AnyRecord] = deque()
        number = 0
        for number, line, found in self._contents.lines():
            new: JournalLine = found
            if isinstance(found, InputLine):
                if waiting:
                    raise self._explain(number, f"{_describe(waiting[0])} is not there")
                new = InputLine(found.n, self._change(line, found))
                waiting.extend(self._handle(number, new))
            elif not isinstance(found, JournalHeader):
                if not waiting or waiting[0].seq != found.seq:
                    raise self._explain(number, f"{_describe(found)} would not be there")
                new = waiting.popleft()
                new.wall = found.wall
                if name := _different_field(found, new, before, after):
                    raise self._explain(number, f"{_describe(found)} differs in `{name}`")
            yield line, found, new
        if waiting and self._contents.ended:
            raise self._explain(number, f"{_describe(waiting[0])} is not there")

    def _handle(self, number: int, line: InputLine) -> list[AnyRecord]:
        try:
            offer_changed(self._kernel, self._folder, line.input)
            records, _ = self._kernel.handle(line.input)
        except Exception as error:  # what the kernel never met before must not leave a trace of what is gone
            raise self._explain(number, f"input {line.n} cannot be carried out ({error})") from error
        return records


def why_not_replayed(folder: Path) -> str:
    """Why a session does not replay as it is, with this version of the program; empty when it does."""
    try:
        comparison = compare_replay(folder)
    except SessionError as error:
        return str(error)
    return "" if comparison.identical else f"the session does not replay unchanged ({comparison.why})"


def _different_field(recorded: AnyRecord, made: AnyRecord, before: Mask, after: Mask) -> str:
    """The first field in which two records differ, as far as they are told."""
    old, new = encode_record(recorded), encode_record(made)
    if old == new and before is after:
        return ""
    was, now = before(msgspec.json.decode(old)), after(msgspec.json.decode(new))
    for name in dict.fromkeys([*was, *now]):
        if name in _OWN_SENTENCES or (name == "text" and was.get("source") == ENGINE):
            continue  # "did you mean" depends on what was written, and nothing depends on that
        if name not in was or name not in now or was[name] != now[name]:
            return name
    return ""


def _describe(record: AnyRecord) -> str:
    kind = type(record).__name__.removesuffix("Record").lower()
    key = f" of `{record.key}`" if isinstance(record, MemoryRecord) else ""
    return f"record {record.seq} ({kind}{key}, at {record.t:.1f} s)"
