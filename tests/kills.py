"""Work that is killed with SIGKILL at its n-th touch of the disk, in a process of its own."""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

from rise_engine.base.files import Disk
from tests.chance import SEARCH

_EVENTS = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.link", "os.truncate", "os.chmod")


class CountingDisk(Disk):
    """Tells of each write and each synchronisation."""

    def __init__(self, touch: Callable[[], None]) -> None:
        self.touch = touch

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        self.touch()
        half = len(data) // 2
        super().write(descriptor, data[:half], offset)
        self.touch()  # in the middle of a write
        super().write(descriptor, data[half:], offset + half)

    def sync(self, descriptor: int) -> None:
        self.touch()
        super().sync(descriptor)


def is_killed(folder: Path, touches: int, work: Callable[[Disk], object]) -> bool:
    """Do the work in a forked process, and kill that when it touches something in `folder` for the n-th time. Whether
    it was; false when it was done before. The work must not fail."""
    child = os.fork()
    if not child:
        _run_and_die(folder, touches, work)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return True
    assert os.WEXITSTATUS(status) == 0, "the work failed; its traceback is on standard error"
    return False


def every_kill(
    folder: Path, make: Callable[[], object], work: Callable[[Disk], object], every: int = 6
) -> Iterator[int]:
    """Make the folder anew and kill the work at its first touch, its second, and so on, until it is done before.

    `./dev test` kills it at one touch of six, or of `every`, `./dev soak --search` at each.
    """
    for touches in count(1, 1 if SEARCH else every):
        make()
        if not is_killed(folder, touches, work):
            return
        yield touches


def _run_and_die(folder: Path, touches: int, work: Callable[[Disk], object]) -> None:
    left = touches
    root = str(folder)

    def touch() -> None:
        nonlocal left
        left -= 1
        if not left:
            os.kill(os.getpid(), signal.SIGKILL)

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        if event in _EVENTS and arguments and str(arguments[0]).startswith(root):
            touch()

    sys.addaudithook(hook)
    try:
        work(CountingDisk(touch))
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    os._exit(0)
