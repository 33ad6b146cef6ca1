"""What was done to a study, and what could not be: steps in words, changes of others, refusals; and files compared."""

from __future__ import annotations

import difflib
import re

from msgspec import Struct

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.history import changed_names
from rise_engine.author.edit.plan import Files

_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")


class Change(Struct, frozen=True):
    """One step that can be undone: an edit, or several that belong together."""

    edits: tuple[AnyEdit, ...]
    says: tuple[str, ...]
    """What it does, in words."""
    noticed: tuple[str, ...] = ()


class OutsideChange(Struct, frozen=True):
    """What somebody else has done to the files meanwhile."""

    files: tuple[str, ...]
    """Those that differ."""
    clash: tuple[str, ...] = ()
    """Those with unsaved changes of one's own, which are as they are here."""
    forgotten: bool = False
    """Whether all steps from before are one step now."""


class Refusal(Struct, frozen=True):
    """An edit that cannot be made."""

    edit: int
    """Which one, from 0."""
    why: str


class SaveReport(Struct, frozen=True):
    files: tuple[str, ...]
    """What was written, made or deleted; empty: nothing was to be saved."""


def diff_of(before: Files, after: Files) -> str:
    """The lines that differ between two states of files, as `diff -u` has them; CR alone ends a line too."""
    pieces: list[str] = []
    for name in sorted(changed_names(before, after)):
        old, new = (side.get(name) for side in (before, after))
        one, other = (_LINE.findall((data or b"").decode("utf-8", "replace")) for data in (old, new))
        from_name = f"a/{name}" if old is not None else "/dev/null"
        to_name = f"b/{name}" if new is not None else "/dev/null"
        for line in difflib.unified_diff(one, other, from_name, to_name):
            if line.endswith("\r"):
                line = f"{line[:-1]}\n"
            pieces.append(line if line.endswith("\n") else f"{line}\n\\ No newline at end of file\n")
    return "".join(pieces)
