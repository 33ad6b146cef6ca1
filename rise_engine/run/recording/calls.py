"""Calls of code that may hang, raise anything, or not let itself be cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from rise_engine.base.text import clean
from rise_engine.ports.recorder import RecorderError

Result = TypeVar("Result")


async def call_within(
    seconds: float, call: Coroutine[Any, Any, Result], what: str, unless: asyncio.Event | None = None
) -> Result:
    """What a call gives, within so many seconds; then it is cancelled, and nobody waits for that either.

    :param seconds: how long it may take.
    :param call: of the code of somebody.
    :param what: was asked of it, for the sentence: `to start`.
    :param unless: set when the answer is of no use any more.
    :raises RecorderError: it gave no answer, or raised something; or `unless` was set before there was one.
    """
    task = asyncio.create_task(call)
    waiting: set[asyncio.Task[Any]] = {task}
    if unless is not None:
        waiting.add(asyncio.create_task(unless.wait()))
    try:
        await asyncio.wait(waiting, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for each in waiting:
            each.cancel()
    if not task.done():
        task.add_done_callback(lambda ended: ended.cancelled() or ended.exception())
        if unless is not None and unless.is_set():
            raise RecorderError(f"nobody needs to know {what} any more")
        raise RecorderError(f"it was asked {what} and did not answer within {seconds:g} s")
    try:
        return task.result()
    except RecorderError:
        raise
    except asyncio.CancelledError:
        raise RecorderError(f"it was asked {what} and gave up") from None
    except Exception as error:
        raise RecorderError(f"it was asked {what} and failed: {type(error).__name__}: {clean(str(error))}") from error
