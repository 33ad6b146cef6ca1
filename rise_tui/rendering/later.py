"""Work for a Textual worker that begins with the worker."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Generator
from functools import partial
from typing import Any, Generic, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class Later(Generic[T]):
    """An async function and its arguments, to be awaited once.

    The next worker of its group may cancel a worker before it has begun. A coroutine object would then never be
    awaited, which Python reports on the terminal.
    """

    def __init__(self, function: Callable[P, Coroutine[Any, Any, T]], *args: P.args, **options: P.kwargs) -> None:
        self._begin: Callable[[], Coroutine[Any, Any, T]] = partial(function, *args, **options)

    def __await__(self) -> Generator[Any, Any, T]:
        return self._begin().__await__()
