"""Keys that come in one piece go one after the other, also where everything takes long."""

from __future__ import annotations

import asyncio

import pytest
from textual import events
from textual.app import App
from textual.screen import Screen

from rise_tui.rendering.terminal_app import MAX_CHECKS, KeyQueue
from tests.virtual_time import VirtualLoop


class SlowScreen(Screen[None]):
    """Works for a number of looks after each key, on a machine so busy that one look takes a fifth of a second."""

    looks_left = 0

    @property
    def is_working(self) -> bool:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        loop.advance(0.2)
        self.looks_left -= 1
        return self.looks_left > 0


@pytest.mark.parametrize(("looks", "is_waited_for"), [(100, True), (10 * MAX_CHECKS, False)])
async def test_a_key_waits_for_what_the_one_before_began_however_busy_the_machine(
    looks: int, is_waited_for: bool
) -> None:
    app = App[None]()
    async with app.run_test() as pilot:
        screen = SlowScreen()
        await app.push_screen(screen)
        left: list[int] = []

        async def pass_on(event: events.Key) -> None:
            left.append(screen.looks_left)
            screen.looks_left = looks

        keys = KeyQueue(app, pass_on)
        for key in "ab":
            keys.put(events.Key(key, key))
        while not keys.is_empty:
            await pilot.pause(0.01)
        assert len(left) == 2 and (left[1] <= 0) is is_waited_for


@pytest.mark.parametrize("at", ["at once", "while it is carried out"])
async def test_a_key_that_leaves_the_program_is_done(at: str) -> None:
    app = App[None]()
    async with app.run_test() as pilot:
        stacks = dict(app._screen_stacks)

        async def pass_on(event: events.Key) -> None:
            if at == "at once":
                app._screen_stacks[app.current_mode] = []
            else:
                app.call_later(lambda: app._screen_stacks.__setitem__(app.current_mode, []))

        keys = KeyQueue(app, pass_on)
        keys.put(events.Key("q", "q"))
        task = keys._task
        assert task is not None
        await task
        assert keys.is_empty
        app._screen_stacks.update(stacks)
        await pilot.pause()
