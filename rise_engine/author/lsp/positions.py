"""Conversion between offsets in a text and positions of the language server protocol.

Lines end with LF, CRLF or CR alone. Columns count units of the encoding that client and server agree on. Source:
https://microsoft.github.io/language-server-protocol/specifications/lsp/3.17/specification/#position
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from itertools import accumulate
from typing import Literal, NamedTuple, TypeAlias

PositionEncoding: TypeAlias = Literal["utf-8", "utf-16", "utf-32"]
_LINE_END = re.compile(r"\r\n?|\n")
_CODECS: dict[PositionEncoding, str] = {"utf-8": "utf-8", "utf-16": "utf-16-le", "utf-32": "utf-32-le"}
_WIDE: dict[PositionEncoding, re.Pattern[str]] = {
    "utf-8": re.compile("[\x80-\ud7ff\ue000-\U0010ffff]"),
    "utf-16": re.compile("[\U00010000-\U0010ffff]"),
    "utf-32": re.compile("(?!)"),
}
"""Characters of more than one unit. Lone surrogates, which no encoding has, count as `?`."""
_UNIT_BYTES: dict[PositionEncoding, int] = {"utf-8": 1, "utf-16": 2, "utf-32": 4}


class LinePlace(NamedTuple):
    """A line, and units in it; both from 0."""

    line: int
    units: int


class TextPositions:
    """The positions in one text."""

    def __init__(self, text: str, encoding: PositionEncoding = "utf-16") -> None:
        self.text = text
        self._starts = [0, *(found.end() for found in _LINE_END.finditer(text))]
        wide = list(_WIDE[encoding].finditer(text))
        self._wide = [found.start() for found in wide]
        """Offsets of characters with more than one unit; a file may be one line of megabytes."""
        self._more = [
            0,
            *accumulate(len(found[0].encode(_CODECS[encoding])) // _UNIT_BYTES[encoding] - 1 for found in wide),
        ]
        """The additional units of the first 0, 1, 2, ... of them."""
        self._codec = _CODECS[encoding]
        self._unit = _UNIT_BYTES[encoding]

    def place(self, offset: int) -> LinePlace:
        """Return the position of a character.

        >>> TextPositions("a\\r\\n😀x").place(4)
        LinePlace(line=1, units=2)
        """
        line = bisect_right(self._starts, offset) - 1
        return LinePlace(line, self._units(offset) - self._units(self._starts[line]))

    def _units(self, offset: int) -> int:
        """Return the units from the text's beginning."""
        return offset + self._more[bisect_left(self._wide, offset)]

    def offset(self, line: int, units: int) -> int:
        """Return the offset of a position, kept within the text.

        >>> TextPositions("a\\r\\n😀x").offset(1, 2)
        4
        """
        if line >= len(self._starts):
            return len(self.text)
        start = self._starts[line]
        end = self._starts[line + 1] if line + 1 < len(self._starts) else len(self.text)
        written = self.text[start:end].rstrip("\r\n").encode(self._codec, "replace")
        return start + len(written[: units * self._unit].decode(self._codec, "ignore"))
