"""The journal's writer: everything that was handed over is on the disk once, in order, whatever the disk does."""

from __future__ import annotations

import errno
import threading
from pathlib import Path

import pytest

from rise_engine.base.files import Disk
from rise_engine.session.journal import Journal
from tests.patience import PATIENCE
from tests.run.engine.disks import FailingDisk, FullDisk


class Watch:
    """Waits for what the writer's thread says."""

    def __init__(self) -> None:
        self._changed = threading.Condition()

    def __call__(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def until(self, true: object) -> None:
        assert callable(true)
        with self._changed:
            assert self._changed.wait_for(true, PATIENCE)


@pytest.fixture(autouse=True)
def _always_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    """At each commit, whether the file is in its place; usually once a second."""
    monkeypatch.setattr("rise_engine.session.journal.CLOCK_SECONDS", 0.0001)


def journal(path: Path, disk: Disk | None = None, **more: object) -> tuple[Journal, Watch]:
    watch = Watch()
    return Journal(path, changed=watch, disk=disk, retry=0.001, **more), watch  # type: ignore[arg-type]


LINES = [f'{{"line":{n}}}\n'.encode() for n in range(200)]


def test_lines_become_durable_in_order(tmp_path: Path) -> None:
    it, watch = journal(tmp_path / "journal.jsonl")
    positions = [it.append(line) for line in LINES]
    assert positions == list(range(1, 201))
    watch.until(lambda: it.durable == 200)
    assert it.lag == 0.0 and it.error == ""
    assert it.close()
    assert it.path.read_bytes() == b"".join(LINES)
    assert it.path.stat().st_mode & 0o777 == 0o600


def test_an_existing_file_is_gone_on_with_and_never_made_anew(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    it, _ = journal(path)
    it.append(b"one\n")
    assert it.close()
    with pytest.raises(FileExistsError):
        journal(path)
    more, _ = journal(path, size=4)
    more.append(b"two\n")
    assert more.close()
    assert path.read_bytes() == b"one\ntwo\n"


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO, errno.EROFS])
@pytest.mark.parametrize("nth", range(2, 12))
@pytest.mark.parametrize("times", [1, 3])
def test_the_disk_fails_at_the_nth_call(tmp_path: Path, number: int, nth: int, times: int) -> None:
    """J01, J03: whichever call fails, nothing is lost, doubled or out of order once the disk works again."""
    disk = FailingDisk(lambda call, what: number if nth <= call < nth + times else None)
    it, watch = journal(tmp_path / "journal.jsonl", disk)
    for n in range(5):
        it.append(LINES[n])
        watch.until(lambda n=n: it.durable > n)  # one by one, so that there are that many calls
    assert it.close()
    assert it.path.read_bytes() == b"".join(LINES[:5])
    assert len(disk.calls) >= nth


def test_a_failing_disk_and_its_recovery_are_reported(tmp_path: Path) -> None:
    disk = FullDisk()
    it, watch = journal(tmp_path / "journal.jsonl", disk)
    it.append(b"one\n")
    watch.until(lambda: it.durable == 1)
    disk.number = errno.ENOSPC
    it.append(b"two\n")
    watch.until(lambda: it.error)
    assert it.error == "the disk is full"
    assert it.durable == 1
    assert it.lag > 0
    disk.number = None
    watch.until(lambda: it.durable == 2)
    assert it.error == ""
    assert it.close()


def test_a_disk_that_never_comes_back_does_not_hold_the_end(tmp_path: Path) -> None:
    disk = FullDisk()
    it, watch = journal(tmp_path / "journal.jsonl", disk)
    disk.number = errno.EIO
    it.append(b"one\n")
    watch.until(lambda: it.error)
    assert it.close(timeout=0.01) is False


def test_a_file_that_was_removed_is_written_anew(tmp_path: Path) -> None:
    it, watch = journal(tmp_path / "journal.jsonl")
    it.append(b"one\n")
    watch.until(lambda: it.durable == 1)
    it.path.unlink()
    it.append(b"two\n")
    watch.until(lambda: it.durable == 2)
    assert it.close()
    assert it.path.read_bytes() == b"one\ntwo\n"


class CountingDisk(Disk):
    """Says how often a file was opened again."""

    def __init__(self) -> None:
        self.reopened = 0
        self.opened_again = threading.Condition()

    def open(self, path: Path, *, create: bool) -> int:
        descriptor = super().open(path, create=create)
        if not create:
            with self.opened_again:
                self.reopened += 1
                self.opened_again.notify_all()
        return descriptor


def test_another_file_in_its_place_is_not_touched(tmp_path: Path) -> None:
    disk = CountingDisk()
    it, watch = journal(tmp_path / "journal.jsonl", disk)
    it.append(b"one\n")
    watch.until(lambda: it.durable == 1)
    other = tmp_path / "other"
    other.write_bytes(b"mine")
    other.replace(it.path)  # at once: a journal that is only missing is made anew
    lines = [b"one\n"]
    while not it.error:  # what comes before it is looked for again is still in the removed file
        lines.append(b"%d\n" % len(lines))
        it.append(lines[-1])
        watch.until(lambda: it.error or it.durable == len(lines))
    with disk.opened_again:  # also when it has been tried again and again
        assert disk.opened_again.wait_for(lambda: disk.reopened >= 3, PATIENCE)
    assert it.path.read_bytes() == b"mine"
    it.path.unlink()
    watch.until(lambda: it.durable == len(lines))
    assert it.close()
    assert it.path.read_bytes() == b"".join(lines)


def test_the_time_is_noted_for_whoever_finds_the_session_unfinished(tmp_path: Path) -> None:
    it, _ = journal(tmp_path / "journal.jsonl", now=lambda: 12.5)
    noted = tmp_path / "clock"
    beat = threading.Event()
    while not noted.read_bytes():
        assert not beat.wait(0.02)
    assert float(noted.read_bytes()) == 12.5
    assert it.close()
