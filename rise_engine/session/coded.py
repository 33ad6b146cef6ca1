"""`coded.json` and `coded/` in a session's folder: annotations that people made in ELAN or BORIS and added.

`coded/` has the unchanged files. `coded.json` relates their time to the session's and names the tiers for tables.
Annotations are read from the files each time.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import make_private_folder, write_private_file
from rise_engine.session.coded_formats import CodedClock, CodedSpan, read_coded_document, replace_words
from rise_engine.session.media import change_list, list_bytes, read_list, with_item

CODED_FILE, CODED_FOLDER = "coded.json", "coded"
MAX_BYTES = 200_000_000
ClockSource: TypeAlias = Literal["file", "media", "given"]
"""How the time of an annotation file was aligned. file: by the clock in the file, which this program wrote; media: by
the annotated recording; given: by a person."""


class CodedFile(Struct, frozen=True, kw_only=True):
    """One annotation file of a session."""

    name: str
    """The file's name in `coded/`."""
    sha256: str
    clock: CodedClock
    clock_by: ClockSource
    tiers: tuple[str, ...]
    """The used tiers."""
    speech: tuple[str, ...] = ()
    """The tiers among them that hold the participant's speech."""
    annotator: str = ""
    """The annotator, where a tier does not name one."""
    observation: str = ""
    """For a BORIS file: the session's observation."""
    added: str = ""
    """ISO 8601 with offset."""
    spans: tuple[CodedSpan, ...] = ()
    """Only in a shared session: the annotations in session seconds, instead of the file."""


def read_coded(folder: Path) -> tuple[CodedFile, ...]:
    """Read the list of a session's annotation files, in the order of their addition.

    :param folder: the session's folder.
    :raises SessionError: coded.json cannot be read.
    """
    return read_list(folder / CODED_FILE, CodedFile)


def read_spans(folder: Path, file: CodedFile) -> list[CodedSpan]:
    """Read the annotations of one file, in session seconds.

    :param folder: the session's folder.
    :param file: the file's entry in coded.json.
    :raises SessionError: the file cannot be read, or has changed since it was added.
    """
    if not file.sha256:
        return list(file.spans)
    path = folder / CODED_FOLDER / file.name
    data = read_bytes(path)
    if hashlib.sha256(data).hexdigest() != file.sha256:
        raise SessionError(f"{path} was changed since it was added: rise-engine coded add {folder.name} {path}")
    document = read_coded_document(file.name, data, file.observation, folder.name)
    return [
        replace(file.clock.span_to_session(each), annotator=each.annotator or file.annotator)
        for each in document.spans
        if each.tier in file.tiers
    ]


def read_bytes(path: Path) -> bytes:
    """Read an annotation file. Raises SessionError."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise SessionError(f"{path} is larger than {MAX_BYTES // 1_000_000} MB, which no annotation file is")
        return path.read_bytes()
    except OSError as error:
        raise SessionError(f"{path} cannot be read: {error.strerror or error}") from None


def add_coded(folder: Path, file: CodedFile, data: bytes) -> bool:
    """Copy an annotation file into a session's folder. It replaces a file of the same name.

    :param folder: the session's folder.
    :param file: the file's entry for coded.json.
    :param data: the file's contents.
    :return: whether it replaced a file.
    :raises SessionError: it cannot be written.
    """

    def put(files: list[CodedFile]) -> list[CodedFile]:
        make_private_folder(folder / CODED_FOLDER)
        write_private_file(folder / CODED_FOLDER / file.name, data)
        return with_item(files, file, "name")

    return bool(change_list(folder / CODED_FILE, CodedFile, put))


def remove_coded(folder: Path, name: str) -> None:
    """Delete an annotation file of a session.

    :param folder: the session's folder.
    :param name: the file's name.
    :raises SessionError: there is no file of that name, or it cannot be deleted.
    """

    def take_out(files: list[CodedFile]) -> list[CodedFile]:
        if not any(each.name == name for each in files):
            listed = ", ".join(each.name for each in files) or "none"
            raise SessionError(f"{folder.name} has no annotation file {name}; it has {listed}")
        (folder / CODED_FOLDER / name).unlink(missing_ok=True)
        return [each for each in files if each.name != name]

    change_list(folder / CODED_FILE, CodedFile, take_out)


def coded_paths(folder: Path) -> list[Path]:
    """Return the paths of coded.json and its files; empty: there are none."""
    try:
        files = read_coded(folder)
    except SessionError:
        return []
    theirs = (folder / CODED_FOLDER / each.name for each in files if each.sha256)
    return [folder / CODED_FILE, *theirs] if files else []


def redacted_files(folder: Path, change: Callable[[str], str]) -> dict[Path, bytes]:
    """Return the new contents of the annotation files and coded.json that a change of texts affects.

    :param folder: the session's folder.
    :param change: maps an old text to a new one.
    :raises SessionError: one of them cannot be read.
    """
    found: dict[Path, bytes] = {}
    files: list[CodedFile] = []
    before = read_coded(folder)
    for file in before:
        path = folder / CODED_FOLDER / file.name
        if not file.sha256:
            files.append(_redacted(file, None, change))
            continue
        data = read_bytes(path)
        if (new := replace_words(file.name, data, change)) != data:
            found[path] = new
        files.append(_redacted(file, found.get(path), change))
    if files != list(before):
        found[folder / CODED_FILE] = list_bytes(files)
    return found


def _redacted(file: CodedFile, data: bytes | None, change: Callable[[str], str]) -> CodedFile:
    return replace(
        file,
        tiers=tuple(map(change, file.tiers)),
        speech=tuple(map(change, file.speech)),
        annotator=change(file.annotator),
        observation=change(file.observation),
        spans=tuple(
            replace(each, tier=change(each.tier), value=change(each.value), comment=change(each.comment))
            for each in file.spans
        ),
        sha256=file.sha256 if data is None else hashlib.sha256(data).hexdigest(),
    )
