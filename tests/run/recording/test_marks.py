"""Marks that are given: what plays them, what is on record about them, what goes wrong."""

from __future__ import annotations

import io
import re
import stat
import tempfile
import wave
from pathlib import Path
from time import monotonic
from types import SimpleNamespace
from typing import Any

import pytest

from rise_engine.run.client import EngineGone
from rise_engine.run.protocol.client import Rejected
from rise_engine.run.recording import marks
from rise_engine.run.recording.chirp import CHIRP_SECONDS, PLAYED_RATE, SOUND_SECONDS, chirp, mark_sound
from rise_engine.run.recording.marks import PLAY_SECONDS, give_mark
from rise_engine.study.model import SyncSettings


class MarkedSession:
    """What marks need of a session; its time is `offset` seconds after the computer's."""

    def __init__(self, *, speed: float = 1.0, refuses: Exception | None = None) -> None:
        self.attach_reply: Any = SimpleNamespace(speed=speed, mode="debug")
        self.view: Any = SimpleNamespace(control="wizard:anna")
        self.speed, self.refuses = speed, refuses
        self.marks: list[dict[str, Any]] = []
        self.notes: list[str] = []
        self._began = monotonic()

    def now(self) -> float:
        return (monotonic() - self._began) * self.speed

    async def mark_sync(self, number: int, medium: str, text: str = "", **more: Any) -> None:
        if self.refuses is not None:
            raise self.refuses
        self.marks.append({"number": number, "medium": medium, "text": text, **more})

    async def add_note(self, text: str) -> None:
        self.notes.append(text)


def player(folder: Path, name: str, script: str) -> tuple[str, ...]:
    """A program that plays sounds, in its own way."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return (str(path), "{file}")


def test_the_sound_is_a_file_that_any_program_plays() -> None:
    up, down = mark_sound(1), mark_sound(2)
    with wave.open(io.BytesIO(up)) as file:
        assert (file.getframerate(), file.getnchannels(), file.getsampwidth()) == (PLAYED_RATE, 1, 2)
        assert file.getnframes() == round(SOUND_SECONDS * PLAYED_RATE)
    assert up != down and mark_sound(3) == up, "numbers can be told apart by how they sweep"
    tone = chirp("up", 48_000)
    assert len(tone) == CHIRP_SECONDS * 48_000 and max(map(abs, (tone[0], tone[-1]))) < 1e-6
    crossings = [index for index in range(1, len(tone)) if tone[index - 1] < 0 <= tone[index]]
    early, late = crossings[3:13], crossings[-13:-3]
    assert 48_000 * 9 / (early[-1] - early[0]) < 1_200 and 48_000 * 9 / (late[-1] - late[0]) > 3_800


@pytest.mark.slow
async def test_a_sound_is_played_and_when_it_began_is_on_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sounds = tmp_path / "sounds"  # not where another run of the tests has its own
    sounds.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(sounds))
    session = MarkedSession(speed=10.0)
    play = player(
        tmp_path, "play", f'test "$(head -c 4 "$1")" = RIFF && stat -c %a "$1" > {tmp_path}/mode && sleep 1.4'
    )
    given = await give_mark(session, 2, SyncSettings(play=play))
    [mark] = session.marks
    assert (given.problem, mark["number"], mark["medium"], mark["text"]) == ("", 2, "sound", "down, played by play")
    assert not session.notes and mark["at"] == given.at and mark["within"] == given.within
    assert given.at is not None and given.within is not None
    # Wherever within its running time the program has played, it is within what is said.
    ended = session.now()
    assert given.at - given.within >= 4.0 and given.at + given.within <= ended - 8.0 + 0.5 and given.within >= 0.2
    assert not [*sounds.iterdir()], "no sound is left behind"


@pytest.mark.slow
async def test_the_next_player_is_asked_when_one_fails(tmp_path: Path) -> None:
    session = MarkedSession()
    players = [
        ("no-such-player", "{file}"),
        player(tmp_path, "broken", "echo 'Connection refused' >&2; exit 1"),
        player(tmp_path, "works", "sleep 1.2"),
    ]
    given = await give_mark(session, 1, SyncSettings(), players=players)
    assert not given.problem and session.marks[0]["text"] == "up, played by works" and not session.notes


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "problem"),
    [
        ("echo one >&2; echo 'no card' >&2; exit 3", "player ended with exit status 3: no card"),
        (
            "exit 0",
            r"player has played nothing that could be heard: it was there for \d+\.\d s, and the sound",
        ),
        ("exec sleep 60", f"player did not end within {PLAY_SECONDS:g} s"),
    ],
)
async def test_what_goes_wrong_is_said_and_harms_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, problem: str
) -> None:
    monkeypatch.setattr(marks, "EARLY_SECONDS", -PLAY_SECONDS)  # a busy machine may take a second to run `exit 0`
    session = MarkedSession()
    given = await give_mark(session, 1, SyncSettings(play=player(tmp_path, "player", script)))
    assert given.at is None and not session.marks
    assert re.search(problem, given.problem)
    assert session.notes == [f"mark 1 was not given: {given.problem}"]


async def test_where_nothing_plays_sounds_it_is_said_what_to_do(tmp_path: Path) -> None:
    session = MarkedSession()
    given = await give_mark(session, 1, SyncSettings(), players=[("no-such-player",), ("none-either",)])
    assert "no program that plays sounds is installed (no-such-player, none-either)" in given.problem
    assert 'medium = "flash"' in given.problem and session.notes
    given = await give_mark(session, 1, SyncSettings(play=("no-such-player", "{file}")))
    assert "there is no program 'no-such-player'" in given.problem
    plain = tmp_path / "no-program"
    plain.write_text("nothing that runs\0")
    plain.chmod(0o700)
    given = await give_mark(session, 1, SyncSettings(play=(str(plain), "{file}")))
    assert "no-program cannot be started" in given.problem


async def test_a_flash_is_its_record() -> None:
    session = MarkedSession()
    given = await give_mark(session, 3, SyncSettings(medium="flash"))
    assert not given.problem and session.marks == [{"number": 3, "medium": "flash", "text": ""}]
    assert not session.notes
    session.view.control = None
    assert not (await give_mark(session, 4, SyncSettings(medium="flash"))).problem
    assert session.notes == ["mark 4 should flash on consoles, but no console has control: perhaps none is attached"]


@pytest.mark.parametrize("refusal", [Rejected("nothing can be recorded"), EngineGone("the session has ended")])
async def test_a_session_that_takes_no_record_harms_nothing(refusal: Exception) -> None:
    session = MarkedSession(refuses=refusal)
    given = await give_mark(session, 3, SyncSettings(medium="flash"))
    assert given.problem == f"mark 3 is not on record: {refusal}" and session.notes
