"""What has been worked out of contents of files, kept until too much is kept."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

Made = TypeVar("Made")
_MOST = 3_000_000
"""Bytes of files of which something is kept; what is made of a file takes some twenty times as much as the file."""


class ContentCache(Generic[Made]):
    """Remembers what was made of files' contents, the last ones asked for, within a limit of bytes of these contents.

    >>> cache = ContentCache(most=5)
    >>> [cache.get(word, len(word), word.upper) for word in ("abc", "abc", "defg")]
    ['ABC', 'ABC', 'DEFG']
    >>> len(cache)
    1
    """

    def __init__(self, most: int = _MOST) -> None:
        self.most = most
        self._kept: OrderedDict[Hashable, tuple[int, Made]] = OrderedDict()
        self._size = 0
        self._lock = Lock()  # a study is checked beside the console's loop

    def __len__(self) -> int:
        return len(self._kept)

    def get(self, key: Hashable, size: int, make: Callable[[], Made]) -> Made:
        """What was made for a key, or is made now.

        :param size: bytes of what it is made of. :param make: what it raises goes on to the caller, and is not kept.
        """
        with self._lock:
            found = self._kept.get(key)
            if found is not None:
                self._kept.move_to_end(key)
                return found[1]
        made = make()
        with self._lock:
            if key not in self._kept:
                self._kept[key] = size, made
                self._size += size
            while self._size > self.most and len(self._kept) > 1:
                _, (gone, _) = self._kept.popitem(last=False)
                self._size -= gone
        return made
