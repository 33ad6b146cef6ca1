"""Lengths of time and sizes as people write them in study.toml: `30 d`, `10 y`, `20 GB`."""

from __future__ import annotations

import re

_QUANTITY = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([A-Za-z]+)\s*\Z", re.ASCII)
DAY = 86_400.0
"""Seconds."""
TIME_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": DAY, "w": 7 * DAY, "y": 365.25 * DAY}
SIZE_UNITS = {"kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
_SIZES = {name.casefold(): factor for name, factor in SIZE_UNITS.items()}


def parse_length(text: str) -> float | None:
    """Seconds of a length of time as it is written; None when it is none.

    >>> parse_length("30 d"), parse_length("90min"), parse_length("a while")
    (2592000.0, 5400.0, None)
    """
    found = _QUANTITY.match(text)
    if found is None or found.group(2) not in TIME_UNITS:
        return None
    return float(found.group(1)) * TIME_UNITS[found.group(2)]


def parse_size(text: str) -> int | None:
    """Bytes of a size as it is written; None when it is none.

    >>> parse_size("20 GB"), parse_size("1.5gb"), parse_size("much")
    (20000000000, 1500000000, None)
    """
    found = _QUANTITY.match(text)
    if found is None or found.group(2).casefold() not in _SIZES:
        return None
    return round(float(found.group(1)) * _SIZES[found.group(2).casefold()])
