"""Writes a journal: a thread makes lines durable, each time all waiting lines together (natural group commit).

The engine passes lines on, continues, and is notified when they are on the disk. When the disk fails, no line is lost.
The thread opens the file again and writes all lines that are not known to be durable, because after a failed sync a
successful one proves nothing. An open journal is locked (`rise_engine.session.lock`), also after its file was reopened
or rewritten.
"""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from queue import Empty, Queue

from rise_engine.base.files import Disk, error_message
from rise_engine.session.lock import JournalLock

RETRY_SECONDS = 1.0
"""Seconds between a failure of the disk and the next attempt."""
CLOCK_SECONDS = 1.0
"""Seconds between writes of the session's time to the file `clock`, which is used if the engine dies."""
BATCH = 4_000_000
"""Maximum number of bytes in a batch."""


class Journal:
    """The journal of a running session. Only the engine's thread may use it."""

    def __init__(
        self,
        path: Path,
        *,
        size: int = 0,
        lock: JournalLock | None = None,
        changed: Callable[[], None] = lambda: None,
        now: Callable[[], float] | None = None,
        disk: Disk | None = None,
        retry: float = RETRY_SECONDS,
    ) -> None:
        """Open the journal and start its thread. Raises OSError, and SessionError if it cannot be locked.

        `size`: 0 makes a new file; otherwise an existing one continues there. `lock`: an existing lock of the journal,
        which owns it from now on. `changed` is called on the writer's thread when `durable` or `error` changes, and
        must not block. `now` returns the session's time in seconds for the file `clock`.
        """
        self.path = path
        self.on_change = changed
        self.error = ""
        """Why lines do not become durable at present, for a person; empty: no trouble."""
        self.durable = 0
        """The number of `append` calls whose lines are on the disk."""
        self.appended = 0
        self._now = now
        self._disk = disk or Disk()
        self._retry = retry
        self._size = size
        self._queue: Queue[bytes | None] = Queue()
        """Not a SimpleQueue: its `get` waits forever if the thread gets no processor until its timeout is over."""
        self._last_progress = 0.0
        """When lines last became durable, or when a new line found no other waiting (monotonic clock)."""
        self._last_seen_in_place = 0.0
        """When the file was last found in its place."""
        self._give_up = threading.Event()
        self._descriptor = self._disk.open(path, create=size == 0)
        self._file = os.fstat(self._descriptor)
        """The file's identity, for times when the file cannot be accessed."""
        self.lock = lock or JournalLock(path)
        if size == 0:
            self._disk.sync_folder(path.parent)
        self._clock = os.open(path.with_name("clock"), os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
        self._thread = threading.Thread(target=self._run, name="rise-journal", daemon=True)
        self._thread.start()

    def append(self, lines: bytes) -> int:
        """Pass on whole lines. They are durable when `durable` reaches the returned number."""
        if self.durable == self.appended:
            self._last_progress = time.monotonic()
        self.appended += 1
        self._queue.put(lines)
        return self.appended

    @property
    def lag(self) -> float:
        """Seconds for which lines have waited without progress; 0: none waits."""
        return 0.0 if self.durable == self.appended else time.monotonic() - self._last_progress

    def close(self, timeout: float = 5.0) -> bool:
        """Wait (blocking) until all lines are durable. False if the disk needs more than `timeout` seconds."""
        self._queue.put(None)
        self._thread.join(timeout)
        self._give_up.set()
        self._thread.join(1.0)
        if not self._thread.is_alive():  # otherwise it may still write, and the lock ends with the process
            self.lock.release()
        return self.durable == self.appended

    # --- the writer's thread --------------------------------------------------------------------------------------

    def _run(self) -> None:
        going = True
        while going:
            batch: list[bytes] = []
            size = 0
            try:
                lines = self._queue.get(timeout=CLOCK_SECONDS)
                while lines is not None:
                    batch.append(lines)
                    size += len(lines)
                    if size > BATCH:
                        break
                    lines = self._queue.get_nowait()
                going = lines is not None
            except Empty:
                self._write_clock()
            if batch and self._commit(b"".join(batch)):
                self._last_progress = time.monotonic()
                self.durable += len(batch)
                self.on_change()
        with suppress(OSError):
            self._restore_if_removed()
        with suppress(OSError):
            self._disk.close(self._descriptor)
        with suppress(OSError):
            os.close(self._clock)

    def _commit(self, data: bytes) -> bool:
        """Write lines durably. False if the engine cannot wait any longer."""
        while True:
            try:
                if time.monotonic() - self._last_seen_in_place > CLOCK_SECONDS:
                    self._restore_if_removed()
                self._disk.write(self._descriptor, data, self._size)
                self._disk.sync(self._descriptor)
            except OSError as error:
                self._set_error(error_message(error))
                if self._give_up.wait(self._retry):
                    return False
                self._reopen()
            else:
                self._size += len(data)
                self._set_error("")
                return True

    def _restore_if_removed(self) -> None:
        """Write the journal again if its file was removed and would vanish with all its lines.

        Checked once a second instead of at each commit: meanwhile, the removed file still has the lines.
        """
        with suppress(FileNotFoundError):
            if os.path.samestat(self.path.stat(follow_symlinks=False), os.fstat(self._descriptor)):
                self._last_seen_in_place = time.monotonic()
                return
            raise FileExistsError(errno.EEXIST, f"another file has been put in the place of {self.path.name}")
        copy = self.path.with_name(self.path.name + ".new")
        copy.unlink(missing_ok=True)
        fresh = self._disk.open(copy, create=True)
        try:
            with self.lock.move_to(copy):
                for at in range(0, self._size, BATCH):
                    self._disk.write(fresh, os.pread(self._descriptor, min(BATCH, self._size - at), at), at)
                self._disk.sync(fresh)
                os.link(copy, self.path)  # unlike a rename, a link never replaces a file
        except OSError:
            self._disk.close(fresh)
            raise
        copy.unlink(missing_ok=True)
        self._disk.close(self._descriptor)
        self._descriptor, self._file = fresh, os.fstat(fresh)
        self._disk.sync_folder(self.path.parent)

    def _reopen(self) -> None:
        """Open the same file again after an error. Network file systems need this."""
        try:
            fresh = self._disk.open(self.path, create=False)
        except OSError:  # the next write reports the error
            return
        stale = fresh
        if os.path.samestat(os.fstat(fresh), self._file):
            stale, self._descriptor = self._descriptor, fresh
        with suppress(OSError):
            self._disk.close(stale)

    def _set_error(self, message: str) -> None:
        if message != self.error:
            self.error = message
            self.on_change()

    def _write_clock(self) -> None:
        with suppress(OSError):  # the next commit reports the error
            self._restore_if_removed()
        if self._now is not None:
            with suppress(OSError):
                os.pwrite(self._clock, b"%-15.3f\n" % self._now(), 0)
