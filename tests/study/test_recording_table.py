"""`[recording]` of study.toml: what it says, and everything that is wrong with it at once."""

from __future__ import annotations

from pathlib import Path

from rise_engine.study.model import MarkerSettings, RecorderSettings, RecordingSettings, SyncSettings
from rise_engine.study.study_toml import load_study
from tests.study.studies import DESIGN, write_study

LINES = DESIGN.count("\n")


def read(folder: Path, text: str) -> RecordingSettings:
    return write_study(folder, f"{DESIGN}[recording]\n{text}", plan=False).recording


def found(folder: Path, text: str) -> list[str]:
    """The findings about `[recording]`, whose lines count from its own."""
    write_study(folder, plan=False)
    (folder / "study.toml").write_text(f"{DESIGN}[recording]\n{text}", "utf-8")
    loaded = load_study(folder)
    return [
        f"{each.location.line - LINES - 1}:{each.location.column}: {each.severity} {each.code}: {each.message}"
        for each in loaded.diagnostics
        if each.location.line > LINES
    ]


def test_nothing_records_where_nothing_is_said(tmp_path: Path) -> None:
    assert write_study(tmp_path / "a", plan=False).recording == RecordingSettings()
    assert read(tmp_path / "b", "lsl = false\nsync = false\n") == RecordingSettings()


def test_recorders_markers_and_marks_are_read(tmp_path: Path) -> None:
    settings = read(
        tmp_path,
        """camera = { by = "ffmpeg", input = ["-f", "v4l2", "-i", "/dev/video0"], stalled = "8 s" }
        obs = { password_file = "~/.config/rise/obs" }
        lsl = { scope = "link", payload = "json" }
        sync = { end = false, play = ["aplay", "-q", "{file}"] }
        folder = "videos"
        consent = "video"
        """,
    )
    assert settings == RecordingSettings(
        recorders=(
            RecorderSettings("camera", "ffmpeg", {"input": ["-f", "v4l2", "-i", "/dev/video0"]}, 8.0),
            RecorderSettings("obs", "obs", {"password_file": "~/.config/rise/obs"}),
        ),
        markers=MarkerSettings("link", "json"),
        sync=SyncSettings(end=False, play=("aplay", "-q", "{file}")),
        folder=str(tmp_path / "videos"),
        consent="video",
    )
    usual = read(tmp_path / "usual", "lsl = true\nsync = true\n")
    assert (usual.markers, usual.sync) == (MarkerSettings(), SyncSettings())


def test_a_table_of_its_own_is_the_same_as_one_in_a_line(tmp_path: Path) -> None:
    line = read(tmp_path / "line", 'bag = { by = "rosbag2", topics = ["/rise/record"] }\n')
    table = read(tmp_path / "table", '[recording.bag]\nby = "rosbag2"\ntopics = ["/rise/record"]\n')
    assert line == table


def test_everything_that_is_wrong_is_told_at_once_where_it_stands(tmp_path: Path) -> None:
    told = found(
        tmp_path,
        """camera = { by = "fmpeg", input = ["-i", "x"] }
obs = { url = "http://127.0.0.1:4455", pasword_file = "x" }
labrecorder = { port = 123456, stalled = "soon" }
mic = { by = "ffmpeg", input = "hw:0", kind = "sound" }
bag = { by = "rosbag2", node = "recorder", topics = ["/a"] }
room = { url = "x" }
"2nd" = { by = "obs" }
marks = { by = "obs" }
video = true
lls = true
synch = { start = true }
sync = { strat = true, medium = "light", play = ["aplay"] }
lsl = { scope = "world", payload = 3 }
consent = "the video"
folder = 7
""",
    )
    assert told == [
        "1:17: error unknown-name: there is no recorder `fmpeg`; did you mean `ffmpeg`?",
        '2:15: error recorder-option: `url` begins with ws:// or wss://: url = "ws://127.0.0.1:4455"',
        "2:55: error recorder-option: `pasword_file` is not an option of this recorder; did you mean `password_file`?",
        "3:24: error recorder-option: `port` is a whole number from 1 to 65535",
        "3:42: error wrong-value: `soon` is not a time without growth after which it counts as stalled; write "
        "10 s, from 3 s to 1 h",
        '4:32: error recorder-option: `input` is a list of texts: input = ["-f", "v4l2", "-i", "/dev/video0"]',
        "4:47: error recorder-option: `kind` is one of video, audio",
        '5:32: error recorder-option: `node` is the full name of the node that records: node = "/rosbag2_recorder"',
        "5:53: error recorder-option: `topics` is for a recorder that is started for the session; the recorder at "
        "`node` has its own",
        '6:1: error missing-value: `room` needs `by`, the kind of its recorder: room = { by = "..." }, one of '
        "`ffmpeg`, `labrecorder`, `obs`, `rosbag2`",
        "7:1: error bad-name: a recorder has a name of letters, digits, `_` and `-`, beginning with a "
        "letter, not `2nd`",
        "8:1: error bad-name: records call something else `marks`; take another name",
        '9:1: error wrong-type: a recorder is a table: video = { by = "ffmpeg", ... }',
        "10:1: error unknown-key: unknown key `lls`; did you mean `lsl`?",
        "11:1: error unknown-key: unknown key `synch`; did you mean `sync`?",
        "12:10: error unknown-key: unknown key `strat`; did you mean `start`?",
        "12:33: error wrong-value: `medium` is one of `sound`, `flash`, not `light`",
        "12:49: error wrong-value: `play` is a program that plays a sound, with {file} for it: play = "
        '["aplay", "{file}"]',
        "13:17: error wrong-value: `scope` is one of `machine`, `link`, `site`, not `world`",
        "13:36: error wrong-type: `payload` is a text",
        "14:11: error bad-name: a consent has a name of letters, digits and `_`, not `the video`",
        '15:10: error wrong-type: `folder` is a text: folder = "/data/videos"',
    ]


def test_a_recorder_that_is_not_installed_here_is_a_warning(tmp_path: Path) -> None:
    """The study may be looked at on another computer than the one that records."""
    told = found(tmp_path, 'eyes = { by = "acme_tracker_9000" }\n')
    assert told == [
        "1:15: warning no-recorder: there is no recorder `acme_tracker_9000` on this computer; there are `ffmpeg`, "
        "`labrecorder`, `obs`, `rosbag2`"
    ]
