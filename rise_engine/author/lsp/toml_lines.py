"""Where a place of a TOML file is that may be half written: in which table, and in which text of its line."""

from __future__ import annotations

import re

_HEADER = re.compile(r"^[ \t]*\[[ \t]*([\w-]+)([^\]\n]*)\]", re.MULTILINE)


def table_at(before: str) -> tuple[str, str]:
    """The table in which a text ends, and what its header has behind the first name: `.a` of `[eventually.a]`.

    >>> table_at('[explore]\\nfaults = 1\\n[eventually."it ends"]\\nthen')
    ('eventually', '."it ends"')
    """
    headers = list(_HEADER.finditer(before))
    return (headers[-1].group(1), headers[-1].group(2)) if headers else ("", "")


def opened_text(line: str) -> int | None:
    """Where in a line the text begins that is not closed at its end; null: there is none.

    >>> opened_text("a = \\"runs('R_"), opened_text("a = 'b' # \\"")
    (4, None)
    """
    at, opened = 0, None
    while at < len(line):
        character = line[at]
        if opened is None:
            if character == "#":
                return None
            if character in "\"'":
                opened = at
        elif character == "\\" and line[opened] == '"':
            at += 1
        elif character == line[opened]:
            opened = None
        at += 1
    return opened
