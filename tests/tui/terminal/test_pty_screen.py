"""Terminals that change their size, stop reading, or go: stop works meanwhile, and the truth is shown afterwards."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from time import monotonic, sleep

import pytest

from rise_engine.kernel.records import MemoryRecord
from tests.patience import PATIENCE
from tests.tui.fake import FakeClient
from tests.tui.scripted import scripted_console
from tests.tui.terminals import Terminal, terminal

pytestmark = pytest.mark.pty

STALLED = 4.0


def busy(fake: FakeClient, number: int) -> None:
    """A hundred records: tasks come and end, and a value changes each time."""
    for one in range(25):
        fake.task("raiseEventTopic", f"/e{number}x{one}", "SUCCEEDED", source="node:n")
        fake.emit(MemoryRecord(0, 0.0, "", "side", f"turn{number}x{one}", None, "node:n", created=False))


def to_memory(it: Terminal) -> None:
    for _ in range(6):
        if "MEMORY" in it.text:
            return
        it.cost(b"\t")
    raise AssertionError(it.text)


def until(it: Terminal, holds: Callable[[], object], what: str) -> None:
    end = monotonic() + PATIENCE
    while not holds():
        assert monotonic() < end, f"{what}, and it is\n{it.text}"
        it.read(0.2)


def test_a_storm_of_sizes_ends_in_the_same_screen_and_a_terminal_that_goes_detaches() -> None:
    with scripted_console() as (it, engine):
        to_memory(it)
        before = it.text
        for size in ((80, 24), (200, 50)) * 6:
            it.resize(*size)
            it.read(0.03)
        it.resize(120, 40)
        until(it, lambda: it.text == before, f"it was\n{before}")
        it.forget_screen()  # a window that was another one, and has its size again before the console has looked
        os.kill(it.process.pid, signal.SIGWINCH)
        until(it, lambda: it.text == before, f"it was\n{before}")
        for size in ((80, 24), (200, 50)):
            it.resize(*size)
            until(
                it, lambda: "LIVE" in it.lines[0] and "STOP" in it.text.splitlines()[-1], f"it is not whole at {size}"
            )
        it.press(b"\x07")
        engine.until_sent("stopAll")
        engine.do(lambda fake: busy(fake, 1))
        it.read(1)
        engine.do(lambda fake: busy(fake, 2))
        os.close(it.master)  # in the middle of a frame
        it.master = -1
        assert it.process.wait(60) == 128 + signal.SIGHUP
        assert engine.asked("stopAll") == 1
        with terminal("--wizard", "anna", home=it.home) as again:  # the engine goes on
            again.until_screen("LIVE")
            again.press(b"\x07")
            engine.until_sent("stopAll", times=2)


def test_a_terminal_that_takes_nothing_holds_nothing_up() -> None:
    """Neither the engine nor the console's own keys; and what it shows afterwards is the state of now."""
    with scripted_console() as (it, engine):
        to_memory(it)
        until, number = monotonic() + STALLED, 0
        while monotonic() < until:  # nobody reads the terminal
            number += 1
            engine.do(lambda fake, number=number: busy(fake, number))
            sleep(0.05)
        os.write(it.master, b"p")
        engine.until_sent("startCommunicationRobotAct", "Praise")
        for times, key in enumerate((b"\x07", b"\x1b[20~"), 1):  # ctrl+g and F9
            os.write(it.master, key)
            engine.until_sent("stopAll", times=times)
        it.until_screen(f"turn{number}x24")
        it.still(0.5)
        assert f"/e{number}x24" in it.text and "Praise" in it.text
        assert it.process.poll() is None
