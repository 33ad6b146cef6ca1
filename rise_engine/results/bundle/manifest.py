"""The check sums of a bundle (`manifest-sha256.txt`, as `sha256sum` writes and checks it), and a bundle as a ZIP.

The metadata of an RO-Crate 1.1 have no word for a check sum, so they stand in a file of their own.
"""

from __future__ import annotations

import shutil
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from msgspec import Struct, field

from rise_engine.base.files import file_hash
from rise_engine.base.text import clean
from rise_engine.results.export.format import ExportError
from rise_engine.scenario.study_paths import why_no_name
from rise_engine.session.unfinished_files import erase_unfinished, private_folder
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
            check.unreadable.append(f"line {number} of {MANIFEST_FILE} is not the check sum of a file in the bundle")
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


MAX_BYTES, MAX_FILES = 20_000_000_000, 200_000
"""Of what a zip file may hold when it is unpacked."""
MAX_RATIO, SMALL_BYTES = 100, 100_000_000
"""How many times its own size a zip file may hold, and how much it may hold in any case. What sessions write becomes a
tenth of its size."""
SPARE_BYTES = 100_000_000
"""What unpacking leaves free on the disk."""
_NAMED = 5
"""Names that a sentence shows."""
_DATE = (1980, 1, 1, 0, 0, 0)
"""The first that a zip file can say: it tells nobody when something was."""


def write_zip(folder: Path, path: Path) -> None:
    """Put everything in a folder into a new zip file. Raises OSError, FileExistsError."""
    with path.open("xb") as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in files_in(folder):
            entry = zipfile.ZipInfo(name, _DATE)
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            with (folder / name).open("rb") as source, archive.open(entry, "w") as target:
                shutil.copyfileobj(source, target)


@contextmanager
def opened_bundle(path: Path) -> Iterator[Path]:
    """The folder of a bundle, within a `with` statement; a zip file is unpacked for that long, for its owner alone.

    What a killed program has left of one that was unpacked is erased first.

    :raises ExportError: it is neither, or would do harm.
    """
    beside = Path(tempfile.gettempdir(), "rise-bundle")
    if path.is_dir():
        erase_unfinished(beside)
        _refuse_links(path)
        yield path
        return
    if not path.exists():
        raise ExportError(f"there is no {path}")
    with ExitStack() as stack:
        try:
            archive = stack.enter_context(zipfile.ZipFile(path))
            folder = stack.enter_context(private_folder(beside))
            _check(archive, path.stat().st_size, shutil.disk_usage(folder).free)
            _unpack(archive, folder)
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
            raise ExportError(f"{path} is not a zip file that can be read ({error})") from None
        except OSError as error:
            raise ExportError(f"{path} cannot be unpacked: {error.strerror or error}") from None
        yield folder


def _refuse_links(folder: Path) -> None:
    """A bundle has none, and one could lead to any file of whoever reads it. Raises ExportError."""
    links = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_symlink())
    if links:
        raise ExportError(f"it is not a bundle, because these in it are links: {_some(links)}")


def _some(names: list[str]) -> str:
    return ", ".join(f"`{clean(name)}`" for name in names[:_NAMED]) + ", ..." * (len(names) > _NAMED)


def _check(archive: zipfile.ZipFile, size: int, free: int) -> None:
    """Look at what a zip file says that it holds, before any of it is unpacked.

    :param size: how large it is. :param free: how much room there is.
    :raises ExportError: it holds what no bundle has, or too much; all that is wrong, a line for each.
    """
    entries = archive.infolist()
    total = sum(entry.file_size for entry in entries)
    problems = []
    if len(entries) > MAX_FILES:
        problems.append(f"it holds {len(entries):,} files, and a bundle has at most {MAX_FILES:,}")
    if total > MAX_BYTES or total > max(MAX_RATIO * size, SMALL_BYTES):
        problems.append(
            f"it is {_megabytes(size)} and would become {_megabytes(total)}: more than any bundle, so it is not one"
        )
    elif total + SPARE_BYTES > free:
        problems.append(
            f"it needs {_megabytes(total)} to be unpacked, and the disk has {_megabytes(free)} left; make room, or set "
            "TMPDIR to a folder on another disk"
        )
    elsewhere = [entry.filename for entry in entries if why_no_name(entry.filename, None)]
    other = [entry.filename for entry in entries if not _is_plain(entry)]
    for names, what in ((elsewhere, "would lie outside of it, or be hidden"), (other, "are links, or no files")):
        if names:
            problems.append(f"it is not a bundle, because these in it {what}: {_some(names)}")
    if problems:
        raise ExportError(*problems)


def _is_plain(entry: zipfile.ZipInfo) -> bool:
    """A file or a folder; programs that are not of Unix say nothing about it."""
    return stat.S_IFMT(entry.external_attr >> 16) in (0, stat.S_IFREG, stat.S_IFDIR)


def _megabytes(size: int) -> str:
    return f"{size / 1_000_000:,.1f} MB"


def _unpack(archive: zipfile.ZipFile, folder: Path) -> None:
    """What was checked, into a folder. Of each file only as much comes as the check has counted."""
    for entry in archive.infolist():
        target = folder / entry.filename
        if entry.is_dir():
            target.mkdir(parents=True, exist_ok=True)
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(entry) as source, target.open("xb") as file:
            shutil.copyfileobj(source, file)
