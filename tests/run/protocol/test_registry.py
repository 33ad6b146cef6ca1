"""Where sessions are reached: the folder is safe, a lock goes with its process, and what is left over does no harm."""

from __future__ import annotations

import os
import signal
import socket
import stat
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path

import pytest

from rise_engine.run.protocol import registry
from rise_engine.run.protocol.registry import RegistryError

HOLDER = """
import socket, sys
from rise_engine.run.protocol.registry import acquire_lock
lock = acquire_lock(sys.argv[1])
listening = socket.socket(socket.AF_UNIX)
listening.bind(str(lock.socket))
listening.listen()
print("held", flush=True)
sys.stdin.read()
"""


def test_the_folder_is_made_and_is_ones_own(scratch: Path) -> None:
    folder = registry.runtime_folder()
    assert folder == scratch / "run" and stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert registry.runtime_folder() == folder


def test_which_folder(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RISE_RUNTIME")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(scratch))
    assert registry.runtime_folder() == scratch / "rise-tui"
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    uid = os.getpid() + 1_000_000  # nobody's; so the folder that is made is not this user's
    monkeypatch.setattr(os, "getuid", lambda: uid)
    try:
        with pytest.raises(RegistryError, match=f"^/tmp/rise-tui-{uid} belongs to another user"):
            registry.runtime_folder()
    finally:
        Path(f"/tmp/rise-tui-{uid}").rmdir()


def test_an_unsafe_folder_is_refused(scratch: Path) -> None:
    run = scratch / "run"
    run.mkdir(0o700)
    run.chmod(0o750)
    with pytest.raises(RegistryError, match=r"open to other users.*chmod 700"):
        registry.runtime_folder()
    run.rmdir()
    (scratch / "real").mkdir(0o700)
    run.symlink_to(scratch / "real")
    with pytest.raises(RegistryError, match="is a link"):
        registry.runtime_folder()
    run.unlink()
    run.touch()
    with pytest.raises(RegistryError, match="is not a folder"):
        registry.runtime_folder()
    run.unlink()
    if os.getuid() == 0:
        run.mkdir(0o700)
        os.chown(run, 65534, 65534)
        with pytest.raises(RegistryError, match="belongs to another user"):
            registry.acquire_lock("x")


def test_a_folder_that_cannot_be_made(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (scratch / "file").touch()
    monkeypatch.setenv("RISE_RUNTIME", str(scratch / "file" / "run"))
    with pytest.raises(RegistryError, match="cannot be created: Not a directory"):
        registry.runtime_folder()


def test_the_name_of_a_session(scratch: Path) -> None:
    folder = scratch / "Ölüm & Leben (2)"
    folder.mkdir()
    (scratch / "link").symlink_to(folder)
    name = registry.session_name(folder)
    assert name.startswith("olum-leben-2-") and len(name) == len("olum-leben-2-") + 6
    assert registry.session_name(scratch / "link") == name == registry.session_name(f"{folder}/")
    (scratch / "other" / folder.name).mkdir(parents=True)
    assert registry.session_name(scratch / "other" / folder.name) != name
    assert registry.session_name("/").startswith("scenario-")
    assert len(registry.session_name("/" + "x" * 200)) <= 39
    for odd in ("", "../x", "a/b", ".hidden", "x" * 65):
        with pytest.raises(RegistryError, match="cannot be the name"):
            registry.socket_path(odd)


def test_a_path_that_is_too_long(scratch: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RISE_RUNTIME", str(scratch / ("x" * 100)))
    with pytest.raises(RegistryError, match="shorter path in RISE_RUNTIME"):
        registry.acquire_lock("name")


def test_one_lock_at_a_time_and_nothing_left_after_it(scratch: Path) -> None:
    lock = registry.acquire_lock("study-123456")
    assert lock is not None and registry.running_names() == ["study-123456"]
    assert registry.acquire_lock("study-123456") is None
    other = registry.acquire_lock("other-123456")
    assert other is not None and registry.running_names() == ["other-123456", "study-123456"]
    lock.socket.touch()
    lock.close()
    lock.close()
    other.close()
    assert registry.running_names() == [] and list(registry.runtime_folder().iterdir()) == []
    with closing(registry.acquire_lock("study-123456") or pytest.fail("it is free again")) as again:
        assert again.name == "study-123456"


def test_asking_whether_it_is_locked_keeps_nobody_from_locking(scratch: Path) -> None:
    done = threading.Event()

    def look() -> None:
        while not done.is_set():
            registry.running_names()

    looking = threading.Thread(target=look)
    looking.start()
    try:
        for _ in range(200):
            lock = registry.acquire_lock("busy-123456")
            assert lock is not None
            lock.close()
    finally:
        done.set()
        looking.join()


def test_a_name_without_its_digits(scratch: Path) -> None:
    with pytest.raises(RegistryError, match="no session study is running; no session is running"):
        registry.find_running("study")
    with (
        closing(registry.acquire_lock("study-123456") or pytest.fail("")),
        closing(registry.acquire_lock("study-2-abcdef") or pytest.fail("")),
    ):
        assert registry.find_running("study") == "study-123456" == registry.find_running("study-123456")
        assert registry.find_running("study-2") == "study-2-abcdef"
        with pytest.raises(RegistryError, match="there are: study-123456, study-2-abcdef"):
            registry.find_running("studio")
        with (
            closing(registry.acquire_lock("study-654321") or pytest.fail("")),
            pytest.raises(RegistryError, match="could be study-123456 or study-654321"),
        ):
            registry.find_running("study")


@pytest.mark.slow
def test_a_killed_engine_leaves_no_lock_and_its_socket_is_replaced(scratch: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, "killed-123456"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        assert registry.running_names() == ["killed-123456"] and registry.acquire_lock("killed-123456") is None
        assert registry.ask_summary("killed-123456") is None, "it listens, but says nothing: one second"
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    path = registry.socket_path("killed-123456")
    assert path.is_socket() and registry.lock_path(path).exists(), "left over"
    assert registry.running_names() == [] and registry.ask_summary("killed-123456") is None
    lock = registry.acquire_lock("killed-123456")
    assert lock is not None and not path.exists()
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(lock.socket))
    lock.close()
