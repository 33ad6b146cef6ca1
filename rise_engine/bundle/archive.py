"""A bundle as one zip file: the same bytes for the same files, and opened without a file ever leaving its place."""

from __future__ import annotations

import shutil
import stat
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from rise_engine.bundle.errors import BundleError
from rise_engine.bundle.manifest import files_in

MAX_BYTES, MAX_FILES = 20_000_000_000, 1_000_000
"""Of what a zip file may hold when it is unpacked."""
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
    """The folder of a bundle, within a `with` statement; a zip file is unpacked for that long.

    :raises BundleError: it is neither.
    """
    if path.is_dir():
        yield path
        return
    if not path.exists():
        raise BundleError(f"there is no {path}")
    with tempfile.TemporaryDirectory(prefix="rise-bundle-") as name:  # for its owner alone
        folder = Path(name)
        try:
            with zipfile.ZipFile(path) as archive:
                _unpack(archive, folder)
        except (zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
            raise BundleError(f"{path} is no zip file that can be read ({error})") from None
        except OSError as error:
            raise BundleError(f"{path} cannot be unpacked: {error.strerror or error}") from None
        yield folder


def _unpack(archive: zipfile.ZipFile, folder: Path) -> None:
    entries = archive.infolist()
    if len(entries) > MAX_FILES or sum(entry.file_size for entry in entries) > MAX_BYTES:
        raise BundleError("this zip file would unpack to more than any bundle has")
    for entry in entries:
        parts = PurePosixPath(entry.filename).parts
        if entry.filename.startswith("/") or "\\" in entry.filename or ".." in parts or not parts:
            raise BundleError(f"{entry.filename!r} in this zip file would lie outside of it, so it is no bundle")
        if stat.S_ISLNK(entry.external_attr >> 16):
            raise BundleError(f"{entry.filename!r} in this zip file is a link, so it is no bundle")
        target = folder.joinpath(*parts)
        if entry.is_dir():
            target.mkdir(parents=True, exist_ok=True)
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(entry) as source, target.open("xb") as file:
            shutil.copyfileobj(source, file)
