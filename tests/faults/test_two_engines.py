"""Never two engines on one session: real processes, other runtime folders, kills, copies, forks, other computers."""

from __future__ import annotations

import fcntl
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rise_engine.base.errors import SessionError
from rise_engine.base.files import is_locked
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import EngineGone
from rise_engine.run.protocol.registry import session_name
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.preparation import ServeRefused, SessionPreparation
from rise_engine.session import lock as locks
from rise_engine.session.folder import JOURNAL, find_unfinished, running_sessions
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.lock import HOLDER_FILE, JournalLock, JournalLockedError, file_system, read_holder
from rise_engine.session.recovery import recover
from tests.cli.processes import engine, folder
from tests.forked import Forked, run_engine
from tests.patience import PATIENCE

from .test_serve import Serving, wait_for_record

pytestmark = pytest.mark.slow

RUNNING = " is running: "
"""What is said to whoever is refused; then which process it is, or "another program" when that has only just begun and
not yet written who it is."""


class Runtimes:
    """Two runtime folders of one user, and one sessions folder."""

    def __init__(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.root = tmp_path
        self.runs = [Path(tempfile.mkdtemp(prefix="r-", dir="/tmp")) for _ in range(2)]
        self._monkeypatch = monkeypatch
        self._tried: list[Forked] = []
        monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "sessions"))
        self.use(0)

    def use(self, number: int) -> None:
        self._monkeypatch.setenv("RISE_RUNTIME", str(self.runs[number]))

    def try_to_serve(self, study: Path, how: list[str], **environment: str) -> Forked:
        """An engine that may be refused. Whatever becomes of the test, it does not outlive it."""
        tried = Forked("serve", study, *how, stdout=subprocess.DEVNULL, env={**os.environ, **environment})
        self._tried.append(tried)
        return tried

    def close(self) -> None:
        for each in self._tried:
            each.kill()
            each.communicate()
        for run in self.runs:
            for path in run.glob("*.lock"):
                if is_locked(path):
                    os.kill(int(path.read_text().split()[0]), signal.SIGKILL)
            shutil.rmtree(run, ignore_errors=True)


@pytest.fixture
def runtimes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Runtimes]:
    made = Runtimes(tmp_path, monkeypatch)
    yield made
    made.close()


def begun(study: Path, *more: object) -> Serving:
    it = Serving(study, *more)
    assert it.report.startswith("serving "), it.report
    wait_for_record(it.record, b'"kind":"robot"')
    return it


def killed(study: Path) -> Path:
    """A session whose engine was killed; its folder."""
    it = begun(study, "--new")
    assert it.end(signal.SIGKILL) == -signal.SIGKILL
    return it.record


@pytest.mark.parametrize("how", [[], ["--recover"], ["--new"]])
def test_a_running_session_is_not_begun_again_in_another_runtime_folder(runtimes: Runtimes, how: list[str]) -> None:
    study = folder(runtimes.root / "study")
    it = begun(study)
    before = (it.record / JOURNAL).read_bytes()
    runtimes.use(1)
    result = engine("serve", study, *how)
    assert result.returncode == 3, result.stderr
    assert it.record.name in result.stderr and f"process {it.process.pid} of " in result.stderr
    socket = runtimes.runs[0] / f"{session_name(study)}.sock"
    assert f"To attach: rise-tui --session {socket}." in result.stderr
    assert f"To end it: rise-engine stop {socket}" in result.stderr
    assert (it.record / JOURNAL).read_bytes() == before and len(list(it.record.parent.iterdir())) == 1
    assert it.end() == 0


@pytest.mark.parametrize("how", ["--recover", "--session"])
def test_another_name_does_not_recover_a_running_session(runtimes: Runtimes, how: str) -> None:
    study = folder(runtimes.root / "study")
    it = begun(study)
    if how == "--session":
        result = engine("serve", study, "--name", "other", "--session", it.record)
        assert result.returncode == 3 and f"process {it.process.pid} of " in result.stderr, result.stderr
    else:  # there is nothing to recover, so another session begins, as whoever gave it a name wants it
        other = begun(study, "--name", "other", "--recover")
        assert other.record != it.record
        assert other.end() == 0
    assert it.end() == 0
    assert engine("replay", it.record).stdout.startswith("identical")


def test_a_running_session_is_listed_attached_to_and_stopped_from_anywhere(runtimes: Runtimes) -> None:
    study = folder(runtimes.root / "study")
    it = begun(study, "--set", 'name="Bo"')
    socket = str(runtimes.runs[0] / f"{session_name(study)}.sock")
    runtimes.use(1)
    result = engine("sessions")
    assert result.stdout.startswith(f"{socket}  ") and str(it.record) in result.stdout
    assert "did not end" not in result.stderr
    assert [each["name"] for each in json.loads(engine("sessions", "--json").stdout)] == [socket]
    assert find_unfinished(str(study)) == [] and list(running_sessions(str(study))) == [it.record]
    assert engine("stop", runtimes.root).returncode == 1
    assert engine("stop", study).returncode == 0
    assert it.wait() == 0
    assert running_sessions(str(study)) == {} and not (it.record / HOLDER_FILE).exists()
    assert engine("stop", socket).returncode == 1


async def test_a_client_attaches_by_the_socket_that_the_folder_names(runtimes: Runtimes) -> None:
    it = begun(folder(runtimes.root / "study"))
    runtimes.use(1)
    holder = read_holder(it.record)
    assert holder is not None and holder.pid == it.process.pid and holder.is_this_computer
    client = SocketClient(holder.socket, "anna")
    assert (await client.attach()).folder == str(it.record)
    it.end(signal.SIGKILL)
    with pytest.raises(EngineGone, match="its process no longer exists"):
        async for _ in client.records():
            pass
    await client.close()


def test_the_lock_goes_with_the_process_however_that_ends(runtimes: Runtimes) -> None:
    study = folder(runtimes.root / "study")
    record = killed(study)
    assert not is_locked(record / JOURNAL) and read_holder(record) is not None
    assert find_unfinished(str(study)) == [record]
    runtimes.use(1)
    more = begun(study, "--recover")
    assert more.record == record
    assert more.end() == 0


def test_of_many_that_recover_at_once_one_does(runtimes: Runtimes) -> None:
    study = folder(runtimes.root / "study")
    record = killed(study)
    tried = [runtimes.try_to_serve(study, ["--name", f"n{number}", "--session", str(record)]) for number in range(6)]
    lines = [each.stderr.readline() for each in tried if each.stderr is not None]
    serving = [each for each, line in zip(tried, lines, strict=True) if line.startswith("In ") or "serving" in line]
    refused = [line for line in lines if f"the session {record.name}{RUNNING}" in line]
    assert len(serving) == 1 and len(refused) == 5, lines
    _end(tried, lines)
    assert engine("replay", record).returncode == 0
    contents = read_journal(record / JOURNAL)
    assert contents.ended and not contents.gaps and not contents.damaged


@pytest.mark.parametrize("how", [[], ["--new"]])
def test_of_many_that_begin_at_once_one_does(runtimes: Runtimes, how: list[str]) -> None:
    """Each with a runtime folder of its own, as cron, su and a console have."""
    study = folder(runtimes.root / "study")
    runs = [runtimes.root / f"run{number}" for number in range(4)]
    for run in runs:
        run.mkdir(0o700)
    tried = [runtimes.try_to_serve(study, how, RISE_RUNTIME=str(run)) for run in runs]
    lines = [each.stderr.readline() for each in tried if each.stderr is not None]
    assert sum(line.startswith("serving ") for line in lines) == 1, lines
    assert sum(RUNNING in line for line in lines) == 3, lines
    _end(tried, lines)
    assert len(list((runtimes.root / "sessions").iterdir())) == 1


def _end(tried: list[Forked], lines: list[str]) -> None:
    for each, line in zip(tried, lines, strict=True):
        refused = RUNNING in line
        if not refused:
            each.terminate()
        assert each.wait(PATIENCE) == (3 if refused else 0)


def test_a_copied_folder_is_not_locked(runtimes: Runtimes) -> None:
    study = folder(runtimes.root / "study")
    it = begun(study)
    copy = it.record.with_name("copy")
    shutil.copytree(it.record, copy)
    assert is_locked(it.record / JOURNAL) and not is_locked(copy / JOURNAL)
    assert find_unfinished(str(study)) == [copy]
    recover(copy)
    assert is_locked(it.record / JOURNAL)
    assert it.end() == 0


def test_a_forked_process_does_not_hold_the_lock(tmp_path: Path) -> None:
    """Neither one that goes on as it is nor one that becomes another program."""
    (tmp_path / JOURNAL).touch()
    lock = JournalLock(tmp_path / JOURNAL)
    sleeping = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, close_fds=False)
    ready, go = os.pipe()
    forked, there = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(go)
        os.write(there, b".")
        os.read(ready, 1)
        os._exit(0)
    os.close(ready)
    assert os.read(forked, 1) == b"."
    try:
        assert is_locked(tmp_path / JOURNAL), "the child that lets go of it takes it from nobody"
        lock.release()
        assert not is_locked(tmp_path / JOURNAL)
        JournalLock(tmp_path / JOURNAL).release()
    finally:
        os.close(go)
        os.waitpid(child, 0)
        os.close(forked)
        os.close(there)
        sleeping.communicate(b"\n")


def test_the_lock_is_there_before_a_byte_is_read_and_while_it_is_repaired(
    runtimes: Runtimes, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = killed(folder(runtimes.root / "study"))
    path = record / JOURNAL
    lines = path.read_bytes().splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if b'"kind":"robot"' in line)
    path.write_bytes(b"".join([*lines[:at], lines[at].replace(b"robot", b"rabot"), *lines[at + 1 :], b'{"torn']))
    seen: list[tuple[str, bool]] = []
    wrap(monkeypatch, "rise_engine.session.recovery.Replay", lambda: seen.append(("read", is_locked(path))))
    wrap(monkeypatch, "os.replace", lambda: seen.append(("replaced", is_locked(path))))
    lock = JournalLock(path)
    assert recover(record, lock=lock).report
    assert ("read", True) in seen and ("replaced", True) in seen and all(locked for _, locked in seen), seen
    assert is_locked(path), "the one that was written anew is locked like the one before"
    lock.release()
    assert not is_locked(path)


def wrap(monkeypatch: pytest.MonkeyPatch, name: str, also: Any) -> None:
    module, _, attribute = name.rpartition(".")
    function = getattr(sys.modules[module], attribute)

    def wrapped(*arguments: Any, **more: Any) -> Any:
        also()
        found = function(*arguments, **more)
        also()
        return found

    monkeypatch.setattr(name, wrapped)


def test_a_journal_that_was_removed_and_is_written_anew_is_locked(runtimes: Runtimes) -> None:
    it = begun(folder(runtimes.root / "study"))
    (it.record / JOURNAL).unlink()
    wait_for_file(it.record / JOURNAL)
    assert is_locked(it.record / JOURNAL)
    assert it.end() == 0
    assert engine("replay", it.record).returncode == 0


def wait_for_file(path: Path) -> None:
    """Until the engine, which looks once a second, has put it back."""
    import time

    deadline = time.monotonic() + PATIENCE
    while not path.exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_reading_needs_no_lock(runtimes: Runtimes) -> None:
    it = begun(folder(runtimes.root / "study"))
    assert engine("replay", it.record).stdout.startswith("note: the session has not ended properly")
    assert engine("export", it.record, "--format", "csv").stdout.startswith("session,")
    assert it.end() == 0


@pytest.mark.skipif(sys.platform != "linux" or os.getuid() != 0, reason="needs root to become somebody else")
def test_a_folder_that_may_only_be_read_is_refused_in_words(runtimes: Runtimes) -> None:
    record = killed(folder(runtimes.root / "study"))
    runtimes.root.chmod(0o755)
    program = (
        "import os, sys; from pathlib import Path; from rise_engine.session.recovery import recover\n"
        "from rise_engine.session.folder import SessionError\n"
        "os.setgroups([]); os.setgid(65534); os.setuid(65534)\n"
        "try: recover(Path(sys.argv[1]))\n"
        "except SessionError as error: print(error)\n"
    )
    record.chmod(0o755)
    for each in record.rglob("*"):
        each.chmod(0o755 if each.is_dir() else 0o444)
    for parent in (*record.parents,):
        if parent.stat().st_mode & 0o005 != 0o005 and parent.is_relative_to("/tmp/pytest-of-root"):
            parent.chmod(0o755)
    tried = subprocess.run([sys.executable, "-c", program, record], capture_output=True, text=True, check=False)
    assert "cannot be read and written: the file may not be written" in tried.stdout, tried
    assert "can be replayed and exported" in tried.stdout


# --- where a file system does not tell of locks -------------------------------------------------------------------


def of_another_computer(record: Path) -> None:
    note = json.loads((record / HOLDER_FILE).read_text())
    (record / HOLDER_FILE).write_text(json.dumps({**note, "host": "lab-2"}))


def test_another_computer_had_it_last(runtimes: Runtimes, monkeypatch: pytest.MonkeyPatch) -> None:
    study = folder(runtimes.root / "study")
    record = killed(study)
    of_another_computer(record)
    recover(record)  # on a disk of this machine the lock says it all; a copied or a renamed computer binds nobody
    assert not (record / HOLDER_FILE).exists()

    record = killed(study)
    of_another_computer(record)
    monkeypatch.setattr(locks, "file_system", lambda path: "nfs4")
    with pytest.raises(SessionError, match=r"of .* on the computer lab-2, since .*add --here to continue"):
        JournalLock(record / JOURNAL)
    order = SessionOptions(str(study), unfinished=str(record))
    with pytest.raises(ServeRefused) as refused:
        SessionPreparation(order, print)
    assert refused.value.report.code == 5 and "lab-2" in refused.value.report.lines[0]
    holder = read_holder(record)
    assert holder is not None and holder.host == "lab-2", "who only asked has changed nothing"
    prepared = SessionPreparation(SessionOptions(str(study), unfinished=str(record), from_other_computer=True), print)
    holder = read_holder(record)
    assert holder is not None and holder.host == platform.node()
    prepared.close()


def test_where_nothing_can_be_locked_it_is_asked_too(runtimes: Runtimes, monkeypatch: pytest.MonkeyPatch) -> None:
    record = killed(folder(runtimes.root / "study"))
    monkeypatch.setattr(locks, "file_system", lambda path: "cifs")
    with pytest.raises(SessionError, match="add --here to continue"):
        JournalLock(record / JOURNAL)
    JournalLock(record / JOURNAL, here=True).release()
    JournalLock(record / JOURNAL).release()  # it was let go of in order


def test_here_goes_with_a_recovery() -> None:
    assert "--here goes with" in engine("serve", ".", "--here").stderr
    assert "--here goes with" in run_engine("--config", ".", "--here", module="rise_tui").stderr


MOUNTS = r"""22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw
40 22 0:40 / /home rw,relatime shared:2 - nfs4 server:/home rw,vers=4.2
41 40 8:3 / /home/anna/my\040disk rw - xfs /dev/sdb1 rw
42 22 0:50 / /mnt/x rw - fuse.sshfs a: rw
43 42 0:51 / /mnt/x rw - tmpfs none rw
"""


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/srv/a", "ext4"),
        ("/home/anna/rise-sessions", "nfs4"),
        ("/homes", "ext4"),
        ("/home/anna/my disk/a", "xfs"),
        ("/mnt/x/y", "tmpfs"),
    ],
)
def test_the_kind_of_a_file_system(path: str, kind: str) -> None:
    assert file_system(Path(path), MOUNTS) == kind
    assert file_system(Path(path), "") == ""


def test_who_is_refused_is_told_even_without_a_note(tmp_path: Path) -> None:
    (tmp_path / JOURNAL).touch()
    lock = JournalLock(tmp_path / JOURNAL)
    (tmp_path / HOLDER_FILE).write_bytes(b"{half")
    with pytest.raises(JournalLockedError, match="another program has locked its journal"):
        JournalLock(tmp_path / JOURNAL)
    lock.release()
    with pytest.raises(SessionError, match="there is no journal"):
        JournalLock(tmp_path / "nothing.jsonl")


def test_asking_whether_a_session_runs_keeps_nobody_from_its_lock(tmp_path: Path) -> None:
    """However long one of them stands still while it looks."""
    (tmp_path / JOURNAL).touch()
    looking = os.open(tmp_path / JOURNAL, os.O_RDONLY)
    fcntl.flock(looking, fcntl.LOCK_SH)
    ends = threading.Timer(0.5, os.close, (looking,))
    ends.start()
    JournalLock(tmp_path / JOURNAL).release()
    ends.join()
