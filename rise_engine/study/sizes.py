"""Sizes of files and disks, as people write them (`min = "20 GB"` of a check) and read them."""

from __future__ import annotations

import re

_SIZE = re.compile(r"\s*(\d{1,9}(?:\.\d{1,6})?)\s*([kKMGT]?i?B)\s*\Z", re.ASCII)
_PREFIXES = {"": 0, "k": 1, "m": 2, "g": 3, "t": 4}
DEFAULT_SPACE = 1_000_000_000
"""Bytes that must be free where `disk` does not say how many."""


def parse_size(text: str) -> int:
    """The bytes of a size as people write it: kB, MB, GB and TB by the thousand, KiB to TiB by 1024.

    :raises ValueError: it is none, or it is 0; the text is a sentence.

    >>> parse_size("20 GB"), parse_size("1.5GiB")
    (20000000000, 1610612736)
    """
    found = _SIZE.match(text)
    if found is not None:
        unit = found[2].lower()
        binary = unit.endswith("ib")
        size = int(float(found[1]) * (1024 if binary else 1000) ** _PREFIXES[unit.removesuffix("ib").removesuffix("b")])
        if size > 0 and unit != "ib":
            return size
    raise ValueError(f'"{text}" is no size; a number with MB, GB or TB is expected, such as "20 GB"')


def size_text(size: float) -> str:
    """Bytes in words: `34.1 GB`.

    >>> size_text(34_123_000_000), size_text(999)
    ('34.1 GB', '999 bytes')
    """
    if size < 1000:
        return f"{size:g} bytes"
    for unit in ("kB", "MB", "GB"):
        size /= 1000
        if size < 1000:
            return f"{size:.1f} {unit}"
    return f"{size / 1000:.1f} TB"
