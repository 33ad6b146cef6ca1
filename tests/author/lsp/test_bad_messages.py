"""Messages that are not as the protocol has them: each request is answered, and a broken header ends the connection."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from typing import Any

import pytest

from rise_engine.author.lsp.served_study import PositionEncoding, TextPositions
from rise_engine.base.errors import ExchangeError
from rise_engine.cli.scenario.lsp import CheckedHeaders

PLACE = {"textDocument": {"uri": "file:///a.xml"}, "position": {"line": 0, "character": 0}}
BAD_PARAMETERS: list[tuple[str, Any, str]] = [
    ("textDocument/hover", {}, "required field missing @ $.params.text_document"),
    ("textDocument/hover", {**PLACE, "position": {"line": 0, "character": "a"}}, "expected int @ $.params.position"),
    ("textDocument/documentSymbol", None, "expected DocumentSymbolParams @ $.params"),
    ("textDocument/rename", PLACE, "required field missing @ $.params.new_name"),
]


def frame(message: dict[str, Any]) -> bytes:
    body = json.dumps({"jsonrpc": "2.0", **message}).encode()
    return b"Content-Length: %d\r\n\r\n%b" % (len(body), body)


@pytest.mark.slow
def test_bad_requests_are_answered_and_a_bad_length_ends_it() -> None:
    requests = [("initialize", {"capabilities": {}, "processId": None, "rootUri": None})]
    requests += [(method, parameters) for method, parameters, _ in BAD_PARAMETERS]
    sent = [frame({"id": n, "method": method, "params": found}) for n, (method, found) in enumerate(requests)]
    command = [sys.executable, "-m", "rise_engine", "lsp"]
    done = subprocess.run(
        command, input=b"".join([*sent, b"Content-Length: -5\r\n\r\n{}", frame({"id": 9, "method": "shutdown"})]),
        capture_output=True, check=False, timeout=120,
    )  # fmt: skip
    said = [
        json.loads(each) for each in re.split(rb"Content-Length: .*\r\n(?:Content-Type: .*\r\n)?\r\n", done.stdout)[1:]
    ]
    answers = {each["id"]: each for each in said if "id" in each}
    assert sorted(answers) == [0, 1, 2, 3, 4] and "result" in answers[0]
    for n, (method, _, why) in enumerate(BAD_PARAMETERS, 1):
        assert answers[n]["error"]["code"] == -32602
        assert method in answers[n]["error"]["message"] and why in answers[n]["error"]["message"]
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(b"error: the header 'Content-Length: -5' cannot be understood")


@pytest.mark.parametrize(
    ("line", "is_right"),
    [
        (b"Content-Length: 12\r\n", True),
        (b"Content-Type: application/vscode-jsonrpc; charset=utf-8\r\n", True),
        (b"\r\n", True),
        (b"", True),
        (b"Content-Len", True),  # it ends there
        (b"Content-Length: -5\r\n", False),
        (b"Content-Length: \r\n", False),
        (b"Content-Length: 1e3\r\n", False),
        (b"Content-Length: 12\n", False),
        (b'{}Content-Length: 12\r\n', False),
    ],
)  # fmt: skip
def test_headers(line: bytes, is_right: bool) -> None:
    headers = CheckedHeaders(io.BytesIO(line))
    if is_right:
        assert headers.readline() == line
    else:
        with pytest.raises(ExchangeError, match="Content-Length"):
            headers.readline()


TEXT = "a\rä\r\n漢😀x\n\ud83d1\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-32"])
def test_places_count_the_units_of_the_encoding(encoding: PositionEncoding) -> None:
    positions, codec = TextPositions(TEXT, encoding), {"utf-8": "utf-8"}.get(encoding, f"{encoding}-le")
    unit = {"utf-8": 1, "utf-16": 2, "utf-32": 4}[encoding]
    lines = re.split("(?<=\n)|(?<=\r)(?!\n)", TEXT)
    starts = [sum(map(len, lines[:n])) for n in range(len(lines))]
    for line, (start, text) in enumerate(zip(starts, lines, strict=True)):
        for column in range(len(text)):
            units = len(text[:column].encode(codec, "replace")) // unit
            assert positions.place(start + column) == (line, units), (line, column)
