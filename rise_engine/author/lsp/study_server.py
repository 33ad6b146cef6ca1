"""The server's state for an editor: open files, studies, positions of the protocol, and diagnostics."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from cattrs import transform_error
from lsprotocol import types as lsp
from msgspec import UNSET
from pygls import uris
from pygls.exceptions import JsonRpcException, JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol, lsp_method

from rise_engine import __version__
from rise_engine.author.lsp.served_study import PositionEncoding, ServedStudy, TextPositions, study_folder
from rise_engine.scenario.checking.uses import Use
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.model import SourceLocation


class OpenFilesProtocol(LanguageServerProtocol):
    """The protocol, for editors that send messages in the wrong order: the newest version of a file counts.

    Helix 25.01 sends quick changes in the wrong order. For a file that a quick fix has made, it sends first the
    content, and then that the file is open and empty. Each change has the whole text (`TextDocumentSyncKind.Full`), so
    that a late one can be ignored.
    """

    def structure_message(self, data: dict[str, Any]) -> Any:
        """Parse a message like pygls, but also answer a request that cannot be read."""
        try:
            return super().structure_message(data)
        except JsonRpcException as error:
            if "id" in data and "method" in data:
                why = "; ".join(transform_error(error.__cause__)) if error.__cause__ is not None else str(error)
                refusal = JsonRpcInvalidParams(f"this is no request {data['method']} of the protocol: {why}")
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
    """Cache a text's positions, since an answer needs hundreds of them."""
    return TextPositions(text, encoding)


class StudyServer(LanguageServer):
    """A language server with the studies that have open files."""

    def __init__(self) -> None:
        whole = lsp.TextDocumentSyncKind.Full
        super().__init__("rise-engine", __version__, whole, protocol_cls=OpenFilesProtocol)
        self.studies: dict[Path, ServedStudy] = {}
        self.told: dict[Path, set[str]] = {}
        """By study, the files for which the editor has diagnostics."""

    # --- studies and places -------------------------------------------------------------------------------------------

    def study_of(self, uri: str) -> tuple[ServedStudy, str] | None:
        """Return a file's study, and its name in it; None: it is not one of a study's files."""
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
        """Return the study, the file, and the offset that a request is about."""
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

    def tell(self, study: ServedStudy) -> None:
        """Send the diagnostics of a study, with an empty list for each file that has none any more."""
        by_file: dict[str, list[Diagnostic]] = {name: [] for name in study.held}
        for found in study.checked.diagnostics:
            by_file.setdefault(found.location.file, []).append(found)
        for name in self.told.get(study.folder, set()) - by_file.keys():
            by_file[name] = []
        self.told[study.folder] = {name for name, found in by_file.items() if found}
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
