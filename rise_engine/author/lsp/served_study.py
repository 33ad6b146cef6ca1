"""A study of which files are open in an editor: checked with what is not saved yet."""

from __future__ import annotations

from pathlib import Path

from msgspec import UNSET
from msgspec.structs import replace

from rise_engine.author.edit.edits import AddRule, Rename
from rise_engine.author.edit.formatting import format_file
from rise_engine.author.edit.plan import EditRefused, Files, Plan, StudyState
from rise_engine.author.edit.planning import plan
from rise_engine.author.edit.remedies import Remedy, remedies
from rise_engine.author.edit.study_folder import read_study_files
from rise_engine.author.lsp.positions import PositionEncoding, TextPositions
from rise_engine.scenario.checker import ScenarioChecker
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.file_names import SCENARIO_FILE
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import SourceLocation
from rise_engine.scenario.source_files import SourceFile
from rise_engine.scenario.uses import Use

_FOLDERS = ("acts", "rules")
_FOLDERS_OF_PARTS = (*_FOLDERS, "tables", "patterns", "robots", "texts")


def study_folder(file: Path) -> Path | None:
    """The folder of the study that a file belongs to; None: it is none of a study's files.

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
    """One study."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.held: dict[str, bytes] = {}
        """The contents of open files."""
        self._checker = ScenarioChecker(folder)
        self._checked: LoadResult | None = None
        self._state: StudyState | None = None

    def name_of(self, path: Path) -> str:
        """How findings name a file."""
        return path.relative_to(self.folder).as_posix() if path.is_relative_to(self.folder) else str(path)

    def hold(self, path: Path, text: str) -> None:
        """A file has this text in the editor."""
        self.held[self.name_of(path)] = text.encode(errors="replace")
        self._checked = None

    def let_go(self, path: Path) -> None:
        """A file is closed: what is on the disk counts."""
        self.held.pop(self.name_of(path), None)
        self._checked = None

    def forget(self) -> None:
        """Something on the disk has changed."""
        self._checked = None

    @property
    def checked(self) -> LoadResult:
        """What the checks find."""
        if self._checked is None:
            self._checked = self._checker.check(self.held)
        return self._checked

    def source(self, name: str) -> SourceFile | None:
        """A file as it is now; None: it cannot be read."""
        data = self.held.get(name)
        if data is None:
            try:
                data = (self.folder / name).read_bytes()
            except OSError:
                return None
        return SourceFile(name, data, data.decode("utf-8-sig", "replace"))

    def use_at(self, name: str, offset: int) -> Use | None:
        """What is named at an offset of a file."""
        source = self.source(name)
        if source is None:
            return None
        place = source.location(offset)
        return self.checked.uses.at(name, place.line, place.column)

    def uses_like(self, use: Use) -> list[Use]:
        """All uses of the same name, each place once."""
        return list({each.place: each for each in reversed(self.checked.uses.of(use.kind, use.name))}.values())[::-1]

    def definitions(self, use: Use) -> list[Use]:
        """What is called so. Of the end of an act, the act; of an event, where it is raised or awaited."""
        found = [each for each in self.uses_like(use) if each.defines and each.length]
        if not found and use.kind == "event":
            head, _, ending = use.name.rpartition("_")
            if ending in ("end", "succeeded", "failed", "stopped"):
                found = [each for kind in ("act", "rule") for each in self.checked.uses.of(kind, head) if each.defines]
        return found or [each for each in self.uses_like(use) if each.length and each.place != use.place]

    @property
    def state(self) -> StudyState:
        """What edits are planned on. Raises EditRefused: the folder cannot be read."""
        if self._state is None or self._state.checked is not self.checked:
            files = self.files
            self._state = StudyState(files, self.checked, self.folder)
        return self._state

    def findings(self, name: str, start: int, end: int) -> list[Diagnostic]:
        """The findings in a stretch of a file, also those that it only touches."""
        source = self.source(name)
        found = [each for each in self.checked.diagnostics if each.location.file == name and source is not None]
        return [each for each in found if source is not None and _touches(source, each, start, end)]

    def rename(self, use: Use, new: str) -> Plan:
        """What gives a thing another name everywhere. Raises EditRefused."""
        return plan(Rename(use.kind, use.name, new), self.state)

    def remedies(self, finding: Diagnostic, *, with_new_files: bool) -> list[tuple[Remedy, Plan]]:
        """What can be done about a finding, and what that changes.

        :param with_new_files: whether files may be made; else new parts stand in those that there are.
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
        """All files of the study as they are now. Raises EditRefused."""
        return {**read_study_files(self.folder), **self.held}

    def formatted(self, name: str) -> str:
        """A file in the usual layout. Raises EditRefused."""
        return format_file(name, self.files).decode("utf-8-sig")


def place_of(positions: TextPositions, source: SourceFile, location: SourceLocation) -> tuple[int, int]:
    """A place of a finding as the protocol has it."""
    return positions.place(source.offset(location.line, location.column))


def _touches(source: SourceFile, found: Diagnostic, start: int, end: int) -> bool:
    first = source.offset(found.location.line, found.location.column)
    last = first if found.end is UNSET else source.offset(found.end.line, found.end.column)
    return first <= end and start <= last


__all__ = ["PositionEncoding", "ServedStudy", "place_of", "study_folder"]
