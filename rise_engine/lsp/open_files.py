"""What editors say of open files, in whichever order."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from lsprotocol import types as lsp
from pygls import uris
from pygls.protocol import LanguageServerProtocol, lsp_method


class OpenFilesProtocol(LanguageServerProtocol):
    """The protocol, for editors that say first what they change in a file, and then that it is open.

    Helix 25.01 does so with a file that a quick fix has made, and its opening has the older text. The newer version of
    a file counts.
    """

    @lsp_method(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def lsp_text_document__did_change(self, params: lsp.DidChangeTextDocumentParams) -> Iterator[Any]:
        uri = params.text_document.uri
        if unquote(uri) not in self.workspace.text_documents:
            self.workspace.put_text_document(lsp.TextDocumentItem(uri, "", 0, _on_disk(uri)))
        yield from super().lsp_text_document__did_change(params)

    @lsp_method(lsp.TEXT_DOCUMENT_DID_OPEN)
    def lsp_text_document__did_open(self, params: lsp.DidOpenTextDocumentParams) -> Iterator[Any]:
        opened = params.text_document
        known = self.workspace.text_documents.get(unquote(opened.uri))
        if known is not None and (known.version or 0) > opened.version:
            opened.text, opened.version = known.source, known.version or 0
        yield from super().lsp_text_document__did_open(params)


def _on_disk(uri: str) -> str:
    """A file's text; empty when it is not there yet."""
    path = uris.to_fs_path(uri)
    try:
        return Path(path).read_bytes().decode("utf-8-sig", "replace") if path is not None else ""
    except OSError:
        return ""
