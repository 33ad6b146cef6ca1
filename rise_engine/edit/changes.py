"""What was done to a study, and what could not be: steps in words, changes of others, refusals; and files compared."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from hashlib import sha256

from msgspec import Struct

from rise_engine.edit.edits import (
    AddAct,
    AddAction,
    AddBranch,
    AddColumn,
    AddRow,
    AddRule,
    AddState,
    AddStatement,
    AddTransition,
    AddVariant,
    AnyEdit,
    CopyAct,
    CopyRule,
    ReplaceFile,
)
from rise_engine.edit.history import changed_names
from rise_engine.edit.plan import Files, Plan

_ADDING = (
    AddAct, AddAction, AddBranch, AddColumn, AddRow, AddRule, AddState, AddStatement, AddTransition, AddVariant,
    CopyAct, CopyRule,
)  # fmt: skip
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
    lost: tuple[Change, ...] = ()
    """Own changes that cannot be made again on what the files are now: they are set aside (`Workspace.waiting`)."""
    forgotten: bool = False
    """Whether steps from before can no longer be taken back."""


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


def replaced_by(edit: AnyEdit, planned: Plan, files: Files) -> bytes:
    """What a plan takes away, as a sum; the same for the same, wherever it stands. Of what only adds: nothing.

    An edit that is made again on files that somebody else has changed, and then takes away something else than it did
    before, would overwrite what they wrote.
    """
    if isinstance(edit, _ADDING):
        return b""
    gone = {files[each.file][each.start : each.end] for each in planned.splices}
    gone |= {files.get(name) or b"" for name in planned.written}
    total = sha256()
    for piece in sorted(gone):
        total.update(b"%d:" % len(piece) + piece)
    return total.digest()[:8]


def taken_back(change: Change, before: Files, names: Iterable[str]) -> Change:
    """A saved change that was taken back, as one that can be made: these files as they were before it, whole."""
    says = tuple(f"taken back: {sentence}" for sentence in change.says)
    edits: list[AnyEdit] = []
    for name in sorted(names):
        data = before.get(name)
        try:
            edits.append(ReplaceFile(name, None if data is None else data.decode()))
        except UnicodeDecodeError:
            return Change((), says)
    return Change(tuple(edits), says)
