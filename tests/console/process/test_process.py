"""The console as a person starts it: a process on a terminal of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.console.fake import DEMO
from tests.console.terminals import ROOT, alive, terminal
from tests.patience import PATIENCE

pytestmark = pytest.mark.pty


def test_start_press_stop_and_leave() -> None:
    with terminal("--config", DEMO, "--seed", "1", "--wizard", "anna") as it:
        it.until("LIVE")
        it.press(b"g")
        it.until("running")
        it.press(b"\x1b[20~")  # F9
        it.until("everything asked has confirmed")
        it.press(b"\x03")
        it.until("End the session")
        it.press(b"\x18")  # ctrl+x
        it.until("Type end and press enter")
        it.press(b"end\r")
        it.until("ended: the record is in ")
        assert it.ended() == 0
        assert not [engine for engine in it.engines() if alive(engine)]


def test_detach_and_come_back_to_what_went_on() -> None:
    with terminal("--config", DEMO, "--seed", "1", "--wizard", "anna") as it:
        it.until("LIVE")
        it.press(b"m")
        it.until("running")
        it.press(b"\x03")
        it.until("Detach (d)")
        it.press(b"d")
        it.until("detached: Demo study goes on; come back with: rise-tui")
        assert it.ended() == 0
        (engine,) = it.engines()
        assert alive(engine)
        with terminal("--wizard", "anna", home=it.home) as again:
            again.until("LIVE")
            again.until("waiting")  # the rule went on to its next state meanwhile
            assert again.engines() == [engine]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_detaches_and_gives_the_terminal_back(number: signal.Signals) -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        it.press(b"g")
        it.until("running")
        it.process.send_signal(number)
        assert it.ended() == 128 + number
        it.read(0.2)
        assert b"\x1b[?1049l" in it.shown, "the terminal was not given back"
        assert all(alive(engine) for engine in it.engines()) and it.engines()


def test_a_closed_terminal_detaches() -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        os.close(it.master)
        it.master = -1
        assert it.process.wait(PATIENCE) == 128 + signal.SIGHUP
        assert all(alive(engine) for engine in it.engines()) and it.engines()


def test_a_console_that_is_killed_changes_nothing() -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        it.process.kill()
        it.process.wait()
        with terminal("--config", DEMO, home=it.home) as again:  # the same line again attaches
            again.until("LIVE")


def test_the_session_of_another_participant_is_not_attached_to() -> None:
    with terminal("--config", DEMO, "--seed", "1", "--participant", "P07") as it:
        it.until("LIVE")
        with terminal("--config", DEMO, "--participant", "P08", home=it.home) as other:
            other.until("is running already, with --participant P07 and not P08")
            assert other.ended() == 2
        with terminal("--config", DEMO, "--participant", "P07", home=it.home) as again:
            again.until("WATCHING")


def test_an_engine_that_is_killed_is_told_and_its_session_recovered() -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        it.press(b"p")
        it.until("running")
        os.kill(it.engines()[0], signal.SIGKILL)
        it.until("ENGINE GONE")
        it.press(b"\x03")
        it.until("Leave (l)")
        it.press(b"l")
        it.until("to recover the session: rise-tui --config ")
        assert it.ended() == 0
        with terminal("--config", DEMO, home=it.home) as again:
            again.until("r, n or q?")
            again.press(b"q\r")
            assert again.ended() == 0
        with terminal("--config", DEMO, "--recover", home=it.home) as again:
            again.until("the session goes on; what the robot was doing counts as lost")
            again.until("failed")  # the act that the robot was doing counts as lost


def test_consoles_go_on_with_a_session_whose_engine_was_killed() -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        with terminal("--observe", home=it.home) as watching:
            watching.until("WATCHING")
            it.press(b"p")
            it.until("running")
            os.kill(it.engines()[0], signal.SIGKILL)
            watching.until("ENGINE GONE")
            watching.press(b"\x03")
            watching.until("Watch (r)")
            watching.press(b"r")
            watching.until("nobody has recovered it yet")
            watching.until_screen("Watch (r)", gone=True)  # else it still seems to be there the next time
            it.until("ENGINE GONE")
            it.press(b"\x03")
            it.until("Recover (r)")
            it.press(b"r")
            it.until("LIVE")
            it.until("what the robot was doing counts as lost")
            it.until("failed")  # the act that the robot was doing counts as lost
            it.press(b"p")
            it.until("running")
            watching.press(b"\x03")
            watching.until("Watch (r)")
            watching.press(b"r")
            watching.until("has control")


def test_two_consoles_take_control_from_one_another() -> None:
    with terminal("--config", DEMO, "--seed", "1", "--wizard", "anna") as anna:
        anna.until("LIVE")
        with terminal("--wizard", "ben", home=anna.home) as ben:
            ben.until("WATCHING · anna has control")
            ben.press(b"\x1b[19~")  # F8
            ben.until("Take it (t)")
            ben.press(b"t")
            ben.until("LIVE")
            anna.until("ben took control at ")


def test_an_observer_watches_and_starts_no_session() -> None:
    with terminal("--config", DEMO, "--observe") as it:
        it.until("is running, and --observe starts none")
        assert it.ended() == 2 and it.engines() == []


def test_a_refused_scenario_is_told_with_all_findings_and_no_console(tmp_path: Path) -> None:
    (tmp_path / "acts").mkdir()
    (tmp_path / "acts" / "a.xml").write_text("<Dialogs><Dialog name='A'><Spech/></Dialog></Dialogs>", encoding="utf-8")
    (tmp_path / "scenario.toml").write_text('titel = "x"\n', encoding="utf-8")
    with terminal("--config", str(tmp_path)) as it:
        assert it.ended() == 1 and it.engines() == []
        it.read(0.2)
        said = it.shown.decode()
        assert "acts/a.xml:1:" in said and "scenario.toml:1:1" in said and "\x1b" not in said
        assert "was refused: nothing was started" in said


def test_without_a_terminal_it_says_what_to_use_instead() -> None:
    command = [sys.executable, "-m", "rise_tui", "--config", DEMO]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 2 and "rise-engine run" in done.stderr


def test_a_recorded_session_is_played_again() -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        it.press(b"g")
        it.until("running")
        it.press(b"\x03")
        it.until("End the session")
        it.press(b"\x18")  # ctrl+x
        it.until("Type end and press enter")
        it.press(b"end\r")
        it.until("ended: the record is in ")
        it.ended()
        session = next(Path(it.home, "sessions").iterdir()).name
        with terminal("--replay", session, "--speed", "5", home=it.home) as again:
            again.until("REPLAY")
            again.until("SESSION ENDED")
            again.press(b"\x03")
            assert again.ended() == 0
        with terminal("--replay", session[:-1], home=it.home) as again:
            again.until(f"did you mean `{session}`")
