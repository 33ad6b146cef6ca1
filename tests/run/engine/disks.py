"""Disks that fail, stall or lie, behind the interface that a journal writes through."""

from __future__ import annotations

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path

from rise_engine.base.files import Disk
from tests.patience import PATIENCE


class FailingDisk(Disk):
    """Counts its calls; `fails(n, what)` says with which errno the n-th fails (None: it works)."""

    def __init__(self, fails: Callable[[int, str], int | None]) -> None:
        self.calls: list[str] = []
        self._fails = fails

    def _call(self, what: str) -> None:
        self.calls.append(what)
        number = self._fails(len(self.calls), what)
        if number is not None:
            raise OSError(number, os.strerror(number))

    def open(self, path: Path, *, create: bool) -> int:
        self._call("open")
        return super().open(path, create=create)

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        try:
            self._call("write")
        except OSError as error:
            if error.errno == errno.ENOSPC:  # a full disk takes a part
                super().write(descriptor, data[: len(data) // 2], offset)
            raise
        super().write(descriptor, data, offset)

    def sync(self, descriptor: int) -> None:
        self._call("sync")
        super().sync(descriptor)


class StallingDisk(Disk):
    """Takes nothing while `stalled` is set, and says when it has begun to wait."""

    def __init__(self) -> None:
        self.go = threading.Event()
        self.go.set()
        self.waits = threading.Event()

    def sync(self, descriptor: int) -> None:
        if not self.go.is_set():
            self.waits.set()
            assert self.go.wait(PATIENCE)
        super().sync(descriptor)


class FullDisk(Disk):
    """Fails with `number` while that is set."""

    def __init__(self, number: int | None = None) -> None:
        self.number = number

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        if self.number is not None:
            raise OSError(self.number, os.strerror(self.number))
        super().write(descriptor, data, offset)
