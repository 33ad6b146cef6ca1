"""The outlet of the Lab Streaming Layer by itself: whose settings hold, which clock, and who can connect."""

from __future__ import annotations

import configparser
import subprocess
import sys
import time
from asyncio import Event
from pathlib import Path

import pytest
from click.testing import CliRunner
from rise_adapters.lsl import outlet, send_markers

from rise_engine.base.errors import AdapterError
from rise_engine.base.exit_status import NO_SUCH_SESSION, USAGE
from rise_engine.cli.program import main
from rise_engine.ports.outlet import OutletPlan
from rise_engine.run.recording.companion_main import find_outlet


def settings(scope: str) -> configparser.ConfigParser:
    found = configparser.ConfigParser()
    found.optionxform = str  # type: ignore[assignment,method-assign]
    found.read_string(outlet.library_settings(scope))
    return found


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The lab's settings, which the library would read."""
    path = tmp_path / "lsl_api.cfg"
    monkeypatch.setenv("LSLAPICFG", str(path))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return path


def test_the_scope_is_ours_and_the_session_id_is_the_lab_s(lab: Path) -> None:
    lab.write_text(
        "[lab]\nSessionID = lab7\nKnownPeers = {10.0.0.7}\n"
        "[multicast]\nResolveScope = global\n[ports]\nBasePort = 17000\n"
    )
    found = settings("machine")
    assert found["multicast"]["ResolveScope"] == "machine" and list(found["multicast"]) == ["ResolveScope"]
    assert found["lab"]["SessionID"] == "lab7"
    assert found["ports"]["BasePort"] == "17000" and found["ports"]["IPv6"] == "disable"
    assert settings("site")["multicast"]["ResolveScope"] == "site" and "IPv6" not in settings("site")["ports"]


@pytest.mark.parametrize("text", [None, "no settings at all", "[lab\n", "[lab]\nSessionID = 100%\n"])
def test_settings_of_the_lab_that_are_none(lab: Path, text: str | None) -> None:
    if text is not None:
        lab.write_text(text)
    assert settings("link")["multicast"]["ResolveScope"] == "link"


def test_one_clock_is_no_offset_and_two_are_measured() -> None:
    assert outlet.clock_offset(time.monotonic) == 0.0
    assert outlet.clock_offset(lambda: time.monotonic() + 1000.0) == pytest.approx(1000.0, abs=0.01)
    assert outlet.clock_offset(lambda: time.monotonic() - 1000.0) == pytest.approx(-1000.0, abs=0.01)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux binds an open port to a device")
def test_with_the_scope_machine_ports_take_what_comes_over_the_loopback_only() -> None:
    """In a process of its own, because it is about all ports of a process."""
    program = """
import socket
from rise_adapters.lsl.outlet import bind_to_loopback
with socket.create_server(("0.0.0.0", 0)) as server, socket.socket(socket.AF_UNIX) as other:
    assert bind_to_loopback()
    assert server.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16).rstrip(b"\\0") == b"lo"
    with socket.create_connection(server.getsockname()) as client:
        server.accept()[0].close()
    assert other.fileno() >= 0
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)


async def test_a_missing_extra_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pylsl", None)
    with pytest.raises(AdapterError, match=r'pip install "rise-tui\[lsl\]"'):
        await send_markers(OutletPlan("nowhere"), Event())


async def test_a_library_that_is_missing_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "pylsl.py").write_text("raise RuntimeError('LSL binary library file was not found.')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "pylsl", raising=False)
    with pytest.raises(AdapterError, match="set PYLSL_LIB to its path"):
        await send_markers(OutletPlan("nowhere"), Event())


def test_it_is_found_without_naming_the_adapter() -> None:
    assert find_outlet("lsl") is send_markers
    with pytest.raises(AdapterError, match="there is no outlet 'mqtt'"):
        find_outlet("mqtt")


@pytest.mark.parametrize("session", ["nobody", "/tmp/nowhere/there.sock"])
def test_a_session_that_does_not_run(session: str) -> None:
    done = CliRunner().invoke(main, ["lsl", session])
    assert done.exit_code == NO_SUCH_SESSION and done.stderr.startswith("error: ")


def test_a_scope_that_is_none() -> None:
    assert CliRunner().invoke(main, ["lsl", "nobody", "--scope", "world"]).exit_code == USAGE
