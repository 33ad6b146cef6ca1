"""Writing a journal: a thread of its own makes lines durable, as many at a time as have come (natural group commit).

The engine hands over and goes on; it is told when what it handed over is on the disk. When the disk fails, nothing is
dropped: the thread tries again, each time with a freshly opened file and all that was not yet known to be durable,
because a synchronisation that failed once proves nothing when it succeeds later. As long as a journal is open it is
locked (`rise_engine.session.lock`), also when its file has been opened or written anew.
"""

from __future__ import annotations

import errno
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue

from rise_engine.base.files import Disk, error_message
from rise_engine.session.lock import JournalLock

RETRY_SECONDS = 1.0
"""How long after a failure the disk is tried again."""
CLOCK_SECONDS = 1.0
"""How often the session's time is noted in the file `clock`, which says how late it was when an engine vanished."""
BATCH = 4_000_000
"""Bytes after which a batch is written although more is waiting."""


class Journal:
    """The journal of a running session. Everything but the thread belongs to the engine's thread."""

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
        """`size`: 0 makes a new file, else an existing one goes on there. `lock`: of an existing one, for who has taken
        it before; the journal's from now on. Raises OSError, and SessionError when it cannot be locked.

        `changed` is called on the writer's thread whenever `durable` or `error` has changed; it must not block.
        `now` gives the session's time in seconds, noted in the file `clock`.
        """
        self.path = path
        self.on_change = changed
        self.error = ""
        """Why nothing becomes durable at the moment, for a person; empty while all is well."""
        self.durable = 0
        """How many of the `append`s are on the disk."""
        self.appended = 0
        self._now = now
        self._disk = disk or Disk()
        self._retry = retry
        self._size = size
        self._queue: SimpleQueue[bytes | None] = SimpleQueue()
        self._last_progress = 0.0
        """When something became durable, or began to wait after all was (monotonic clock)."""
        self._last_seen_in_place = 0.0
        """When the file was last seen in its place."""
        self._give_up = threading.Event()
        self._descriptor = self._disk.open(path, create=size == 0)
        self._file = os.fstat(self._descriptor)
        """Which file it is, also when it can no longer be asked."""
        self.lock = lock or JournalLock(path)
        if size == 0:
            self._disk.sync_folder(path.parent)
        self._clock = os.open(path.with_name("clock"), os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
        self._thread = threading.Thread(target=self._run, name="rise-journal", daemon=True)
        self._thread.start()

    def append(self, lines: bytes) -> int:
        """Hand over whole lines; they are durable when `durable` has reached the number that this returns."""
        if self.durable == self.appended:
            self._last_progress = time.monotonic()
        self.appended += 1
        self._queue.put(lines)
        return self.appended

    @property
    def lag(self) -> float:
        """Seconds for which something waits and nothing has become durable; 0 when nothing waits."""
        return 0.0 if self.durable == self.appended else time.monotonic() - self._last_progress

    def close(self, timeout: float = 5.0) -> bool:
        """Wait (blocking) until all is durable. False when the disk did not take it within `timeout` seconds."""
        self._queue.put(None)
        self._thread.join(timeout)
        self._give_up.set()
        self._thread.join(1.0)
        if not self._thread.is_alive():  # else it may still write: the lock goes with the process
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
        """True when it is durable; False when the engine cannot wait any longer."""
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
        """A file that somebody has removed takes everything, and then nothing is left of it: write it anew.

        Looked at once a second and not at each commit: what was written meanwhile is still in the removed file.
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
                os.link(copy, self.path)  # unlike a renaming, this never puts itself in the place of another file
        except OSError:
            self._disk.close(fresh)
            raise
        copy.unlink(missing_ok=True)
        self._disk.close(self._descriptor)
        self._descriptor, self._file = fresh, os.fstat(fresh)
        self._disk.sync_folder(self.path.parent)

    def _reopen(self) -> None:
        """Take the file in hand anew after an error, as network file systems want it; never another file."""
        try:
            fresh = self._disk.open(self.path, create=False)
        except OSError:  # the next write says what is wrong
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
        with suppress(OSError):  # the next commit says what is wrong
            self._restore_if_removed()
        if self._now is not None:
            with suppress(OSError):
                os.pwrite(self._clock, b"%-15.3f\n" % self._now(), 0)
