"""The registry of running sessions: a folder of the user's own, with a socket and a lock for each of them.

    $RISE_RUNTIME, or $XDG_RUNTIME_DIR/rise-tui, or /tmp/rise-tui-<uid>      0700
        lablinking-3f09ac.sock                                              0600
        lablinking-3f09ac.lock      held by the engine's process as long as it lives

The locks belong to the operating system (flock) and end with the process, however it ends. So a session runs exactly
when its lock is held, and a socket without a held lock is left over from an engine that was killed.
"""

from __future__ import annotations

import os
import re
import socket
import stat
import sys
import time
import unicodedata
from contextlib import suppress
from pathlib import Path
from zlib import crc32

from rise_engine.base.errors import RiseError
from rise_engine.base.files import is_locked, take_lock
from rise_engine.run.protocol.messages import AskSummaryMessage, SessionSummary, decode_server_message, encode_line

SUMMARY_SECONDS = 1.0
MAX_PATH_BYTES = 103 if sys.platform == "darwin" else 107
"""Maximum bytes of a Unix socket's path."""


class RegistryError(RiseError):
    """The folder or name of a session's socket cannot be used; the text says why, for a person."""


def runtime_folder() -> Path:
    """Return the folder of this user's sockets, and create it if necessary. Raises RegistryError if it is not safe."""
    ours, runtime = os.environ.get("RISE_RUNTIME"), os.environ.get("XDG_RUNTIME_DIR")
    if ours:
        folder = Path(ours).expanduser()
    elif runtime:
        folder = Path(runtime) / "rise-tui"
    else:
        folder = Path(f"/tmp/rise-tui-{os.getuid()}")
    try:
        folder.mkdir(0o700, parents=True)
    except FileExistsError:
        pass
    except OSError as error:
        raise RegistryError(
            f"the folder {folder} for the sockets of sessions cannot be created: {error.strerror}"
        ) from None
    found = os.lstat(folder)
    if stat.S_ISLNK(found.st_mode):
        raise RegistryError(f"{folder} is a link, so somebody else could have put it there; remove it")
    if not stat.S_ISDIR(found.st_mode):
        raise RegistryError(f"{folder} is not a folder; remove it")
    if found.st_uid != os.getuid():
        raise RegistryError(f"{folder} belongs to another user; name a folder of your own in RISE_RUNTIME")
    if stat.S_IMODE(found.st_mode) & 0o077:
        raise RegistryError(f"{folder} is open to other users, who could then run your session; do: chmod 700 {folder}")
    return folder


def session_name(folder: str | os.PathLike[str]) -> str:
    """Return the name of a scenario folder's session: the folder's own name, and six digits of its path's hash."""
    real = os.path.realpath(folder)
    plain = unicodedata.normalize("NFKD", os.path.basename(real)).encode("ascii", "ignore").decode()  # noqa: PTH119
    slug = re.sub(r"[^a-z0-9]+", "-", plain.lower()).strip("-")[:32].strip("-") or "scenario"
    return f"{slug}-{crc32(os.fsencode(real)) >> 8:06x}"


def socket_path(name: str) -> Path:
    """Return the socket of a session: by its name in the runtime folder, or by its whole path in any other folder.

    Raises RegistryError.
    """
    return Path(name) if name.startswith("/") else _socket_in_runtime_folder(name)


def _socket_in_runtime_folder(name: str) -> Path:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}", name):
        raise RegistryError(f"{name!r} cannot be the name of a session: letters, digits, `-`, `_` and `.` can")
    path = runtime_folder() / f"{name}.sock"
    length = len(os.fsencode(path))
    if length > MAX_PATH_BYTES:
        raise RegistryError(
            f"the path {path} has {length} bytes, and a socket's may have {MAX_PATH_BYTES}; "
            "name a folder with a shorter path in RISE_RUNTIME"
        )
    return path


def lock_path(socket: Path) -> Path:
    """Return the lock beside a session's socket."""
    return socket.with_suffix(".lock")


class SessionLock:
    """A session's name, held until `close` or the end of this process."""

    def __init__(self, name: str, path: Path, descriptor: int) -> None:
        self.name = name
        self.socket = path
        """The socket's path. Nothing exists there yet."""
        self._descriptor = descriptor

    def write_folder(self, folder: Path) -> None:
        """Write the session's folder into the lock, before the session begins."""
        os.write(self._descriptor, os.fsencode(folder.absolute()) + b"\n")

    def close(self) -> None:
        """Remove the socket and release the name."""
        if self._descriptor < 0:
            return
        # In this order: while the lock is held, no other process creates these files.
        for path in (self.socket, lock_path(self.socket)):
            with suppress(OSError):
                path.unlink()
        os.close(self._descriptor)
        self._descriptor = -1


def acquire_lock(name: str) -> SessionLock | None:
    """Take a session's name for this process; None if a running session has it. Raises RegistryError."""
    path = _socket_in_runtime_folder(name)
    for _ in range(20):  # a process that tests the lock holds it for a moment
        try:
            descriptor = _lock_file(lock_path(path))
        except OSError as error:
            raise RegistryError(f"{lock_path(path)} cannot be locked: {error.strerror or error}") from None
        if descriptor is not None:
            with suppress(FileNotFoundError):
                path.unlink()  # of an engine that was killed
            os.ftruncate(descriptor, 0)
            os.write(descriptor, b"%d\n" % os.getpid())
            return SessionLock(name, path, descriptor)
        time.sleep(0.01)
    return None


def _lock_file(path: Path) -> int | None:
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        try:
            if not take_lock(descriptor):
                os.close(descriptor)
                return None
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        except FileNotFoundError:
            pass
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # the previous holder removed this file: lock the new one


def read_lock(path: Path) -> tuple[int, Path | None]:
    """Read the process that holds a session's lock, and the session's folder. None: not chosen yet.

    :raises OSError: there is no such lock.
    :raises ValueError: it names no process.
    """
    process, _, folder = path.read_bytes().partition(b"\n")
    return int(process), Path(os.fsdecode(folder[:-1])) if folder.endswith(b"\n") else None


def running_names() -> list[str]:
    """Return the names of this user's running sessions. Raises RegistryError."""
    folder = runtime_folder()
    return sorted(path.stem for path in folder.glob("*.lock") if is_locked(path))


def find_running(name: str) -> str:
    """Find a running session by its name, with or without the six digits, or by its socket's path in any folder.

    Raises RegistryError if there is none, or more than one.
    """
    if "/" in name:
        path = os.path.abspath(name)  # noqa: PTH100  # does not resolve links
        if is_locked(lock_path(Path(path))):
            return path
        raise RegistryError(f"no session runs at {name}")
    running = running_names()
    matches = [each for each in running if each == name] or [
        each for each in running if each.rpartition("-")[0] == name
    ]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise RegistryError(f"{name} could be {' or '.join(matches)}; say which")
    others = f"; there are: {', '.join(running)}" if running else "; no session is running"
    raise RegistryError(f"no session {name} is running{others}")


def ask_summary(name: str) -> SessionSummary | None:
    """Ask a session for its summary; None if it does not answer within a second. Raises RegistryError. Blocks."""
    path = socket_path(name)
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(SUMMARY_SECONDS)
            connection.connect(str(path))
            connection.sendall(encode_line(AskSummaryMessage()))
            with connection.makefile("rb") as answer:
                message = decode_server_message(answer.readline())
    except (OSError, ValueError):
        return None
    return message if isinstance(message, SessionSummary) else None


def ask_all_summaries() -> dict[str, SessionSummary | None]:
    """Return every running session with its summary. Raises RegistryError. Blocks up to a second for each."""
    return {name: ask_summary(name) for name in running_names()}
