"""Finds and reads robot profiles (docs/reference/robots.md)."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

from msgspec.structs import replace

from rise_engine.base.nearest_name import suggest
from rise_engine.base.plugins import installed_plugins
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import MAX_TOML_BYTES, FileReader, SourceFile
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, why_no_name
from rise_engine.scenario.files.toml_files import TomlTable, read_toml, toml_of
from rise_engine.scenario.files.tree import FileTree
from rise_engine.scenario.model import RobotProfile, SourceLocation
from rise_engine.scenario.reading.action_declarations import apply_declarations, core_actions, name_places, read_places

ENTRY_POINT_GROUP = "rise.robots"
"""The entry-point group of packages with robot profiles (*.toml)."""
DEFAULT_ROBOT = "generic"
_KEYS = ("title", "driver", "options", "places", "actions")


def read_robot(name: str, files: FileReader, location: SourceLocation, *, asked: bool = False) -> RobotProfile:
    """Read the profile called `name`; with errors, the valid part.

    :param location: the place of the name.
    :param asked: whether the caller gave the name, not a file.
    """
    packages = files.memo.get("package folders", lambda: tuple(package_folders()))
    path = find_profile(name, files.folder, files.tree, packages)
    if path is None:
        if name != DEFAULT_ROBOT:
            what = f"the robot asked for, `{name}`, does not exist" if asked else f"there is no robot `{name}`"
            near = suggest(name, robot_names(files.folder, files.tree))
            files.diagnostics.error("unknown-robot", location, what, near)
        return builtin_robot()
    return read_profile(path, name, files)


def read_profile(path: Path, name: str, files: FileReader) -> RobotProfile:
    """Read a profile from any file; with errors, the valid part."""
    source = files.read(path, MAX_TOML_BYTES)
    if source is None:
        return builtin_robot()
    return files.memo.read(("profile", source, name), files.diagnostics, lambda found: _make(source, name, found))


def _make(source: SourceFile, name: str, diagnostics: Diagnostics) -> RobotProfile:
    file = read_toml(source, diagnostics)
    if file is None:
        return builtin_robot()
    table = TomlTable(file, (), file.values, diagnostics)
    table.report_unknown_keys(_KEYS)
    places = read_places(table, {})
    return RobotProfile(
        name=name,
        title=table.read("title", str, name),
        driver=table.read("driver", str, "simulated"),
        actions=name_places(apply_declarations(table, core_actions(), "profile"), places),
        options=table.read("options", dict, {}, form=": [options]"),
        places=places,
    )


def locate_in_profile(where: str, name: str, files: FileReader) -> SourceLocation:
    """The place of a robot's key such as `actions.Wave.carrier.goal`, or of its nearest parent. It is in the profile,
    or in the scenario.toml (from `files`) that may change the profile."""
    best, location = -1, SourceLocation(name)
    for path in (find_profile(name, files.folder, files.tree), files.folder / SCENARIO_FILE):
        source = files.read(path, MAX_TOML_BYTES) if path is not None and files.tree.is_file(path) else None
        file = toml_of(source, files) if source is not None else None
        if file is None:
            continue
        found = file.find_path(where)
        if len(found) > best or (found and len(found) == best):
            best, location = len(found), file.key_location(*found)
    return location


def builtin_robot() -> RobotProfile:
    """The robot of a scenario without one, if no profile is installed: all core actions, simulated."""
    actions = {**core_actions(), "Speech": replace(core_actions()["Speech"], ssml=True)}
    return RobotProfile(DEFAULT_ROBOT, "Generic simulated robot", "simulated", actions)


def find_profile(
    name: str, folder: Path, tree: FileTree | None = None, packages: Sequence[Path] | None = None
) -> Path | None:
    """The file of the profile called `name`, searched in the documented order.

    :param tree: the content of the folder; None: the disk's.
    :param packages: the folders of installed packages, if they are known.
    """
    tree = tree or FileTree(folder)
    if "/" in name or why_no_name(f"{name}.toml", (".toml",)):
        return None
    for directory in profile_folders(folder, packages):
        path = directory / f"{name}.toml"
        if tree.is_file(path):
            return path
    return None


def robot_names(folder: Path, tree: FileTree | None = None) -> list[str]:
    """The names of all profiles that a scenario in `folder` can use, sorted. `tree`: the content of the folder.

    >>> "pepper" in robot_names(Path("scenarios/greeting"))
    True
    """
    names, tree = {DEFAULT_ROBOT}, tree or FileTree(folder)
    for directory in profile_folders(folder):
        if tree.is_folder(directory):
            names.update(path.removesuffix(".toml") for path in tree.names(directory) if path.endswith(".toml"))
    return sorted(names)


def profile_folders(folder: Path, packages: Sequence[Path] | None = None) -> Iterator[Path]:
    """The folders in which profiles are searched, in order. Installed packages are only looked up if necessary."""
    yield folder / "robots"
    config = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    yield Path(config) / "rise-tui" / "robots"
    yield from package_folders() if packages is None else packages


def package_folders() -> Iterator[Path]:
    """The folders of the packages in the entry-point group."""
    for package in dict.fromkeys(entry.module for entry in installed_plugins(ENTRY_POINT_GROUP)):
        yield from _package_folder(package)


def _package_folder(package: str) -> Iterator[Path]:
    """Search the path first: `find_spec` imports the parent package, and a check needs no adapter."""
    parts = package.split(".")
    for entry in sys.path:
        directory = Path(entry, *parts)
        if (directory / "__init__.py").is_file():
            yield directory
            return
    try:
        spec = find_spec(package)
    except (ImportError, ValueError):
        return
    for location in (spec.submodule_search_locations or ()) if spec is not None else ():
        yield Path(location)
