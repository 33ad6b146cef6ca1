"""The errors of expressions: they cannot be read (at load), or they cannot be evaluated (at run time)."""

from __future__ import annotations

from rise_engine.base.errors import RiseError
from rise_engine.base.nearest_name import Correction


class LanguageError(RiseError, ValueError):
    """An expression or an assignment cannot be used.

    `message` describes the error in one sentence, without the remedy; `text` is the source.
    """

    def __init__(self, message: str, text: str) -> None:
        super().__init__(message, text)
        self.message = message
        self.text = text

    @property
    def lines(self) -> tuple[str, ...]:
        return (str(self),)

    def __str__(self) -> str:
        return self.message


class ExpressionError(LanguageError):
    """A text is not an expression (or no assignment). Raised by parsing, never later.

    `column` counts from 1 within `text`; one past the end means that a part is missing there. `hint` is a remedy for
    the author, or empty. `suggestion` is the replacement for a wrong word, if that is the remedy.
    """

    def __init__(
        self, message: str, text: str, column: int, hint: str = "", suggestion: Correction | None = None
    ) -> None:
        super().__init__(message, text)
        self.args = (message, text, column, hint, suggestion)
        self.column = column
        self.hint = hint
        self.suggestion = suggestion

    def __str__(self) -> str:
        remedy = f"; {self.hint}" if self.hint else ""
        return f"{self.message} (column {self.column}){remedy}"


class EvaluationError(LanguageError):
    """A value does not fit the expression: a text is added, a number has no beginning, ..."""

    def __str__(self) -> str:
        if _normalize(f"`{self.text}`") in _normalize(self.message):  # the message already quotes it
            return self.message
        return f"{self.message} (in `{shorten(self.text)}`)"


class MissingPartError(EvaluationError):
    """`items[i].text` names a missing part: no such key, entry or name. The message begins with `MISSING_PART`."""


MISSING_PART = "missing-part"


def _normalize(text: str) -> str:
    """A text without the differences between an expression in a file and in a message."""
    return "".join(text.split()).replace("==", "=").replace("'", '"')


def shorten(text: str, limit: int = 80) -> str:
    """Shorten a text for a message if it is longer than `limit` characters."""
    return text if len(text) <= limit else text[: limit - 1] + "…"
