"""The checksums of a bundle (`manifest-sha256.txt`, in the format of `sha256sum`), and bundles as ZIP files.

RO-Crate 1.1 has no term for a checksum, so they are in a separate file.
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
from rise_engine.scenario.files.study_paths import why_no_name
from rise_engine.session.unfinished_files import erase_unfinished, private_folder
from rise_engine.study.traces import MANIFEST_FILE


class ManifestCheck(Struct):
    """The result of comparing a bundle with its manifest."""

    files: int = 0
    """The number of unchanged files."""
    changed: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    unlisted: list[str] = field(default_factory=list)
    """Files that were added later."""
    unreadable: list[str] = field(default_factory=list)
    """Sentences about invalid lines of the manifest."""

    @property
    def whole(self) -> bool:
        """Whether everything is there, and nothing else."""
        return not (self.changed or self.missing or self.unlisted or self.unreadable)


def files_in(root: Path) -> list[str]:
    """Return every file under a folder as a relative path, in the order of the manifest."""
    return sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())


def manifest_text(root: Path) -> str:
    """Write the manifest of everything in a folder."""
    return "".join(f"{file_hash(root / name)}  {name}\n" for name in files_in(root) if name != MANIFEST_FILE)


def fingerprint(root: Path) -> str:
    """Return the checksum of the checksums. A paper can give it, so that readers recognise the published bundle.

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
"""The limits of a zip file's unpacked contents."""
MAX_RATIO, SMALL_BYTES = 100, 100_000_000
"""The largest ratio of unpacked to packed size, and the size allowed in any case. Session files shrink to a tenth."""
SPARE_BYTES = 100_000_000
"""The bytes that unpacking leaves free on the disk."""
_NAMED = 5
"""The most names that a sentence lists."""
_DATE = (1980, 1, 1, 0, 0, 0)
"""The earliest date that a zip file can have, so that it reveals no real date."""


def write_zip(folder: Path, path: Path) -> None:
    """Write everything in a folder to a new zip file. Raises OSError, FileExistsError."""
    with path.open("xb") as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in files_in(folder):
            entry = zipfile.ZipInfo(name, _DATE)
            entry.external_attr = (stat.S_IFREG | 0o644) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            with (folder / name).open("rb") as source, archive.open(entry, "w") as target:
                shutil.copyfileobj(source, target)


@contextmanager
def opened_bundle(path: Path) -> Iterator[Path]:
    """Give the folder of a bundle for a `with` statement. A zip file is unpacked privately for that time.

    Unpacked bundles that killed programs left are erased first.

    :raises ExportError: it is neither a folder nor a valid zip file, or could do harm.
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
        except FileExistsError as error:
            raise ExportError(f"{path} cannot be unpacked: it holds {Path(error.filename).name} twice") from None
        except OSError as error:
            raise ExportError(f"{path} cannot be unpacked: {error.strerror or error}") from None
        yield folder


def _refuse_links(folder: Path) -> None:
    """Refuse links: a bundle has none, and they could lead to any file of the reader. Raises ExportError."""
    links = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_symlink())
    if links:
        raise ExportError(f"it is not a bundle, because these in it are links: {_some(links)}")


def _some(names: list[str]) -> str:
    return ", ".join(f"`{clean(name)}`" for name in names[:_NAMED]) + ", ..." * (len(names) > _NAMED)


def _check(archive: zipfile.ZipFile, size: int, free: int) -> None:
    """Check the directory of a zip file before unpacking it.

    :param size: the size of the zip file. :param free: the free space on the disk.
    :raises ExportError: it contains too much, or entries that no bundle has; one line for each problem.
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
    """Whether an entry is a file or a folder. Programs other than Unix ones do not record this."""
    return stat.S_IFMT(entry.external_attr >> 16) in (0, stat.S_IFREG, stat.S_IFDIR)


def _megabytes(size: int) -> str:
    return f"{size / 1_000_000:,.1f} MB"


def _unpack(archive: zipfile.ZipFile, folder: Path) -> None:
    """Unpack the checked entries into a folder. No file can become larger than the check has counted."""
    for entry in archive.infolist():
        target = folder / entry.filename
        if entry.is_dir():
            target.mkdir(parents=True, exist_ok=True)
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(entry) as source, target.open("xb") as file:
            shutil.copyfileobj(source, file)
