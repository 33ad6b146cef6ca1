"""Reads files, and caches the results for the next check, so that unchanged files are not read again.

The result for a file is a value with diagnostics that depends only on its key. So a check with cached results equals
one that reads everything (`tests/scenario/test_checker.py`).
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Hashable
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import Any, TypeVar

from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.tree import FileTree, UnreadableError
from rise_engine.scenario.model import SourceLocation

Value = TypeVar("Value")
_ROUNDS = 16
"""Number of checks without a use after which a result is removed. An undo, or a preview of an edit, still finds it."""
_MAX_EXPRESSIONS = 20_000


class Memo:
    """A cache of results by their inputs. For one check at a time."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, tuple[Any, list[int]]] = {}
        """The value, and the round of its last use."""
        self._numbers: dict[str, tuple[Any, int]] = {}
        self._round = 0
        self.expressions: dict[str, Expression] = {}
        """By text, for all files."""
        self.assignments: dict[str, Assignment] = {}

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """The cached value, or else the value that `make` returns."""
        if (known := self._kept.get(key)) is None:
            self._kept[key] = known = (make(), [self._round])
        known[1][0] = self._round
        value: Value = known[0]
        return value

    def read(self, key: Hashable, diagnostics: Diagnostics, make: Callable[[Diagnostics], Value]) -> Value:
        """Like `get`, for a reader that reports diagnostics, which are reported each time."""

        def make_with_findings() -> tuple[Value, Diagnostics]:
            found = Diagnostics()
            return make(found), found

        value, found = self.get(key, make_with_findings)
        diagnostics.add(found)
        return value

    def read_part(
        self,
        key: Hashable,
        draft: ScenarioDraft,
        diagnostics: Diagnostics,
        make: Callable[[ScenarioDraft, Diagnostics], Value],
    ) -> Value:
        """Like `read`, for a reader of a part of a draft, which is added to `draft`."""

        def make_part(found: Diagnostics) -> tuple[Value, ScenarioDraft]:
            part = ScenarioDraft(self.expressions, self.assignments)
            return make(part, found), part

        value, part = self.read(key, diagnostics, make_part)
        draft.add(part)
        return value

    def number(self, kind: str, value: object) -> int:
        """A number for a value that cannot be a key itself: the previous number if the value has not changed."""
        before, number = self._numbers.get(kind, (None, 0))
        if before is value or (number and before == value):
            return number
        self._numbers[kind] = value, number + 1
        return number + 1

    def end_round(self) -> None:
        """Remove results that have not been used for long."""
        self._kept = {key: kept for key, kept in self._kept.items() if self._round - kept[1][0] < _ROUNDS}
        self._round += 1
        if len(self.expressions) + len(self.assignments) > _MAX_EXPRESSIONS:
            self.expressions.clear()
            self.assignments.clear()


# --- files ------------------------------------------------------------------------------------------------------------


MAX_BYTES = 10_000_000
"""Larger files are refused before they are read."""
MAX_TOML_BYTES = 1_000_000
"""The same limit for settings and robot profiles, which people write by hand."""
ENCODING_REMEDY = "open it with the encoding it has (often Windows-1252 or Latin-1) and save it as UTF-8"
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_CONFLICT = re.compile(
    r"^<{7}(?=[ \r\n])(?:(?!^<{7}[ \r\n]).)*?^={7}(?=[ \r\n])(?:(?!^<{7}[ \r\n]).)*?(?P<closing>^>{7}(?=[ \r\n]|\Z))",
    re.MULTILINE | re.DOTALL,
)
"""The lines of a git merge conflict."""
_NAMED_CONFLICTS = 5
"""Maximum number of further conflicts of a file that a message lists by line."""


class SourceFile:
    """One file of a scenario."""

    def __init__(self, name: str, data: bytes, text: str, encoding: str = "utf-8") -> None:
        self.name = name
        """Relative to the scenario folder if the file is inside it."""
        self.data = data
        self.text = text
        """Decoded, without byte order mark."""
        self.encoding = encoding

    @cached_property
    def _line_starts(self) -> list[int]:
        """The offsets at which lines begin. Lines end with LF or CRLF."""
        return [0, *accumulate(len(line) + 1 for line in self.text.split("\n")[:-1])]

    def location(self, offset: int) -> SourceLocation:
        """Line and column of an offset in `text`."""
        starts = self._line_starts
        line = bisect_right(starts, offset)
        return SourceLocation(self.name, line, offset - starts[line - 1] + 1)

    def offset(self, line: int, column: int) -> int:
        """The reverse of `location`, limited to the text."""
        starts = self._line_starts
        line = min(max(line, 1), len(starts))
        return min(starts[line - 1] + max(column, 1) - 1, len(self.text))

    def byte_offset(self, line: int, column: int) -> int:
        """The offset in `data` of a line and column, like `offset` in `text`."""
        offset = self.offset(line, column)
        mark = len(_BYTE_ORDER_MARK) if self.data.startswith(_BYTE_ORDER_MARK) and self.encoding == "utf-8" else 0
        return mark + (offset if self.text.isascii() else len(self.text[:offset].encode(self.encoding)))

    def line_text(self, number: int) -> str:
        """The text of a line, without its end."""
        starts = self._line_starts
        return self.text[starts[number - 1] : starts[number] if number < len(starts) else None].rstrip("\r\n")


class FileReader:
    """Reads files and remembers them, so that the scenario can be identified by their contents."""

    def __init__(
        self, folder: Path, diagnostics: Diagnostics, tree: FileTree | None = None, memo: Memo | None = None
    ) -> None:
        """
        :param folder: the scenario's folder.
        :param diagnostics: gets the diagnostics.
        :param tree: the content of the folder; None: the disk's.
        :param memo: cached results.
        """
        self.memo = memo or Memo()
        self.folder = folder
        self.diagnostics = diagnostics
        self.tree = tree or FileTree(folder)
        self.sources: list[SourceFile] = []

    def display_name(self, path: Path) -> str:
        """The name of a file in diagnostics: relative to the folder if it is inside."""
        try:
            return path.relative_to(self.folder).as_posix()
        except ValueError:
            return str(path)

    def read(
        self, path: Path, most: int = MAX_BYTES, encoding: str = "utf-8", remedy: str = ENCODING_REMEDY
    ) -> SourceFile | None:
        """Read a file of at most `most` bytes; None after a diagnostic. `remedy` ends that about the encoding."""
        name = self.display_name(path)
        location = SourceLocation(name)
        try:
            data = self.tree.read(path, most)
        except UnreadableError as error:
            self.diagnostics.error(error.code, location, str(error))
            return None
        key = ("source", name, data, encoding, remedy)
        source = self.memo.read(key, self.diagnostics, lambda found: _decode(name, data, found, encoding, remedy))
        if source is not None:
            self.sources.append(source)
        return source


def _decode(name: str, data: bytes, diagnostics: Diagnostics, encoding: str, remedy: str) -> SourceFile | None:
    """Decode a file; None after diagnostics."""
    text = decode_text(name, data, diagnostics, encoding, remedy)
    source = SourceFile(name, data, text, encoding) if text is not None else None
    return None if source is None or _has_conflicts(source, diagnostics) else source


def _has_conflicts(source: SourceFile, diagnostics: Diagnostics) -> bool:
    """Whether a file has unresolved merge conflicts. Reports only one diagnostic, at the first conflict."""
    conflicts = list(_CONFLICT.finditer(source.text)) if "<<<<<<<" in source.text else []
    if not conflicts:
        return False
    first, *others = conflicts
    begin, end = (source.location(offset).line for offset in (first.start(), first.start("closing")))
    more = ", ".join(str(source.location(each.start()).line) for each in others[:_NAMED_CONFLICTS])
    more += ", ..." if len(others) > _NAMED_CONFLICTS else ""
    diagnostics.error(
        "merge-conflict",
        source.location(first.start()),
        "a merge of git was not resolved here: this file holds two versions; keep one of them, and delete the lines "
        f"with the marks (`<<<<<<<` in line {begin}, `=======`, and `>>>>>>>` in line {end})"
        + (f"; it has more of them, in line {more}" if others else ""),
    )
    return True


def decode_text(
    name: str, data: bytes, diagnostics: Diagnostics, encoding: str = "utf-8", remedy: str = ENCODING_REMEDY
) -> str | None:
    """The text of a file, in UTF-8 with or without byte order mark; otherwise None and a diagnostic."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or data[:4].count(0) >= 2:
        diagnostics.error("encoding", SourceLocation(name), "this file is UTF-16 or UTF-32; save it as UTF-8")
        return None
    try:
        return data.decode("utf-8-sig" if encoding == "utf-8" else encoding)
    except UnicodeDecodeError as error:
        before = error.object[: error.start].decode(encoding, "replace")  # error.object has no byte order mark
        location = SourceFile(name, b"", before).location(len(before))
        diagnostics.error(
            "encoding",
            location,
            f"this file is not {encoding.upper()} (byte 0x{error.object[error.start]:02X}); {remedy}",
        )
        return None
