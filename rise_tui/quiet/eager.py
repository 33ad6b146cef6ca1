"""Work that is begun at once, and not in the loop's next turn: before that many other things may have theirs."""

from __future__ import annotations

from collections.abc import Coroutine, Generator
from types import coroutine
from typing import Any, TypeVar

Result = TypeVar("Result")


def begin(work: Coroutine[Any, Any, Result]) -> Coroutine[Any, Any, Result] | None:
    """Do the work up to where it first waits; returns what is left of it, to be awaited, or None. Raises what it does.

    Python 3.12 has `asyncio.eager_task_factory` for it. There is no current task meanwhile.
    """
    try:
        waits_for = work.send(None)
    except StopIteration:
        return None
    return _rest(work, waits_for)


async def _rest(work: Coroutine[Any, Any, Result], waits_for: Any) -> Result:
    return await _resumed(work, waits_for)


@coroutine
def _resumed(work: Coroutine[Any, Any, Result], waits_for: Any) -> Generator[Any, Any, Result]:
    while True:
        try:
            try:
                sent = yield waits_for
            except GeneratorExit:
                work.close()
                raise
            except BaseException as error:
                waits_for = work.throw(error)
            else:
                waits_for = work.send(sent)
        except StopIteration as done:
            result: Result = done.value
            return result
