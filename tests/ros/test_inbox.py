"""What stands between a transport's thread and the loop: in order, in slices, and no more than there is room for."""

from __future__ import annotations

import asyncio
from functools import partial
from threading import Thread
from typing import Any

from rise_adapters.ros2.transport.inbox import LIMIT, Inbox

from tests.patience import PATIENCE


def filler(inbox: Inbox, heard: list[int], count: int) -> Thread:
    def fill() -> None:
        for number in range(count):
            inbox.put(partial(heard.append, number))

    thread = Thread(target=fill, daemon=True)
    thread.start()
    return thread


async def test_everything_comes_in_order_on_the_loop_however_much_it_is() -> None:
    heard: list[int] = []
    thread = filler(Inbox(asyncio.get_running_loop()), heard, 3 * LIMIT)
    async with asyncio.timeout(PATIENCE):
        while len(heard) < 3 * LIMIT:  # noqa: ASYNC110  # the loop must go on
            await asyncio.sleep(0)
    thread.join()
    assert heard == list(range(3 * LIMIT))


async def test_a_thread_waits_while_there_is_no_room_and_closing_lets_it_go() -> None:
    heard: list[int] = []
    inbox = Inbox(asyncio.get_running_loop())
    thread = filler(inbox, heard, LIMIT + 1)
    thread.join(0.2)
    assert thread.is_alive() and not heard, "the loop had no turn"
    inbox.close()
    thread.join(30)
    assert not thread.is_alive()
    await asyncio.sleep(0)
    assert not heard, "nothing comes after that"


async def test_the_loops_own_thread_never_waits() -> None:
    heard: list[int] = []
    inbox = Inbox(asyncio.get_running_loop())
    for number in range(LIMIT + 1):
        inbox.put(partial(heard.append, number), wait=False)
    async with asyncio.timeout(PATIENCE):
        while len(heard) <= LIMIT:  # noqa: ASYNC110
            await asyncio.sleep(0)


async def test_what_cannot_be_dealt_with_is_told_and_keeps_nothing_else() -> None:
    loop, told, heard = asyncio.get_running_loop(), list[dict[str, Any]](), list[int]()
    loop.set_exception_handler(lambda _, context: told.append(context))
    inbox = Inbox(loop)
    inbox.put(lambda: 1 / 0, partial(heard.append, 1))
    async with asyncio.timeout(PATIENCE):
        while not heard:  # noqa: ASYNC110
            await asyncio.sleep(0)
    assert [type(each["exception"]) for each in told] == [ZeroDivisionError]
