"""Work for a Textual worker that begins when the worker does."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Generator
from functools import partial
from typing import Any, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class Later(Generic[T]):
    """An async function and its arguments, to be awaited once.

    A worker may be cancelled before it has begun, by the next one of its group. The coroutine itself would then be one
    that nobody awaits, which Python reports on the terminal.
    """

    def __init__(self, function: Callable[P, Coroutine[Any, Any, T]], *args: P.args, **options: P.kwargs) -> None:
        self._begin: Callable[[], Coroutine[Any, Any, T]] = partial(function, *args, **options)

    def __await__(self) -> Generator[Any, Any, T]:
        return self._begin().__await__()
