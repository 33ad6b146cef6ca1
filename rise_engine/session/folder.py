"""A session's folder: what the session ran, and what happened.

    2026-11-21_141503_P07_lablinking_real/
        session.toml     what ran: who, scenario and its hash, mode, robot, seed, speed, versions, machine
        scenario/        a copy of every file that was read, the robot's profile included
        journal.jsonl    what happened (rise_engine.session.journal_format)

The folders are in `$RISE_SESSIONS`, by default `~/rise-sessions`, and those of a study in its `sessions`. No folder is
ever overwritten.
"""

from __future__ import annotations

import json
import os
import platform
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Mapping
from contextlib import suppress
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import msgspec
from msgspec import Struct, field
from msgspec.structs import asdict, replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import is_locked, make_private_folder, write_private_file, write_whole
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import escape_all_surrogates, restore_all_surrogates
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.records import OpenGoal, Purpose, SessionRecord, identity_of
from rise_engine.ports.bridge import RosConnection, RosTransport
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS
from rise_engine.scenario.loader import LoadResult, load
from rise_engine.scenario.model import Scenario
from rise_engine.session.journal_format import FORMAT, LineError, read_line
from rise_engine.session.journal_format import JOURNAL as JOURNAL
from rise_engine.session.labels import (
    label_differences,
    labels_for,
    moment_differences,
    moment_of_zero,
    read_labels,
    refuse_differences,
)
from rise_engine.session.lock import LockHolder, forget_holder, read_holder, user_name

_ANY_CONNECTION = RosConnection()
INFO, SCENARIO_COPY = "session.toml", "scenario"
_ABANDONED = "abandoned"


class SessionInfo(Struct, frozen=True):
    """The contents of `session.toml`."""

    title: str
    mode: Literal["debug", "real"]
    """debug: the robot was simulated, so these are not a participant's data."""
    robot: str
    seed: int
    scenario_hash: str
    scenario_folder: str
    """The folder of the scenario. Its copy is beside this file."""
    started: str
    """ISO 8601 with offset."""
    format: int = FORMAT
    speed: float = 1.0
    faults: tuple[str, ...] = ()
    """The requested faults of the simulated robot."""
    ros: RosTransport = "auto"
    """The requested connection to ROS 2."""
    ros_args: tuple[str, ...] = ()
    participant: str = ""
    condition: str = ""
    wizard: str = ""
    """The wizard who started it, as in consoles (`anna`); empty: a program or an older version did."""
    study: str = ""
    """The study's id; empty: the session belongs to no study."""
    study_hash: str = ""
    slot: int = 0
    """The row of the study's plan; 0: none."""
    run: int = 0
    attempt: int = 0
    purpose: Purpose | Literal[""] = ""
    """The fields from `study` on are those of `rise_engine.kernel.records.SessionRecord`."""
    language: str = ""
    """The requested language (`--language`); empty: that of the acts."""
    allow_untranslated: bool = False
    """Whether untranslated sentences were spoken in the language of the acts."""
    factors: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    machine: dict[str, str] = field(default_factory=dict)


def sessions_folder() -> Path:
    """Return the default folder for sessions."""
    named = os.environ.get("RISE_SESSIONS")
    return Path(named).expanduser() if named else Path.home() / "rise-sessions"


def find_session(text: str) -> Path:
    """Find a session by its path (or that of its journal or session.toml), or by its name in the sessions folder.

    Raises SessionError, with the nearest right name.
    """
    if not text:
        raise SessionError(f"name a session: its folder, or its name in {sessions_folder()}")
    path = Path(text)
    if path.name in (JOURNAL, INFO) and path.is_file():
        path = path.parent
    if _is_session(path):
        return path
    root = sessions_folder()
    plain = text.rstrip("/")
    named = plain != "" and Path(plain).name == plain and plain not in (".", "..")
    if named and _is_session(root / plain):
        return root / plain
    if os.path.lexists(path):
        raise SessionError(f"{text} is not a session: it is not a folder with a {JOURNAL} or {INFO} in it")
    if not named:
        raise SessionError(f"there is no folder {text}")
    known = []
    with suppress(OSError):
        known = sorted((entry.name for entry in root.iterdir() if _is_session(entry)), reverse=True)
    raise SessionError(f"there is no session `{text}` in {root}{did_you_mean(text, known)}")


def create_session(
    root: Path,
    scenario: Scenario,
    files: Mapping[str, bytes],
    *,
    seed: int,
    faults: tuple[str, ...],
    connection: RosConnection = _ANY_CONNECTION,
    wizard: str = "",
    begun: SessionStarted | None = None,
    language: str = "",
    allow_untranslated: bool = False,
    versions: Mapping[str, str],
) -> Path:
    """Make the folder of a new session, without its journal. `files` as in `LoadResult.files`. Raises SessionError.

    `begun`: its first input.
    `language`, `allow_untranslated`: as for loading the scenario.
    """
    started = datetime.now().astimezone()
    begun = begun or SessionStarted()
    real = scenario.mode == "real"  # participants' data must not name the people who run the session
    info = SessionInfo(
        title=scenario.title,
        mode=scenario.mode,
        robot=scenario.robot.name,
        seed=seed,
        scenario_hash=scenario.hash,
        scenario_folder=without_home(scenario.folder) if real else scenario.folder,
        started=started.isoformat(timespec="milliseconds"),
        speed=begun.speed,
        faults=faults,
        ros=connection.transport,
        ros_args=connection.arguments,
        **{**identity_of(begun), "slot": begun.slot or 0},
        wizard=wizard,
        language=language,
        allow_untranslated=allow_untranslated,
        versions=dict(versions),
        machine={"system": platform.platform()} if real else _machine(),
    )
    name = _folder_name(started, begun, scenario)
    try:
        root.mkdir(0o700, parents=True, exist_ok=True)
        folder = _make_folder(root, name)
        for relative_path, data in files.items():
            path = folder / SCENARIO_COPY / relative_path
            make_private_folder(path.parent)
            write_private_file(path, data)
        (folder / SCENARIO_COPY).mkdir(0o700, exist_ok=True)
        write_info(folder / INFO, info)
    except OSError as error:
        raise SessionError(f"the session's folder cannot be made in {root}: {error.strerror or error}") from None
    return folder


def read_info(folder: Path, *, compare: bool = True) -> SessionInfo:
    """Read `session.toml` in a session's folder, and compare it with the journal, which has the time of the start.

    :param folder: the session's folder.
    :param compare: False: use the journal's values without an error where the two differ.
    :raises RelabelledError: the journal has other values.
    :raises SessionError: there is no `session.toml`, it cannot be read, or a newer version wrote it.
    """
    info, labels = _read_info(folder), read_labels(folder / JOURNAL)
    values = asdict(info)
    differences = label_differences(labels, values, INFO)
    if compare:
        refuse_differences(folder, differences)
    if differences:
        values |= labels_for(labels, values)
        info = msgspec.convert({**values, "slot": values["slot"] or 0}, SessionInfo)
    if labels is not None and (began := moment_of_zero(labels["wall"], labels["t"], info.speed)):
        info = replace(info, started=began)
    return info


def info_differences(folder: Path, *, moments: bool = False) -> list[str]:
    """List the differences between `session.toml` and the journal, in sentences; empty: it cannot be read.

    :param folder: the session's folder.
    :param moments: also compare the start.
    """
    try:
        values = asdict(_read_info(folder))
    except SessionError:
        return []
    labels = read_labels(folder / JOURNAL)
    return [*label_differences(labels, values, INFO), *(moment_differences(labels, values, INFO) if moments else ())]


@lru_cache(maxsize=1024)  # as for the labels: readers of a study ask for it many times
def _parse_info(text: str) -> dict[str, Any]:
    return tomllib.loads(text)


def _read_info(folder: Path) -> SessionInfo:
    path = folder / INFO
    try:
        values = _parse_info(path.read_text(encoding="utf-8"))
        found = values.get("format")
        if isinstance(found, int) and found > FORMAT:
            raise SessionError(
                f"{path} was written by a newer version (format {found}; this one reads up to format {FORMAT}): "
                "install that version"
            )
        info = msgspec.convert(restore_all_surrogates(values), SessionInfo)
        return replace(info, scenario_folder=os.path.expanduser(info.scenario_folder))  # noqa: PTH111  # it may be empty
    except FileNotFoundError:
        raise SessionError(f"{folder} is not a session: it has no {INFO}") from None
    except (OSError, ValueError, msgspec.ValidationError) as error:
        raise SessionError(f"{path} cannot be read: {error}") from None


def speech_arguments(info: SessionInfo) -> dict[str, Any]:
    """Return the arguments of `load` for the spoken texts of this session."""
    return {"language": info.language or None, "allow_untranslated": info.allow_untranslated}


def load_copy(copy: Path, **how: Any) -> LoadResult:
    """Load a copy of a scenario, with the files that the session used.

    :param how: as for `rise_engine.scenario.loader.load`.
    """
    return load(copy, paths={kind: path for kind, path in DEFAULT_PATHS.items() if (copy / path).exists()}, **how)


def load_scenario_copy(folder: Path, info: SessionInfo) -> Scenario:
    """Load the session's copy of the scenario. Raises SessionError if it is missing or was changed."""
    copy = folder / SCENARIO_COPY
    if not copy.is_dir():
        raise SessionError(
            f"the copy of the scenario is missing ({copy}); put one there with the hash {info.scenario_hash[:12]}..."
        )
    loaded = load_copy(copy, robot=info.robot, mode=info.mode, **speech_arguments(info))
    if loaded.scenario is None:
        raise SessionError(f"the session's scenario does not load: {loaded.errors[0]}")
    if loaded.scenario.hash != info.scenario_hash:
        raise SessionError(
            f"{copy} is not the scenario that this session ran: its hash is {loaded.scenario.hash[:12]}..., "
            f"not {info.scenario_hash[:12]}..."
        )
    return replace(loaded.scenario, title=info.title, folder=info.scenario_folder)


def has_ended(folder: Path) -> bool:
    """Whether the last input in the journal ended the session; False if unknown."""
    return b'"input":"session_ended"' in _end_of_journal(folder)  # a text would escape the quotes


def open_goals_at_end(folder: Path) -> tuple[OpenGoal, ...]:
    """The robot's open goals at the end of a session; also empty if unknown."""
    try:
        last = read_line(_end_of_journal(folder).rstrip(b"\n").rpartition(b"\n")[2])
    except LineError:
        return ()
    return last.open if isinstance(last, SessionRecord) else ()


def _end_of_journal(folder: Path) -> bytes:
    """The last bytes of the journal, with the input that ended the session and its records; empty if unreadable."""
    try:
        with (folder / JOURNAL).open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - 16_384))
            return file.read()
    except OSError:
        return b""


def find_unfinished(scenario_folder: str | None = None, root: Path | None = None) -> list[Path]:
    """Find sessions of one or all scenarios that did not end and that no engine runs, the latest first.

    `root`: the folder with the sessions, such as a study's `sessions`. Default: `sessions_folder`.
    """
    return [
        folder
        for folder, runs in _not_ended(scenario_folder, [root or sessions_folder()])
        if not runs and has_begun(folder) and not is_abandoned(folder)
    ]


def running_sessions(scenario_folder: str | None = None, root: Path | None = None) -> dict[Path, LockHolder | None]:
    """Find sessions of one or all scenarios that an engine runs, with the noted holders, the latest first.

    The journal's lock decides, so the engine's socket may be anywhere. `root` as in `find_unfinished`; without it, the
    study around the scenario's folder is searched, too.
    """
    roots = [root] if root is not None else [sessions_folder(), *_study_sessions(scenario_folder)]
    return {folder: read_holder(folder) for folder, runs in _not_ended(scenario_folder, roots) if runs}


def _study_sessions(scenario_folder: str | None) -> list[Path]:
    """Return the folder of the sessions of this scenario's study, if any."""
    if scenario_folder is None:
        return []
    around = list(Path(os.path.realpath(scenario_folder)).parents)[:3]
    return [folder / "sessions" for folder in around if (folder / "study.toml").is_file()]


def _not_ended(scenario_folder: str | None, roots: Iterable[Path]) -> list[tuple[Path, bool]]:
    """Find sessions that have not ended, the latest first, and whether an engine runs each."""
    found: list[tuple[Path, bool]] = []
    folders: list[Path] = []
    where = os.path.realpath(scenario_folder) if scenario_folder is not None else None
    for root in roots:
        with suppress(OSError):
            folders += [Path(entry.path) for entry in os.scandir(root) if entry.is_dir()]
    for folder in folders:
        # The cheapest test first: after a year there are hundreds of sessions, and nearly all have ended.
        if has_ended(folder):
            continue
        try:
            info = read_info(folder, compare=False)
        except SessionError:
            continue
        if where is None or os.path.realpath(info.scenario_folder) == where:
            found.append((folder, is_locked(folder / JOURNAL)))
    return sorted(found, reverse=True)


def describe_session(folder: Path) -> str:
    """Describe a session and its progress in a sentence."""
    try:
        info = read_info(folder)
        last = (folder / JOURNAL).stat().st_mtime
        began, end = datetime.fromisoformat(info.started), datetime.fromtimestamp(last)
    except (SessionError, OSError, ValueError) as error:
        return f"{folder.name} cannot be described: {error}"
    who = [f"{what} {name}" for what in ("participant", "condition") if (name := getattr(info, what))]
    if info.run:
        who.append(f"run {info.run}, attempt {info.attempt}" if info.attempt > 1 else f"run {info.run}")
    by = f" by {info.wizard}" if info.wizard else ""
    return (
        f"{', '.join([f'{info.title} ({info.mode}, {info.robot})', *who])}, "
        f"begun {began:%Y-%m-%d %H:%M}{by}, ran {duration_text(last - began.timestamp())}, last record {end:%H:%M:%S}"
    )


def belongs_to(info: SessionInfo, participant: str, condition: str) -> bool:
    """Whether a session is of this participant and condition; empty: any."""
    return participant in ("", info.participant) and condition in ("", info.condition)


def participant_text(participant: str, condition: str) -> str:
    """Name a participant and a condition, as far as they are given: `P07, condition calm`."""
    return ", ".join(filter(None, (participant, condition and f"condition {condition}"))) or "nobody named"


def duration_text(seconds: float) -> str:
    """Write a duration in words: `40 s`, `12 min`, `1 h 5 min`."""
    if round(seconds) < 60:
        return f"{max(0, round(seconds))} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def has_begun(folder: Path) -> bool:
    """Whether the session has at least one input."""
    try:
        with (folder / JOURNAL).open("rb") as file:
            return any(line.startswith(b'{"n":') for line in file)
    except OSError:
        return False


def mark_abandoned(folder: Path) -> None:
    """Stop offering an unfinished session for recovery. It can still be recovered by name."""
    (folder / _ABANDONED).touch(0o600)
    forget_holder(folder)


def is_abandoned(folder: Path) -> bool:
    """Whether a person decided not to continue it."""
    return (folder / _ABANDONED).exists()


def _is_session(path: Path) -> bool:
    return (path / JOURNAL).is_file() or (path / INFO).is_file()


def _make_folder(root: Path, name: str) -> Path:
    for number in range(1, 10_000):
        folder = root / (name if number == 1 else f"{name}-{number}")
        try:
            folder.mkdir(0o700)
        except FileExistsError:
            continue
        return folder
    raise SessionError(f"{root} has too many sessions of one second")


def _folder_name(started: datetime, begun: SessionStarted, scenario: Scenario) -> str:
    """Name a folder by date, participant, study or scenario, mode, and why a real session does not count.

    A study's session is not named after its scenario, whose title could tell the condition.
    """
    rehearsal = begun.purpose if begun.purpose in ("pilot", "training") else ""
    what = _ascii_name(begun.study or scenario.title).lower() or "session"
    parts = (_ascii_name(begun.participant), what, scenario.mode, rehearsal)
    return "_".join((f"{started:%Y-%m-%d_%H%M%S}", *filter(None, parts)))


def _ascii_name(text: str) -> str:
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return re.sub(r"[^A-Za-z0-9]+", "-", plain).strip("-")[:40]


def write_info(path: Path, info: SessionInfo) -> None:
    """Write the file in one step, because a study's checks rely on it."""
    write_whole(path, _info_toml(info).encode("utf-8"))


def _machine() -> dict[str, str]:
    return {"host": platform.node(), "system": platform.platform(), "user": user_name()}


def without_home(folder: str) -> str:
    """Shorten a path in the home folder to `~/study`, so that it does not show the owner's login."""
    home = str(Path.home())
    return f"~{folder[len(home) :]}" if home != "/" and folder.startswith(f"{home}/") else folder


def _info_toml(info: SessionInfo) -> str:
    lines = ["# A RISE session (docs/reference/sessions.md)."]
    if info.mode == "debug":
        lines.append("# DEBUG: the robot was simulated. These are not a participant's data.")
    tables: list[str] = []
    for key, value in asdict(info).items():
        if isinstance(value, dict):
            tables += ["", f"[{key}]", *(f"{_toml_value(name)} = {_toml_value(each)}" for name, each in value.items())]
        else:
            lines.append(f"{key} = {_toml_value(list(value) if isinstance(value, tuple) else value)}")
    return "\n".join([*lines, *tables, ""])


def _toml_value(value: Any) -> str:
    """Write a TOML value. Strings, numbers and lists are as in JSON, but DEL needs an escape too."""
    return json.dumps(escape_all_surrogates(value), ensure_ascii=False).replace("\x7f", "\\u007f")
