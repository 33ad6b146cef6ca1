"""The names of our events in SCXML, where a dot makes one name part of another (section 3.12.1 of the standard).

A transition for `a` would also take `a.b`, and our topics may contain blanks and other characters that SCXML names
cannot have. Everything except letters, digits, `-` and `_` is therefore written like `_x2E_`, with its code point in
capital hexadecimal digits. No two topics get the same name, and only the document's own names have dots.
"""

from __future__ import annotations

import re

RESERVED = frozenset({"memory", "forgotten", "ended", "after", "error"})
"""The first words of names with another meaning in a document."""
_LETTERS = (
    "A-Za-z\\u00c0-\\u00d6\\u00d8-\\u00f6\\u00f8-\\u02ff\\u0370-\\u037d\\u037f-\\u1fff\\u200c\\u200d\\u2070-\\u218f"
    "\\u2c00-\\u2fef\\u3001-\\ud7ff\\uf900-\\ufdcf\\ufdf0-\\ufffd\\U00010000-\\U000effff"
)
_UNUSABLE = re.compile(f"[^{_LETTERS}0-9_-]|_(?=x[0-9A-F]+_)")
_UNUSABLE_IN_KEYS = re.compile(f"[^{_LETTERS}0-9_.-]|_(?=x[0-9A-F]+_)|^\\.|\\.$|\\.(?=\\.)")


def event_name(topic: str) -> str:
    """The name of an event in SCXML.

    :param topic: the topic without its leading slash.

    >>> event_name("R_Greeting_end"), event_name("a.b c"), event_name("memory")
    ('R_Greeting_end', 'a_x2E_b_x20_c', '_x6D_emory')
    """
    name = _UNUSABLE.sub(_escape, topic)
    return f"_x{ord(name[0]):X}_{name[1:]}" if name in RESERVED else name


def key_name(key: str) -> str:
    """A memory key for use after `memory.` in the name of an event; its dots stay.

    >>> key_name("person.name"), key_name("two words")
    ('person.name', 'two_x20_words')
    """
    return _UNUSABLE_IN_KEYS.sub(_escape, key)


def _escape(found: re.Match[str]) -> str:
    return f"_x{ord(found[0]):X}_"
