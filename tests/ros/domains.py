"""A ROS domain that nobody else on this machine uses while this process runs: no test meets another one's nodes."""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path

_held: list[int] = []


def own_domain() -> int:
    """The first of those whose ports are surely free (up to 101) that no other test run holds."""
    for domain in range(1, 102):
        path = Path(tempfile.gettempdir(), f"rise-test-domain-{domain}-{os.getuid()}")
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            continue
        _held.append(descriptor)
        return domain
    raise RuntimeError("101 test runs use all domains")
