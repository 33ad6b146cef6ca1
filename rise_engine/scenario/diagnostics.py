"""What is wrong with a scenario: findings with a location, a stable code and a sentence that says what to do.

Every code is listed in docs/reference/scenario.md.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.scenario.model import SourceLocation
from rise_engine.text import clean

Severity: TypeAlias = Literal["error", "warning"]

WARNING_CODES = frozenset(
    {
        "ambiguous-else",
        "bare-word",
        "empty-act",
        "memory-form",
        "no-effect",
        "no-filler",
        "reads-differently",
        "same-name",
        "short-loop",
        "unheard-event",
        "unraised-event",
        "unreachable-state",
        "unreachable-transition",
        "unset-key",
        "unwritable-key",
        "variants",
    }
)
"""The codes of warnings that can be silenced (`rise_engine.scenario.suppressions`)."""


class Diagnostic(Struct, frozen=True):
    """One thing to know about a scenario. Errors refuse it, warnings do not.

    >>> str(Diagnostic("warning", "empty-act", "the act `Greet` has no actions", SourceLocation("acts/a.xml", 2, 3)))
    'acts/a.xml:2:3: warning empty-act: the act `Greet` has no actions'
    """

    severity: Severity
    code: str
    """Short, stable and readable: `unknown-element`."""
    message: str
    location: SourceLocation

    def __str__(self) -> str:
        """One line, with nothing in it that a terminal would obey."""
        return clean(f"{self.location}: {self.severity} {self.code}: {self.message}")


class Diagnostics:
    """Collects findings while a scenario is read; nothing stops at the first one."""

    def __init__(self) -> None:
        self._found: list[Diagnostic] = []
        self._errors = 0

    def error(self, code: str, location: SourceLocation, message: str) -> None:
        self._errors += 1
        self._found.append(Diagnostic("error", code, message, location))

    def warning(self, code: str, location: SourceLocation, message: str) -> None:
        self._found.append(Diagnostic("warning", code, message, location))

    @property
    def errors(self) -> int:
        """How many errors there are so far."""
        return self._errors

    def sorted(self) -> list[Diagnostic]:
        """All findings in reading order: by file, line and column, each once."""
        unique = dict.fromkeys(
            (f.location.file, f.location.line, f.location.column, f.severity, f.code, f.message) for f in self._found
        )
        return [
            Diagnostic(severity, code, message, SourceLocation(file, line, column))
            for file, line, column, severity, code, message in sorted(unique)
        ]
