"""`rise-engine media`: recordings that come later, and where they lie against the session."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from rise_engine.cli import main
from rise_engine.kernel.records import AnyRecord, RecordingRecord, SessionRecord, SyncRecord
from rise_engine.run.recording import media_files
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_format import encode_header, encode_record, with_checksum
from rise_engine.session.media import MEDIA_FILE, FoundMark, read_media
from tests.run.recording.sounds import make_video, record_marks, write_wav

MARKS: list[AnyRecord] = [
    SyncRecord(1, 2.9, "", 1, "sound", "up", "node:recorders", 2.0, 0.04),
    SyncRecord(2, 31.9, "", 2, "sound", "down", "node:recorders", 31.0, 0.06),
]
FLASHES: list[AnyRecord] = [SyncRecord(1, 2.0, "", 1, "flash", "", "node:recorders")]


def session(root: Path, *records: AnyRecord) -> Path:
    folder = root / "session"
    folder.mkdir()
    for number, record in enumerate(records, 1):
        record.seq = number
    lines = [with_checksum(encode_record(each)) for each in records]
    (folder / JOURNAL).write_bytes(encode_header("rise-tui test") + b"".join(lines))
    return folder


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["media", *map(str, words)])


@pytest.fixture
def without_ffmpeg(monkeypatch: pytest.MonkeyPatch) -> None:
    """A WAV file is read without it, and so are files that are no film: no process is started for them."""
    monkeypatch.setattr(media_files.shutil, "which", lambda name: None)


@pytest.fixture
def sound(tmp_path: Path, without_ffmpeg: None) -> Path:
    """What a microphone has heard that began 4.5 s before the session, and runs 100 ppm fast."""
    recorded = record_marks([(1, 2.0), (2, 31.0)], offset=4.5, rate=1.0001, seconds=40, noise=0.01, samples=16_000)
    return write_wav(tmp_path / "mic.wav", recorded, 16_000)


def test_a_recording_is_registered_by_its_marks(tmp_path: Path, sound: Path) -> None:
    folder = session(tmp_path, *MARKS)
    done = run("add", folder, sound, "--find-marks", "--name", "mic")
    assert done.exit_code == 0, done.output
    lines = done.output.splitlines()
    assert lines[0] == f"{sound}: mic, audio, 1.3 MB, 40.0 s"
    assert lines[1].startswith("mark 1: 6.5002 s in the file, 2.0000 s of the session, ")
    assert lines[2].startswith("mark 2: 35.5031 s in the file, 31.0000 s of the session, ")
    told = "with no measurable drift (within 4,138 ppm)"
    assert lines[3] == f"begins 4.500 s before the session, {told} (by marks)"
    assert lines[4].startswith("this is accurate to 60 ms, and its drift to 4138 ppm, ")
    assert lines[5].startswith("time in the file = 4.5000 s + 1.0000998")
    [file] = read_media(folder)
    assert (file.kind, file.name, file.aligned_by, file.bytes) == ("audio", "mic", "marks", sound.stat().st_size)
    assert file.sha256 == hashlib.sha256(sound.read_bytes()).hexdigest() and file.added
    assert file.offset is not None and abs(file.offset + file.rate * 16 - (4.5 + 1.0001 * 16)) < 0.001
    assert [mark.number for mark in file.marks] == [1, 2]

    listed = run("list", folder)
    assert listed.exit_code == 0 and listed.output.splitlines() == [lines[0], f"   {lines[3]}"]
    as_json = json.loads(run("list", folder, "--json").output)
    assert as_json["files"][0]["there"] and 95 < as_json["files"][0]["drift_ppm"] < 106

    sound.rename(tmp_path / "away.wav")
    listed = run("list", folder)
    assert (
        listed.exit_code == 1 and "THE FILE IS MISSING: put it back, or use rise-engine media remove" in listed.output
    )
    removed = run("remove", folder, "mic")
    assert (
        removed.exit_code == 0 and "no longer a recording of session; the file itself was not touched" in removed.output
    )
    assert read_media(folder) == () and (tmp_path / "away.wav").exists()
    assert "has no recordings: rise-engine media add" in run("list", folder).output
    assert run("remove", folder, "mic").exit_code == 1


def test_what_was_known_stays_when_nothing_is_found(tmp_path: Path, sound: Path) -> None:
    folder = session(tmp_path, *MARKS)
    first = run("add", folder, sound, "--at", "-4.5")
    assert first.exit_code == 0 and "begins 4.500 s before the session (as you entered it)" in first.output
    noise = write_wav(sound, record_marks([], offset=0, seconds=5, noise=0.1, samples=16_000), 16_000)
    again = run("add", folder, noise, "--find-marks", "--json")
    [found] = json.loads(again.output)["files"]
    assert again.exit_code == 1 and found["problem"] == "none of the session's 2 marks was found in the file"
    assert (found["offset"], found["aligned_by"], found["duration"]) == (4.5, "given", 5.0)
    refreshed = run("add", folder, noise)
    assert refreshed.exit_code == 0 and "it was registered already" in refreshed.output
    assert "not aligned" not in refreshed.output and read_media(folder)[0].aligned_by == "given"


@pytest.mark.parametrize(
    ("at", "offset", "rate", "marks"),
    [
        (["14.04=12.34"], 1.7, 1.0, [FoundMark(0, 12.34, 14.04, 0.0)]),
        (["0:14.04=12.34"], 1.7, 1.0, [FoundMark(0, 12.34, 14.04, 0.0)]),
        (["1:00:14.04 = 3612.34"], 1.7, 1.0, [FoundMark(0, 3612.34, 3614.04, 0.0)]),
        (["3.5=mark1"], 1.5, 1.0, [FoundMark(1, 2.0, 3.5, 0.0)]),
        (["3.5=mark1", "33=mark 2"], 3.5 - 2 * 29.5 / 29, 29.5 / 29, None),
        (["3.5=mark1", "32.51=mark2"], 1.499310, 29.01 / 29, [FoundMark(1, 2.0, 3.5, 0), FoundMark(2, 31.0, 32.51, 0)]),
        (["12"], -12.0, 1.0, [FoundMark(0, 12.0, 0.0, 0.0)]),
    ],
)
@pytest.mark.usefixtures("without_ffmpeg")
def test_where_somebody_says_that_it_lies(
    tmp_path: Path, at: list[str], offset: float, rate: float, marks: list[FoundMark] | None
) -> None:
    folder = session(tmp_path, *MARKS)
    film = tmp_path / "room.bin"
    film.write_bytes(b"film")
    done = run("add", folder, film, *(word for each in at for word in ("--at", each)))
    [file] = read_media(folder)
    if marks is None:  # half a second in 29 s is no clock
        assert done.exit_code == 1 and file.offset is None
        assert "not aligned: these moments cannot all be right: the file would run 1.7% faster" in done.output
        return
    assert done.exit_code == 0, done.output
    assert file.offset == pytest.approx(offset, abs=1e-6) and file.rate == pytest.approx(rate)
    assert file.aligned_by == "given" and list(file.marks) == marks and file.kind == "other"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--at", "soon"], "--at soon: 'soon' is not a time: write seconds (75.2), a clock (1:15.2), or FILE=markN"),
        (["--at", "nan=1"], "--at nan=1: 'nan' is not a time"),
        (["--at", "3=mark7"], "--at 3=mark7: the session has no mark 7; its marks are 1, 2"),
        (["--at", "3", "--find-marks"], "use either --find-marks or --at"),
    ],
)
def test_what_cannot_be_meant_registers_nothing(tmp_path: Path, sound: Path, words: list[str], sentence: str) -> None:
    folder = session(tmp_path, *MARKS)
    done = run("add", folder, sound, *words)
    assert done.exit_code == 2 and sentence in done.output and not (folder / MEDIA_FILE).exists()


def test_what_is_not_there_is_said(tmp_path: Path, sound: Path) -> None:
    folder = session(tmp_path)
    gone = run("add", folder, tmp_path / "gone.mp4")
    assert gone.exit_code == 2 and "there is no file" in gone.output
    assert run("add", tmp_path / "nowhere", sound).exit_code == 2 and run("list", tmp_path / "nowhere").exit_code == 2
    (folder / MEDIA_FILE).write_text("?")
    broken = run("add", folder, sound)
    assert broken.exit_code == 2 and "has an error" in broken.output
    assert (folder / MEDIA_FILE).read_text() == "?" and run("list", folder).exit_code == 2


def test_without_a_word_it_lies_where_its_recorder_was_started(tmp_path: Path, sound: Path) -> None:
    folder = session(
        tmp_path,
        RecordingRecord(1, 1.25, "", "camera", "started", str(sound), None, "", "node:recorders"),
        RecordingRecord(2, 2.0, "", "bag", "started", "/data/bag", None, "", "node:recorders"),
    )
    done = run("add", folder, sound)
    assert done.exit_code == 0 and "begins 1.250 s after the session (by when it was started)" in done.output
    assert "which is not the time of its first frame: use --find-marks" in done.output
    assert "on record, and not in media.json (rise-engine media add):\n   /data/bag" in run("list", folder).output
    other = write_wav(tmp_path / "other.wav", [], 16_000)
    unknown = run("add", folder, other)
    assert unknown.exit_code == 1 and "not aligned: no marks or times are given" in unknown.output
    assert "it is not aligned with the session" in run("list", folder).output


def test_all_that_the_session_has_is_looked_at_at_once(tmp_path: Path, sound: Path) -> None:
    started = RecordingRecord(1, 0.5, "", "mic", "started", "recordings/mic.wav", None, "", "node:recorders")
    folder = session(tmp_path, started, *MARKS)
    assert run("add", folder).exit_code == 2 and "has no recordings yet: name a file" in run("add", folder).output
    (folder / "recordings").mkdir()
    shutil.copy(sound, folder / "recordings" / "mic.wav")
    silent = write_wav(tmp_path / "silent.wav", [], 16_000)
    assert run("add", folder, silent, "--at", "0").exit_code == 0
    done = run("add", folder, "--find-marks", "--json")
    files = json.loads(done.output)["files"]
    assert done.exit_code == 1 and [each["path"] for each in files] == [str(silent), "recordings/mic.wav"]
    assert [each["aligned_by"] for each in files] == ["given", "marks"] and files[0]["problem"]
    wrong = run("add", folder, "--at", "3")
    assert wrong.exit_code == 2 and "--at and --name are about one file: name it" in wrong.output


def test_flashes_and_sessions_without_marks_say_what_to_do(tmp_path: Path, sound: Path) -> None:
    folder = session(tmp_path, *FLASHES)
    done = run("add", folder, sound, "--find-marks")
    assert done.exit_code == 1
    assert "not aligned: the session's marks are flashes: look for them, and use --at FILE=markN" in done.output
    assert run("add", folder, sound, "--at", "6.5=mark1").exit_code == 0 and read_media(folder)[0].offset == 4.5
    shutil.rmtree(folder)
    done = run("add", session(tmp_path), sound, "--find-marks")
    assert done.exit_code == 1 and "the session has no mark that could be heard" in done.output


def test_a_session_that_was_interrupted_says_for_what_it_holds(tmp_path: Path, sound: Path) -> None:
    recovered = SessionRecord(3, 20.0, "", status="recovered")
    folder = session(tmp_path, MARKS[0], recovered, MARKS[1])
    done = run("add", folder, sound, "--find-marks")
    assert done.exit_code == 1 and "not aligned: 2 marks found" in done.output
    done = run("add", folder, sound, "--at", "6.5=mark1")
    assert "note: the session was interrupted, but not the recording: this alignment holds only before 20.0 s" in (
        done.output
    )
    done = run("add", folder, sound, "--at", "35.5=mark2", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.output)["files"][0]["remarks"][0].endswith("this alignment holds only after 20.0 s")


def test_a_recording_that_went_on_without_an_engine_begins_when_it_began(tmp_path: Path, sound: Path) -> None:
    recovered = SessionRecord(3, 20.0, "", status="recovered", downtime=30.0)
    folder = session(tmp_path, MARKS[0], recovered, MARKS[1])
    run("add", folder, sound, "--at", "65.5=mark2")  # 30 s later in the file than in the session
    for done in (run("list", folder), run("add", folder, sound)):
        assert "begins 4.500 s before the session (as you entered it)" in done.output, done.output


def test_a_bag_is_a_folder(tmp_path: Path) -> None:
    folder = session(tmp_path)
    bag = folder / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("rosbag2")
    (bag / "0.mcap").write_bytes(bytes(1_000))
    done = run("add", folder, bag, "--at", "0.5")
    [file] = read_media(folder)
    assert done.exit_code == 0 and (file.path, file.kind, file.bytes, file.sha256) == ("bag", "bag", 1_007, "")


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("ffmpeg"), reason="ffmpeg is not installed: no film is made")
def test_a_film(tmp_path: Path) -> None:
    recorded = record_marks([(1, 2.0), (2, 31.0)], offset=-1.5, seconds=35, noise=0.01)
    film = make_video(tmp_path / "room.mp4", write_wav(tmp_path / "a.wav", recorded), 35)
    folder = session(tmp_path, *MARKS)
    done = run("add", folder, film, "--find-marks")
    assert done.exit_code == 0 and "begins 1.500 s after the session" in done.output
    [file] = read_media(folder)
    assert (file.kind, file.fps) == ("video", 5.0) and file.duration == pytest.approx(35, abs=0.1)
