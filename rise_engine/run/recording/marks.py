"""Marks for recordings: a sound, or a flash on the consoles' screens. The record has the start of each."""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
import tempfile
from asyncio.subprocess import DEVNULL, PIPE
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Protocol

from msgspec import Struct

from rise_engine.base.text import clean
from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol.client import AttachReply, EngineGone, Rejected
from rise_engine.run.recording.chirp import LEAD_SECONDS, SOUND_SECONDS, mark_sound, sweep_of
from rise_engine.study.model import SyncSettings

PLAYERS: tuple[tuple[str, ...], ...] = (
    ("pw-play", "{file}"),
    ("paplay", "{file}"),
    ("aplay", "-q", "{file}"),
    ("ffplay", "-nodisp", "-autoexit", "-loglevel", "error", "{file}"),
    ("afplay", "{file}"),
)
"""Commands of programs that play a sound. First come those that wait until it was played."""
PLAY_SECONDS = 3.5
"""Maximum duration of giving a mark; the sound itself takes 1.2 s."""
MIN_WITHIN = 0.02
"""Minimum error in seconds: no player knows the start of the sound more exactly."""
EARLY_SECONDS = 0.25
"""Maximum time before the end of the sound at which a player may exit: the rest is in the card's buffer."""


class MarkSession(Protocol):
    """The part of a `rise_engine.run.client.Session` that marks need."""

    @property
    def attach_reply(self) -> AttachReply: ...

    @property
    def view(self) -> SessionView: ...

    def now(self) -> float: ...

    async def mark_sync(
        self, number: int, medium: str, text: str = "", *, at: float | None = None, within: float | None = None
    ) -> None: ...

    async def add_note(self, text: str) -> None: ...


class GivenMark(Struct, frozen=True):
    """The result of giving a mark."""

    number: int
    at: float | None = None
    """Session time in seconds of its start; None: it was not given, or is a flash, which follows its record."""
    within: float | None = None
    """Maximum error of that in seconds."""
    problem: str = ""
    """Why it was not audible, in a sentence; empty: it was given."""


class _Played(Struct, frozen=True):
    """The result of one player; times are monotonic."""

    begun: float
    ended: float
    problem: str = ""


async def give_mark(
    session: MarkSession, number: int, settings: SyncSettings, *, players: Sequence[Sequence[str]] | None = None
) -> GivenMark:
    """Give a mark, and record it. Returns within five seconds, and never raises.

    A problem becomes a note in the record, and is part of the result. The start and end of the player are bounds for
    the time of a sound. `at` is the middle of the possible starts, and `within` half of their range. The delay of a
    loudspeaker (a wireless one has a tenth of a second and more) is not included. It is the same for every mark of a
    session.

    :param session: attached as a program.
    :param number: the mark's; odd ones sweep up, even ones down.
    :param settings: sound or flash, and the program that plays the sound.
    :param players: instead of `PLAYERS`, for tests.
    """
    try:
        if settings.medium == "flash":
            await session.mark_sync(number, "flash")
            if session.view.control is None:
                await session.add_note(
                    f"mark {number} should flash on consoles, but no console has control: perhaps none is attached"
                )
            return GivenMark(number)
        tried = [settings.play] if settings.play else [*(PLAYERS if players is None else players)]
        program, played = await _play_with_one_of(tried, number)
        if played is None or played.problem:
            given = GivenMark(number, problem=played.problem if played is not None else _no_player(tried))
        else:
            given = _time_of(session, number, played)
            text = f"{sweep_of(number)}, played by {program}"
            await session.mark_sync(number, "sound", text, at=given.at, within=given.within)
    except (Rejected, EngineGone) as error:
        given = GivenMark(number, problem=f"mark {number} is not on record: {error}")
    except OSError as error:
        given = GivenMark(number, problem=f"the sound cannot be written: {error.strerror or error}")
    if given.problem:
        with suppress(Rejected, EngineGone):
            await session.add_note(f"mark {number} was not given: {given.problem}")
    return given


def _time_of(session: MarkSession, number: int, played: _Played) -> GivenMark:
    """Compute the start of the tone by the session's clock."""
    speed = session.attach_reply.speed
    latest = max(played.begun, played.ended - SOUND_SECONDS)
    middle, half = (played.begun + latest) / 2, (latest - played.begun) / 2
    at = session.now() - (monotonic() - middle - LEAD_SECONDS) * speed
    return GivenMark(number, round(at, 4), round(max(half, MIN_WITHIN) * speed, 4))


async def _play_with_one_of(commands: Sequence[Sequence[str]], number: int) -> tuple[str, _Played | None]:
    """Play the mark with the first program that works; return its name and result, or those of the last failure."""
    deadline = monotonic() + PLAY_SECONDS
    name, played = "", None
    with tempfile.TemporaryDirectory(prefix="rise-mark-") as folder:  # readable only by its owner
        file = _write_sound(folder, number)
        for command in commands:
            program = shutil.which(command[0])
            if program is None or monotonic() > deadline - SOUND_SECONDS:
                continue
            name = Path(command[0]).name
            played = await _play([program, *(each.replace("{file}", file) for each in command[1:])], deadline)
            if not played.problem:
                break
    return name, played


def _write_sound(folder: str, number: int) -> str:
    path = Path(folder, f"mark-{number}.wav")
    path.write_bytes(mark_sound(number))
    return str(path)


async def _play(command: Sequence[str], deadline: float) -> _Played:
    """Run a player until it has ended, or until the deadline."""
    name = Path(command[0]).name
    begun = monotonic()
    try:
        process = await asyncio.create_subprocess_exec(
            *command, stdin=DEVNULL, stdout=DEVNULL, stderr=PIPE, start_new_session=True
        )
    except OSError as error:
        return _Played(begun, begun, f"{name} cannot be started: {error.strerror or error}")
    assert process.stderr is not None
    output = b""
    try:
        async with asyncio.timeout(max(0.1, deadline - monotonic())):
            while data := await process.stderr.read(4_096):
                output = (output + data)[-4_096:]
            status = await process.wait()
        ended = monotonic()
    except TimeoutError:
        return _Played(begun, monotonic(), f"{name} did not end within {PLAY_SECONDS:g} s")
    finally:
        if process.returncode is None:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            await process.wait()
    last = clean(output.decode("utf-8", "replace").strip().rpartition("\n")[2])[:200]
    if status:
        return _Played(begun, ended, f"{name} ended with exit status {status}" + (f": {last}" if last else ""))
    if ended - begun < SOUND_SECONDS - EARLY_SECONDS:
        took = f"{ended - begun:.1f} s, and the sound takes {SOUND_SECONDS:.1f} s"
        return _Played(begun, ended, f"{name} has played nothing that could be heard: it was there for {took}")
    return _Played(begun, ended)


def _no_player(tried: Sequence[Sequence[str]]) -> str:
    if len(tried) == 1:
        return f"there is no program {tried[0][0]!r}; name another one in study.toml: sync = {{ play = [...] }}"
    names = ", ".join(each[0] for each in tried)
    return f'no program that plays sounds is installed ({names}); install one, or write sync = {{ medium = "flash" }}'
