"""Unsaved drafts, stored so that they survive a lost terminal, and the lock of a study's editor.

Each study has one draft file in the state folder of the account. It holds the complete changed files, the changes in
words, and checksums of the original files.
"""

from __future__ import annotations

import glob
import json
import os
import socket
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from hashlib import sha256
from pathlib import Path

import msgspec
from msgspec import Struct

from rise_engine.author.edit.plan import Files
from rise_engine.base.files import take_lock, write_whole

FORMAT = 1


class Draft(Struct, frozen=True):
    """The unsaved changes of a study."""

    folder: str
    kept: str
    """The time with its time zone (ISO 8601)."""
    base: dict[str, str]
    """SHA-256 of every original file, by name."""
    files: dict[str, bytes | None]
    """The complete files that differ; None: deleted."""
    says: tuple[str, ...]
    format: int = FORMAT


def state_folder() -> Path:
    """Return the folder of drafts: `$XDG_STATE_HOME/rise-tui/drafts`."""
    state = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(state) / "rise-tui" / "drafts"


def hashes(files: Files) -> dict[str, str]:
    return {name: sha256(data).hexdigest() for name, data in files.items()}


class DraftFile:
    """The draft of one study on the disk."""

    def __init__(self, folder: Path) -> None:
        """:param folder: the study's folder."""
        self.folder = Path(os.path.realpath(folder))
        name = sha256(os.fsencode(self.folder)).hexdigest()[:16]
        self.path = state_folder() / f"{self.folder.name}-{name}.json"

    def read(self) -> Draft | None:
        """Read the latest draft; None: there is none, or none is readable."""
        found = self._find()
        return None if found is None else found[1]

    def _find(self) -> tuple[Path, Draft] | None:
        earlier = sorted(self.path.parent.glob(f"{glob.escape(self.path.stem)}.earlier-*.json"), reverse=True)
        for path in (self.path, *earlier):
            with suppress(OSError, msgspec.DecodeError, UnicodeError):
                draft = msgspec.json.decode(path.read_bytes(), type=Draft)
                if draft.format == FORMAT and draft.files:
                    return path, draft
        return None

    def put_aside(self) -> None:
        """Rename the current draft, so that the next one does not replace it; it is offered again. Raises OSError."""
        if self.path.exists():
            now = datetime.now().astimezone().strftime("%Y%m%d-%H%M%S-%f")
            self.path.rename(self.path.with_name(f"{self.path.stem}.earlier-{now}.json"))

    def forget(self) -> None:
        """Delete the draft that `read` returns. Raises OSError."""
        found = self._find()
        if found is not None:
            found[0].unlink(missing_ok=True)

    def keep(self, base: Files, files: Mapping[str, bytes | None], says: tuple[str, ...]) -> None:
        """Write the draft; without changed files, delete it. Raises OSError."""
        if not files:
            self.path.unlink(missing_ok=True)
            return
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        draft = Draft(str(self.folder), now, hashes(base), dict(files), says)
        self.path.parent.mkdir(0o700, parents=True, exist_ok=True)
        beside = self.path.with_suffix(f".{os.getpid()}.new")
        write_whole(self.path, msgspec.json.encode(draft), beside=beside)


class EditorLock:
    """The lock that gives a study one editor at a time. It ends with its process, however that ends."""

    def __init__(self, folder: Path) -> None:
        """:param folder: the study's folder. The folder itself is locked; nothing is written in it."""
        self.folder = folder
        self._descriptor = -1
        self._note = DraftFile(folder).path.with_suffix(".editor")
        self.holder = ""
        """The other editor, in words; empty: this editor has the lock."""
        self.try_again()

    def try_again(self) -> None:
        """Take the lock if no other editor has it now."""
        if self._descriptor >= 0:
            return
        self.holder = ""
        try:
            descriptor = os.open(self.folder, os.O_RDONLY | os.O_CLOEXEC)
        except OSError:
            return
        try:
            locked = take_lock(descriptor)
        except OSError:  # a file system without locks, on which editors are not detected
            os.close(descriptor)
            return
        if not locked:
            os.close(descriptor)
            self.holder = self._read_holder()
            return
        self._descriptor = descriptor
        self._write_holder()

    def release(self) -> None:
        if self._descriptor >= 0:
            self._note.unlink(missing_ok=True)
            os.close(self._descriptor)
            self._descriptor = -1

    def _write_holder(self) -> None:
        since = datetime.now().astimezone().strftime("%H:%M")
        with suppress(OSError):
            self._note.parent.mkdir(0o700, parents=True, exist_ok=True)
            self._note.write_text(json.dumps({"process": os.getpid(), "host": socket.gethostname(), "since": since}))

    def _read_holder(self) -> str:
        try:
            holder = json.loads(self._note.read_text(encoding="utf-8"))
            return f"another editor, process {holder['process']} on {holder['host']}, since {holder['since']}"
        except (OSError, ValueError, KeyError):
            return "another editor, of another user"
