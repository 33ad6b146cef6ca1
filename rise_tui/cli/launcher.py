"""What `rise-tui` offers if no session or study is named. Prepare Textual before importing this module."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from rise_engine.cli.session.sessions import unfinished_sessions
from rise_engine.run.client.running_sessions import all_running_sessions
from rise_engine.run.protocol.messages import SessionSummary
from rise_engine.run.protocol.registry import RegistryError
from rise_engine.scenario.files.study_paths import SCENARIO_FILE, STUDY_FILE
from rise_engine.scenario.shipped_studies import shipped_name, shipped_studies, study_title
from rise_engine.session.folder import SessionInfo
from rise_engine.study.sessions import SESSIONS
from rise_engine.study.standing import when_text
from rise_tui.cli.command_line import CommandLine
from rise_tui.cli.stop_session import stop_session
from rise_tui.config.display import choose_theme, detect_colors
from rise_tui.config.key_file import KeyFile
from rise_tui.config.preferences import (
    MAX_FOLDERS,
    PREFERENCES_NAME,
    Preferences,
    abbreviate_home,
    load_saved,
    state_folder,
)
from rise_tui.model.notice import short_name
from rise_tui.rendering.text import format_age
from rise_tui.screens.launcher import LauncherApp, LaunchItem

NOBODY = "nobody named"
"""Instead of a participant. No row names a condition, because a wizard may be blind to it."""
GOES_ON = (
    "Memory, rules, timers and the stop will be as they were. What the robot was doing counts as lost: nothing is "
    "repeated by itself"
)


def choose_item(options: CommandLine, keys: KeyFile | None) -> LaunchItem | None:
    """Let the person choose from everything that can be opened; None: nothing was chosen."""
    kept = Preferences() if options.fresh else load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0]
    app = LauncherApp(
        lambda: find_items(kept.folders, only_running=options.observe),
        lambda session: stop_session(session, "launcher"),
        theme=choose_theme(options.display, detect_colors(options.display, os.environ), kept.theme),
        keys=keys,
    )
    chosen = app.run(mouse=options.display.mouse)
    return chosen if isinstance(chosen, LaunchItem) else None


def find_items(used: Mapping[str, str], *, only_running: bool = False) -> list[LaunchItem]:
    """Find everything that can be opened. Blocks.

    :param used: folders of scenarios and studies, with the time of their last use (ISO 8601).
    :param only_running: find only running sessions.
    """
    try:
        running = all_running_sessions()
    except RegistryError:  # the attempt to attach reports it
        running = {}
    items = [_running_item(name, about) for name, about in running.items()]
    if only_running:
        return items
    folders = _study_folders(used)
    items += _unfinished_items(running, folders)
    items += [_folder_item(folder, when_text(used.get(str(folder), ""))) for folder in folders]
    for folder in shipped_studies().values():
        items.append(LaunchItem("shipped", str(folder), study_title(folder), _kind(folder), where=folder.name))
    return items


def _running_item(name: str, about: SessionSummary | None) -> LaunchItem:
    if about is None:
        return LaunchItem("running", name, name, when="does not answer", role="fault")
    others = f", {len(about.clients)} attached" if len(about.clients) > 1 else ""
    state = f"NOT RECORDING, paused: {about.trouble}" if about.trouble else "STOPPED" if about.stopped else ""
    detail = " · ".join(filter(None, (state, f"{short_name(about.control)} has control{others}")))
    return LaunchItem(
        "running",
        name,
        about.title,
        about.participant or NOBODY,
        f"{about.mode.upper()} {about.robot}",
        f"for {format_age(about.t)}",
        abbreviate_home(about.folder or about.scenario_folder),
        detail,
        role="fault" if about.trouble else "wait" if about.stopped else "plain",
    )


def _unfinished_items(running: Mapping[str, SessionSummary | None], folders: list[Path]) -> Iterator[LaunchItem]:
    """The latest unfinished session of each scenario and of each study."""
    for found in unfinished_sessions(running):
        yield _unfinished_item(found.info, found.info.scenario_folder, GOES_ON, session=str(found.folder))
    for study in folders:
        for found in unfinished_sessions(running, study / SESSIONS)[:1]:
            yield _unfinished_item(found.info, str(study), f"Its study opens. {GOES_ON}")


def _unfinished_item(info: SessionInfo, target: str, detail: str, *, session: str = "") -> LaunchItem:
    return LaunchItem(
        "unfinished",
        target,
        info.title,
        info.participant or NOBODY,
        f"{info.mode.upper()} {info.robot}",
        when_text(info.started),
        abbreviate_home(target),
        detail,
        session=session,
        participant="" if session else info.participant,
        role="wait",
    )


def _folder_item(folder: Path, when: str) -> LaunchItem:
    return LaunchItem(
        "recent", str(folder), study_title(folder), _kind(folder), when=when, where=abbreviate_home(str(folder))
    )


def _kind(folder: Path) -> str:
    return "study" if (folder / STUDY_FILE).is_file() else "scenario"


def _study_folders(used: Mapping[str, str]) -> list[Path]:
    """The folders used before, the latest first, and those in the current folder; without shipped ones."""
    found = [Path(each) for each in sorted(used, key=lambda each: used[each], reverse=True)]
    with suppress(OSError):
        here = Path.cwd()
        found += [here, *sorted(Path(entry.path) for entry in os.scandir(here) if entry.is_dir())]
    folders: dict[str, Path] = {}
    for folder in found:
        if _is_study_or_scenario(folder) and not shipped_name(folder):
            folders.setdefault(os.path.realpath(folder), folder)
    return [*folders.values()][:MAX_FOLDERS]


def _is_study_or_scenario(folder: Path) -> bool:
    return any((folder / name).is_file() for name in (STUDY_FILE, SCENARIO_FILE))
