"""A study with open files in an editor, checked with their unsaved content, and positions in the protocol's form.

Lines end with LF, CRLF or CR alone. Columns count units of the encoding that client and server have negotiated. Source:
https://microsoft.github.io/language-server-protocol/specifications/lsp/3.17/specification/#position
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from functools import lru_cache
from itertools import accumulate
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias
from urllib.parse import unquote

from cattrs import transform_error
from lsprotocol import types as lsp
from msgspec import UNSET
from msgspec.structs import replace
from pygls import uris
from pygls.exceptions import JsonRpcException, JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol, lsp_method

from rise_engine import __version__
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
"""Characters of more than one unit. Lone surrogates, which no encoding allows, count as `?`."""
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
        """The additional units of the first 0, 1, 2, ... of these characters."""
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
    """Return the folder of a file's study; None: the file belongs to no study.

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
        """Return a file's name in the form of diagnostics."""
        return path.relative_to(self.folder).as_posix() if path.is_relative_to(self.folder) else str(path)

    def hold(self, path: Path, text: str) -> None:
        """Take a file's text from the editor."""
        self.held[self.name_of(path)] = text.encode(errors="replace")
        self._checked = None

    def release_file(self, path: Path) -> None:
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
        """Return a file in its present state; None: it is unreadable."""
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
        return [each for each in found if source is not None and _overlaps(source, each, start, end)]

    def rename(self, use: Use, new: str) -> Plan:
        """Plan another name everywhere. Raises EditRefused."""
        return plan(Rename(use.kind, use.name, new), self.state)

    def remedies(self, finding: Diagnostic, *, with_new_files: bool) -> list[tuple[Remedy, Plan]]:
        """Return the remedies for a diagnostic, with their plans.

        :param with_new_files: whether files may be created; if not, new parts go into existing files.
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


def _overlaps(source: SourceFile, found: Diagnostic, start: int, end: int) -> bool:
    first = source.offset(found.location.line, found.location.column)
    last = first if found.end is UNSET else source.offset(found.end.line, found.end.column)
    return first <= end and start <= last


__all__ = ["PositionEncoding", "ServedStudy", "place_of", "study_folder"]


class OpenFilesProtocol(LanguageServerProtocol):
    """The protocol, for editors that send messages in the wrong order: the newest version of a file counts.

    Helix 25.01 sends quick changes in the wrong order. For a file that a quick fix has created, it sends the content
    before it opens the file as empty. Each change has the whole text (`TextDocumentSyncKind.Full`), so a late one can
    be ignored.
    """

    def structure_message(self, data: dict[str, Any]) -> Any:
        """Parse a message like pygls, but also answer an unreadable request."""
        try:
            return super().structure_message(data)
        except JsonRpcException as error:
            if "id" in data and "method" in data:
                why = "; ".join(transform_error(error.__cause__)) if error.__cause__ is not None else str(error)
                refusal = JsonRpcInvalidParams(f"this is not a request {data['method']} of the protocol: {why}")
                self._send_response(data["id"], error=refusal.to_response_error())
            raise

    @lsp_method(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def lsp_text_document__did_change(self, params: lsp.DidChangeTextDocumentParams) -> Iterator[Any]:
        uri, version = params.text_document.uri, params.text_document.version
        known = self.workspace.text_documents.get(unquote(uri))
        if known is None:
            self.workspace.put_text_document(lsp.TextDocumentItem(uri, "", version, ""))
        elif version < (known.version or 0):
            return
        yield from super().lsp_text_document__did_change(params)

    @lsp_method(lsp.TEXT_DOCUMENT_DID_OPEN)
    def lsp_text_document__did_open(self, params: lsp.DidOpenTextDocumentParams) -> Iterator[Any]:
        opened = params.text_document
        known = self.workspace.text_documents.get(unquote(opened.uri))
        if known is not None and (known.version or 0) > opened.version:
            opened.text, opened.version = known.source, known.version or 0
        yield from super().lsp_text_document__did_open(params)


# --- studies ----------------------------------------------------------------------------------------------------------


SOURCE = "rise"
"""The source of diagnostics that editors show."""
_ENCODINGS: dict[str, PositionEncoding] = {
    lsp.PositionEncodingKind.Utf8: "utf-8",
    lsp.PositionEncodingKind.Utf16: "utf-16",
    lsp.PositionEncodingKind.Utf32: "utf-32",
}


@lru_cache(maxsize=32)
def _positions(text: str, encoding: PositionEncoding) -> TextPositions:
    """Cache a text's positions, because an answer needs hundreds of them."""
    return TextPositions(text, encoding)


class StudyServer(LanguageServer):
    """A language server with the studies that have open files."""

    def __init__(self) -> None:
        whole = lsp.TextDocumentSyncKind.Full
        super().__init__("rise-engine", __version__, whole, protocol_cls=OpenFilesProtocol)
        self.studies: dict[Path, ServedStudy] = {}
        self.published: dict[Path, set[str]] = {}
        """By study, the files for which the editor has diagnostics."""

    # --- studies and places -------------------------------------------------------------------------------------------

    def study_of(self, uri: str) -> tuple[ServedStudy, str] | None:
        """Return a file's study, and its name in it; None: the file belongs to no study."""
        written = uris.to_fs_path(uri)
        if written is None:
            return None
        path = Path(written)
        folder = study_folder(path)
        if folder is None:
            return None
        study = self.studies.setdefault(folder, ServedStudy(folder))
        return study, study.name_of(path)

    def positions(self, source: SourceFile) -> TextPositions:
        return _positions(source.text, _ENCODINGS[self.workspace.position_encoding or lsp.PositionEncodingKind.Utf16])

    def range_of(self, source: SourceFile, start: int, end: int) -> lsp.Range:
        """Return the range of a part of a file's text."""
        positions = self.positions(source)
        return lsp.Range(lsp.Position(*positions.place(start)), lsp.Position(*positions.place(end)))

    def place_of_use(self, study: ServedStudy, use: Use) -> lsp.Location | None:
        source = study.source(use.place.file)
        if source is None:
            return None
        start = source.offset(use.place.line, use.place.column)
        return lsp.Location(self.uri(study, use.place.file), self.range_of(source, start, start + use.length))

    def uri(self, study: ServedStudy, name: str) -> str:
        return uris.from_fs_path(str(study.folder / name)) or ""

    def at(self, params: Any) -> tuple[ServedStudy, str, SourceFile, int] | None:
        """Return the study, the file and the offset of a request."""
        found = self.study_of(params.text_document.uri)
        source = found[0].source(found[1]) if found is not None else None
        if found is None or source is None:
            return None
        offset = self.positions(source).offset(params.position.line, params.position.character)
        return found[0], found[1], source, offset

    def use_at(self, params: Any) -> tuple[ServedStudy, Use] | None:
        place = self.at(params)
        use = place[0].use_at(place[1], place[3]) if place is not None else None
        return (place[0], use) if place is not None and use is not None else None

    # --- findings -----------------------------------------------------------------------------------------------------

    def publish(self, study: ServedStudy) -> None:
        """Send the diagnostics of a study, with an empty list for each file that no longer has any."""
        by_file: dict[str, list[Diagnostic]] = {name: [] for name in study.held}
        for found in study.checked.diagnostics:
            by_file.setdefault(found.location.file, []).append(found)
        for name in self.published.get(study.folder, set()) - by_file.keys():
            by_file[name] = []
        self.published[study.folder] = {name for name, found in by_file.items() if found}
        for name, findings in by_file.items():
            source = study.source(name)
            shown = [self.diagnostic(each, source) for each in findings]
            self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(self.uri(study, name), shown))

    def diagnostic(self, found: Diagnostic, source: SourceFile | None) -> lsp.Diagnostic:
        def offset(location: SourceLocation) -> int:
            return source.offset(location.line, location.column) if source is not None else 0

        start = offset(found.location)
        end = offset(found.end) if found.end is not UNSET else start
        is_error = found.severity == "error"
        return lsp.Diagnostic(
            range=self.range_of(source or SourceFile("", b"", ""), start, end),
            message=found.message,
            severity=lsp.DiagnosticSeverity.Error if is_error else lsp.DiagnosticSeverity.Warning,
            code=found.code,
            source=SOURCE,
        )
