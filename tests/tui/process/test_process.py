"""The console as a person starts it: a process on a terminal of its own."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from tests.patience import PATIENCE
from tests.tui.fake import DEMO
from tests.tui.terminals import STARTED, Terminal, alive, run_rise_tui, terminal

pytestmark = pytest.mark.pty

F8, F9, CTRL_C, CTRL_X = b"\x1b[19~", b"\x1b[20~", b"\x03", b"\x18"


def test_start_press_stop_leave_and_see_it_played_again() -> None:
    with terminal("--config", DEMO, "--seed", "1", "--wizard", "anna", program=STARTED) as it:
        it.until("LIVE")
        it.press(b"g")
        it.until("► running")
        it.press(F9)
        it.until("every part has confirmed")
        it.press(CTRL_C)
        it.until("End the session")
        it.press(CTRL_X)
        it.until("Type end and press enter")
        it.press(b"end\r")
        it.until("ended: the record is in ")
        assert it.ended() == 0
        assert not [engine for engine in it.engines() if alive(engine)]
        session = next(Path(it.home, "sessions").iterdir()).name
        with terminal("--replay", session, "--speed", "5", home=it.home) as again:
            again.until("REPLAY")
            again.until("SESSION ENDED")
            again.press(CTRL_C)
            assert again.ended() == 0
        with terminal("--replay", session[:-1], home=it.home) as again:
            again.until(f"did you mean `{session}`")


def test_consoles_come_and_go_and_the_session_goes_on() -> None:
    with terminal("--config", DEMO, "--seed", "1", "--participant", "P07", "--wizard", "anna") as it:
        it.until("LIVE")
        (engine,) = it.engines()
        with terminal("--config", DEMO, "--participant", "P08", home=it.home) as other:
            other.until("is running already, with --participant P07 and not P08")
            assert other.ended() == 2
        with terminal("--config", DEMO, "--participant", "P07", "--wizard", "ben", home=it.home) as ben:
            ben.until("WATCHING · anna has control")
            ben.press(F8)
            ben.until("Take it (t)")
            ben.press(b"t")
            ben.until("LIVE")
            it.until("ben took control at ")
            ben.process.send_signal(signal.SIGTERM)
            gives_back(ben, signal.SIGTERM)
        it.press(F8)
        it.until("Take it (t)")
        it.press(b"t")
        it.until("LIVE")
        it.press(b"m")
        it.until("► running")
        it.press(CTRL_C)
        it.until("Detach (d)")
        it.press(b"d")
        it.until("detached: Demo study goes on; come back with: ")
        assert it.ended() == 0
        with terminal("--wizard", "anna", home=it.home) as again:
            again.until("LIVE")
            again.until("waiting")  # the rule went on to its next state meanwhile
            again.process.kill()  # changes nothing
            again.process.wait()
        with terminal("--config", DEMO, "--wizard", "anna", home=it.home) as again:  # the line of the start attaches
            again.until("LIVE")
            again.process.send_signal(signal.SIGHUP)
            gives_back(again, signal.SIGHUP)
        with terminal("--wizard", "anna", home=it.home) as again:
            again.until("LIVE")
            os.close(again.master)
            again.master = -1
            assert again.process.wait(PATIENCE) == 128 + signal.SIGHUP
        assert it.engines() == [engine] and alive(engine)


def gives_back(it: Terminal, number: signal.Signals) -> None:
    """It leaves, and the terminal is as it was."""
    assert it.ended() == 128 + number
    it.read(0.2)
    assert b"\x1b[?1049l" in it.shown, "the terminal was not given back"


def test_an_engine_that_is_killed_is_told_and_its_session_recovered() -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        with terminal("--observe", home=it.home) as watching:
            watching.until("WATCHING")
            it.press(b"p")
            it.until("► running")
            os.kill(it.engines()[0], signal.SIGKILL)
            watching.until("ENGINE GONE")
            watching.press(CTRL_C)
            watching.until("Watch (r)")
            watching.press(b"r")
            watching.until("nobody has recovered it yet")
            watching.until_screen("Watch (r)", gone=True)  # else it still seems to be there the next time
            it.until("ENGINE GONE")
            it.press(CTRL_C)
            it.until("Recover (r)")
            it.press(b"r")
            it.until("LIVE")
            it.until("what the robot was doing counts as lost")
            it.until("failed")  # the act that the robot was doing counts as lost
            it.press(b"p")
            it.until("► running")
            watching.press(CTRL_C)
            watching.until("Watch (r)")
            watching.press(b"r")
            watching.until("has control")
        os.kill(it.engines()[0], signal.SIGKILL)
        it.until("ENGINE GONE")
        it.press(CTRL_C)
        it.until("Leave (l)")
        it.press(b"l")
        it.until("to recover the session: ")
        assert it.ended() == 0
        with terminal("--config", DEMO, home=it.home) as again:
            again.until("r, n or q?")
            again.press(b"q\r")
            assert again.ended() == 0
        with terminal("--config", DEMO, "--recover", home=it.home) as again:
            again.until("the session goes on; what the robot was doing counts as lost")
            again.until("failed")


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
    done = run_rise_tui("--config", DEMO)
    assert done.returncode == 2 and "rise-engine run" in done.stderr
