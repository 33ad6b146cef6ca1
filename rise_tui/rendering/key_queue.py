"""Handles keys one after the other: each goes to what the previous key has opened, however soon it came.

Textual gives a key to the widget with the focus when the key arrives. Over a slow line several keys come in one piece.
Then `/` and the letters after it would all go to the list in which `/` opens a line.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, Protocol, runtime_checkable

from textual import events
from textual.app import App
from textual.message_pump import MessagePump

LOOK_SECONDS = 0.004
"""Seconds between two checks whether a screen has opened, or work is done."""
MOST_LOOKS = 500
"""The most checks whether a key's effect is complete. The limit counts checks, not seconds: on a busy machine
everything takes longer, and a key that did not wait would go to the wrong field."""
ROUNDS = 3
"""Walks from the focus up to the app: for a key's message, that message's answer, and what it opens."""


@runtime_checkable
class WorkingScreen(Protocol):
    """A screen whose keys begin work that opens something at its end."""

    @property
    def is_working(self) -> bool:
        """Whether such work is in progress."""


class KeyQueue:
    """Passes keys on in order."""

    def __init__(self, app: App[Any], pass_on: Callable[[events.Key], Awaitable[None]]) -> None:
        self._app, self._pass_on = app, pass_on
        self._keys: deque[events.Key] = deque()
        self._task: asyncio.Task[None] | None = None

    @property
    def is_empty(self) -> bool:
        """Whether every key has been carried out."""
        return self._task is None

    def put(self, event: events.Key) -> None:
        """Pass this key on after those before it have been carried out."""
        self._keys.append(event)
        if self._task is None:
            self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        try:
            while self._keys:
                await self._pass_on(self._keys.popleft())
                carried_out = asyncio.create_task(self._carried_out())
                try:
                    for _ in range(MOST_LOOKS):
                        if (await asyncio.wait([carried_out], timeout=LOOK_SECONDS))[0]:
                            carried_out.result()
                            break
                finally:
                    carried_out.cancel()
        finally:
            self._task = None

    async def _carried_out(self) -> None:
        """Return when the last key, and the work that it began, is done."""
        for _ in range(ROUNDS):
            await self._go_round()
            while not self._is_ready:  # noqa: ASYNC110 - no event announces this
                await asyncio.sleep(LOOK_SECONDS)

    async def _go_round(self) -> None:
        """Wait until everything from the focus up to the app has handled its present messages."""
        stack = self._app.screen_stack
        node: MessagePump | None = (self._app.focused or stack[-1]) if stack else None
        while node is not None:
            done = asyncio.get_running_loop().create_future()
            if node.is_running and node.call_later(_set, done):
                await done
            node = node._parent

    @property
    def _is_ready(self) -> bool:
        stack = self._app.screen_stack
        if not stack:  # the key has ended the program
            return True
        if not stack[-1]._is_mounted or any(isinstance(each, WorkingScreen) and each.is_working for each in stack):
            return False
        return all(not node.message_queue_size for node in (self._app, *stack[-1].walk_children(with_self=True)))


def _set(done: asyncio.Future[None]) -> None:
    if not done.done():
        done.set_result(None)
