"""What editors say of open files, in whichever order, and requests that are not as the protocol has them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from urllib.parse import unquote

from cattrs import transform_error
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException, JsonRpcInvalidParams
from pygls.protocol import LanguageServerProtocol, lsp_method


class OpenFilesProtocol(LanguageServerProtocol):
    """The protocol, for editors that mix up the order of what they say: the newest version of a file counts.

    Helix 25.01 sends quick changes in another order than that in which they were made, and of a file that a quick fix
    has made first what is written into it, and then that it is open and empty. Each change has the whole text
    (`TextDocumentSyncKind.Full`), so that a late one can be left out.
    """

    def structure_message(self, data: dict[str, Any]) -> Any:
        """As pygls, which says nothing to whoever waits for an answer to a request that it cannot read."""
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
