"""Cheap and quick (law 8): every detail of Textual 8.2.8 that is not documented, in one package, each with a test.

A new release of Textual that changes one of them fails `tests/console/test_quiet.py` or `test_pieces.py` beside it, and
nothing else needs reading.
What no other module may touch, `tests/console/test_private.py` looks for.

- `views`, `scrollbar`: lists that repaint rows and not themselves, and the bars beside them.
- `screens`, `compositor`: screens that do not repaint whole when the focus moves, and paint a few rows at a time.
- `difference`: of what is painted, only the cells that differ are written.
- `slices`: long work on the loop, in short pieces, and none while a key is on its way.
- `eager`: what a key asks for is sent at once.
- `app`: an app that sees every key first, and at once when nothing is before it.
- `driver`, `outlet`: the terminal: what is read together is told, and a terminal that takes nothing holds nothing up.
"""

from __future__ import annotations

from rise_tui.quiet.app import KeyWatch, QuietApp, is_busy
from rise_tui.quiet.driver import click_driver
from rise_tui.quiet.eager import begin
from rise_tui.quiet.outlet import Outlet
from rise_tui.quiet.screens import EmptyScreen, QuietModal, QuietScreen
from rise_tui.quiet.slices import Slices, outlet_of
from rise_tui.quiet.views import QuietScrollView

__all__ = [
    "EmptyScreen",
    "KeyWatch",
    "Outlet",
    "QuietApp",
    "QuietModal",
    "QuietScreen",
    "QuietScrollView",
    "Slices",
    "begin",
    "click_driver",
    "is_busy",
    "outlet_of",
]
