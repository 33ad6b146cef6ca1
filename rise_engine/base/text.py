"""Makes text from others safe for the command line and the console.

Text from files, sessions and robots can contain characters that move a terminal's cursor, set its title, change the
writing direction, or are invisible. Pass such text through `clean` before you write it to a screen.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any
from unicodedata import name

_UNSEEN = (
    "\x00-\x1f\x7f-\x9f"  # controls
    "\u00ad\u034f\u061c"  # soft hyphen, grapheme joiner, Arabic letter mark
    "\u115f\u1160\u17b4\u17b5\u3164\uffa0"  # fillers: letters without a shape
    "\u180b-\u180f"  # Mongolian selectors
    "\u200b-\u200f\u2028-\u202e\u2060-\u206f"  # without width, line and paragraph ends, directions
    "\ud800-\udfff"  # surrogates: undecodable bytes of a file name
    "\ufe00-\ufe0d"  # variation selectors (not the two that go with emoji)
    "\ufeff\ufff0-\ufffb"  # byte order mark, annotations
    "\U0001bca0-\U0001bca3\U0001d173-\U0001d17a"  # of shorthand and of music
    "\U000e0000-\U000e0fff"  # tags
)
UNSEEN = re.compile(f"[{_UNSEEN}]")
"""One character that moves the cursor, changes the characters around it, or is invisible."""

BLANKS = " \t\r\n"
"""The only blanks of XML and JSON."""
GAP = rf"[{_UNSEEN}\s]"
"""A pattern for one character that leaves a gap: a blank of any kind, or an invisible one."""
_GAP = re.compile(GAP)
_NAMES = {"\x85": "NEXT LINE", "\x1b": "ESCAPE", "\x00": "NULL"}


def clean(text: str, *, keep: str = "") -> str:
    """Replace each character of UNSEEN with a mark: `⏎` for a line end, a blank for a tab, `·` for the others.

    Characters in `keep` stay: `"\\n"` for a text of several lines. Undecodable bytes of file names become `\\udce4`.
    """
    if (text.isascii() and text.isprintable()) or UNSEEN.search(text) is None:  # the first is quicker
        return text

    def mark(found: re.Match[str]) -> str:
        character = found[0]
        if "\ud800" <= character <= "\udfff":
            return escape_surrogates(character)
        return character if character in keep else {"\n": "⏎", "\t": " "}.get(character, "·")

    return UNSEEN.sub(mark, text)


def pluralize(number: int, noun: str) -> str:
    """A number of things in words: `1 record`, `2 records`."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def name_some(values: Sequence[object], most: int = 5) -> str:
    """The first few values, and the number of the others: `3, 7 and 2 more`."""
    more = len(values) - most
    return ", ".join(map(str, values[:most])) + (f" and {more} more" if more > 0 else "")


def escape_unseen_json(text: str) -> str:
    """Escape every character of UNSEEN in a JSON text, with the same values. Line ends between values stay."""

    def escape(found: re.Match[str]) -> str:
        if found[0] in "\r\n\t":  # between values: within a text they are already escaped
            return found[0]
        units = found[0].encode("utf-16-be", "surrogatepass")
        return "".join(f"\\u{units[at : at + 2].hex()}" for at in range(0, len(units), 2))

    return UNSEEN.sub(escape, text)


def find_unseen(text: str, start: int = 0, end: int | None = None) -> int:
    """The offset of the first blank that XML and JSON do not know, or of the first invisible character; -1: none."""
    for found in _GAP.finditer(text, start, len(text) if end is None else end):
        if found[0] not in BLANKS:
            return found.start()
    return -1


def match_end(pattern: re.Pattern[str], text: str, start: int) -> int:
    """The end of a match at `start`; `start` itself if the pattern does not match there."""
    found = pattern.match(text, start)
    return found.end() if found is not None else start


def character_name(character: str) -> str:
    """Describe a character for a person who cannot see it: `U+00A0 (NO-BREAK SPACE)`."""
    known = name(character, _NAMES.get(character, ""))
    return f"U+{ord(character):04X} ({known})" if known else f"U+{ord(character):04X}"


_HALF = re.compile(r"\\u(d[c-f][0-9a-f]{2})")


def escape_surrogates(path: str) -> str:
    """A path as text for any file and message: a byte that is not UTF-8 becomes `\\udce4`."""
    return path.encode("utf-8", "backslashreplace").decode()


def restore_surrogates(text: str) -> str:
    """Undo `escape_surrogates`. A file name that really contains such an escape is changed, too."""
    return _HALF.sub(lambda found: chr(int(found[1], 16)), text) if "\\ud" in text else text


def escape_all_surrogates(value: Any) -> Any:
    """Apply `escape_surrogates` to every text in a JSON-like value."""
    return _map_texts(escape_surrogates, value)


def restore_all_surrogates(value: Any) -> Any:
    """Apply `restore_surrogates` to every text in a JSON-like value."""
    return _map_texts(restore_surrogates, value)


def _map_texts(change: Callable[[str], str], value: Any) -> Any:
    match value:
        case str():
            return change(value)
        case dict():
            return {_map_texts(change, key): _map_texts(change, inner) for key, inner in value.items()}
        case list() | tuple():
            return [_map_texts(change, inner) for inner in value]
        case _:
            return value
