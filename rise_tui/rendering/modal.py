"""Dialogs that close once."""

from __future__ import annotations

from typing import Generic

from textual.await_complete import AwaitComplete
from textual.screen import ModalScreen, ScreenResultType


class SingleDismissModal(ModalScreen[ScreenResultType], Generic[ScreenResultType]):
    """A modal screen whose second `dismiss` does nothing.

    The stock one takes away whatever is on top: at a second key, before it has gone, the console below.
    """

    def dismiss(self, result: ScreenResultType | None = None) -> AwaitComplete:
        return super().dismiss(result) if self.is_active else AwaitComplete.nothing()  # type: ignore[no-untyped-call]
