"""The check sums of a bundle: `manifest-sha256.txt`, as `sha256sum` writes and checks it.

The metadata of an RO-Crate 1.1 have no word for a check sum, so they stand in a file of their own.
"""

from __future__ import annotations

from pathlib import Path

from msgspec import Struct, field

from rise_engine.base.files import file_hash
from rise_engine.scenario.study_paths import why_no_name
from rise_engine.study.traces import MANIFEST_FILE


class ManifestCheck(Struct):
    """What a bundle is, compared with its manifest."""

    files: int = 0
    """How many are as they were."""
    changed: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    unlisted: list[str] = field(default_factory=list)
    """Files that were put into it since."""
    unreadable: list[str] = field(default_factory=list)
    """Lines of the manifest that are none, in sentences."""

    @property
    def whole(self) -> bool:
        """Whether everything is there, and nothing else."""
        return not (self.changed or self.missing or self.unlisted or self.unreadable)


def files_in(root: Path) -> list[str]:
    """Every file under a folder, as paths from there on, in the order of the manifest."""
    return sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())


def manifest_text(root: Path) -> str:
    """The manifest of everything that lies in a folder now."""
    return "".join(f"{file_hash(root / name)}  {name}\n" for name in files_in(root) if name != MANIFEST_FILE)


def fingerprint(root: Path) -> str:
    """The check sum of the check sums: who has it from a paper knows whether a bundle is the one that was published.

    :raises OSError: there is no manifest.
    """
    return file_hash(root / MANIFEST_FILE)


def check_manifest(root: Path) -> ManifestCheck:
    """Compare a bundle with its manifest. Raises OSError."""
    check = ManifestCheck()
    listed: dict[str, str] = {}
    for number, line in enumerate((root / MANIFEST_FILE).read_text("utf-8", "replace").splitlines(), start=1):
        digest, blanks, name = line.partition("  ")
        if not blanks or len(digest) != 64 or why_no_name(name, None):
            check.unreadable.append(f"line {number} of {MANIFEST_FILE} is no check sum of a file in here")
        else:
            listed[name] = digest
    present = set(files_in(root)) - {MANIFEST_FILE}
    check.missing = sorted(set(listed) - present)
    check.unlisted = sorted(present - set(listed))
    for name in sorted(set(listed) & present):
        if file_hash(root / name) == listed[name]:
            check.files += 1
        else:
            check.changed.append(name)
    return check
