"""The steps of an editor, with unlimited undo and redo, and their changes in words.

Undo restores the files before the step, across several files and saves. Unlike a reverse edit, it also restores
quotation marks and blanks.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import Files


class Step(Struct, frozen=True, eq=False):
    """A change, and the files before and after it."""

    change: Change
    before: Files
    after: Files

    @property
    def files(self) -> set[str]:
        """The names of the changed files."""
        return changed_names(self.before, self.after)


def changed_names(one: Files, other: Files) -> set[str]:
    """Return the names of the files that differ."""
    return {name for name in one.keys() | other.keys() if one.get(name) != other.get(name)}


class History:
    """The steps that were made, and those that were undone."""

    def __init__(self) -> None:
        self.done: list[Step] = []
        self.undone: list[Step] = []
        self.saved: list[Step] = []
        """The steps made at the time of the last save."""

    def add(self, step: Step) -> None:
        self.done.append(step)
        self.undone.clear()

    def undo(self) -> Step | None:
        if not self.done:
            return None
        self.undone.append(self.done.pop())
        return self.undone[-1]

    def redo(self) -> Step | None:
        if not self.undone:
            return None
        self.done.append(self.undone.pop())
        return self.done[-1]

    def mark_saved(self) -> None:
        self.saved = list(self.done)

    @property
    def unsaved(self) -> tuple[list[Step], list[Step]]:
        """Saved steps that were undone since, the latest first; and steps that were made since."""
        same = 0
        while same < min(len(self.done), len(self.saved)) and self.done[same] is self.saved[same]:
            same += 1
        return self.saved[: same - 1 if same else None : -1] if len(self.saved) > same else [], self.done[same:]

    def touched(self) -> set[str]:
        """Return the names of all files that any step changes."""
        return {name for steps in (self.done, self.undone, self.saved) for step in steps for name in step.files}

    def take_over_disk(self, on_disk: Mapping[str, bytes | None]) -> None:
        """Take over files that changed outside and that no step changes."""
        known: dict[int, Step] = {}

        def with_disk_changes(files: Files) -> Files:
            merged = {**files, **{name: data for name, data in on_disk.items() if data is not None}}
            for name, data in on_disk.items():
                if data is None:
                    merged.pop(name, None)
            return merged

        for steps in (self.done, self.undone, self.saved):
            for index, step in enumerate(steps):
                if id(step) not in known:
                    known[id(step)] = replace(
                        step, before=with_disk_changes(step.before), after=with_disk_changes(step.after)
                    )
                steps[index] = known[id(step)]

    def begin_anew(self, steps: list[Step]) -> None:
        """Forget the earlier steps, because their files have also changed outside."""
        self.done, self.undone, self.saved = list(steps), [], []


# --- in words --------------------------------------------------------------------------------------------------------


_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")


class Change(Struct, frozen=True):
    """One step that can be undone: one edit, or several that belong together."""

    edits: tuple[AnyEdit, ...]
    says: tuple[str, ...]
    """The effect in words."""
    noticed: tuple[str, ...] = ()


class DiskChange(Struct, frozen=True):
    """A change of the files outside of this editor."""

    files: tuple[str, ...]
    """The files that differ."""
    clash: tuple[str, ...] = ()
    """Files with unsaved changes here, which keep the content from here."""
    forgotten: bool = False
    """Whether all earlier steps are one step now."""


class Refusal(Struct, frozen=True):
    """An edit that cannot be made."""

    edit: int
    """Its index, from 0."""
    why: str


class SaveReport(Struct, frozen=True):
    files: tuple[str, ...]
    """The files written, made or deleted; empty: there was nothing to save."""


def diff_of(before: Files, after: Files) -> str:
    """List the lines that differ between two states of files, as `diff -u` does; a lone CR ends a line, too."""
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
