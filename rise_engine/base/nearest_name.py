"""The known name that a person probably meant: "did you mean ...?", for all code that reads names.

`suggest` returns the name and the end of a sentence, `did_you_mean` the end alone, `nearest_name` the name alone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import get_close_matches
from itertools import islice
from unicodedata import combining, normalize
from unicodedata import name as unicode_name

from msgspec import Struct

from rise_engine.base.text import UNSEEN, character_name

_COMPARISONS = 20_000
"""Maximum number of comparisons of names while one scenario is read, because comparing is slow."""
_LONGEST = 80
"""Maximum characters of a compared name."""
_budget: ContextVar[list[int]] = ContextVar("comparisons that are left")


class Correction(Struct, frozen=True):
    """The probable intention of a study's author for a wrong name."""

    written: str
    """The wrong name, without escapes."""
    meant: str
    """The intended name; empty: no name is near."""
    words: str = ""
    """The end of a sentence: "; did you mean `R_Yes`?"."""


@contextmanager
def limited_comparisons() -> Iterator[None]:
    """Limit `nearest_name` to `_COMPARISONS` names within the block, so that many errors take no more time."""
    token = _budget.set([_COMPARISONS])
    try:
        yield
    finally:
        _budget.reset(token)


def nearest_name(word: str, known: Iterable[str]) -> str | None:
    """The known name that a person most likely meant by `word`; None: none is near."""
    budget = _budget.get([_COMPARISONS])
    if budget[0] <= 0 or len(word) > _LONGEST:
        return None
    folded: dict[str, str] = {}
    for name in islice(_in_order(known), budget[0]):
        if len(name) <= _LONGEST:
            folded.setdefault(_fold(name), name)
    budget[0] -= len(folded)
    matches = get_close_matches(_fold(word), folded, n=1, cutoff=0.6)
    return folded[matches[0]] if matches else None


def _in_order(names: Iterable[str]) -> Collection[str]:
    """Names in a fixed order. A set has none, so the suggestion among equally near names would vary."""
    if isinstance(names, set | frozenset):
        return sorted(names)
    return names if isinstance(names, Collection) else list(names)


def suggest(word: str, known: Iterable[str], *, limit: int = 12, otherwise: str = "") -> Correction:
    """Suggest the nearest known name, or list all names if there are few, or use `otherwise`."""
    names = _in_order(known)
    near = nearest_name(word, names)
    if near is not None:
        return Correction(word, near, f"; did you mean `{near}`?{lookalike_note(word, near)}")
    known_names = in_backquotes(dict.fromkeys(names)) if 0 < len(names) <= limit else ""
    return Correction(word, "", f"; known: {known_names}" if 0 < len(known_names) < 1000 else otherwise)


def did_you_mean(word: str, known: Iterable[str], *, limit: int = 12) -> str:
    """The end of a message about an unknown name: the nearest known name, or all of them if there are few."""
    return suggest(word, known, limit=limit).words


def lookalike_note(word: str, known: str) -> str:
    """Explain the difference of two names that look alike: a sentence for the end of a message, or empty.

    A letter with an accent can be one character or two (file names on macOS and texts from PDF files have two). Names
    are compared as written.
    """
    if word.isascii() and known.isascii():
        return ""
    pairs = enumerate(zip(word, known, strict=False))
    at = next((index for index, (here, there) in pairs if here != there), min(len(word), len(known)))
    if _visible_part(normalize("NFC", word)) == _visible_part(normalize("NFC", known)):
        while at > 0 and any(combining(each) for each in (word[at : at + 1], known[at : at + 1]) if each):
            at -= 1  # to the letter of the accent
    elif not _are_of_two_scripts(word[at : at + 1], known[at : at + 1]):
        return ""
    here, there = _letter_at(word, at), _letter_at(known, at)
    named_here, named_there = _describe_characters(here), _describe_characters(there)
    if len(here) == len(there) or not here or not there:
        return f" They look alike, but here is {named_here}, there {named_there}; copy it from there."
    return (
        f" They look alike, but its `{there}` is written as {named_here} here, and as {named_there} "
        "there; copy the name from there."
    )


def is_in_other_form(word: str, known: Collection[str]) -> bool:
    """Whether a name is known in Unicode's other form: with letters and accents as one character, or as two."""
    return not word.isascii() and any(
        form != word and form in known for form in (normalize("NFC", word), normalize("NFD", word))
    )


def _fold(name: str) -> str:
    """A name without the differences that readers overlook."""
    if name.isascii():
        return name.casefold()
    return normalize("NFC", name).casefold()


def _visible_part(name: str) -> str:
    """The part of a name that readers can see."""
    return " ".join(UNSEEN.sub("", name).split())


def _letter_at(name: str, at: int) -> str:
    """The letter that begins at an offset, with its accents."""
    end = at + 1
    while end < len(name) and combining(name[end]):
        end += 1
    return name[at:end]


def _are_of_two_scripts(here: str, there: str) -> bool:
    """Whether one of two letters is from another alphabet, such as a Cyrillic `а` in a Latin word."""
    scripts = [unicode_name(each, "").partition(" ")[0] for each in (here, there) if each.isalpha()]
    return len(set(scripts)) == 2 and set(scripts) <= {"LATIN", "CYRILLIC", "GREEK", "FULLWIDTH"}


def _describe_characters(letter: str) -> str:
    if not letter:
        return "nothing"
    written = " and ".join(character_name(each) for each in letter)
    return f"two characters, {written}" if len(letter) == 2 else written


def in_backquotes(names: Iterable[str]) -> str:
    """Names in backquotes, separated by commas."""
    return ", ".join(f"`{name}`" for name in names)
