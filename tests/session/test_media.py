"""media.json: written whole or not at all, by several at once, for its owner alone."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rise_engine.base import files
from rise_engine.base.errors import SessionError
from rise_engine.session.media import (
    MEDIA_FILE,
    FoundMark,
    MediaFile,
    media_path,
    read_media,
    register_media,
    remove_media,
)
from tests.forked import Forked
from tests.patience import PATIENCE

FILM = MediaFile(
    path="/data/room.mp4",
    kind="video",
    name="camera",
    bytes=10,
    duration=60.0,
    offset=1.7,
    rate=1.00005,
    aligned_by="marks",
    marks=(FoundMark(1, 2.0, 3.7001, 12.5),),
    fps=25.0,
)


def test_what_is_registered_is_read_again_and_is_for_its_owner_alone(tmp_path: Path) -> None:
    assert read_media(tmp_path) == ()
    assert register_media(tmp_path, FILM) is None
    assert register_media(tmp_path, MediaFile(path="/data/mic.wav", kind="audio")) is None
    assert [each.path for each in read_media(tmp_path)] == ["/data/room.mp4", "/data/mic.wav"]
    assert read_media(tmp_path)[0] == FILM and FILM.drift_ppm == pytest.approx(50)
    assert (tmp_path / MEDIA_FILE).stat().st_mode & 0o777 == 0o600
    assert [each.name for each in tmp_path.iterdir()] == [MEDIA_FILE]
    assert register_media(tmp_path, MediaFile(path="/data/../data/room.mp4", kind="video", offset=2.0)) == FILM
    assert [(each.path, each.offset) for each in read_media(tmp_path)] == [
        ("/data/room.mp4", 2.0),
        ("/data/mic.wav", None),
    ]


def test_a_file_within_the_session_moves_with_it(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    (folder / "media").mkdir(parents=True)
    (folder / "media" / "a.wav").touch()
    register_media(folder, MediaFile(path=str(folder / "media" / "a.wav"), kind="audio"))
    assert json.loads((folder / MEDIA_FILE).read_text())[0]["path"] == "media/a.wav"
    moved = folder.rename(tmp_path / "elsewhere")
    [file] = read_media(moved)
    assert media_path(moved, file) == moved / "media" / "a.wav"
    assert register_media(moved, file) == file and len(read_media(moved)) == 1


def test_one_is_taken_out_by_its_path_its_last_part_or_its_name(tmp_path: Path) -> None:
    other = MediaFile(path="/other/room.mp4", kind="video")
    for each in (FILM, other):
        register_media(tmp_path, each)
    with pytest.raises(
        SessionError, match=r"room.mp4 can be any of /data/room.mp4, /other/room.mp4: say which by its path"
    ):
        remove_media(tmp_path, "room.mp4")
    with pytest.raises(SessionError, match=r"has no file rom.mp4; it has /data/room.mp4, /other/room.mp4"):
        remove_media(tmp_path, "rom.mp4")
    assert remove_media(tmp_path, "camera") == FILM and remove_media(tmp_path, "/other/room.mp4") == other
    assert read_media(tmp_path) == ()


@pytest.mark.parametrize(
    "content", ["[{]", "{}", '[{"path": 3, "kind": "video"}]', '[{"path":"a","kind":"film"}]', "\xff"]
)
def test_what_was_not_written_here_is_not_overwritten(tmp_path: Path, content: str) -> None:
    path = tmp_path / MEDIA_FILE
    path.write_bytes(content.encode("latin-1"))
    with pytest.raises(SessionError, match=r"media.json has an error: .*Correct it, or move it away"):
        read_media(tmp_path)
    with pytest.raises(SessionError):
        register_media(tmp_path, FILM)
    assert path.read_bytes() == content.encode("latin-1")


def test_a_disk_that_takes_nothing_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    register_media(tmp_path, FILM)

    def full(path: Path, data: bytes) -> None:
        path.write_bytes(data[:10])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files, "write_private_file", full)
    with pytest.raises(SessionError, match=r"media.json cannot be written: the disk is full"):
        register_media(tmp_path, MediaFile(path="/data/mic.wav", kind="audio"))
    assert read_media(tmp_path) == (FILM,)
    with pytest.raises(SessionError, match="not a text that can be written"):
        register_media(tmp_path, MediaFile(path="/data/\udcff.wav", kind="audio"))


@pytest.mark.slow
def test_programs_that_write_at_once_lose_nothing(tmp_path: Path) -> None:
    script = (
        "import sys; from pathlib import Path; from rise_engine.session.media import *\n"
        "for number in range(8):\n"
        "    register_media(Path(sys.argv[1]), MediaFile(path=f'/{sys.argv[2]}/{number}', kind='other'))"
    )
    running = [Forked(tmp_path, name, code=script, stdout=None, stderr=None) for name in "abc"]
    assert [each.wait(PATIENCE) for each in running] == [0, 0, 0]
    assert {each.path for each in read_media(tmp_path)} == {
        f"/{name}/{number}" for name in "abc" for number in range(8)
    }
