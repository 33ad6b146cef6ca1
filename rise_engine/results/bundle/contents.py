"""The files of a bundle besides its sessions: the study's files, and the program with its environment.

The program is a wheel in `program/`. `environment.txt` has the versions of all its dependencies.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import platform
import re
import shutil
import subprocess
import tomllib
import zipfile
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from msgspec import Struct

from rise_engine import __version__
from rise_engine.base.files import make_private_folder
from rise_engine.base.json_codec import JsonError, decode, encode
from rise_engine.privacy.levels import ExportLevel, LevelFilter, cut_age, without_dates_and_places
from rise_engine.results.export.format import ExportError
from rise_engine.study.checks import AUTOMATIC
from rise_engine.study.model import Participant, Study
from rise_engine.study.study_log import WITHDRAWN_PREFIX, LogEntry
from rise_engine.study.study_scenarios import scenario_folder
from rise_engine.study.traces import is_withdrawn, without_salts
from rise_engine.study.withdrawal_work import EXPORTED

HIDDEN_DATE = "1900-01-01"
"""Replaces the date of a consent if the level hides dates. No real consent has this date."""
_TABLE = re.compile(r"^\s*\[wizards\]")
_NEXT_TABLE = re.compile(r"^\s*\[")
_INLINE = re.compile(r"^\s*wizards\s*[.=]")
_DATE = re.compile(r"^\d{4}-\d{2}-\d{2}_\d{6}_")


def study_text(text: str, people: Mapping[str, str], level: ExportLevel) -> str:
    """Return study.toml, at levels below full without the names of wizards.

    :param text: its text.
    :param people: the code of each wizard in the bundle, by name.
    :raises ExportError: the names cannot be removed.
    """
    if level == "full" or "wizards" not in tomllib.loads(text):
        return text
    kept: list[str] = []
    within = False
    for line in text.splitlines(keepends=True):
        within = bool(_TABLE.match(line)) or (within and not _NEXT_TABLE.match(line))
        if not within and not _INLINE.match(line):
            kept.append(line)
    new = "".join(kept).rstrip("\n") + "\n"
    names = dict.fromkeys(people.values())
    if names:
        new += "\n[wizards]\n" + "".join(f'"{name}" = "{name}"\n' for name in names)
    try:
        before, after = tomllib.loads(text), tomllib.loads(new)
    except tomllib.TOMLDecodeError:  # the names are still in it
        before, after = {}, {"wizards": {}}
    if before | {"wizards": {}} != after | {"wizards": {}} or not before:
        raise ExportError(
            "the names of wizards in study.toml cannot be taken out: write [wizards] as a table of its own"
        )
    return new


def participants_text(study: Study, people: Iterable[Participant], level: ExportLevel) -> str:
    """Write participants.csv without comments, at levels below full also without dates and ages above 89."""
    consents = [f"consent_{name}" for name in study.consent]
    columns = ["participant", *study.strata, *consents, "status", *study.columns]
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(columns)
    for person in people:
        given = [person.consent.get(name, "") for name in study.consent]
        further = [person.columns.get(name, "") for name in study.columns]
        if level != "full":  # as in BIDS
            further = [cut_age(name, value) for name, value in zip(study.columns, further, strict=True)]
        rows.writerow(
            [
                person.participant,
                *(person.strata.get(name, "") for name in study.strata),
                *(each if level == "full" or not each else HIDDEN_DATE for each in given),
                person.status,
                *further,
            ]
        )
    return text.getvalue()


def log_text(log: Iterable[LogEntry], names: Mapping[str, str], people: Mapping[str, str], level: ExportLevel) -> str:
    """Write study.jsonl without salts, and without lines about withdrawn participants. An earlier version of the
    program wrote such lines when one of their sessions was restored.

    Levels below full also lack dates, names, typed texts, paths of exports, and rehearsals that are not in the bundle.

    :param log: its entries.
    :param names: the names of sessions in the bundle, by their folders' names.
    :param people: the codes of wizards.
    :param level: the export level.
    """
    entries = list(log)
    names_of = {str(each.get("participant") or "") for each in entries}
    gone = {name for name in names_of if not name.startswith(WITHDRAWN_PREFIX) and is_withdrawn(name, entries)}
    entries = without_salts([each for each in entries if each.get("participant") not in gone])
    if level == "full":
        return _lines((each.at, each.kind, each.fields) for each in entries)
    count = LevelFilter(level, None).count_typed_words
    shown = []
    not_counted = {
        str(each.get("folder"))
        for each in entries
        if each.kind == "session" and each.get("purpose") != "counted" and each.get("folder") not in names
    }
    for each in entries:
        about = {str(each.get("folder")), str(each.get("session"))}
        if each.kind in EXPORTED or about & not_counted:
            continue
        fields = _fields_at_level(each.fields, each.kind == "checked", people, count)
        for name in ("folder", "session"):
            if isinstance(folder := fields.get(name), str):
                fields[name] = name_at_level(folder, names, level)
        if "started" in fields:
            fields["started"] = ""
        shown.append(("", each.kind, fields))
    return _lines(shown)


def name_at_level(folder: str, names: Mapping[str, str], level: ExportLevel) -> str:
    """Return the name of a session in the log of a bundle.

    :param folder: its folder's name in the study.
    :param names: the names of sessions in the bundle, by their folders' names.
    """
    return folder if level == "full" else names.get(folder, _DATE.sub("", folder))


def _lines(entries: Iterable[tuple[str, str, dict[str, Any]]]) -> str:
    return "".join(encode({"kind": kind, "at": at, **fields}).decode() + "\n" for at, kind, fields in entries)


def _fields_at_level(
    fields: Mapping[str, Any], of_check: bool, people: Mapping[str, str], count: Callable[[str], str]
) -> dict[str, Any]:
    """Remove names, dates and typed texts from the fields of an entry, or of a check within an entry."""
    shown: dict[str, Any] = {}
    for name, value in fields.items():
        if isinstance(value, list):
            shown[name] = [
                _fields_at_level(each, name == "checks", people, count) if isinstance(each, dict) else each
                for each in value
            ]
        elif not isinstance(value, str):
            shown[name] = value
        elif name == "reason" or (name == "value" and not of_check):
            shown[name] = count(value)
        elif name == "value" and fields.get("text") == AUTOMATIC["wizard"]:
            shown[name] = people.get(value, "W") if value else ""
        elif name in ("value", "text"):
            shown[name] = without_dates_and_places(value)
        else:
            shown[name] = _without_people(value, people)
    return shown


def _without_people(value: str, people: Mapping[str, str]) -> str:
    """Replace the name in a source such as `wizard:anna`."""
    kind, colon, name = value.partition(":")
    return f"{kind}:{people.get(name, 'W')}" if colon and kind in ("wizard", "observer") else value


def copy_scenarios(study: Study, root: Path) -> tuple[list[str], list[str]]:
    """Copy the scenarios in the study's folder. Returns their paths, and sentences about the omitted ones."""
    named = [study.scenario, *(level.scenario for factor in study.factors for level in factor.levels)]
    copied, omitted = [], []
    for name in dict.fromkeys(filter(None, named)):
        source = Path(scenario_folder(study, name))
        if not source.is_dir():
            continue
        if not source.is_relative_to(study.folder) or source == Path(study.folder):
            omitted.append(f"the scenario in {name} lies outside of the study: each session has its own copy of it")
            continue
        where = source.relative_to(study.folder)
        if (root / where).exists():
            continue  # it is inside one that was copied
        for path in sorted(source.rglob("*")):
            hidden = any(part.startswith(".") for part in path.relative_to(source).parts)
            if path.is_file() and not path.is_symlink() and not hidden:
                target = root / where / path.relative_to(source)
                make_private_folder(target.parent)
                shutil.copyfile(path, target)
        copied.append(f"{where.as_posix()}/")
    return copied, omitted


# --- the program ------------------------------------------------------------------------------------------------------


ENVIRONMENT_FILE = "environment.txt"
PROGRAM = "program"
"""The folder of the program."""
REQUIREMENTS = "requirements.txt"
_NAME = re.compile(r"[A-Za-z0-9._-]+")
_OWN = "rise-tui"
_GIT_SECONDS = 5.0
_KEPT = ("METADATA", "entry_points.txt", "licenses/")
"""The installation's own files that are included in the wheel."""


class Wheel(Struct, frozen=True):
    """The running program in a form that `pip` installs."""

    name: str
    """The file's name."""
    data: bytes


def write_program(root: Path) -> str:
    """Write the program into the folder `program` of the bundle in `root`. Raises OSError.

    :return: why it is not included, as part of a sentence; empty: it is.
    """
    wheel = program_wheel()
    if isinstance(wheel, str):
        return wheel
    folder = root / PROGRAM
    folder.mkdir(0o700)
    (folder / wheel.name).write_bytes(wheel.data)
    pinned = [f"{each.metadata['Name']}=={each.version}\n" for each in _needed(_OWN)]
    (folder / REQUIREMENTS).write_text("".join(pinned), "utf-8")
    return ""


def wheel_in(root: Path) -> str:
    """Return the path of the wheel within a bundle. Empty: there is none."""
    return next((each.relative_to(root).as_posix() for each in sorted((root / PROGRAM).glob("*.whl"))), "")


def is_running_program(root: Path) -> bool:
    """Whether the wheel in a bundle equals the running program byte for byte."""
    wheel, there = program_wheel(), wheel_in(root)
    return bool(there) and not isinstance(wheel, str) and (root / there).read_bytes() == wheel.data


@cache
def program_wheel() -> Wheel | str:
    """Make a wheel of the running program from its packages and its installation's metadata.

    :return: the wheel, or why it cannot be made, as part of a sentence.
    """
    try:
        package = distribution(_OWN)
    except PackageNotFoundError:
        return f"{_OWN} was not installed by pip here"
    files = _packaged(package)
    stem = f"rise_tui-{package.version}"
    info = f"{stem}.dist-info"
    modules = {name.partition("/")[0] for name in files if name.endswith(".py")}
    if missing := _packages_of(package) - modules:
        return f"the files of {', '.join(sorted(missing))} are not on this disk"
    files[f"{info}/WHEEL"] = b"Wheel-Version: 1.0\nGenerator: rise-tui\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    record = [f"{name},sha256={_url_hash(data)},{len(data)}" for name, data in sorted(files.items())]
    files[f"{info}/RECORD"] = "\n".join([*record, f"{info}/RECORD,,", ""]).encode()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)  # dated 1980, so that the same program gives the same bytes
            entry.external_attr, entry.compress_type = 0o100644 << 16, zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)
    return Wheel(f"{stem}-py3-none-any.whl", buffer.getvalue())


def _packaged(package: Distribution) -> dict[str, bytes]:
    """Return the contents of the wheel by name: installed files, and packages that are elsewhere."""
    stem, packages = f"rise_tui-{package.version}", _packages_of(package)
    found: dict[str, Path] = {}
    for each in package.files or ():
        path, name = Path(str(package.locate_file(each))), each.as_posix()
        outside, share, rest = name.partition("/share/")
        if share and not outside.strip("./"):
            found[f"{stem}.data/data/share/{rest}"] = path
        elif ".dist-info/" in name and (kept := name.partition(".dist-info/")[2]).startswith(_KEPT):
            found[f"{stem}.dist-info/{kept}"] = path
        elif name.partition("/")[0] in packages:
            found[name] = path
    for top in sorted(packages):
        spec = find_spec(top)
        for folder in (spec.submodule_search_locations or ()) if spec is not None else ():
            here = Path(folder)
            found.update({f"{top}/{path.relative_to(here).as_posix()}": path for path in here.rglob("*")})
    return {
        name: path.read_bytes()
        for name, path in sorted(found.items())
        if path.is_file() and path.suffix != ".pyc" and not any(part.startswith(".") for part in Path(name).parts)
    }


def _packages_of(package: Distribution) -> set[str]:
    """Return the top-level packages of its entry points."""
    return {entry.module.partition(".")[0] for entry in package.entry_points}


def _url_hash(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


def environment_text(recorded: dict[str, set[str]]) -> str:
    """List the versions of the program, Python and all dependencies. For comparison, each dependency has the SHA-256 of
    its list of files.

    :param recorded: the versions in the sessions, by program.
    """
    wheel = program_wheel()
    lines = ["# The bundle was made with", f"{_OWN}=={__version__}"]
    if isinstance(wheel, Wheel):
        lines.append(f"# {PROGRAM}/{wheel.name}: sha256:{hashlib.sha256(wheel.data).hexdigest()}")
    lines += [f"# {name}: {value}" for name, value in _origin().items()]
    lines.append(f"# Python {platform.python_version()}, {platform.system()} {platform.machine()}")
    lines += [_package_line(each) for each in _needed(_OWN)]
    lines += ["", "# The sessions were recorded with"]
    lines += [f"# {name} {', '.join(sorted(versions))}" for name, versions in sorted(recorded.items())]
    return "\n".join([*lines, ""])


@cache
def _origin() -> dict[str, str]:
    """Return the program's sources according to its installation: URLs, and the commit."""
    try:
        package = distribution(_OWN)
    except PackageNotFoundError:
        return {}
    found: dict[str, str] = {}
    for each in package.metadata.get_all("Project-URL") or ():
        name, _, address = each.partition(",")
        found[name.strip()] = address.strip()
    try:
        direct = decode(package.read_text("direct_url.json") or "{}")
    except JsonError:
        direct = {}
    source = direct.get("vcs_info") if isinstance(direct, dict) else None
    if isinstance(source, dict):
        found |= {"source": str(direct["url"]), "commit": str(source.get("commit_id", ""))}
    elif commit := _commit_here():
        found["commit"] = commit
    return found


def _commit_here() -> str:
    """Return the commit of the checkout with the program, with `-dirty` after changes. Empty: there is none."""
    here = Path(__file__).resolve().parents[3]
    if not (here / ".git").exists():
        return ""
    command = ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_GIT_SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _package_line(package: Distribution) -> str:
    files = package.read_text("RECORD")
    found = f"  # files: sha256:{hashlib.sha256(files.encode()).hexdigest()}" if files else ""
    return f"{package.metadata['Name']}=={package.version}{found}"


def _needed(name: str) -> list[Distribution]:
    """Return a package's direct and indirect dependencies, without extras, by name."""
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
                except PackageNotFoundError:  # a dependency for another system
                    continue
                waiting.append(key)
    return [found[key] for key in sorted(found)]
