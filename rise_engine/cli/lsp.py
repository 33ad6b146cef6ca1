"""`rise-engine lsp`: the language server, for editors that start it (docs/how-to/editor.md)."""

from __future__ import annotations

import sys

import click

from rise_engine.exit_status import USAGE
from rise_engine.lsp.headers import CheckedHeaders, HeaderError


@click.command("lsp")
@click.option("--stdio", is_flag=True, help="Speak over standard input and output, as always.")
def lsp(stdio: bool) -> None:
    """Serve editors: findings while typing, completion, definitions, renaming.

    An editor starts this and speaks the language server protocol with it, over standard input and output.
    """
    try:
        from rise_engine.lsp.server import make_server  # pygls is an extra, and takes half a second
    except ModuleNotFoundError as missing:
        if (missing.name or "").partition(".")[0] not in ("pygls", "lsprotocol", "cattrs", "attrs", "attr"):
            raise
        click.echo('the language server needs a package: pip install "rise-tui[lsp]"', err=True)
        sys.exit(USAGE)
    try:
        make_server().start_io(CheckedHeaders(sys.stdin.buffer))  # type: ignore[arg-type]  # what pygls reads with
    except HeaderError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(USAGE)


COMMANDS = {"lsp": lsp}
