"""Proposed changes of a study, kept beside its draft until somebody accepts or refuses each in the editor.

A program or another person proposes edits (`rise-engine edit DIR EDITS.json --propose`); each time a file of its own is
written, so that nobody waits for anybody. The editor that has the study open takes out what was decided.
"""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from datetime import datetime
from pathlib import Path

import msgspec
from msgspec import Struct

from rise_engine.edit.drafts import DraftChange, DraftFile, write_durably

FORMAT = 1


class ProposedChanges(Struct, frozen=True):
    """What was proposed at once."""

    folder: str
    proposed: str
    """When, with the offset of the zone (ISO 8601)."""
    changes: tuple[DraftChange, ...]
    """One for each edit, so that each is accepted or refused by itself."""
    format: int = FORMAT


class ProposalFiles:
    """The proposals for one study, on the disk."""

    def __init__(self, folder: Path) -> None:
        """:param folder: the study's."""
        draft = DraftFile(folder)
        self.folder, self._stem, self._parent = draft.folder, draft.path.stem, draft.path.parent

    def _found(self) -> Iterator[tuple[str, ProposedChanges]]:
        for path in sorted(self._parent.glob(f"{glob.escape(self._stem)}.proposed-*.json")):
            with suppress(OSError, msgspec.DecodeError, UnicodeError):
                proposal = msgspec.json.decode(path.read_bytes(), type=ProposedChanges)
                if proposal.format == FORMAT:
                    yield path.name, proposal

    def read(self, known: Sequence[str] = ()) -> dict[str, ProposedChanges]:
        """All that can be read, by the names of their files, in the order in which they were proposed.

        :param known: names of files that are left out.
        """
        try:
            return {name: proposal for name, proposal in self._found() if name not in known}
        except OSError:
            return {}

    def propose(self, changes: Sequence[DraftChange]) -> tuple[DraftChange, ...]:
        """Keep these until they are decided; those that are proposed already, and wait, are left out. Gives the others.

        :raises OSError: the disk does not take them.
        """
        there = [each.edits for found in self.read().values() for each in found.changes]
        fresh = tuple(each for each in changes if each.edits not in there)
        if fresh:
            now = datetime.now().astimezone()
            name = f"{self._stem}.proposed-{now:%Y%m%d-%H%M%S-%f}-{os.getpid()}.json"
            self._write(name, ProposedChanges(str(self.folder), now.isoformat(timespec="seconds"), fresh))
        return fresh

    def keep(self, name: str, changes: Sequence[DraftChange]) -> None:
        """What is left of a file of proposals; nothing: it goes. Raises OSError."""
        if changes:
            now = datetime.now().astimezone().isoformat(timespec="seconds")
            self._write(name, ProposedChanges(str(self.folder), now, tuple(changes)))
        else:
            (self._parent / name).unlink(missing_ok=True)

    def _write(self, name: str, proposal: ProposedChanges) -> None:
        write_durably(self._parent / name, msgspec.json.encode(proposal))
