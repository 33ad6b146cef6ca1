"""The scenario files of a session: those at its start, and those that it took over.

scenario/      at the start
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
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import SCENARIO_COPY, SessionInfo, load_scenario_copy, read_info, speech_arguments


def copy_folders(folder: Path) -> list[Path]:
    """Return the session's folders with scenario files, in the order of their use."""
    later = (path for path in folder.glob(f"{SCENARIO_COPY}.*") if path.suffix[1:].isdigit() and path.is_dir())
    return [folder / SCENARIO_COPY, *sorted(later, key=lambda path: int(path.suffix[1:]))]


def write_copy(folder: Path, files: Mapping[str, bytes]) -> Path:
    """Write the files of a changed scenario durably to a new folder of a session, and return this folder.

    :param files: as in `LoadResult.files`.
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
    """Remove a copy that the session did not take over."""
    with suppress(OSError):
        shutil.rmtree(copy)


def load_session_scenario(folder: Path, info: SessionInfo, notes: list[str]) -> Scenario:
    """Load the session's copy of the scenario, or the scenario's own folder if it is unchanged."""
    try:
        return load_scenario_copy(folder, info)
    except SessionError as error:
        loaded = load(info.scenario_folder, robot=info.robot, mode=info.mode, **speech_arguments(info))
        found = loaded.scenario
        if found is None or found.hash != info.scenario_hash:
            raise SessionError(
                f"{error}. The scenario's own folder ({info.scenario_folder}) does not help: "
                + ("it cannot be loaded" if found is None else "it was changed since")
            ) from None
        notes.append(
            f"the session's copy of the scenario is missing or was changed; {info.scenario_folder} is still the same "
            "and was used"
        )
        return replace(found, title=info.title, folder=info.scenario_folder)


def load_changed_copy(folder: Path, input: ScenarioChanged, before: Scenario) -> Scenario:
    """Load the scenario that a session took over.

    :param folder: the session's folder.
    :param before: the scenario until then; its robot and mode are kept.
    :raises SessionError: the files are missing or have another hash.
    """
    copy = folder / input.copy
    if Path(input.copy).name != input.copy or not copy.is_dir():
        raise SessionError(f"the files that this session has taken over are missing ({copy})")
    paths = {kind: path for kind, path in DEFAULT_PATHS.items() if (copy / path).exists()}
    spoken = speech_arguments(read_info(folder))
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
    """Give a replaying kernel the scenario that its next input takes over, if any.

    :raises SessionError: this scenario cannot be loaded, or it followed a scenario other than the kernel's.
    """
    if isinstance(input, ScenarioChanged):
        kernel.offered = load_changed_copy(folder, input, kernel.scenario)
        if kernel.scenario.hash != input.was:  # the replay uses another scenario under the recorded name
            raise SessionError(f"the session took over files after others than these ({input.was[:12]}...)")


def load_copy_with_hash(folder: Path, info: SessionInfo, hash: str) -> Scenario:
    """Load the scenario with this hash among those of the session. Raises SessionError."""
    first = load_scenario_copy(folder, info)
    if first.hash == hash:
        return first
    for copy in copy_folders(folder)[1:]:
        with suppress(SessionError):
            return load_changed_copy(folder, ScenarioChanged(hash=hash, was="", copy=copy.name), first)
    raise SessionError(f"{folder} does not hold the scenario that the session runs: none there has its hash")
