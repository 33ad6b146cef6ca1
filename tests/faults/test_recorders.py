"""Recorders beside a real session: what they do changes nothing in it, and whatever ends it ends in time."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from rise_engine.session.folder import JOURNAL
from tests.forked import run_engine
from tests.patience import PATIENCE
from tests.study.studies import DESIGN, write_study

from .test_serve import Serving, root

__all__ = ["root"]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed here"),
]
RECORDING = """
[recording]
nobody = { by = "labrecorder", port = 1 }
sync = { medium = "flash" }

[recording.camera]
by = "ffmpeg"
input = ["-re", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=10"]
output = ["-c:v", "mpeg4"]
"""
PEOPLE = "participant,consent_study,consent_recording,status,comment\nP01,2026-11-01,2026-11-01,,\nP02,2026-11-01,,,\n"


@pytest.fixture
def study(root: Path) -> Path:
    write_study(root / "study", DESIGN + RECORDING, PEOPLE)
    return root / "study"


class Recorded(Serving):
    """`rise-engine serve --study` in debug mode."""

    def __init__(self, study: Path, *arguments: str, participant: str = "P01", code: str = "") -> None:
        command = ("--study", study, "--participant", participant, "--mode", "debug")
        super().__init__(*command, *arguments, code=code)

    def lines(self, *kinds: str) -> list[dict[str, Any]]:
        found = []
        for line in (self.record / JOURNAL).read_bytes().splitlines():
            try:
                found.append(json.loads(line))
            except ValueError:
                continue  # it is being written
        return [each for each in found if each.get("kind") in kinds]

    def statuses(self, name: str) -> list[str]:
        return [each["status"] for each in self.lines("recording") if each["name"] == name]

    def until(self, name: str, status: str, times: int = 1) -> None:
        until = time.monotonic() + PATIENCE
        while self.statuses(name).count(status) < times:
            assert time.monotonic() < until and self.process.poll() is None, (self.statuses(name), self.said)
            time.sleep(0.05)

    @property
    def children(self) -> list[int]:
        """The processes that it has started, and theirs."""
        return _descendants(self.process.pid)


def _descendants(pid: int) -> list[int]:
    found = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True)
    direct = [int(each) for each in found.stdout.split()]
    return [*direct, *(deeper for each in direct for deeper in _descendants(each))]


def acts(serving: Recorded) -> list[tuple[Any, ...]]:
    """What happened in the session, without the clock and without what records it."""
    return [
        (each["kind"], each.get("behavior"), each.get("status"), each.get("key"))
        for each in serving.lines("task", "action", "memory", "rule", "event")
    ]


def test_a_session_is_the_same_with_recorders_and_ends_with_whole_files(study: Path) -> None:
    recorded = Recorded(study, "--record", "--act", "Greet")
    assert "recorded by nobody (labrecorder), camera (ffmpeg)" in recorded.said
    recorded.until("camera", "running")
    recorded.until("nobody", "failed")
    assert recorded.end() == 0
    assert recorded.statuses("camera") == ["started", "running", "stopped"]
    assert [each["number"] for each in recorded.lines("sync")] == [1, 2]
    stopped = recorded.lines("recording")[-1]
    assert (recorded.record / stopped["path"]).stat().st_size == stopped["bytes"]
    assert [each["name"] for each in json.loads((recorded.record / "media.json").read_bytes())] == ["camera"]
    last = recorded.lines("session", "recording", "sync")[-1]
    assert (last["kind"], last["status"]) == ("session", "ended")  # everything was over before it
    plain = Recorded(study, "--no-record", "--act", "Greet")
    until = time.monotonic() + PATIENCE
    while ("task", "Greet", "SUCCEEDED", None) not in acts(plain):
        assert time.monotonic() < until
        time.sleep(0.05)
    assert plain.end() == 0
    assert acts(plain) == acts(recorded) and plain.lines("recording") == []
    for each in (recorded, plain):
        replayed = run_engine("replay", each.record)
        assert replayed.returncode == 0, replayed.stderr


SOON_AGAIN = """from rise_engine.cli import main
from rise_engine.run.server.companions import Companions
Companions.__init__.__kwdefaults__["again_seconds"] = 0.2
main()
"""


def test_recorders_that_are_killed_are_on_record_end_and_begin_again_in_a_new_file(study: Path) -> None:
    serving = Recorded(study, "--record", code=SOON_AGAIN)
    serving.until("camera", "running")
    supervisor, *programs = serving.children
    assert programs
    os.kill(supervisor, signal.SIGKILL)
    serving.until("camera", "failed")
    reasons = [each["reason"] for each in serving.lines("recording") if each["status"] == "failed"]
    assert "SIGKILL ended its process" in reasons
    until = time.monotonic() + PATIENCE
    while any(_runs(pid) for pid in programs):
        assert time.monotonic() < until
        time.sleep(0.05)
    serving.until("camera", "running", times=2)
    assert len({each["path"] for each in serving.lines("recording") if each["status"] == "running"}) == 2
    assert serving.end() == 0 and serving.lines("session")[-1]["status"] == "ended"


def _runs(pid: int) -> bool:
    found = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout.strip()
    return bool(found) and not found.startswith("Z")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process that its parent has died")
def test_nothing_records_any_longer_when_all_is_killed_at_once(study: Path) -> None:
    serving = Recorded(study, "--record")
    serving.until("camera", "running")
    supervisor, *programs = serving.children
    assert programs
    os.kill(supervisor, signal.SIGSTOP)  # so that it does nothing about it
    serving.end(signal.SIGKILL)
    os.kill(supervisor, signal.SIGKILL)
    until = time.monotonic() + PATIENCE
    while any(_runs(pid) for pid in programs):
        assert time.monotonic() < until
        time.sleep(0.05)


def test_after_a_crash_of_the_engine_it_records_into_a_new_file(study: Path) -> None:
    first = Recorded(study, "--record")
    first.until("camera", "running")
    children = first.children
    first.end(signal.SIGKILL)
    again = Recorded(study, "--record", "--session", str(first.record))
    again.until("camera", "running", times=2)
    assert again.end() == 0
    paths = list(dict.fromkeys(each["path"] for each in again.lines("recording") if each["name"] == "camera"))
    stem = f"recordings/{first.record.name}_camera"
    assert paths == [f"{stem}.mkv", f"{stem}_2.mkv"]
    files = {each["path"] for each in json.loads((again.record / "media.json").read_bytes())}
    assert files == set(paths)
    assert not any(_runs(pid) for pid in children)


def test_a_second_signal_does_not_wait_for_recorders(study: Path) -> None:
    serving = Recorded(study, "--record")
    serving.until("camera", "running")
    supervisor = serving.children[0]
    os.kill(supervisor, signal.SIGSTOP)  # it hangs
    serving.process.send_signal(signal.SIGINT)  # another one, because two of a kind that come together are one
    assert serving.end() == 0
    assert serving.lines("recording")[-1]["reason"] == "its process was not waited for, and was ended"
    assert serving.lines("session")[-1]["status"] == "ended"


def test_one_who_has_not_consented_is_not_recorded_which_is_said_before_and_on_record(study: Path) -> None:
    serving = Recorded(study, "--record", participant="P02")
    why = "nothing is recorded: P02 has not consented to it (consent_recording of participants.csv has no date)"
    assert why in serving.said
    assert serving.end() == 0
    assert [each["text"] for each in serving.lines("note")].count(why) == 1
    assert serving.lines("recording") == [] and not (serving.record / "recordings").exists()
