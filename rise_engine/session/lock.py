"""The lock that gives a session to one engine, and the note about that engine.

The lock is the operating system's (flock) on the journal's file. It ends with the process that holds it. A copy of the
folder is not locked. The note, `engine.json`, locks nothing: it names the holder of the lock and its socket, so that
other programs can report them or attach. Some file systems hide the locks of other computers. There, the note names the
last computer, and a person decides.
"""

from __future__ import annotations

import errno
import getpass
import os
import platform
import re
import shlex
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from weakref import WeakSet

import msgspec
from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.base.files import error_message, has_no_locks, is_locked, take_lock, wait_until, write_whole

HOLDER_FILE = "engine.json"
TRIES, TRY_SECONDS = 500, 0.01
"""Number and interval of attempts. Programs that test for a running session, or begin one, hold the lock for a
moment."""
MAX_LOCK_TRIES = 20
"""Number of attempts with an exclusive lock after which the holder must be an engine."""
LOCAL_FILE_SYSTEMS = frozenset(
    {
        *("bcachefs", "btrfs", "ext2", "ext3", "ext4", "f2fs", "jfs", "reiserfs", "xfs", "zfs"),
        *("aufs", "ecryptfs", "overlay", "ramfs", "rootfs", "tmpfs"),
        *("exfat", "fuseblk", "hfs", "hfsplus", "msdos", "ntfs", "ntfs3", "udf", "vfat"),
    }
)
"""File systems that show its locks to every program that can open a file. Others may not."""
MANDATORY = frozenset({"cifs", "smb3", "smbfs"})
"""File systems without locks here, because a lock would stop this process from writing through another descriptor."""

_held_locks: WeakSet[JournalLock] = WeakSet()


class LockHolder(Struct, frozen=True):
    """The present or last engine of a session, as in `engine.json`."""

    pid: int
    host: str
    user: str
    since: str
    """ISO 8601 with offset."""
    socket: str = ""
    """The absolute path of the session's socket; empty: the engine is starting."""

    @property
    def is_this_computer(self) -> bool:
        """Whether the engine is on this computer."""
        return self.host == platform.node()

    def __str__(self) -> str:
        since = self.since
        with suppress(ValueError):
            since = f"{datetime.fromisoformat(since):%Y-%m-%d %H:%M}"
        where = "this computer" if self.is_this_computer else f"the computer {self.host}"
        return f"process {self.pid} of {self.user} on {where}, since {since}"


class JournalLockedError(SessionError):
    """An engine runs the session. The text names it, and how to attach to it and end it."""

    def __init__(self, folder: Path, holder: LockHolder | None) -> None:
        super().__init__(running_message(folder, holder))
        self.holder = holder


class JournalLock:
    """The right to write a journal, until `release` or the end of this process."""

    def __init__(self, journal: Path, *, here: bool = False) -> None:
        """Take the lock without waiting. Call this before reading the journal.

        `here`: a person has confirmed that the last computer of the session no longer runs it.

        Raises JournalLockedError if an engine runs the session. Raises SessionError if an engine on another computer
        may run it, or the journal is missing or cannot be written.
        """
        self._note = journal.with_name(HOLDER_FILE)
        self._descriptor, locked = _acquire(journal)
        before = read_holder(journal.parent)
        trusted = locked and (before is None or before.is_this_computer or file_system(journal) in LOCAL_FILE_SYSTEMS)
        if before is not None and not trusted and not here:
            os.close(self._descriptor)
            raise SessionError(_elsewhere_message(journal.parent, before))
        _held_locks.add(self)
        self.write_holder()

    def write_holder(self, socket: str = "") -> None:
        """Write the note about the holder and the session's socket."""
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        holder = LockHolder(os.getpid(), platform.node(), user_name(), now, socket)
        with suppress(OSError):  # the lock works without it, for example with a full disk
            write_whole(self._note, msgspec.json.format(msgspec.json.encode(holder), indent=2) + b"\n")

    @contextmanager
    def move_to(self, path: Path) -> Iterator[None]:
        """Let the file `path` replace the journal within a `with` statement.

        `path` is locked first. The old journal is unlocked at the end, unless the body fails with OSError. Raises
        OSError.
        """
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        if file_system(path) not in MANDATORY:
            with suppress(OSError):  # on file systems without locks
                take_lock(descriptor)
        try:
            yield
        except OSError:
            os.close(descriptor)
            raise
        self._descriptor, before = descriptor, self._descriptor
        os.close(before)

    def release(self) -> None:
        """Unlock the journal. A second call has no effect."""
        if self._descriptor >= 0:
            with suppress(OSError):
                self._note.unlink()  # only the holder of the lock writes a note
            self._close()

    def _close(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def _close_in_child() -> None:
    """Close the locks in a forked process, which could outlive this one and keep them."""
    for lock in tuple(_held_locks):
        lock._close()


os.register_at_fork(after_in_child=_close_in_child)


def read_holder(folder: Path) -> LockHolder | None:
    """Read the present or last holder of a session; None: there is no readable note."""
    try:
        return msgspec.json.decode((folder / HOLDER_FILE).read_bytes(), type=LockHolder)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError):
        return None


def forget_holder(folder: Path) -> None:
    """Remove the note of an engine that is gone, because it names a user and a computer. It stays while the session
    runs, and where it is the only sign of a holder."""
    holder = read_holder(folder)
    if holder is not None and holder.is_this_computer and not is_locked(folder / "journal.jsonl"):
        with suppress(OSError):
            (folder / HOLDER_FILE).unlink()


def running_message(folder: Path, holder: LockHolder | None) -> str:
    """Describe a running session: its place, and how to attach to it and end it."""
    if holder is None:
        return f"the session {folder.name} is running: another program has locked its journal"
    sentence = f"the session {folder.name} is running: {holder}"
    if not holder.is_this_computer:
        return f"{sentence}. Attach to it and end it there"
    if not holder.socket:
        return f"{sentence}. It is just starting"
    where = shlex.quote(holder.socket)
    return f"{sentence}. To attach: rise-tui --session {where}. To end it: rise-engine stop {where}"


@contextmanager
def one_at_a_time(folder: Path, busy: str = "", seconds: float = TRIES * TRY_SECONDS) -> Iterator[None]:
    """Let programs take turns in a folder: engines that begin a session, so that each one sees the others' sessions,
    and programs that change a list.

    Hold this only for milliseconds.

    :param busy: the message that another program has the folder; empty: for engines that begin a session.
    :param seconds: maximum wait.
    :raises SessionError: another program has it all that time.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:  # the next attempt to write here reports the error
        yield
        return
    try:
        with suppress(OSError):  # folders on NFS cannot be locked: the last writer wins
            if not wait_until(lambda: take_lock(descriptor), seconds, TRY_SECONDS):
                raise SessionError(busy or f"another engine is just beginning a session in {folder}; try again")
        yield
    finally:
        os.close(descriptor)


def file_system(path: Path, mounts: str | None = None) -> str:
    """Read the type of the file system of `path`, as Linux names it; empty: unknown.

    `mounts`: text in the format of /proc/self/mountinfo (proc_pid_mountinfo(5)). Default: this file.
    """
    if mounts is None:
        try:
            mounts = Path("/proc/self/mountinfo").read_text("utf-8", "surrogateescape")
        except OSError:
            return ""
    real, found, kind = os.path.realpath(path), "", ""
    for line in mounts.splitlines():
        fields, dash, rest = line.partition(" - ")
        parts = fields.split()
        if not dash or len(parts) < 5:
            continue
        mount_point = re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), parts[4])
        inside = real == mount_point or real.startswith(mount_point.rstrip("/") + "/")
        if inside and len(mount_point) >= len(found):  # the last mount at a mount point hides earlier ones
            found, kind = mount_point, rest.split()[0]
    return kind


def user_name() -> str:
    """Read the name of this process's user."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())


def _acquire(journal: Path) -> tuple[int, bool]:
    """Open and lock the journal. Returns the descriptor, and False if the file system has no locks."""
    alone = 0
    for _ in range(TRIES):
        try:
            descriptor = os.open(journal, os.O_RDWR | os.O_CLOEXEC)
        except FileNotFoundError:
            raise SessionError(
                f"there is no journal {journal}: nothing was ever recorded, or somebody moved it"
            ) from None
        except OSError as error:
            if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
                raise SessionError(
                    f"{journal} cannot be read and written: {error_message(error)}. A session that may only be read "
                    "can be replayed and exported"
                ) from None
            raise SessionError(f"{journal} cannot be read: {error.strerror or error}") from None
        if file_system(journal) in MANDATORY:
            return descriptor, False
        try:
            if take_lock(descriptor) and os.path.samestat(os.fstat(descriptor), journal.stat()):
                return descriptor, True
        except FileNotFoundError:
            pass
        except OSError as error:
            if has_no_locks(error):
                return descriptor, False
            os.close(descriptor)
            raise SessionError(f"{journal} cannot be locked: {error_message(error)}") from None
        os.close(descriptor)
        alone += is_locked(journal)
        if alone == MAX_LOCK_TRIES:
            break
        time.sleep(TRY_SECONDS)
    raise JournalLockedError(journal.parent, read_holder(journal.parent))


def _elsewhere_message(folder: Path, before: LockHolder) -> str:
    return (
        f"{before} had the session {folder.name} and did not end it, and this file system does not show "
        "whether it still runs there. Look there; if it does not run, add --here to continue it on this computer"
    )
