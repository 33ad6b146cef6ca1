"""Which engine has a session: a lock on the journal itself, and a note beside it that says whose it is.

The lock is the operating system's (flock). It belongs to the journal's file, not to a name or to somebody's
environment, and it goes with the process that holds it, however that ends. A copy of the folder is another file and not
locked. The note, `engine.json`, locks nothing: it says who holds the lock and where that session is reached, so that
another program can say so, or attach. Where a file system may not tell this computer of the locks of another one, the
note says which computer had the session last, and then a person has to decide.
"""

from __future__ import annotations

import errno
import fcntl
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
from rise_engine.session.disk import error_message, write_private_file

HOLDER_FILE = "engine.json"
TRIES, TRY_SECONDS = 500, 0.01
"""How often it is tried, while others only look whether a session runs (they hold its lock for a moment, with others),
or are just beginning one."""
RUNS = 20
"""So many times the lock is held by one alone: that is an engine."""
ONE_MACHINE = frozenset(
    {
        *("bcachefs", "btrfs", "ext2", "ext3", "ext4", "f2fs", "jfs", "reiserfs", "xfs", "zfs"),
        *("aufs", "ecryptfs", "overlay", "ramfs", "rootfs", "tmpfs"),
        *("exfat", "fuseblk", "hfs", "hfsplus", "msdos", "ntfs", "ntfs3", "udf", "vfat"),
    }
)
"""File systems on which every program that can open a file sees its locks. Of any other, nobody knows."""
MANDATORY = frozenset({"cifs", "smb3", "smbfs"})
"""File systems on which a lock would keep this very process from writing by another descriptor: no lock there."""
_HELD = (errno.EAGAIN, errno.EACCES)
_NO_LOCKS = (errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL, errno.EBADF)

_held_locks: WeakSet[JournalLock] = WeakSet()


class LockHolder(Struct, frozen=True):
    """The engine that has a session, or had it last, as `engine.json` says it."""

    pid: int
    host: str
    user: str
    since: str
    """ISO 8601 with offset."""
    socket: str = ""
    """Where the session is reached, absolute; empty while the engine is starting."""

    @property
    def is_this_computer(self) -> bool:
        """Whether it is on this computer."""
        return self.host == platform.node()

    def __str__(self) -> str:
        since = self.since
        with suppress(ValueError):
            since = f"{datetime.fromisoformat(since):%Y-%m-%d %H:%M}"
        where = "this computer" if self.is_this_computer else f"the computer {self.host}"
        return f"process {self.pid} of {self.user} on {where}, since {since}"


class JournalLockedError(SessionError):
    """An engine runs the session; the text says which, and how it is reached and ended."""

    def __init__(self, folder: Path, holder: LockHolder | None) -> None:
        super().__init__(running_message(folder, holder))
        self.holder = holder


class JournalLock:
    """The right to write a journal, held until `release` or the end of this process."""

    def __init__(self, journal: Path, *, here: bool = False) -> None:
        """Take it, without waiting. Read nothing of the journal before.

        `here`: a person has decided that the computer which had the session last does not run it any more.

        Raises JournalLockedError when an engine runs the session; SessionError when one on another computer may;
        SessionError when there is no journal, or it may not be written.
        """
        self._note = journal.with_name(HOLDER_FILE)
        self._descriptor, locked = _acquire(journal)
        before = read_holder(journal.parent)
        trusted = locked and (before is None or before.is_this_computer or file_system(journal) in ONE_MACHINE)
        if before is not None and not trusted and not here:
            os.close(self._descriptor)
            raise SessionError(_elsewhere_message(journal.parent, before))
        _held_locks.add(self)
        self.write_holder()

    def write_holder(self, socket: str = "") -> None:
        """Say beside the journal who has it, and where the session is reached."""
        now = datetime.now().astimezone().isoformat(timespec="seconds")
        holder = LockHolder(os.getpid(), platform.node(), user_name(), now, socket)
        new_note = self._note.with_name(f"{HOLDER_FILE}.new")
        with suppress(OSError):  # a full disk, say: it can be locked all the same
            write_private_file(new_note, msgspec.json.format(msgspec.json.encode(holder), indent=2) + b"\n")
            new_note.replace(self._note)

    @contextmanager
    def move_to(self, path: Path) -> Iterator[None]:
        """Within it the file `path` takes the journal's place: it is locked as long as nobody else knows of it, and the
        one before is unlocked at the end, unless that raises OSError.

        Raises OSError.
        """
        descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        if file_system(path) not in MANDATORY:
            with suppress(OSError):  # where nothing can be locked
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        try:
            yield
        except OSError:
            os.close(descriptor)
            raise
        self._descriptor, before = descriptor, self._descriptor
        os.close(before)

    def release(self) -> None:
        """Unlock the journal: nobody has the session now. Does nothing the second time."""
        if self._descriptor >= 0:
            with suppress(OSError):
                self._note.unlink()  # while the lock is held, nobody else writes one
            self._close()

    def _close(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def _close_in_child() -> None:
    """A process that was forked off would hold the lock after this one has gone."""
    for lock in tuple(_held_locks):
        lock._close()


os.register_at_fork(after_in_child=_close_in_child)


def is_journal_locked(journal: Path) -> bool:
    """Whether an engine has this journal, as far as this computer can see. Does not wait."""
    try:
        descriptor = os.open(journal, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError as error:
        return error.errno in _HELD
    finally:
        os.close(descriptor)
    return False


def read_holder(folder: Path) -> LockHolder | None:
    """Who has a session, or had it when an engine or a computer went away; None: nobody is named."""
    try:
        return msgspec.json.decode((folder / HOLDER_FILE).read_bytes(), type=LockHolder)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError):
        return None


def forget_holder(folder: Path) -> None:
    """Remove the note of an engine that has gone: it names a user and a computer. Not while somebody has the session,
    and not where only the note says who may have it."""
    holder = read_holder(folder)
    if holder is not None and holder.is_this_computer and not is_journal_locked(folder / "journal.jsonl"):
        with suppress(OSError):
            (folder / HOLDER_FILE).unlink()


def running_message(folder: Path, holder: LockHolder | None) -> str:
    """That a session runs, where, and how it is reached and ended."""
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
def one_at_a_time(sessions: Path) -> Iterator[None]:
    """Of engines that begin a session at once, one waits for the other, so that each sees what the other one runs.

    Short: only to look and to lock. Raises SessionError.
    """
    try:
        descriptor = os.open(sessions, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:  # whoever makes a folder in it says what is wrong
        yield
        return
    try:
        for tries_left in reversed(range(TRIES)):
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except OSError as error:
                if error.errno in _NO_LOCKS:  # folders on NFS; the journals' locks are there all the same
                    break
                if not tries_left:
                    raise SessionError(f"another engine is just beginning a session in {sessions}; try again") from None
                time.sleep(TRY_SECONDS)
        yield
    finally:
        os.close(descriptor)


def file_system(path: Path, mounts: str | None = None) -> str:
    """Of which kind it is, as Linux calls it; empty when that is not known.

    `mounts`: as in /proc/self/mountinfo (proc_pid_mountinfo(5)), which is read otherwise.
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
        if inside and len(mount_point) >= len(found):  # the latest of one mount point lies on top
            found, kind = mount_point, rest.split()[0]
    return kind


def user_name() -> str:
    """Whose process this is."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return str(os.getuid())


def _acquire(journal: Path) -> tuple[int, bool]:
    """A descriptor of the journal that holds its lock; False with it where nothing can be locked."""
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
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(descriptor), os.stat(journal)):  # noqa: PTH116
                return descriptor, True
        except FileNotFoundError:
            pass
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return descriptor, False
            if error.errno not in _HELD:
                os.close(descriptor)
                raise SessionError(f"{journal} cannot be locked: {error_message(error)}") from None
        os.close(descriptor)
        alone += is_journal_locked(journal)
        if alone == RUNS:
            break
        time.sleep(TRY_SECONDS)
    raise JournalLockedError(journal.parent, read_holder(journal.parent))


def _elsewhere_message(folder: Path, before: LockHolder) -> str:
    return (
        f"{before} had the session {folder.name} and did not end it, and on this file system it cannot be seen "
        "from here whether it still runs there. Look there; if it does not, add --here to continue it on this computer"
    )
