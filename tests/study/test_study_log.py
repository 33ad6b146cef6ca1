"""The study's log: nothing lost, nothing twice, whoever is killed and whoever else writes."""

from __future__ import annotations

import errno
import json
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest

from rise_engine.base.files import Disk
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.study import study_log
from rise_engine.study.study_log import LOG_FILE, SET_ASIDE_FILE, LockedLog, StudyLogError, read_log
from tests.forked import Forked

BEGINNING = b'{"kind":"taken","at":"2026-11-21T14:15:03.000+01:00","slot":1,"participant":"P01"}\n'


def seven() -> datetime:
    return datetime(2026, 11, 21, 7, 0, tzinfo=timezone(timedelta(hours=1)))


def test_what_is_appended_is_read(tmp_path: Path) -> None:
    with LockedLog(tmp_path, now=seven) as log:
        log.append("planned", plan_hash="abc")
        log.append("taken", slot=1, participant="P01")
        assert [entry.kind for entry in log.entries()] == ["planned", "taken"]
    text = (tmp_path / LOG_FILE).read_text()
    assert json.loads(text.splitlines()[1]) == {
        "kind": "taken",
        "at": "2026-11-21T07:00:00.000+01:00",
        "slot": 1,
        "participant": "P01",
    }
    taken = read_log(tmp_path)[1]
    assert (taken.kind, taken.line, taken.get("participant"), taken.get("nothing", 7)) == ("taken", 2, "P01", 7)
    assert (tmp_path / LOG_FILE).stat().st_mode & 0o777 == 0o600


def test_no_log_has_no_entries(tmp_path: Path) -> None:
    assert read_log(tmp_path) == []
    assert not (tmp_path / LOG_FILE).exists()


@pytest.mark.parametrize("kept", range(1, len(BEGINNING) - 1))
def test_a_torn_line_is_set_aside(tmp_path: Path, kept: int) -> None:
    """At whatever byte the program was killed."""
    (tmp_path / LOG_FILE).write_bytes(BEGINNING + BEGINNING[:kept])
    diagnostics = Diagnostics()
    assert len(read_log(tmp_path, diagnostics)) == 1
    (found,) = diagnostics.sorted()
    assert (found.severity, found.code, found.location.line) == ("warning", "log-torn", 2)
    with LockedLog(tmp_path, now=seven) as log:
        log.append("taken", slot=2, participant="P02")
    assert [entry.get("slot") for entry in read_log(tmp_path)] == [1, 2]
    assert (tmp_path / SET_ASIDE_FILE).read_bytes() == BEGINNING[:kept] + b"\n"


def test_a_line_that_only_lacks_its_end_counts(tmp_path: Path) -> None:
    (tmp_path / LOG_FILE).write_bytes(BEGINNING.rstrip(b"\n"))
    with LockedLog(tmp_path) as log:
        assert [entry.line for entry in log.entries()] == [1]
        assert log.append("outcome", status="complete").line == 2
    assert [entry.kind for entry in read_log(tmp_path)] == ["taken", "outcome"]
    assert not (tmp_path / SET_ASIDE_FILE).exists()


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        (b"nonsense", "this line is not JSON"),
        (b"\xff\xfe", "this line is not UTF-8"),
        (b"[1, 2]", "this line is not an entry"),
        (b'{"kind": "taken"}', "this line is not an entry"),
    ],
)
def test_a_changed_line_is_found_and_nobody_writes_behind_it(tmp_path: Path, line: bytes, sentence: str) -> None:
    """It may have said who holds a slot: to go on without it could give that slot twice."""
    (tmp_path / LOG_FILE).write_bytes(BEGINNING + line + b"\n" + BEGINNING)
    diagnostics = Diagnostics()
    assert len(read_log(tmp_path, diagnostics)) == 2
    (found,) = diagnostics.sorted()
    assert (found.severity, found.location.line) == ("error", 2)
    assert sentence in found.message
    with pytest.raises(StudyLogError, match=rf"{LOG_FILE}:2: {sentence}"), LockedLog(tmp_path):
        pass


class _FullDisk(Disk):
    """Takes half of what is written."""

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        super().write(descriptor, data[: len(data) // 2], offset)
        raise OSError(errno.ENOSPC, "full")


def test_a_full_disk_leaves_nothing_of_an_entry(tmp_path: Path) -> None:
    (tmp_path / LOG_FILE).write_bytes(BEGINNING)
    with LockedLog(tmp_path, disk=_FullDisk()) as log:
        with pytest.raises(StudyLogError, match="the disk is full"):
            log.append("outcome", status="complete")
        assert len(log.entries()) == 1
    assert (tmp_path / LOG_FILE).read_bytes() == BEGINNING


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StudyLogError, match="cannot be opened"), LockedLog(tmp_path / "nowhere"):
        pass


def test_the_log_is_put_anew(tmp_path: Path) -> None:
    (tmp_path / LOG_FILE).write_bytes(BEGINNING * 3)
    with LockedLog(tmp_path, now=seven) as log:
        log.rewrite(log.entries()[1:])
        assert [entry.line for entry in log.entries()] == [1, 2]
        log.append("withdrawn", slot=1)
    assert [entry.kind for entry in read_log(tmp_path)] == ["taken", "taken", "withdrawn"]
    assert [path.name for path in tmp_path.iterdir()] == [LOG_FILE]


def test_the_log_is_put_anew_while_another_one_opens_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between opening and locking: the lock is then on a file that nobody reads any more."""
    lock, before = study_log._try_lock, LockedLog(tmp_path)
    before.__enter__()
    before.append("planned")

    def put_anew_first(descriptor: int) -> bool:
        monkeypatch.setattr(study_log, "_try_lock", lock)
        before.rewrite(before.entries())
        before.__exit__(None, None, None)
        return lock(descriptor)

    monkeypatch.setattr(study_log, "_try_lock", put_anew_first)
    with LockedLog(tmp_path) as log:
        log.append("taken", slot=1)
    assert [entry.kind for entry in read_log(tmp_path)] == ["planned", "taken"]


WRITER = """
import sys
from pathlib import Path
from rise_engine.study.study_log import LockedLog
folder, writer = Path(sys.argv[1]), int(sys.argv[2])
for number in range(25):
    with LockedLog(folder) as log:
        if number == 10 + writer:
            log.rewrite(log.entries())
        log.append("taken", writer=writer, number=number, before=len(log.entries()))
"""


def test_many_writers_at_once(tmp_path: Path) -> None:
    """Each sees what all others wrote before: the number of entries before grows by one each time; also while the file
    is put anew."""
    writers = [Forked(tmp_path, writer, code=WRITER) for writer in range(4)]
    assert [process.communicate()[1] for process in writers] == [""] * 4
    entries = read_log(tmp_path)
    assert [entry.get("before") for entry in entries] == list(range(100))
    assert sorted((entry.get("writer"), entry.get("number")) for entry in entries) == [
        (writer, number) for writer in range(4) for number in range(25)
    ]
