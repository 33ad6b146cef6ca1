"""The driver: what it asks a terminal for, and what it hears of it."""

from __future__ import annotations

import asyncio
import os
import pty
import select
import tty
from collections.abc import AsyncIterator
from threading import Event, Thread
from time import monotonic

import pytest
import pytest_asyncio
from textual import events
from textual.message import Message

from rise_tui.rendering.terminal_driver import TerminalDriver, TerminalReader, read_together
from tests.patience import PATIENCE


def test_the_driver_asks_for_clicks_but_not_for_every_movement() -> None:
    written: list[str] = []

    class Silent(TerminalDriver):
        def __init__(self) -> None:
            self._mouse = True

        def write(self, data: str) -> None:
            written.append(data)

        def flush(self) -> None:
            pass

    driver = Silent()
    driver._enable_mouse_support()
    assert "\x1b[?1003h" not in "".join(written) and "\x1b[?1006h" in "".join(written)
    driver._disable_mouse_support()
    assert "\x1b[?1002l" in "".join(written) and "\x1b[?1000l" in "".join(written)


class Terminal:
    """A pty that is read; collects what it says."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.messages: list[Message] = []
        self.stop = Event()
        self.thread = Thread(target=TerminalReader(self.slave, self.messages.append, self.stop).run)
        self.thread.start()

    async def keys(self, data: bytes, count: int) -> list[tuple[str, bool | None]]:
        self.messages.clear()
        os.write(self.master, data)
        await self.until(lambda: len(self.heard) >= count)
        return [(key.key, read_together(key)) for key in self.heard]

    @property
    def heard(self) -> list[events.Key]:
        return [each for each in list(self.messages) if isinstance(each, events.Key)]

    async def taken(self) -> None:
        """Wait until what was sent has been read."""
        await self.until(lambda: not select.select([self.slave], [], [], 0)[0])

    async def until(self, holds: object) -> None:
        assert callable(holds)
        end = monotonic() + PATIENCE
        while not holds():
            assert monotonic() < end, self.messages
            await asyncio.sleep(0.001)

    def close(self) -> None:
        self.stop.set()
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()
        for descriptor in (self.master, self.slave):
            if descriptor >= 0:
                os.close(descriptor)


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A reader that waits for the rest of a sequence for as long as a busy machine needs to send it."""
    monkeypatch.setattr("textual.constants.ESCAPE_DELAY", PATIENCE)


@pytest_asyncio.fixture
async def terminal() -> AsyncIterator[Terminal]:
    made = Terminal()
    yield made
    made.close()


async def test_a_key_alone_is_known_to_be(terminal: Terminal) -> None:
    assert await terminal.keys(b"g", 1) == [("g", False)]
    assert await terminal.keys(b"\x1b[20~", 1) == [("f9", False)]


async def test_keys_of_one_read_came_together(terminal: Terminal) -> None:
    assert await terminal.keys(b"gp", 2) == [("g", True), ("p", True)]


async def test_what_follows_at_once_came_together(terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first byte of a paste may be read alone; what comes within a third of a millisecond was not typed."""
    read = os.read
    monkeypatch.setattr("rise_tui.rendering.terminal_driver.os.read", lambda descriptor, count: read(descriptor, 1))
    assert (await terminal.keys(b"gp", 2))[0] == ("g", True)


def test_what_no_terminal_brought_came_alone() -> None:
    assert not read_together(events.Key("g", "g"))


async def test_escape_alone_is_a_key_once_no_sequence_can_follow(terminal: Terminal) -> None:
    began = monotonic()
    assert await terminal.keys(b"\x1b", 1) == [("escape", False)]
    assert monotonic() - began > 0.09


@pytest.mark.parametrize(("data", "key"), [(b"\x1b\r", "enter"), (b"\x1b[", "left_square_bracket")])
async def test_what_came_with_escape_did_not_come_alone(data: bytes, key: str, terminal: Terminal) -> None:
    assert await terminal.keys(data, 1) == [(key, True)]


async def test_a_sequence_in_two_pieces_is_one_key(terminal: Terminal, patient: None) -> None:
    terminal.messages.clear()
    os.write(terminal.master, b"\x1b[2")
    await terminal.taken()
    assert await terminal.keys(b"0~", 1) == [("f9", False)]


@pytest.mark.parametrize("garbage", [b"\xff\xc3\x28", b"\x1b[99999999u", b"\x1b[<;;M", b"\x1b[<0;9999;-5M"], ids=repr)
async def test_garbage_ends_nothing(garbage: bytes, terminal: Terminal) -> None:
    os.write(terminal.master, garbage)
    await terminal.taken()
    end = monotonic() + PATIENCE
    while ("f9", False) not in await terminal.keys(b"\x1b[20~", 1):
        assert monotonic() < end


async def test_half_a_character_waits_for_its_other_half(terminal: Terminal) -> None:
    os.write(terminal.master, b"\xc3")
    await terminal.taken()
    assert await terminal.keys(b"\xa4", 1) == [("ä", False)]


async def test_a_terminal_that_has_gone_ends_the_reading(terminal: Terminal) -> None:
    assert await terminal.keys(b"g", 1) == [("g", False)]
    master, terminal.master = terminal.master, -1
    os.close(master)
    await terminal.until(lambda: not terminal.thread.is_alive())
    assert len(terminal.heard) == 1
