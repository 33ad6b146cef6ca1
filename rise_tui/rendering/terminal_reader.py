"""Reads what a terminal sends. Unlike Textual's own reader, it knows for each key whether others came with it."""

from __future__ import annotations

import os
import select
from codecs import getincrementaldecoder
from collections.abc import Callable, Iterable
from threading import Event

from textual import constants, events
from textual._xterm_parser import XTermParser
from textual.message import Message

READ = 4096
ALONE = 0.0003
"""Seconds to wait after a key for others: pasted keys come immediately, typed ones do not."""
POLL = constants.ESCAPE_DELAY + 0.005
"""Seconds after which an incomplete sequence is examined: Esc alone is one."""
_TOGETHER = "_read_together"
_FIRST = "_read_first"


def read_together(event: events.Key) -> bool:
    """Whether a key came in one piece with others, as a paste does."""
    return event.__dict__.get(_TOGETHER, False) is True


def read_first(event: events.Key) -> bool:
    """Whether a key begins something: it came alone, first in its piece, or after a key that is not a letter."""
    return event.__dict__.get(_FIRST, True) is True


def mark_together(messages: Iterable[Message], together: bool, *, begins: bool = True) -> bool:
    """Mark the keys among some messages.

    :param begins: whether the first key begins something (`read_first`).
    :returns: whether the next key in the same piece would.
    """
    for message in messages:
        if isinstance(message, events.Key):
            message.__dict__[_TOGETHER], message.__dict__[_FIRST] = together, begins
            begins = not message.is_printable
    return begins


class TerminalReader:
    """Reads one terminal, on its own thread, until it is stopped or the terminal has gone.

    Textual's own reader does not tell what came in one read, so every key would have to wait for possible followers (25
    ms). It also ends the whole console on a code that its parser cannot handle.
    """

    def __init__(self, fileno: int, deliver: Callable[[Message], None], stop: Event) -> None:
        self._fileno, self._deliver, self._stop = fileno, deliver, stop
        self._parser = XTermParser()
        self._decode = getincrementaldecoder("utf-8")(errors="replace").decode
        self._begins = True
        """Whether the next key begins something."""

    def run(self) -> None:
        """Read and deliver until the end."""
        while not self._stop.is_set():
            if self._has_more(POLL) and not self._read():
                return
            self._deliver_incomplete()

    def _has_more(self, seconds: float) -> bool:
        return bool(select.select((self._fileno,), (), (), seconds)[0])

    def _read(self) -> bool:
        """Read once and deliver. False when the terminal has gone."""
        try:
            data = os.read(self._fileno, READ)
        except OSError:
            return False
        messages = [message for character in self._decode(data) for message in self._parse(character)]
        keys = sum(isinstance(message, events.Key) for message in messages)
        if keys:
            more = self._has_more(ALONE)
            self._begins = mark_together(messages, keys > 1 or more, begins=self._begins) or not more
        for message in messages:
            self._deliver(message)
        return bool(data)

    def _deliver_incomplete(self) -> None:
        """Deliver what has waited in vain for the rest of a sequence."""
        messages = list(self._parser.tick())
        if any(isinstance(message, events.Key) and message.key != "escape" for message in messages):
            # Escape and something else came together: alt+enter is not Enter
            mark_together(messages, True, begins=False)
        for message in messages:
            self._deliver(message)

    def _parse(self, character: str) -> list[Message]:
        try:
            return list(self._parser.feed(character))
        except Exception:  # a code that Textual's parser cannot handle, such as a character beyond Unicode
            self._parser = XTermParser()
            return []
