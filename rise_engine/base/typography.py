"""Characters that word processors and chat programs substitute: curly quotation marks, and special blanks.

Parsers of formats that need the plain ones only report "Invalid value". These give the character and the remedy.
"""

from __future__ import annotations

import re

from rise_engine.base.text import BLANKS, character_name

DOUBLE = "“”„‟«»″＂"
SINGLE = "‘’‚‛‹›′＇"
_QUOTE = re.compile(f"[{DOUBLE}{SINGLE}]")


def straight_quote(character: str) -> str:
    """The straight form of a typographic quotation mark; empty for every other character."""
    return '"' if character and character in DOUBLE else "'" if character and character in SINGLE else ""


def typography_problem(text: str, at: int, *, quote: str = "") -> str:
    """Describe the character at an offset if it is one of these; otherwise empty.

    :param quote: the only quotation mark that the format has.
    """
    character = text[at : at + 1]
    straight = straight_quote(character)
    if straight:
        straight = quote or straight
        name = character_name(character)
        return f"`{character}` is a typographic quotation mark, {name}; write a straight one: {straight}"
    if character and character.isspace() and character not in BLANKS:
        return f"this is {character_name(character)}, which only looks like a blank; write an ordinary blank"
    return ""


def find_typographic_closing(text: str, opening: int) -> int:
    """The offset of the typographic mark that was meant to close the text opened at `opening`, in its line; or -1."""
    end = text.find("\n", opening)
    for found in _QUOTE.finditer(text, opening + 1, end if end >= 0 else len(text)):
        following = text[found.end() : found.end() + 1]
        if not following or following in " \t\r\n,:}])#=":
            return found.start()
    return -1
