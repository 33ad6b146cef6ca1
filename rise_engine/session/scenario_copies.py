"""The files that a session has run: those that it was begun with, and those that it has taken over while it ran.

scenario/      at the beginning
scenario.2/    from the first `scenario_changed` in its journal on, and so forth
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import error_message, make_private_folder, write_private_file
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import AnyInput, ScenarioChanged
from rise_engine.scenario.file_names import DEFAULT_PATHS
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import SCENARIO_COPY, SessionInfo, load_scenario_copy, read_info, spoken_as


def copy_folders(folder: Path) -> list[Path]:
    """The folders of a session in which files of its scenario lie, the first ones first."""
    later = (path for path in folder.glob(f"{SCENARIO_COPY}.*") if path.suffix[1:].isdigit() and path.is_dir())
    return [folder / SCENARIO_COPY, *sorted(later, key=lambda path: int(path.suffix[1:]))]


def write_copy(folder: Path, files: Mapping[str, bytes]) -> Path:
    """Keep files of a changed scenario in a session's folder, durably; the folder that they are in.

    :param files: as `LoadResult.files`.
    :raises SessionError: they cannot be written.
    """
    number = 2
    while (copy := folder / f"{SCENARIO_COPY}.{number}").exists():
        number += 1
    try:
        make_private_folder(copy)
        for name, data in files.items():
            make_private_folder((copy / name).parent)
            write_private_file(copy / name, data)
    except OSError as error:
        remove_copy(copy)
        raise SessionError(f"the changed files cannot be kept in {copy}: {error_message(error)}") from None
    return copy


def remove_copy(copy: Path) -> None:
    """Take files away that were not taken over after all."""
    with suppress(OSError):
        shutil.rmtree(copy)


def load_changed_copy(folder: Path, input: ScenarioChanged, before: Scenario) -> Scenario:
    """The scenario that a session has taken over.

    :param folder: the session's.
    :param before: what it ran until then, whose robot and mode it keeps.
    :raises SessionError: the files are not there, or not those.
    """
    copy = folder / input.copy
    if Path(input.copy).name != input.copy or not copy.is_dir():
        raise SessionError(f"the files that this session has taken over are missing ({copy})")
    paths = {kind: path for kind, path in DEFAULT_PATHS.items() if (copy / path).exists()}
    spoken = spoken_as(read_info(folder))
    loaded = load(copy, robot=before.robot.name, mode=before.mode, paths=paths, **spoken)
    if loaded.scenario is None:
        raise SessionError(f"the files that this session has taken over do not load: {loaded.errors[0]}")
    if loaded.scenario.hash != input.hash:
        raise SessionError(
            f"{copy} does not hold the files that this session has taken over: their hash is "
            f"{loaded.scenario.hash[:12]}..., not {input.hash[:12]}..."
        )
    return replace(loaded.scenario, folder=before.folder)


def offer_changed(kernel: Kernel, folder: Path, input: AnyInput) -> None:
    """Before an input is given to a kernel that replays: give it the scenario that the input takes over, if it does.

    :raises SessionError: that cannot be had.
    """
    if isinstance(input, ScenarioChanged):
        kernel.offered = load_changed_copy(folder, input, kernel.scenario)
        if kernel.scenario.hash != input.was:  # replayed with another scenario, which goes under the recorded name
            raise SessionError(f"the session took over files after others than these ({input.was[:12]}...)")


def load_copy_with_hash(folder: Path, info: SessionInfo, hash: str) -> Scenario:
    """Of the scenarios that a session has run, the one with this hash. Raises SessionError."""
    first = load_scenario_copy(folder, info)
    if first.hash == hash:
        return first
    for copy in copy_folders(folder)[1:]:
        with suppress(SessionError):
            return load_changed_copy(folder, ScenarioChanged(hash=hash, was="", copy=copy.name), first)
    raise SessionError(f"{folder} does not hold the scenario that the session runs: none there has its hash")
