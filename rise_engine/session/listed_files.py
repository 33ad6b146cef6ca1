"""Lists of files that belong to a session (`media.json`, `coded.json`): read as a whole, replaced as a whole, by one
program at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TypeVar

import msgspec

from rise_engine.base.errors import SessionError
from rise_engine.base.files import error_message, sync, take_lock, wait_until, write_whole

WAIT_SECONDS = 10.0
"""How long somebody waits for another program that writes it just now. That takes milliseconds."""
_Item = TypeVar("_Item")


def read_list(path: Path, item: type[_Item]) -> tuple[_Item, ...]:
    """What stands in a list, in its order; nothing when there is no such file.

    :param path: the file.
    :param item: what it holds.
    :raises SessionError: it cannot be read.
    """
    try:
        return tuple(msgspec.json.decode(path.read_bytes(), type=list[item]))  # type: ignore[valid-type]
    except FileNotFoundError:
        return ()
    except OSError as problem:
        raise SessionError(f"{path} cannot be read: {problem.strerror or problem}") from None
    except (msgspec.DecodeError, UnicodeError) as problem:
        raise SessionError(f"{path} is not what was written there: {problem}. Mend it, or move it away") from None


def list_bytes(items: Sequence[object]) -> bytes:
    """A list as it stands in its file."""
    return msgspec.json.format(msgspec.json.encode(items), indent=1) + b"\n"


def change_list(path: Path, item: type[_Item], change: Callable[[list[_Item]], list[_Item]]) -> None:
    """Replace a list by what `change` makes of it, in one step.

    :param path: the file.
    :param item: what it holds.
    :param change: gets what stands there.
    :raises SessionError: it cannot be read or written; then nothing is changed.
    """
    try:
        with _locked(path):
            data = list_bytes(change(list(read_list(path, item))))
            write_whole(path, data)
            sync(path.parent)
    except UnicodeError:
        raise SessionError("a path or name is no text that can be written: give that file another name") from None
    except OSError as problem:
        raise SessionError(f"{path} cannot be written: {error_message(problem)}") from None


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Nobody else changes the list meanwhile. The lock is the folder's own, so that no file is left of it."""
    descriptor = os.open(path.parent, os.O_RDONLY | os.O_CLOEXEC)
    try:
        with suppress(OSError):  # a file system without locks: then the last one who writes wins
            if not wait_until(lambda: take_lock(descriptor), WAIT_SECONDS):
                raise SessionError(f"{path} is held by another program: try again")
        yield
    finally:
        os.close(descriptor)
