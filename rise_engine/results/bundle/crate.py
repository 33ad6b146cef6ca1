"""The metadata of a bundle, its checksums, and bundles as ZIP files.

The metadata is RO-Crate 1.1 with Process Run Crate 0.5, one JSON-LD file. Each session is a CreateAction, with the
program as instrument, design and scenario as inputs, the record as result. RO-Crate 1.1 has no term for checksums, so
these are in a separate file, `manifest-sha256.txt`, in the format of `sha256sum`.

https://www.researchobject.org/ro-crate/specification/1.1/
https://www.researchobject.org/workflow-run-crate/profiles/0.5/process_run_crate/
"""

from __future__ import annotations

import json
import shutil
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeAlias

from msgspec import Struct, field

from rise_engine import __version__
from rise_engine.base.files import file_hash
from rise_engine.base.text import clean
from rise_engine.results.analysis.model import SessionFacts
from rise_engine.results.export.format import ExportError
from rise_engine.scenario.files.study_paths import why_no_name
from rise_engine.session.unfinished_files import erase_unfinished, private_folder
from rise_engine.study.publishing import ORCID, Author, license_url
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
        """Whether all listed files are there, unchanged, and no others."""
        return not (self.changed or self.missing or self.unlisted or self.unreadable)


def files_in(root: Path) -> list[str]:
    """Return every file under a folder as a relative path, in the order of the manifest."""
    return sorted(path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())


def manifest_text(root: Path) -> str:
    """Write the manifest of everything in a folder."""
    return "".join(f"{file_hash(root / name)}  {name}\n" for name in files_in(root) if name != MANIFEST_FILE)


def fingerprint(root: Path) -> str:
    """Return the checksum of the manifest. A paper can state it, so that readers recognise the published bundle.

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
"""The maximum ratio of unpacked to packed size, and the size that is always allowed. Session files reach 10."""
SPARE_BYTES = 100_000_000
"""The free bytes on the disk that unpacking must leave."""
_NAMED = 5
"""Maximum number of names that a sentence lists."""
_DATE = (1980, 1, 1, 0, 0, 0)
"""The earliest date that a zip file allows; it reveals no real date."""


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
    """Refuse links: no bundle has any, and they could lead to any file of the reader. Raises ExportError."""
    links = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_symlink())
    if links:
        raise ExportError(f"it is not a bundle, because these in it are links: {_some(links)}")


def _some(names: list[str]) -> str:
    return ", ".join(f"`{clean(name)}`" for name in names[:_NAMED]) + ", ..." * (len(names) > _NAMED)


def _check(archive: zipfile.ZipFile, size: int, free: int) -> None:
    """Check the directory of a zip file before unpacking it.

    :param size: the size of the zip file. :param free: the free space on the disk.
    :raises ExportError: it is too large, or has entries that no bundle has; one line for each problem.
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
    """Whether an entry is a file or a folder. Only Unix programs record this."""
    return stat.S_IFMT(entry.external_attr >> 16) in (0, stat.S_IFREG, stat.S_IFDIR)


def _megabytes(size: int) -> str:
    return f"{size / 1_000_000:,.1f} MB"


def _unpack(archive: zipfile.ZipFile, folder: Path) -> None:
    """Unpack the checked entries into a folder. No file can become larger than checked."""
    for entry in archive.infolist():
        target = folder / entry.filename
        if entry.is_dir():
            target.mkdir(parents=True, exist_ok=True)
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(entry) as source, target.open("xb") as file:
            shutil.copyfileobj(source, file)


METADATA = "ro-crate-metadata.json"
CRATE = "https://w3id.org/ro/crate/1.1"
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"
PROGRAM = "#rise-tui"
Entity: TypeAlias = dict[str, Any]
_DESCRIPTOR: Entity = {
    "@id": METADATA,
    "@type": "CreativeWork",
    "conformsTo": {"@id": CRATE},
    "about": {"@id": "./"},
}
_PROFILE: Entity = {"@id": PROFILE, "@type": "CreativeWork", "name": "Process Run Crate", "version": "0.5"}
_PROGRAM: Entity = {
    "@id": PROGRAM,
    "@type": "SoftwareApplication",
    "name": "rise-tui",
    "description": "Runs human-robot interaction studies from a terminal",
    "softwareVersion": __version__,
}
_FORMATS = {
    ".R": "text/x-r",
    ".csv": "text/csv",
    ".html": "text/html",
    ".json": "application/json",
    ".jsonl": "application/jsonl",
    ".md": "text/markdown",
    ".sps": "text/plain",
    ".toml": "application/toml",
    ".tsv": "text/tab-separated-values",
    ".txt": "text/plain",
    ".whl": "application/zip",
    ".xml": "application/xml",
}


class CrateSession(Struct, frozen=True):
    """A session in a bundle."""

    facts: SessionFacts
    folder: str
    """Relative to the bundle. Empty: the session is only in the exports."""


class CrateContents(Struct, frozen=True):
    """The facts for the metadata."""

    name: str
    description: str
    published: str
    """The date in ISO 8601."""
    license: str
    """An SPDX id, a URL, or empty: see the file LICENSE."""
    authors: tuple[Author, ...]
    funding: str
    """The funder as written by people. Empty: not given."""
    sessions: tuple[CrateSession, ...]
    inputs: tuple[str, ...]
    """Files and folders from which all sessions were run, relative to the bundle: the design, the scenarios."""


def metadata_text(root: Path, contents: CrateContents) -> str:
    """Write the metadata of everything in a bundle's folder as JSON."""
    graph = [_DESCRIPTOR, *_dataset(root, contents), *_license(contents), _PROFILE, _PROGRAM]
    graph += [
        {"@id": _author_id(number, each), "@type": "Person", "name": each.name}
        for number, each in enumerate(contents.authors, 1)
    ]
    if contents.funding:
        graph.append({"@id": "#funder", "@type": "Organization", "name": contents.funding})
    graph.append({"@id": "#team", "@type": "Organization", "name": "The people who ran the study"})
    graph += [_run_of(session, contents) for session in contents.sessions]
    return json.dumps({"@context": f"{CRATE}/context", "@graph": graph}, indent=2, ensure_ascii=False) + "\n"


def _dataset(root: Path, contents: CrateContents) -> list[Entity]:
    """Describe the bundle, its folders and its files."""
    files = [name for name in files_in(root) if name != METADATA]
    folders = sorted({f"{parent.as_posix()}/" for name in files for parent in Path(name).parents if parent.name})
    url = license_url(contents.license)
    dataset: Entity = {
        "@id": "./",
        "@type": "Dataset",
        "name": contents.name,
        "description": contents.description,
        "datePublished": contents.published,
        "license": {"@id": url or "LICENSE"},
        "conformsTo": {"@id": PROFILE},
        "hasPart": [{"@id": name} for name in [*folders, *files]],
        "mentions": _one_or_all([{"@id": _run_id(each)} for each in contents.sessions]),
    }
    if contents.authors:
        dataset["author"] = _one_or_all(
            [{"@id": _author_id(number, each)} for number, each in enumerate(contents.authors, 1)]
        )
    if contents.funding:
        dataset["funder"] = {"@id": "#funder"}
    entities: list[Entity] = [dataset]
    for folder in folders:
        entities.append({"@id": folder, "@type": "Dataset", "name": folder.rstrip("/")})
    for name in files:
        path = root / name
        entity: Entity = {
            "@id": name,
            "@type": "File",
            "name": name,
            "contentSize": str(path.stat().st_size),
        }
        if form := _FORMATS.get(path.suffix):
            entity["encodingFormat"] = form
        elif not path.suffix:
            entity["encodingFormat"] = "text/plain"
        entities.append(entity)
    return entities


def _author_id(number: int, author: Author) -> str:
    return ORCID + author.orcid if author.orcid else f"#author-{number}"


def _license(contents: CrateContents) -> list[Entity]:
    url = license_url(contents.license)
    if not url:
        return []
    return [
        {
            "@id": url,
            "@type": "CreativeWork",
            "name": contents.license,
            "description": f"The licence of this bundle: {contents.license}",
        }
    ]


def _run_of(session: CrateSession, contents: CrateContents) -> Entity:
    facts = session.facts
    outcome = facts.outcome or ("complete" if facts.ended else "aborted")
    about = ", ".join(filter(None, [facts.participant, facts.condition, f"{facts.duration:.0f} s", outcome]))
    action: Entity = {
        "@id": _run_id(session),
        "@type": "CreateAction",
        "name": f"Session {facts.session}",
        "description": f"A session with a robot ({facts.robot or 'unknown'}): {about}",
        "instrument": {"@id": PROGRAM},
        "agent": {"@id": "#team"},
        "object": _one_or_all([{"@id": each} for each in contents.inputs]),
        "actionStatus": f"http://schema.org/{'Failed' if outcome == 'aborted' else 'Completed'}ActionStatus",
    }
    if session.folder:
        action["result"] = {"@id": session.folder}
    if outcome == "aborted":
        action["error"] = facts.outcome_reason or "the session was broken off"
    if facts.started:
        action["startTime"] = facts.started
    return action


def _one_or_all(entities: list[Entity]) -> Entity | list[Entity]:
    """Return a list in compact JSON-LD: a single entity is not in a list."""
    return entities[0] if len(entities) == 1 else entities


def _run_id(session: CrateSession) -> str:
    return f"#session-{session.facts.session}"
