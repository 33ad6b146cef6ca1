"""Names of clients: which are valid, and which two look alike in a record. Pure.

The record identifies people only by name, so a lookalike would attribute words to the wrong person. Following UTS 39 of
Unicode, a name must not mix scripts with similar letters. Two names must differ in their skeleton, in which each letter
becomes the Latin letter that it resembles.
"""

from __future__ import annotations

import unicodedata

MAX_CHARACTERS = 64
LOOKALIKE_SCRIPTS = ("LATIN", "CYRILLIC", "GREEK", "ARMENIAN", "CHEROKEE", "COPTIC")
"""Scripts with letters that resemble those of another one of them."""

_INVISIBLE = frozenset("\u115f\u1160\u2800\u3164\uffa0\u034f\u17b4\u17b5")
"""Characters that count as letters or signs but are invisible."""

_LATIN_LOOKALIKES = {
    # Cyrillic
    **dict(zip("авгеӏһіјкмнопрстухѕԁԛԝѵѡԍ", "abrelhijkmhonpctyxsdqwvwg", strict=True)),
    **dict(zip("АВЕНІЈКМОРСТУХЅԌԚԜѴ", "ABEHlJKMOPCTYXSGQWV", strict=True)),
    # Greek
    **dict(zip("αγεικνορτυχωϲϳ", "ayeikvoptuxwcj", strict=True)),
    **dict(zip("ΑΒΕΖΗΙΚΜΝΟΡΤΥΧϹ", "ABEZHlKMNOPTYXC", strict=True)),
    # Armenian, Latin beyond ASCII, and lookalikes within ASCII
    **dict(zip("օսոհցզյ", "ounhgqj", strict=True)),
    **dict(zip("ıɑɡɩʟ", "iagil", strict=True)),
    **dict(zip("I1|0", "lllO", strict=True)),
}
"""The Latin letter that a letter resembles."""


def name_problem(name: str) -> str:
    """Return why this cannot be a name, or empty."""
    if not name.strip():
        return "say who you are: the name is empty"
    if len(name) > MAX_CHARACTERS:
        return f"the name is longer than {MAX_CHARACTERS} characters"
    blank = any(character in _INVISIBLE for character in unicodedata.normalize("NFKC", name))
    if name != name.strip() or not name.isprintable() or "#" in name or blank:
        return f"{name!r} cannot be a name: it has blanks at an end, a `#`, or characters that cannot be shown"
    for word in name.split():
        scripts = _scripts(word)
        if len(scripts) > 1:
            mixed = " and ".join(script.capitalize() for script in sorted(scripts))
            return f"{name!r} cannot be a name: it mixes {mixed} letters that look alike; write it in one script"
    return ""


def find_lookalike(name: str, others: list[str]) -> str:
    """Return the other name that this one could be confused with; or empty."""
    own = skeleton(name)
    return next((other for other in others if other != name and skeleton(other) == own), "")


def skeleton(name: str) -> str:
    """Return the visible form of a name: names with the same skeleton look the same."""
    seen = unicodedata.normalize("NFKD", name)
    return "".join(_LATIN_LOOKALIKES.get(character, character) for character in seen if character not in _INVISIBLE)


def _scripts(word: str) -> set[str]:
    """Return the scripts of a word's letters, among those that look alike."""
    found = {unicodedata.name(letter, "").partition(" ")[0] for letter in word if letter.isalpha()}
    return found & set(LOOKALIKE_SCRIPTS)
