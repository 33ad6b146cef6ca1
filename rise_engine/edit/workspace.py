"""A study in the hands of an editor: its files with all that was changed and not yet saved."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

from rise_engine.edit.edits import AnyEdit
from rise_engine.edit.outline import Outline
from rise_engine.edit.plan import Files
from rise_engine.scenario import LoadResult
from rise_engine.scenario.uses import Uses


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
    """Own changes that cannot be made any more on what the files are now."""


class SaveReport(Struct, frozen=True):
    files: tuple[str, ...]
    """What was written, made or deleted; empty: nothing was to be saved."""


class Workspace:
    """A study's folder, opened for editing. Reads and writes the disk; blocks, not for a loop."""

    folder: Path
    files: Files
    """As they are now, with all changes."""
    saved: Files
    """As they were last read from the disk or written to it."""

    def __init__(self, folder: Path, *, robot: str | None = None) -> None:
        """:raises EditRefused: it is no folder, cannot be read, or a study that comes with the program."""

    @property
    def checked(self) -> LoadResult:
        """The check of `files`, as they are now; `scenario` is None while there is an error."""

    @property
    def outline(self) -> Outline: ...

    @property
    def uses(self) -> Uses: ...

    @property
    def changes(self) -> Sequence[Change]:
        """What is not saved yet, in order."""

    def preview(self, *edits: AnyEdit) -> LoadResult:
        """The check of what the files would be, changing nothing. :raises EditRefused: one cannot be made."""

    def apply(self, *edits: AnyEdit) -> Change:
        """Make edits as one step. :raises EditRefused: one cannot be made; then none is."""

    def undo(self) -> Change | None:
        """Take the last step back, also over a save; gives it. None: there is none."""

    def redo(self) -> Change | None: ...

    def diff(self) -> str:
        """What saving would change, as `diff -u` has it."""

    def notice_outside(self) -> OutsideChange | None:
        """Look at the disk: take in what was changed there, and make own changes again on it. None: nothing was."""

    def save(self) -> SaveReport:
        """Write all changed files or none.

        :raises EditRefused: there is an error, the disk cannot be written, or files have changed outside (call
            `notice_outside` first).
        """

    def close(self) -> None:
        """Give up the lock; a draft with unsaved changes stays for the next time."""
