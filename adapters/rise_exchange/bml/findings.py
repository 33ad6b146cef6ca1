"""What is reported before anything is written: reasons to refuse a conversion, and losses."""

from __future__ import annotations

from msgspec import Struct

from rise_engine.base.text import clean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import SourceLocation

TIME = "bml-time"
"""The code of errors: a time that an act cannot keep exactly."""
NAME = "bml-name"
"""The code of errors: an unknown target or lexeme."""
NO_ACTION = "bml-no-action"
"""The code of errors: a behaviour without an action for it."""
FORM = "bml-form"
"""The code of errors: this is not BML 1.0."""


class BmlLoss(Struct, frozen=True):
    """Something in one format that the other does not have, with the reason.

    >>> str(BmlLoss(SourceLocation("hello.xml", 3, 5), "acts have no prosody"))
    'hello.xml:3:5: lost: acts have no prosody'
    """

    location: SourceLocation
    message: str

    def __str__(self) -> str:
        """One line, without control characters for a terminal."""
        return clean(f"{self.location}: lost: {self.message}")


class ConversionFindings:
    """Collects the reasons to refuse a conversion and its losses. It does not stop at the first one."""

    def __init__(self) -> None:
        self.diagnostics = Diagnostics()
        """The reasons to refuse it."""
        self._losses: list[BmlLoss] = []

    def lose(self, location: SourceLocation, message: str) -> None:
        """Add something that the other format does not have."""
        self._losses.append(BmlLoss(location, message))

    @property
    def losses(self) -> list[BmlLoss]:
        """The losses in reading order, each once."""
        return sorted(set(self._losses), key=_reading_order)


def _reading_order(loss: BmlLoss) -> tuple[str, int, int, str]:
    return loss.location.file, loss.location.line, loss.location.column, loss.message
