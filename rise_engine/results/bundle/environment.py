"""The environment in which a bundle was made, so that others can have the same: the program as a wheel, and the
versions of its dependencies (`program/`, `environment.txt`)."""

from __future__ import annotations

import base64
import hashlib
import io
import platform
import re
import subprocess
import zipfile
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path

from msgspec import Struct

from rise_engine import __version__
from rise_engine.base.json_codec import JsonError, decode

ENVIRONMENT_FILE = "environment.txt"
PROGRAM = "program"
"""The folder of the program."""
REQUIREMENTS = "requirements.txt"
_NAME = re.compile(r"[A-Za-z0-9._-]+")
_OWN = "rise-tui"
_GIT_SECONDS = 5.0
_KEPT = ("METADATA", "entry_points.txt", "licenses/")
"""The installation's own files that go into the wheel."""


class Wheel(Struct, frozen=True):
    """The running program in a form that `pip` installs."""

    name: str
    """The file's name."""
    data: bytes


def write_program(root: Path) -> str:
    """Write the program into the folder `program` of the bundle in `root`. Raises OSError.

    :return: why it is not in there, as part of a sentence; empty: it is.
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
    """Whether the wheel in a bundle is, byte for byte, the program that runs."""
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
    """List the versions of the program, of Python and of every dependency. For comparison, each dependency has the
    SHA-256 of the list of its files.

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
    """Return where the installation says the program comes from: URLs, and the commit of its source."""
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
    """Return the commit of the checkout that contains the program, with `-dirty` after changes. Empty: there is
    none."""
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
                except PackageNotFoundError:  # for another system
                    continue
                waiting.append(key)
    return [found[key] for key in sorted(found)]
