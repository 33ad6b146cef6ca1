"""Finds and replaces words, in all forms in which a program may have written them.

It finds upper and lower case, both of Unicode's forms of `ü`, and any blanks between parts of a word. It also finds the
escapes of JSON (`\\u00fc`, also in JSON within a JSON text) and of XML (`&#252;`).
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from html.entities import codepoint2name
from typing import Any

from msgspec import Struct

from rise_engine.base.errors import RiseError

MIN_CHARACTERS = 2
_REPLACEMENT = re.compile(r"[A-Za-z0-9_]{1,40}")
_MARKS = "\u0300-\u036f"
"""Combining marks, which turn a `u` into `ü` in Unicode's decomposed form."""
_BEFORE = r"(?:(?<![\w])|(?<=\\[nrt]))"
"""Where a word can begin: not within another word. The `n` of an escaped line end is no letter of it."""
_NO_QUOTES = str.maketrans("", "", "'\"\\")
_AFTER = rf"(?![\w{_MARKS}])"
_HALF_ESCAPE = re.compile(r"\\(?:u[0-9a-fA-F]{0,3})?$")


class WordError(RiseError):
    """A word cannot be replaced like this."""


class Replacement(Struct, frozen=True):
    """A word, and the name that replaces it."""

    word: str
    name: str


def parse_replacement(text: str) -> Replacement:
    """Read `Maria=NAME1`. The new name follows the last `=`. Raises WordError."""
    word, mark, name = text.rpartition("=")
    word, name = unicodedata.normalize("NFC", " ".join(word.split())), name.strip()
    if not mark:
        raise WordError(f"{text!r} has no replacement; write --replace Maria=NAME1")
    if len(word) < MIN_CHARACTERS:
        what = "there is no word before the `=`" if not word else f"{word!r} has one character only"
        raise WordError(f"{what}; a replaced word needs at least {MIN_CHARACTERS}, because a shorter one is everywhere")
    if not any(character.isalnum() for character in word):
        raise WordError(f"{word!r} has no letter and no digit, so it cannot be anybody's name")
    if not _REPLACEMENT.fullmatch(name):
        raise WordError(
            f"{name!r} cannot be a replacement: use letters without accents, digits and `_`, 40 at most, such as NAME1"
        )
    return Replacement(word, name)


class Words:
    """Replaces words in texts, and in all texts of a JSON value."""

    def __init__(
        self, replacements: Iterable[Replacement], *, whole_words: bool = False, match_case: bool = False
    ) -> None:
        """`whole_words`: do not replace within longer words. `match_case`: only replace the same case.

        Raises WordError if replacements contradict one another.
        """
        self.replacements = tuple(dict.fromkeys(replacements))
        if not self.replacements:
            raise WordError("name the words to replace: --replace Maria=NAME1")
        ordered = sorted(self.replacements, key=lambda each: -len(each.word))  # `Anna Berg` before `Anna`
        patterns = [word_pattern(each.word, match_case=match_case) for each in ordered]
        before, after = (_BEFORE, _AFTER) if whole_words else ("", f"[{_MARKS}]*")
        self._names = [each.name for each in ordered]
        self._pattern = re.compile("|".join(f"({before}{each}{after})" for each in patterns))
        self._anywhere = re.compile("|".join(f"({each}[{_MARKS}]*)" for each in patterns))
        self._longer = re.compile(f"[\\w{_MARKS}]*(?:{'|'.join(patterns)})[\\w{_MARKS}]*")
        self._refuse_contradictions(ordered)

    def _refuse_contradictions(self, ordered: list[Replacement]) -> None:
        by_word: dict[str, str] = {}
        for each in ordered:
            known = by_word.setdefault(each.word.casefold(), each.name)
            if known != each.name:
                raise WordError(f"{each.word!r} cannot become both {known!r} and {each.name!r}")
            if found := self._longer.search(each.name):
                raise WordError(
                    f"{each.name!r} contains a word to replace ({found.group()!r}), so it would be there again; "
                    "choose another name"
                )

    def find(self, text: str) -> bool:
        """Whether a text contains one of the words."""
        return self._pattern.search(text) is not None

    def may_find(self, text: str) -> bool:
        """Like `find`, also within longer words. Fast enough to decide which lines of JSON need parsing."""
        return self._anywhere.search(text) is not None

    def is_cut_off(self, text: str) -> bool:
        """Whether a text may end within one of the words, like a half-written line."""
        end = unicodedata.normalize("NFC", _HALF_ESCAPE.sub("", text)).casefold()
        words = [each.word.casefold() for each in self.replacements]
        return any(end.endswith(word[:length]) for word in words for length in range(MIN_CHARACTERS, len(word)))

    def mask(self, value: Any) -> Any:
        """Prepare a JSON value for comparison with one in which the words were replaced. Replaces them everywhere, also
        within longer words, and makes objects sorted pairs. Removes quotation marks and backslashes, because programs
        choose them depending on the text."""
        if isinstance(value, str):
            return self._anywhere.sub(self._name_of, value).translate(_NO_QUOTES)
        if isinstance(value, list):
            return [self.mask(each) for each in value]
        if isinstance(value, dict):
            return sorted(((self.mask(key), self.mask(each)) for key, each in value.items()), key=repr)
        return value

    def _name_of(self, found: re.Match[str]) -> str:
        return self._names[(found.lastindex or 1) - 1]

    def longer_words(self, text: str) -> list[str]:
        """The longer words of a text that contain one of the words."""
        pattern = self._pattern
        return [found for found in self._longer.findall(text) if pattern.fullmatch(found) is None]

    def replace(self, text: str) -> str:
        """Replace the words in a text. Raises WordError if the result contains one of them again."""
        if self._pattern.search(text) is None:
            return text
        replaced = self._pattern.sub(self._name_of, text)
        if self._pattern.search(replaced) is not None:
            raise WordError("a new name and the text around it make up one of the words; choose another name")
        return replaced

    def replace_in(self, value: Any) -> Any:
        """Replace the words in a JSON value, including keys. Raises WordError if two keys would become equal."""
        if isinstance(value, str):
            return self.replace(value)
        if isinstance(value, list):
            return [self.replace_in(each) for each in value]
        if isinstance(value, dict):
            replaced = {self.replace(key): self.replace_in(each) for key, each in value.items()}
            if len(replaced) != len(value):
                raise WordError("two keys of one object would become the same")
            return replaced
        return value


def word_pattern(word: str, *, match_case: bool = False) -> str:
    """A regular expression that matches all forms of a word."""
    parts = []
    for part in word.split():
        parts.append("".join(_character_pattern(character, match_case=match_case) for character in part))
    return r"(?:\s|&#0*160;|&nbsp;|\\+[nrt])+".join(parts)


def _character_pattern(character: str, *, match_case: bool) -> str:
    """A pattern for all forms of a character."""
    cases = {character}
    if not match_case:
        cases |= {character.lower(), character.upper(), character.title(), character.casefold()}
    written: set[str] = set()
    for each in cases:
        for form in (unicodedata.normalize("NFC", each), unicodedata.normalize("NFD", each)):
            written.add("".join(map(_escaped_pattern, form)))
    return f"(?:{'|'.join(sorted(written, key=len, reverse=True))})"


def _escaped_pattern(character: str) -> str:
    """A pattern for one code point: plain, or escaped as in JSON or XML."""
    code = ord(character)
    units = character.encode("utf-16-be", "surrogatepass")
    escaped = "".join(rf"\\+u(?i:{units[at : at + 2].hex()})" for at in range(0, len(units), 2))
    forms = [re.escape(character), escaped, f"&#0*{code};", f"&#[xX]0*(?i:{code:x});"]
    name = "apos" if character == "'" else codepoint2name.get(code)
    if name is not None:
        forms.append(f"&{name};")
    return f"(?:{'|'.join(forms)})"
