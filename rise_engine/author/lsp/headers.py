"""A check of message headers before pygls reads them: after an invalid header, pygls waits without a limit.

https://microsoft.github.io/language-server-protocol/specifications/lsp/3.17/specification/#headerPart
"""

from __future__ import annotations

import re
from typing import BinaryIO

from rise_engine.base.errors import ExchangeError

_LENGTH = re.compile(rb"Content-Length: [0-9]+\r\n")
_OTHER = re.compile(rb"(?!Content-Length)([A-Za-z-]+: .*)?\r\n")


class CheckedHeaders:
    """The editor's messages. Bodies are read with `read`, so each line belongs to a header."""

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
                "ended by CR LF. The connection ends, because nobody can say where the next message begins"
            )
        return line
