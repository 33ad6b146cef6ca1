"""Runs a session with changed inputs in a fresh kernel, and compares the new records with the recorded ones.

Redaction and sharing remove parts of the inputs. Each new record must equal the recorded one under a mask. If a removed
part had an effect (on a condition, or by the length of a text), a record differs.
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
"""Fields in which the program itself describes what happened, and quotes the request."""

ChangeInput: TypeAlias = Callable[[bytes, InputLine], AnyInput]
"""Maps an input's line in the journal to the new input, or to the same input if nothing changes."""
Mask: TypeAlias = Callable[[dict[str, Any]], dict[str, Any]]
"""Maps a record as JSON to the part that must stay the same."""
Explain: TypeAlias = Callable[[int, str], SessionError]
"""Makes the error from the line number in the journal and a description of the difference."""


class ChangedSession:
    """A session in `folder` whose inputs are changed.

    :param kernel: a fresh kernel.
    :param contents: the whole journal, without damage.
    :param change: makes the new inputs.
    :param explain: makes the error for a record that differs.
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
        """Give the kernel's records without comparing them. Raises SessionError: an input cannot be carried out."""
        for number, line, found in self._contents.lines():
            if isinstance(found, InputLine):
                yield from self._handle(number, InputLine(found.n, self._change(line, found)))

    def lines(self, before: Mask, after: Mask) -> Iterator[tuple[bytes, JournalLine, JournalLine]]:
        """Give each line of the journal without its end, with its old and its new content.

        :param before: the mask of recorded records.
        :param after: the mask of new records.
        :raises SessionError: a record differs, or an input cannot be carried out.
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
        except Exception as error:  # a traceback must not show the removed text
            raise self._explain(number, f"input {line.n} cannot be carried out ({error})") from None
        return records


def why_not_replayed(folder: Path) -> str:
    """Return why an unchanged session does not replay with this version of the program, or an empty text."""
    try:
        comparison = compare_replay(folder)
    except SessionError as error:
        return str(error)
    return "" if comparison.identical else f"the session does not replay unchanged ({comparison.why})"


def _different_field(recorded: AnyRecord, made: AnyRecord, before: Mask, after: Mask) -> str:
    """Return the first field that differs between two records under their masks."""
    old, new = encode_record(recorded), encode_record(made)
    if old == new and before is after:
        return ""
    was, now = before(msgspec.json.decode(old)), after(msgspec.json.decode(new))
    for name in dict.fromkeys([*was, *now]):
        if name in _OWN_SENTENCES or (name == "text" and was.get("source") == ENGINE):
            continue  # "did you mean" depends on the typed words, and has no effect
        if name not in was or name not in now or was[name] != now[name]:
            return name
    return ""


def _describe(record: AnyRecord) -> str:
    kind = type(record).__name__.removesuffix("Record").lower()
    key = f" of `{record.key}`" if isinstance(record, MemoryRecord) else ""
    return f"record {record.seq} ({kind}{key}, at {record.t:.1f} s)"
