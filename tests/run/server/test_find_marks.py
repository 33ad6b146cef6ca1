"""Marks in what recorded a session are found after it, by a process that nobody waits for."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.kernel.records import SyncRecord
from rise_engine.kernel.view import SessionView
from rise_engine.run.server import find_marks
from rise_engine.run.server.find_marks import find_marks_later, unaligned
from rise_engine.session.media import MediaFile, read_media, register_media
from tests.run.engine.test_media_command import MARKS, session
from tests.run.recording.sounds import record_marks, write_wav


def ended(medium: str | None) -> SessionView:
    view = SessionView()
    if medium is not None:
        view.sync = SyncRecord(1, 2.0, "", 1, medium, "", "node:recorders")
    return view


def recorded(root: Path) -> Path:
    folder = session(root, *MARKS)
    (folder / "recordings").mkdir()
    sound = record_marks([(1, 2.0), (2, 31.0)], offset=-0.7, rate=1.0, seconds=40, noise=0.01, samples=16_000)
    write_wav(folder / "recordings" / "mic.wav", sound, 16_000)
    register_media(
        folder, MediaFile(path="recordings/mic.wav", kind="audio", name="mic", offset=0.4, aligned_by="start")
    )
    register_media(folder, MediaFile(path="recordings/bag", kind="bag", name="bag", aligned_by="start"))
    register_media(folder, MediaFile(path="/far/obs.mkv", kind="video", name="obs", aligned_by="start"))
    return folder


@pytest.mark.slow
def test_each_file_of_a_recorder_is_laid_against_the_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = recorded(tmp_path)
    assert unaligned(folder) == [("mic", folder / "recordings" / "mic.wav")]
    monkeypatch.setattr("os.nice", lambda number: number)
    find_marks.main(folder)
    found = {each.name: each for each in read_media(folder)}
    assert found["mic"].aligned_by == "marks" and len(found["mic"].marks) == 2
    assert found["mic"].offset is not None and abs(found["mic"].offset + 0.7) < 0.01
    assert found["obs"].aligned_by == found["bag"].aligned_by == "start"
    assert unaligned(folder) == []


def test_nothing_is_looked_for_where_there_is_nothing_to_find(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def start(*arguments: object, **more: object) -> None:
        raise OSError("no more processes")

    monkeypatch.setattr("subprocess.Popen", start)
    folder = recorded(tmp_path)
    assert not find_marks_later(folder, ended(None)) and not find_marks_later(folder, ended("flash"))
    assert not find_marks_later(folder, ended("sound"))  # what cannot be started is nobody's trouble
    (tmp_path / "empty").mkdir()
    assert not find_marks_later(tmp_path / "empty", ended("sound"))
