"""`shadow/N.jsonl` in a session's folder: another wizard's decisions on the session's cues.

Each sitting has one file, with one JSON object a line (docs/reference/shadow.md). Nothing is overwritten: resuming
appends, and a new start gets the next number. Times are session seconds.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TypeAlias

import msgspec
from msgspec import Struct

from rise_engine import __version__
from rise_engine.base.errors import SessionError
from rise_engine.base.files import Disk, error_message, make_private_folder, take_lock
from rise_engine.kernel.records import Mark

SHADOW_FOLDER = "shadow"
SHADOW_FORMAT = 1
_MAX_SHADOWS = 10_000
_TYPED = frozenset({"say", "assignValue", "markCue"})
"""Tasks whose behaviour may be typed by a person."""
NO_ANSWERS = frozenset(
    {"nextFiller", "markCue", "undoCue", "markMistake", "moveTask"}
    | {"releaseStop", "cancelOpenGoals", "releaseOpenGoals"}
)
"""Wizard tasks that do not answer a cue: they bridge it, mark it, or concern earlier tasks."""


class ShadowHeader(Struct, tag_field="kind", tag="shadow", frozen=True, kw_only=True):
    """The first line, with the judging wizard."""

    format: int = SHADOW_FORMAT
    wizard: str
    """The wizard's name, as in consoles: `ben`."""
    began: str
    """ISO 8601 with offset."""
    speed: float = 1.0
    """Session seconds per second. Latencies are meaningful only at speed 1."""
    version: str = __version__


class ShadowPlay(Struct, tag_field="kind", tag="play", frozen=True):
    """The session plays from here on."""

    t: float


class ShadowPause(Struct, tag_field="kind", tag="pause", frozen=True):
    """The session was paused here, or the wizard left."""

    t: float


class ShadowCue(Struct, tag_field="kind", tag="cue", frozen=True):
    """A cue was shown. The first wizard's reply was hidden until this wizard answered or the cue was over."""

    t: float
    cue: int
    """`seq` of its record in the session."""


class ShadowKey(Struct, tag_field="kind", tag="key", frozen=True, kw_only=True):
    """A key press, a chosen row or a spoken text. It had no effect."""

    t: float
    """The session time of the key press."""
    function: str
    """As in a task: `startCommunicationRobotAct`, `say`, ..."""
    behavior: str = ""
    calling_type: str = ""
    cue: int | None = None
    """The open cue; None: none."""
    filler: bool = False
    """Whether it would only have bridged the time."""

    @property
    def answers(self) -> bool:
        """Whether this is the wizard's decision on the cue."""
        return self.cue is not None and not self.filler and self.function not in NO_ANSWERS


class ShadowMark(Struct, tag_field="kind", tag="mark", frozen=True):
    """The wizard's judgement of an action of the first wizard."""

    t: float
    task: int
    mark: Mark


class ShadowNote(Struct, tag_field="kind", tag="note", frozen=True):
    """A remark."""

    t: float
    text: str


class ShadowEnd(Struct, tag_field="kind", tag="end", frozen=True):
    """The end of the session: everything was shown."""

    t: float


ShadowLine: TypeAlias = (
    ShadowHeader | ShadowPlay | ShadowPause | ShadowCue | ShadowKey | ShadowMark | ShadowNote | ShadowEnd
)
_decoder = msgspec.json.Decoder(ShadowLine)


class Shadow(Struct, frozen=True, kw_only=True):
    """The contents of one file."""

    path: Path
    header: ShadowHeader
    lines: tuple[ShadowLine, ...]
    """All lines after the header."""
    problems: tuple[str, ...] = ()
    """Sentences about unreadable lines."""

    @property
    def complete(self) -> bool:
        """Whether the whole session was shown."""
        return any(isinstance(line, ShadowEnd) for line in self.lines)

    @property
    def resume_at(self) -> tuple[float, int]:
        """The session time at which to resume, and the `seq` of the cue to repeat (0: none).

        A cue without an answer is shown again, and keys pressed since then do not count. Everything before is kept.
        """
        at, open_cue = 0.0, 0
        for line in self.lines:
            match line:
                case ShadowCue(t=at, cue=open_cue):
                    pass
                case ShadowKey() if line.cue == open_cue and line.answers:
                    at, open_cue = max(at, line.t), 0
                case ShadowPlay() | ShadowPause() | ShadowKey() | ShadowMark() | ShadowNote() if not open_cue:
                    at = max(at, line.t)
        return at, open_cue


# --- reading ----------------------------------------------------------------------------------------------------------


def read_shadow(path: Path) -> Shadow:
    """Read one file. Unreadable lines, such as a torn last line, are omitted and reported.

    :raises SessionError: the file cannot be read at all, or its first line is not a header.
    """
    try:
        text = path.read_bytes()
    except OSError as error:
        raise SessionError(f"{path} cannot be read: {error.strerror}") from None
    lines: list[ShadowLine] = []
    problems: list[str] = []
    for number, line in enumerate(text.split(b"\n"), 1):
        if not line.strip():
            continue
        try:
            lines.append(_decoder.decode(line))
        except msgspec.MsgspecError as error:
            problems.append(f"{path.name}:{number}: cannot be read, and is left out ({error})")
    if not lines or not isinstance(header := lines[0], ShadowHeader):
        raise SessionError(f"{path} is not a shadow of a session: its first line does not say who judges")
    if header.format > SHADOW_FORMAT:
        raise SessionError(f"{path} was written by a newer version of this program ({header.version})")
    return Shadow(path=path, header=header, lines=tuple(lines[1:]), problems=tuple(problems))


def shadow_files(folder: Path) -> list[Path]:
    """Return the files of a session's folder in the order of their numbers; empty: none."""
    try:
        found = [path for path in (folder / SHADOW_FOLDER).iterdir() if path.suffix == ".jsonl"]
    except OSError:
        return []
    return sorted((path for path in found if path.stem.isdecimal()), key=lambda path: int(path.stem))


def read_shadows(folder: Path) -> tuple[list[Shadow], list[str]]:
    """Read all files of a session. Returns the readable ones, and sentences about the others."""
    shadows, problems = [], []
    for path in shadow_files(folder):
        try:
            shadows.append(read_shadow(path))
        except SessionError as error:
            problems.append(str(error))
    return shadows, problems


# --- writing ----------------------------------------------------------------------------------------------------------


class ShadowWriter:
    """A writer of one file, which it locks. When `append` returns, the line is on the disk."""

    def __init__(self, path: Path, descriptor: int, disk: Disk, size: int) -> None:
        self.path = path
        self._descriptor, self._disk, self._size = descriptor, disk, size

    @classmethod
    def begin(cls, folder: Path, wizard: str, *, speed: float = 1.0, disk: Disk | None = None) -> ShadowWriter:
        """Make a new file in the session's folder, with its header.

        :raises SessionError: it cannot be written.
        """
        disk = disk or Disk()
        began = datetime.now().astimezone().isoformat(timespec="seconds")
        try:
            make_private_folder(folder / SHADOW_FOLDER)
            number = max((int(path.stem) for path in shadow_files(folder)), default=0)
            while (number := number + 1) < _MAX_SHADOWS:
                path = folder / SHADOW_FOLDER / f"{number}.jsonl"
                try:
                    descriptor = disk.open(path, create=True)
                except FileExistsError:
                    continue
                writer = cls._locked(path, descriptor, disk, 0)
                try:
                    writer.append(ShadowHeader(wizard=wizard, began=began, speed=speed))
                    disk.sync_folder(path.parent)
                except OSError:  # leave no empty file behind
                    writer.close()
                    path.unlink(missing_ok=True)
                    raise
                return writer
        except OSError as error:
            raise SessionError(f"no shadow can be kept in {folder}: {error_message(error)}") from None
        raise SessionError(f"{folder / SHADOW_FOLDER} is full")

    @classmethod
    def resume(cls, path: Path, *, disk: Disk | None = None) -> ShadowWriter:
        """Continue a file. Its contents stay, even a torn line.

        :raises SessionError: another program is writing it, or it cannot be opened.
        """
        disk = disk or Disk()
        try:
            descriptor = disk.open(path, create=False)
            size = os.fstat(descriptor).st_size
            writer = cls._locked(path, descriptor, disk, size)
            if size and os.pread(descriptor, 1, size - 1) != b"\n":
                disk.write(descriptor, b"\n", size)
                writer._size += 1
        except OSError as error:
            raise SessionError(f"{path} cannot be continued: {error_message(error)}") from None
        return writer

    @classmethod
    def _locked(cls, path: Path, descriptor: int, disk: Disk, size: int) -> ShadowWriter:
        if not take_lock(descriptor):
            disk.close(descriptor)
            raise SessionError(f"{path} is being written by another console")
        return cls(path, descriptor, disk, size)

    def append(self, line: ShadowLine) -> None:
        """Write a line durably. Raises OSError if the line does not count."""
        data = msgspec.json.encode(line) + b"\n"
        self._disk.write(self._descriptor, data, self._size)
        self._disk.sync(self._descriptor)
        self._size += len(data)

    def close(self) -> None:
        """Close the file. A second call has no effect."""
        if self._descriptor >= 0:
            self._disk.close(self._descriptor)
            self._descriptor = -1


def unfinished_shadow(folder: Path, wizard: str) -> Shadow | None:
    """Return this wizard's latest shadow if it is not complete; None: there is nothing to resume."""
    own = [each for each in read_shadows(folder)[0] if each.header.wizard == wizard]
    return own[-1] if own and not own[-1].complete else None


def replace_words(line: bytes, replace: Callable[[str], str]) -> bytes:
    """Replace typed texts in a line: the wizard's name, notes, speech and values. The names of acts, events and rules
    come from the scenario and stay.

    :param replace: maps an old text to a new one.
    :return: the same line if nothing changes or it cannot be read (the caller then finds the word in it).
    """
    try:
        found = _decoder.decode(line)
    except msgspec.MsgspecError:
        return line
    new: ShadowLine = found
    match found:
        case ShadowHeader():
            new = msgspec.structs.replace(found, wizard=replace(found.wizard))
        case ShadowKey() if found.function in _TYPED:
            new = msgspec.structs.replace(found, behavior=replace(found.behavior))
        case ShadowNote():
            new = msgspec.structs.replace(found, text=replace(found.text))
    return line if new == found else msgspec.json.encode(new)
