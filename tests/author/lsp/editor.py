"""An editor for tests: talks with the language server as editors do, and keeps what it says about files.

The server is a fork (see `tests.forked`); test_bad_messages.py starts it as editors do.
"""

from __future__ import annotations

import asyncio
import logging
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from lsprotocol import types as lsp
from pygls.io_ import run_async
from pygls.lsp.client import LanguageClient

from rise_engine.author.lsp.served_study import TextPositions
from tests.forked import PIPE, AsyncForked
from tests.patience import PATIENCE

SCENARIOS = Path(__file__).parents[3] / "scenarios"


class Client(LanguageClient):
    """pygls' own, whose server is a fork."""

    async def start(self) -> None:
        server = await AsyncForked.start("lsp", loads=["rise_engine.author.lsp.server"], stdin=PIPE)
        self.protocol.set_writer(server.stdin)
        reading = run_async(
            self._stop_event, server.stdout, self.protocol, logging.getLogger(__name__), self.report_server_error
        )
        self._server = server  # type: ignore[assignment]  # has what is used of it
        self._async_tasks.append(asyncio.create_task(reading))
        self._async_tasks.append(asyncio.create_task(self._server_exit()))  # type: ignore[no-untyped-call]


class Editor:
    """Open files, and what the server says about them."""

    def __init__(self, client: LanguageClient, folder: Path) -> None:
        self.client = client
        self.folder = folder
        self.texts: dict[str, str] = {}
        self.findings: dict[str, list[lsp.Diagnostic]] = {}
        self._said = asyncio.Condition()
        self._version = 0

        async def take(params: lsp.PublishDiagnosticsParams) -> None:
            async with self._said:
                self.findings[params.uri] = list(params.diagnostics)
                self._said.notify_all()

        client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(take)

    def uri(self, name: str) -> str:
        return (self.folder / name).as_uri()

    def document(self, name: str) -> lsp.TextDocumentIdentifier:
        return lsp.TextDocumentIdentifier(self.uri(name))

    def codes(self, name: str) -> list[Any]:
        return [each.code for each in self.findings.get(self.uri(name), [])]

    async def until(self, name: str, codes: list[str]) -> None:
        """Wait for the findings about a file to be these."""

        def is_so() -> bool:
            return self.uri(name) in self.findings and self.codes(name) == codes

        async with self._said:
            await asyncio.wait_for(self._said.wait_for(is_so), PATIENCE)

    def open(self, name: str) -> None:
        self.texts[name] = (self.folder / name).read_bytes().decode("utf-8-sig")
        item = lsp.TextDocumentItem(self.uri(name), "xml", 1, self.texts[name])
        self.client.text_document_did_open(lsp.DidOpenTextDocumentParams(item))

    def replace(self, name: str, old: str, new: str) -> None:
        """Type something in the place of the first such text."""
        text = self.texts[name]
        at = text.index(old)
        self._version += 1
        self.texts[name] = text[:at] + new + text[at + len(old) :]
        document = lsp.VersionedTextDocumentIdentifier(self._version, self.uri(name))
        change = lsp.TextDocumentContentChangeWholeDocument(self.texts[name])
        self.client.text_document_did_change(lsp.DidChangeTextDocumentParams(document, [change]))

    def place(self, name: str, text: str, into: int = 0) -> dict[str, Any]:
        """The arguments of a request about a character of the first such text."""
        position = lsp.Position(*TextPositions(self.texts[name]).place(self.texts[name].index(text) + into))
        return {"text_document": lsp.TextDocumentIdentifier(self.uri(name)), "position": position}

    async def definitions(self, name: str, text: str, into: int) -> list[lsp.Location]:
        """Where what is named there is defined."""
        asked = lsp.DefinitionParams(**self.place(name, text, into))
        found = await self.client.text_document_definition_async(asked)
        return [each for each in found if isinstance(each, lsp.Location)] if isinstance(found, (list, tuple)) else []

    async def remedies(self, name: str, text: str, into: int = 0, **context: Any) -> dict[str, lsp.CodeAction]:
        """What is offered at a character of the first such text, by what it is called."""
        place = self.place(name, text, into)
        at = lsp.Range(place["position"], place["position"])
        asked = lsp.CodeActionParams(
            place["text_document"], at, lsp.CodeActionContext(**{"diagnostics": [], **context})
        )
        found = await self.client.text_document_code_action_async(asked) or []
        return {each.title: each for each in found if isinstance(each, lsp.CodeAction)}

    def apply(self, edits: dict[str, list[lsp.TextEdit]]) -> None:
        """Write changes to the files, as an editor does."""
        for uri, those in edits.items():
            path = Path(uri.removeprefix("file://"))
            data = path.read_bytes()
            text = data.decode("utf-8-sig")
            positions = TextPositions(text)
            spans = [[positions.offset(at.line, at.character) for at in (e.range.start, e.range.end)] for e in those]
            for (start, end), edit in sorted(zip(spans, those, strict=True), key=lambda each: -each[0][0]):
                text = text[:start] + edit.new_text + text[end:]
            path.write_bytes((b"\xef\xbb\xbf" if data.startswith(b"\xef\xbb\xbf") else b"") + text.encode())


@asynccontextmanager
async def editing(
    tmp_path: Path, study: str, capabilities: lsp.ClientCapabilities | None = None
) -> AsyncIterator[Editor]:
    """An editor with a copy of a shipped study; without `capabilities`, one that can only what all can."""
    folder = tmp_path / study
    shutil.copytree(SCENARIOS / study, folder)
    client = Client("editor", "1")
    await client.start()
    editor = Editor(client, folder)
    await client.initialize_async(lsp.InitializeParams(capabilities or lsp.ClientCapabilities()))
    client.initialized(lsp.InitializedParams())
    try:
        yield editor
    finally:
        await client.shutdown_async(None)
        client.exit(None)
        await client.stop()  # type: ignore[no-untyped-call]
