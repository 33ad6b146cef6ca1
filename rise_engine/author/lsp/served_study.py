"""A study with files open in an editor, checked with their unsaved content; and positions as the protocol has them.

Lines end with LF, CRLF or CR alone. Columns count units of the encoding that client and server agree on. Source:
https://microsoft.github.io/language-server-protocol/specifications/lsp/3.17/specification/#position
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from itertools import accumulate
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

from msgspec import UNSET
from msgspec.structs import replace

from rise_engine.author.edit.edits import AddRule, Rename
from rise_engine.author.edit.formatting import format_file
from rise_engine.author.edit.plan import EditRefused, Files, Plan, StudyState
from rise_engine.author.edit.planning import plan
from rise_engine.author.edit.remedies import Remedy, remedies
from rise_engine.author.edit.study_folder import read_study_files
from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.scenario.checking.uses import Use
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import SourceLocation

PositionEncoding: TypeAlias = Literal["utf-8", "utf-16", "utf-32"]
_LINE_END = re.compile(r"\r\n?|\n")
_CODECS: dict[PositionEncoding, str] = {"utf-8": "utf-8", "utf-16": "utf-16-le", "utf-32": "utf-32-le"}
_WIDE: dict[PositionEncoding, re.Pattern[str]] = {
    "utf-8": re.compile("[\x80-\ud7ff\ue000-\U0010ffff]"),
    "utf-16": re.compile("[\U00010000-\U0010ffff]"),
    "utf-32": re.compile("(?!)"),
}
"""Characters of more than one unit. Lone surrogates, which no encoding has, count as `?`."""
_UNIT_BYTES: dict[PositionEncoding, int] = {"utf-8": 1, "utf-16": 2, "utf-32": 4}


class LinePlace(NamedTuple):
    """A line, and units in it; both from 0."""

    line: int
    units: int


class TextPositions:
    """The positions in one text."""

    def __init__(self, text: str, encoding: PositionEncoding = "utf-16") -> None:
        self.text = text
        self._starts = [0, *(found.end() for found in _LINE_END.finditer(text))]
        wide = list(_WIDE[encoding].finditer(text))
        self._wide = [found.start() for found in wide]
        """Offsets of characters with more than one unit; a file may be one line of megabytes."""
        self._more = [
            0,
            *accumulate(len(found[0].encode(_CODECS[encoding])) // _UNIT_BYTES[encoding] - 1 for found in wide),
        ]
        """The additional units of the first 0, 1, 2, ... of them."""
        self._codec = _CODECS[encoding]
        self._unit = _UNIT_BYTES[encoding]

    def place(self, offset: int) -> LinePlace:
        """Return the position of a character.

        >>> TextPositions("a\\r\\n😀x").place(4)
        LinePlace(line=1, units=2)
        """
        line = bisect_right(self._starts, offset) - 1
        return LinePlace(line, self._units(offset) - self._units(self._starts[line]))

    def _units(self, offset: int) -> int:
        """Return the units from the text's beginning."""
        return offset + self._more[bisect_left(self._wide, offset)]

    def offset(self, line: int, units: int) -> int:
        """Return the offset of a position, kept within the text.

        >>> TextPositions("a\\r\\n😀x").offset(1, 2)
        4
        """
        if line >= len(self._starts):
            return len(self.text)
        start = self._starts[line]
        end = self._starts[line + 1] if line + 1 < len(self._starts) else len(self.text)
        written = self.text[start:end].rstrip("\r\n").encode(self._codec, "replace")
        return start + len(written[: units * self._unit].decode(self._codec, "ignore"))


_FOLDERS = ("acts", "rules")
_FOLDERS_OF_PARTS = (*_FOLDERS, "tables", "patterns", "robots", "texts")


def study_folder(file: Path) -> Path | None:
    """Return the folder of the study that a file belongs to; None: it is not one of a study's files.

    >>> study_folder(Path("scenarios/greeting/acts/greeting.xml")).name
    'greeting'
    >>> study_folder(Path("docs/page.xml"))
    """
    within = file.parent.name in _FOLDERS_OF_PARTS
    folder = file.parent.parent if within else file.parent
    if (folder / SCENARIO_FILE).is_file() or file.name == SCENARIO_FILE:
        return folder
    return folder if file.parent.name in _FOLDERS and file.suffix.lower() == ".xml" else None


class ServedStudy:
    """One study that the server serves."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.held: dict[str, bytes] = {}
        """The contents of open files."""
        self._checker = ScenarioChecker(folder)
        self._checked: LoadResult | None = None
        self._state: StudyState | None = None

    def name_of(self, path: Path) -> str:
        """Return a file's name as diagnostics give it."""
        return path.relative_to(self.folder).as_posix() if path.is_relative_to(self.folder) else str(path)

    def hold(self, path: Path, text: str) -> None:
        """Take a file's text from the editor."""
        self.held[self.name_of(path)] = text.encode(errors="replace")
        self._checked = None

    def let_go(self, path: Path) -> None:
        """Release a closed file: the content on the disk counts again."""
        self.held.pop(self.name_of(path), None)
        self._checked = None

    def forget(self) -> None:
        """Note that something on the disk has changed."""
        self._checked = None

    @property
    def checked(self) -> LoadResult:
        """The result of the study's check."""
        if self._checked is None:
            self._checked = self._checker.check(self.held)
        return self._checked

    def source(self, name: str) -> SourceFile | None:
        """Return a file in its present state; None: it cannot be read."""
        data = self.held.get(name)
        if data is None:
            try:
                data = (self.folder / name).read_bytes()
            except OSError:
                return None
        return SourceFile(name, data, data.decode("utf-8-sig", "replace"))

    def use_at(self, name: str, offset: int) -> Use | None:
        """Return the use of a name at an offset of a file."""
        source = self.source(name)
        if source is None:
            return None
        place = source.location(offset)
        return self.checked.uses.at(name, place.line, place.column)

    def uses_like(self, use: Use) -> list[Use]:
        """Return all uses of the same name, each place once."""
        return list({each.place: each for each in reversed(self.checked.uses.of(use.kind, use.name))}.values())[::-1]

    def definitions(self, use: Use) -> list[Use]:
        """Return the definitions of a name: for an act's end, the act; for an event, where it is raised or awaited."""
        found = [each for each in self.uses_like(use) if each.defines and each.length]
        if not found and use.kind == "event":
            head, _, ending = use.name.rpartition("_")
            if ending in ("end", "succeeded", "failed", "stopped"):
                found = [each for kind in ("act", "rule") for each in self.checked.uses.of(kind, head) if each.defines]
        return found or [each for each in self.uses_like(use) if each.length and each.place != use.place]

    @property
    def state(self) -> StudyState:
        """The state for planning edits. Raises EditRefused: the folder cannot be read."""
        if self._state is None or self._state.checked is not self.checked:
            files = self.files
            self._state = StudyState(files, self.checked, self.folder)
        return self._state

    def findings(self, name: str, start: int, end: int) -> list[Diagnostic]:
        """Return the diagnostics that overlap or touch a range of a file."""
        source = self.source(name)
        found = [each for each in self.checked.diagnostics if each.location.file == name and source is not None]
        return [each for each in found if source is not None and _touches(source, each, start, end)]

    def rename(self, use: Use, new: str) -> Plan:
        """Plan another name everywhere. Raises EditRefused."""
        return plan(Rename(use.kind, use.name, new), self.state)

    def remedies(self, finding: Diagnostic, *, with_new_files: bool) -> list[tuple[Remedy, Plan]]:
        """Return the remedies for a diagnostic, with their plans.

        :param with_new_files: whether files may be made; if not, new parts go into existing files.
        """
        try:
            found = [(each, plan(each.edit, self.state)) for each in remedies(finding, self.state)]
            rules = self.state.outline.rules
            for at, (remedy, planned) in enumerate(found):
                if planned.written and isinstance(remedy.edit, AddRule) and rules and not with_new_files:
                    edit = replace(remedy.edit, after=rules[-1].name)
                    remedy = replace(remedy, title=f"{remedy.title} in {rules[-1].file}", edit=edit)
                    found[at] = remedy, plan(edit, self.state)
        except EditRefused:  # the folder cannot be read
            return []
        return found

    @property
    def files(self) -> Files:
        """All files of the study in their present state. Raises EditRefused."""
        return {**read_study_files(self.folder), **self.held}

    def formatted(self, name: str) -> str:
        """Return a file in the usual layout. Raises EditRefused."""
        return format_file(name, self.files).decode("utf-8-sig")


def place_of(positions: TextPositions, source: SourceFile, location: SourceLocation) -> tuple[int, int]:
    """Return the place of a diagnostic in terms of the protocol."""
    return positions.place(source.offset(location.line, location.column))


def _touches(source: SourceFile, found: Diagnostic, start: int, end: int) -> bool:
    first = source.offset(found.location.line, found.location.column)
    last = first if found.end is UNSET else source.offset(found.end.line, found.end.column)
    return first <= end and start <= last


__all__ = ["PositionEncoding", "ServedStudy", "place_of", "study_folder"]
