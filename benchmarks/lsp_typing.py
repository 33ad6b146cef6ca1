"""From a key in an editor to its diagnostics: `rise-engine lsp` as a process, with a file of rules of LabLinking, one
character at a time. Wall seconds of both processes and their pipe. Also the outline of a large file, compared with that
of an eighth of it."""

from __future__ import annotations

import asyncio
import statistics
import sys
import tempfile
import time
from pathlib import Path

from lsprotocol import types as lsp
from measure import Report, cpu_seconds
from pygls.lsp.client import LanguageClient
from pygls.workspace import Workspace

from rise_engine.author.lsp.served_study import ServedStudy
from rise_engine.author.lsp.server import file_symbols, make_server

FILE = Path(__file__).parents[1] / "scenarios" / "lablinking" / "rules" / "table_setting.xml"
KEYS = 200


async def typed() -> list[float]:
    """Seconds from each key to its diagnostics."""
    client = LanguageClient("benchmark", "1")
    said = asyncio.Event()

    def take(params: lsp.PublishDiagnosticsParams) -> None:
        said.set()

    client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(take)
    await client.start_io(sys.executable, "-m", "rise_engine", "lsp")
    await client.initialize_async(lsp.InitializeParams(lsp.ClientCapabilities()))
    client.initialized(lsp.InitializedParams())
    uri, text = FILE.as_uri(), FILE.read_text("utf-8")
    client.text_document_did_open(lsp.DidOpenTextDocumentParams(lsp.TextDocumentItem(uri, "xml", 1, text)))
    await said.wait()
    at = text.index("<State id=")
    line = text.count("\n", 0, at)
    start = lsp.Position(line, at - text.rfind("\n", 0, at) - 1 + len('<State id="'))
    seconds = []
    for key in range(KEYS):
        said.clear()
        begin = time.perf_counter()
        document = lsp.VersionedTextDocumentIdentifier(key + 2, uri)
        change = lsp.TextDocumentContentChangePartial(lsp.Range(start, start), "x")
        client.text_document_did_change(lsp.DidChangeTextDocumentParams(document, [change]))
        await said.wait()
        seconds.append(time.perf_counter() - begin)
    await client.shutdown_async(None)
    client.exit(None)
    await client.stop()  # type: ignore[no-untyped-call]
    return sorted(seconds)


def outline_seconds(folder: Path, rules: int) -> tuple[float, int]:
    """CPU seconds for the symbols of a file with this many rules on one line, and its bytes."""
    name = "rules/all.xml"
    rule = '<InteractionRule name="R{0}" initial="A"><State id="A"><transition eventTopic="/{0} ü" target="B"/></State>'
    text = "".join(f'{rule.format(number)}<State id="B"/></InteractionRule>' for number in range(rules))
    (folder / "rules").mkdir(parents=True)
    (folder / "scenario.toml").write_text('robot = "generic"\n')
    (folder / name).write_text(f"<InteractionRules>{text}</InteractionRules>", "utf-8")
    server, study = make_server(), ServedStudy(folder)
    server.protocol._workspace = Workspace(None)
    source = study.source(name)
    assert source is not None and study.state  # read once
    seconds = cpu_seconds(lambda: file_symbols(server, study, name, source), 1)
    return seconds, len(source.data)


def main() -> bool:
    seconds = asyncio.run(typed())
    report = Report("Findings while typing, through the language server", "on the clock")
    report.row("median", f"{statistics.median(seconds) * 1000:.1f} ms")
    report.row("longest", f"{seconds[-1] * 1000:.1f} ms")
    report.target("95 of 100 keys, ms", seconds[int(0.95 * KEYS)] * 1000, 100, at_least=False)
    with tempfile.TemporaryDirectory() as folder:
        (eighth, _), (whole, size) = (outline_seconds(Path(folder, str(rules)), rules) for rules in (1_600, 12_800))
    report.row(f"symbols of {size / 1e6:.1f} MB on one line", f"{whole:.2f} s")
    report.target("times an eighth of it", whole / eighth, 24, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
