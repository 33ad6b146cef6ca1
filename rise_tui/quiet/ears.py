"""Reading what a terminal sends, on the loop."""

from __future__ import annotations

import asyncio
import os
import select
from codecs import getincrementaldecoder
from collections.abc import Callable, Iterable
from contextlib import suppress
from time import perf_counter

from textual import constants, events
from textual._xterm_parser import XTermParser
from textual.message import Message

from rise_tui.quiet.outlet import Outlet

READ = 4096
ALONE = 0.0003
"""Seconds for which a key waits whether something follows it: what is pasted comes at once, and fingers do not."""
LATER = 0.005
"""Seconds after which a sequence that was not completed in time is looked at: Esc alone is one."""
_TOGETHER = "_read_together"


def read_together(event: events.Key) -> bool | None:
    """Whether a key came in one piece with others; None when no terminal has brought it."""
    found = event.__dict__.get(_TOGETHER)
    return found if isinstance(found, bool) else None


def mark_together(messages: Iterable[Message], *, more: bool) -> bool:
    """Mark the keys of one read; `more`: something follows at once. Returns whether there is a key among them."""
    keys = [message for message in messages if isinstance(message, events.Key)]
    for key in keys:
        key.__dict__[_TOGETHER] = more or len(keys) > 1
    return bool(keys)


class Ears:
    """Reads one terminal from now on and says what it sends; of each key it knows whether others came with it.

    Nothing that a terminal sends ends it; only `close` does, and a terminal that has gone.
    """

    def __init__(self, fileno: int, outlet: Outlet, said: Callable[[Message], None]) -> None:
        self._outlet, self._said = outlet, said
        self._loop = asyncio.get_running_loop()
        self._own = -1
        with suppress(OSError):
            # Opened anew, not to block: somebody else could read this terminal too, and leave us nothing.
            self._own = os.open(os.ttyname(fileno), os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
        self._fileno = self._own if self._own >= 0 else fileno
        self._parser = XTermParser()
        self._decode = getincrementaldecoder("utf-8")(errors="replace").decode
        self._look: asyncio.TimerHandle | None = None
        self._loop.add_reader(self._fileno, self._read)
        outlet.listening = self._fileno

    def close(self) -> None:
        self._stop()
        if self._own >= 0:
            os.close(self._own)
            self._own = -1

    def _stop(self) -> None:
        self._outlet.listening = -1
        with suppress(ValueError, OSError):
            self._loop.remove_reader(self._fileno)
        if self._look is not None:
            self._look.cancel()
            self._look = None

    def _read(self) -> None:
        try:
            data = os.read(self._fileno, READ)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        came = perf_counter()
        if not data:  # the terminal has gone
            self._stop()
            return
        messages: list[Message] = []
        for character in self._decode(data):
            messages += self._parsed(character)
        if mark_together(messages, more=False):
            mark_together(messages, more=self._more_comes(came))
            self._outlet.key_read()
        self._say(messages)
        if self._look is not None:
            self._look.cancel()
        self._look = self._loop.call_later(constants.ESCAPE_DELAY + LATER, self._look_again)

    def _more_comes(self, came: float) -> bool:
        """Not asleep: on a busy machine others would run meanwhile, for milliseconds."""
        until = came + ALONE
        while perf_counter() < until:
            if select.select((self._fileno,), (), (), 0)[0]:
                return True
        return False

    def _look_again(self) -> None:
        self._look = None
        messages = list(self._parser.tick())
        if any(isinstance(message, events.Key) and message.key != "escape" for message in messages):
            mark_together(messages, more=True)  # Escape and something else came at once: alt+enter is not Enter
        self._say(messages)

    def _say(self, messages: list[Message]) -> None:
        for message in messages:
            self._said(message)

    def _parsed(self, character: str) -> list[Message]:
        try:
            return list(self._parser.feed(character))
        except Exception:  # a code that Textual's parser trips over, such as a character beyond Unicode
            self._parser = XTermParser()
            return []
