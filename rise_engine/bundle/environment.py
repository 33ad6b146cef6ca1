"""With what a bundle was made: `environment.txt`."""

from __future__ import annotations

import hashlib
import platform
import re
from importlib.metadata import Distribution, PackageNotFoundError, distribution

from rise_engine import __version__

ENVIRONMENT_FILE = "environment.txt"
_NAME = re.compile(r"[A-Za-z0-9._-]+")


def environment_text(recorded: dict[str, set[str]]) -> str:
    """Versions of the program, of Python and of every package that the program needs, each with the SHA-256 of the
    list of its files, so that somebody can tell whether theirs is the same.

    :param recorded: the versions that the sessions name, of each program.
    """
    lines = [
        "# The bundle was made with",
        f"rise-tui=={__version__}",
        f"# Python {platform.python_version()}, {platform.system()} {platform.machine()}",
    ]
    lines += [_package_line(each) for each in _needed("rise-tui")]
    lines += ["", "# The sessions were recorded with"]
    lines += [f"# {name} {', '.join(sorted(versions))}" for name, versions in sorted(recorded.items())]
    return "\n".join([*lines, ""])


def _package_line(package: Distribution) -> str:
    files = package.read_text("RECORD")
    found = f"  # files: sha256:{hashlib.sha256(files.encode()).hexdigest()}" if files else ""
    return f"{package.metadata['Name']}=={package.version}{found}"


def _needed(name: str) -> list[Distribution]:
    """What a package needs, and what that needs, without extras, by name."""
    found: dict[str, Distribution] = {}
    waiting = [name]
    while waiting:
        try:
            package = distribution(waiting.pop())
        except PackageNotFoundError:
            continue
        for requirement in package.requires or ():
            wanted = _NAME.match(requirement)
            if wanted is None or "extra ==" in requirement:
                continue
            key = wanted[0].lower().replace("_", "-")
            if key not in found and key != name:
                try:
                    found[key] = distribution(key)
                except PackageNotFoundError:  # for another system
                    continue
                waiting.append(key)
    return [found[key] for key in sorted(found)]
