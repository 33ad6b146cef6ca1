"""Work that blocks, in threads that nobody has to wait for: neither at a limit nor at the end of the program."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor, Future
from threading import Event, Thread
from typing import Any, TypeVar

Result = TypeVar("Result")

ENDING_SECONDS = 3.0
"""For which the work may go on after its limit, to end what it has started."""


class BackgroundExecutor(Executor):
    """A thread of its own for each call. A disk that does not answer holds up neither the loop nor the program's end,
    which would wait for the threads of asyncio's own executor."""

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()

        def work() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                result = function(*arguments, **named)
            except BaseException as error:  # whoever waits is told
                future.set_exception(error)
            else:
                future.set_result(result)

        Thread(target=work, name="rise-check", daemon=True).start()
        return future


_EXECUTOR = BackgroundExecutor()


async def call_in_background(work: Callable[[Event], Result], limit: float) -> Result:
    """Call something that blocks, and wait without blocking.

    :param work: gets an event that is set when nobody waits any more, and then ends what it has started, soon.
    :param limit: seconds after which it is given up.
    :raises TimeoutError: it did not end within the limit, nor within ENDING_SECONDS after that.
    :raises asyncio.CancelledError: whoever waits was cancelled; the work was told, and had a moment to end.
    """
    cancelled = Event()
    future = asyncio.get_running_loop().run_in_executor(_EXECUTOR, work, cancelled)
    future.add_done_callback(_take_exception)
    try:
        done, _ = await asyncio.wait({future}, timeout=limit)
        if not done:
            cancelled.set()
            done, _ = await asyncio.wait({future}, timeout=ENDING_SECONDS)
        if not done:
            raise TimeoutError
        return future.result()
    except asyncio.CancelledError:
        cancelled.set()
        await asyncio.wait({future}, timeout=ENDING_SECONDS)
        raise
    finally:
        future.cancel()  # what is still not done goes nowhere


def _take_exception(future: asyncio.Future[Any]) -> None:
    """So that one which came after everybody had left is nobody's warning."""
    if not future.cancelled():
        future.exception()
