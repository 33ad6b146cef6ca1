"""`shadow/N.jsonl` in a session's folder: what another wizard would have done, to whom the session's cues were played.

One file for each time that somebody sat down, one JSON object a line (docs/reference/shadow.md). Nothing is written
over: whoever goes on later appends, whoever begins anew gets the next number. Times are the session's, in seconds.
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
_MOST = 10_000
_TYPED = frozenset({"say", "assignValue", "markCue"})
"""Tasks whose behaviour somebody may have typed."""
NO_ANSWERS = frozenset(
    {"nextFiller", "markCue", "undoCue", "markMistake", "moveTask"}
    | {"releaseStop", "cancelOpenGoals", "releaseOpenGoals"}
)
"""Tasks of a wizard that do not answer a cue: they bridge it, mark it, or see to what is there already."""


class ShadowHeader(Struct, tag_field="kind", tag="shadow", frozen=True, kw_only=True):
    """The first line: who judges."""

    format: int = SHADOW_FORMAT
    wizard: str
    """As consoles name people: `ben`."""
    began: str
    """ISO 8601 with offset."""
    speed: float = 1.0
    """Session seconds in a second. At another speed than 1 latencies say nothing."""
    version: str = __version__


class ShadowPlay(Struct, tag_field="kind", tag="play", frozen=True):
    """From here on the session was played."""

    t: float


class ShadowPause(Struct, tag_field="kind", tag="pause", frozen=True):
    """Here it was halted, or the wizard left."""

    t: float


class ShadowCue(Struct, tag_field="kind", tag="cue", frozen=True):
    """A cue was shown; what the first wizard did about it was not, until this one had answered or it was over."""

    t: float
    cue: int
    """`seq` of its record in the session."""


class ShadowKey(Struct, tag_field="kind", tag="key", frozen=True, kw_only=True):
    """A key was pressed (or a row chosen, or something said); it was sent nowhere."""

    t: float
    """When it was pressed."""
    function: str
    """As of a task: `startCommunicationRobotAct`, `say`, ..."""
    behavior: str = ""
    calling_type: str = ""
    cue: int | None = None
    """The cue that was open; null: none."""
    filler: bool = False
    """It would only have bridged the time."""

    @property
    def answers(self) -> bool:
        """Whether it is what the wizard decided to do about the cue."""
        return self.cue is not None and not self.filler and self.function not in NO_ANSWERS


class ShadowMark(Struct, tag_field="kind", tag="mark", frozen=True):
    """The wizard judges something that the first one did."""

    t: float
    task: int
    mark: Mark


class ShadowNote(Struct, tag_field="kind", tag="note", frozen=True):
    """A remark."""

    t: float
    text: str


class ShadowEnd(Struct, tag_field="kind", tag="end", frozen=True):
    """All of the session was shown."""

    t: float


ShadowLine: TypeAlias = (
    ShadowHeader | ShadowPlay | ShadowPause | ShadowCue | ShadowKey | ShadowMark | ShadowNote | ShadowEnd
)
_decoder = msgspec.json.Decoder(ShadowLine)


class Shadow(Struct, frozen=True, kw_only=True):
    """What is in one file."""

    path: Path
    header: ShadowHeader
    lines: tuple[ShadowLine, ...]
    """After the header."""
    problems: tuple[str, ...] = ()
    """What could not be read, in sentences."""

    @property
    def complete(self) -> bool:
        """Whether all of the session was shown."""
        return any(isinstance(line, ShadowEnd) for line in self.lines)

    @property
    def resume_at(self) -> tuple[float, int]:
        """Where somebody goes on: the session time, and the `seq` of the cue that is shown again (0: none).

        A cue that was shown and had no answer when the wizard left is shown again, and what was pressed since counts no
        more; everything before stays as it is.
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
    """One file. A line that cannot be read, as the last one of a program that was killed, is left out and told.

    :raises SessionError: it cannot be read at all, or does not begin as such a file.
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
    """The files of a session's folder, the first one first; none where there is none."""
    try:
        found = [path for path in (folder / SHADOW_FOLDER).iterdir() if path.suffix == ".jsonl"]
    except OSError:
        return []
    return sorted((path for path in found if path.stem.isdecimal()), key=lambda path: int(path.stem))


def read_shadows(folder: Path) -> tuple[list[Shadow], list[str]]:
    """All of a session that can be read, and sentences about what cannot."""
    shadows, problems = [], []
    for path in shadow_files(folder):
        try:
            shadows.append(read_shadow(path))
        except SessionError as error:
            problems.append(str(error))
    return shadows, problems


# --- writing ----------------------------------------------------------------------------------------------------------


class ShadowWriter:
    """One file that is being written, by one process alone. Each line is on the disk when `append` returns."""

    def __init__(self, path: Path, descriptor: int, disk: Disk, size: int) -> None:
        self.path = path
        self._descriptor, self._disk, self._size = descriptor, disk, size

    @classmethod
    def begin(cls, folder: Path, wizard: str, *, speed: float = 1.0, disk: Disk | None = None) -> ShadowWriter:
        """A new file in the session's folder, with its header.

        :raises SessionError: the disk does not take it.
        """
        disk = disk or Disk()
        began = datetime.now().astimezone().isoformat(timespec="seconds")
        try:
            make_private_folder(folder / SHADOW_FOLDER)
            number = max((int(path.stem) for path in shadow_files(folder)), default=0)
            while (number := number + 1) < _MOST:
                path = folder / SHADOW_FOLDER / f"{number}.jsonl"
                try:
                    descriptor = disk.open(path, create=True)
                except FileExistsError:
                    continue
                writer = cls._locked(path, descriptor, disk, 0)
                try:
                    writer.append(ShadowHeader(wizard=wizard, began=began, speed=speed))
                    disk.sync_folder(path.parent)
                except OSError:  # nobody is to find a file that says nothing
                    writer.close()
                    path.unlink(missing_ok=True)
                    raise
                return writer
        except OSError as error:
            raise SessionError(f"no shadow can be kept in {folder}: {error_message(error)}") from None
        raise SessionError(f"{folder / SHADOW_FOLDER} is full")

    @classmethod
    def resume(cls, path: Path, *, disk: Disk | None = None) -> ShadowWriter:
        """Go on with a file; what is in it stays, also a line that was torn.

        :raises SessionError: somebody else writes it now, or it cannot be opened.
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
            raise SessionError(f"{path} cannot be gone on with: {error_message(error)}") from None
        return writer

    @classmethod
    def _locked(cls, path: Path, descriptor: int, disk: Disk, size: int) -> ShadowWriter:
        if not take_lock(descriptor):
            disk.close(descriptor)
            raise SessionError(f"{path} is being written by another console")
        return cls(path, descriptor, disk, size)

    def append(self, line: ShadowLine) -> None:
        """Write a line, durably. Raises OSError; then nothing of it counts."""
        data = msgspec.json.encode(line) + b"\n"
        self._disk.write(self._descriptor, data, self._size)
        self._disk.sync(self._descriptor)
        self._size += len(data)

    def close(self) -> None:
        """Nothing more comes. May be called twice."""
        if self._descriptor >= 0:
            self._disk.close(self._descriptor)
            self._descriptor = -1


def unfinished_shadow(folder: Path, wizard: str) -> Shadow | None:
    """The latest of this wizard, if it does not go to the session's end; None: there is nothing to go on with."""
    own = [each for each in read_shadows(folder)[0] if each.header.wizard == wizard]
    return own[-1] if own and not own[-1].complete else None


def replace_words(line: bytes, replace: Callable[[str], str]) -> bytes:
    """A line in which what people typed is replaced: the wizard's name, what would have been said or set, notes. The
    names of acts, events and rules are the scenario's.

    :param replace: from a text to another one.
    :return: the line itself when nothing changes, or when it cannot be read (then whoever asks finds the word there).
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
