"""`rise-engine lsp`: the language server, for editors that start it (docs/how-to/editor.md)."""

from __future__ import annotations

import re
import sys
from typing import BinaryIO

import click

from rise_engine.base.errors import ExchangeError
from rise_engine.base.exit_status import USAGE
from rise_engine.cli.terminal import Refused, refusing

_LENGTH = re.compile(rb"Content-Length: [0-9]+\r\n")
_OTHER = re.compile(rb"(?!Content-Length)([A-Za-z-]+: .*)?\r\n")


class CheckedHeaders:
    """Checks the headers of the editor's messages: after an invalid one, pygls would wait without a limit.

    Bodies are read with `read`, so each line belongs to a header. Source: LSP 3.17, header part.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.read = stream.read

    def readline(self) -> bytes:
        """Return the next header line, as pygls reads it; empty at the end. Raises ExchangeError."""
        line = self._stream.readline()
        if line.endswith(b"\n") and not (_LENGTH.fullmatch(line) or _OTHER.fullmatch(line)):
            shown = line[:80].decode(errors="replace").rstrip("\r\n")
            raise ExchangeError(
                f"the header {shown!r} cannot be understood: `Content-Length: ` and the number of bytes was expected, "
                "ended by CR LF. The connection ends, because nothing shows where the next message begins"
            )
        return line


@click.command("lsp")
@click.option("--stdio", is_flag=True, help="Use standard input and output, as always.")
def lsp(stdio: bool) -> None:
    """Serve editors: diagnostics while typing, completion, definitions, renaming.

    An editor starts this command and speaks the language server protocol with it, over standard input and output.
    """
    try:
        from rise_engine.author.lsp.server import make_server  # pygls is an extra, and takes half a second
    except ModuleNotFoundError as missing:
        if (missing.name or "").partition(".")[0] not in ("pygls", "lsprotocol", "cattrs", "attrs", "attr"):
            raise
        raise Refused(
            status=USAGE, hints=['the language server needs a package: pip install "rise-tui[lsp]"']
        ) from None
    with refusing(USAGE):
        make_server().start_io(CheckedHeaders(sys.stdin.buffer))  # type: ignore[arg-type]  # what pygls reads with
