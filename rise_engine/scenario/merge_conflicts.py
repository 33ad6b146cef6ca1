"""What git leaves in a file whose two versions it could not join: conflicts, each with both versions of some lines.

A line with `<<<<<<<` and a name, the lines as they are here, a line with `=======`, the lines as the other has
them, and a line with `>>>>>>>` and the other's name.

With git's setting `merge.conflictStyle diff3` there is a third part between `|||||||` and `=======`: as it was before.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal, NamedTuple, TypeAlias

Keep: TypeAlias = Literal["yours", "theirs", "both"]
"""What is kept of a conflict: the lines as they are here, the other's, or these and then the other's."""

_MARK = re.compile(r"^(?:<{7}|\|{7}|={7}|>{7})(?=[ \r\n]|\Z)", re.MULTILINE)
_END = re.compile(r"\r\n|\n|\r|\Z")


class MergeConflict(NamedTuple):
    """One place with two versions; all numbers are characters of the text."""

    start: int
    """Where the line with `<<<<<<<` begins."""
    end: int
    """Behind the line with `>>>>>>>`."""
    closing: int
    """Where the line with `>>>>>>>` begins."""
    yours: tuple[int, int]
    """From where to where the lines stand as they are here."""
    theirs: tuple[int, int]
    """From where to where the other's stand."""
    your_name: str
    """What git calls the version here: `HEAD`; empty: nothing."""
    their_name: str
    """What git calls the other one: a branch, a commit."""


def find_conflicts(text: str) -> list[MergeConflict]:
    """The conflicts of a text, in order. Marks that are no whole conflict are none.

    >>> text = "a\\n<<<<<<< HEAD\\nb\\n=======\\nc\\n>>>>>>> anna\\n"
    >>> [(text[slice(*each.theirs)], each.their_name) for each in find_conflicts(text)]
    [('c\\n', 'anna')]
    """
    return list(_find(text)) if "<<<<<<<" in text else []


def _find(text: str) -> Iterator[MergeConflict]:
    opening = before = middle = None
    for mark in _MARK.finditer(text):
        kind = mark.group()[0]
        if kind == "<":
            opening, before, middle = mark, None, None
        elif opening is None:
            continue
        elif kind == "|" and before is None and middle is None:
            before = mark
        elif kind == "=" and middle is None:
            middle = mark
        elif kind == ">" and middle is not None:
            yours = _behind(text, opening), (before or middle).start()
            theirs = _behind(text, middle), mark.start()
            end = _behind(text, mark)
            names = _name(text, opening), _name(text, mark)
            yield MergeConflict(opening.start(), end, mark.start(), yours, theirs, *names)
            opening = None


def _behind(text: str, mark: re.Match[str]) -> int:
    """Behind the line of a mark."""
    end = _END.search(text, mark.end())
    return end.end() if end is not None else len(text)


def _name(text: str, mark: re.Match[str]) -> str:
    return text[mark.end() : _behind(text, mark)].strip()
