"""`rise-engine lsp`: the language server, for editors that start it (docs/how-to/editor.md)."""

from __future__ import annotations

import sys

import click

from rise_engine.author.lsp.headers import CheckedHeaders
from rise_engine.base.exit_status import USAGE
from rise_engine.cli.terminal import Refused, refusing


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
