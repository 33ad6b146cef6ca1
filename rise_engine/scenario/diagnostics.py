"""Diagnostics: the mistakes in a scenario, each with a location, a stable code and a sentence with a remedy.

docs/reference/scenario.md lists every code.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Literal, TypeAlias

from msgspec import UNSET, Struct, UnsetType
from msgspec.structs import replace

from rise_engine.base.nearest_name import Correction, is_in_other_form
from rise_engine.base.text import clean
from rise_engine.scenario.model import SourceLocation

Severity: TypeAlias = Literal["error", "warning"]

WARNING_CODES = frozenset(
    {
        "ambiguous-else",
        "bare-condition",
        "bare-word",
        "condition-changed",
        "condition-unread",
        "decimal-comma",
        "empty-act",
        "language-column",
        "memory-form",
        "memory-type",
        "no-effect",
        "no-filler",
        "no-language",
        "no-ssml",
        "odd-blank",
        "own-session",
        "same-name",
        "short-loop",
        "ssml",
        "stale-translation",
        "unheard-event",
        "unicode-form",
        "unnoticed-failure",
        "unraised-event",
        "unreachable-state",
        "unreachable-transition",
        "unset-key",
        "untranslated",
        "unused-parameter",
        "unused-table",
        "unused-template",
        "unwritable-key",
        "variants",
    }
)
"""The codes of warnings that can be silenced (`rise_engine.scenario.reading.suppressions`)."""


class Diagnostic(Struct, frozen=True):
    """One mistake in a scenario. An error refuses the scenario, a warning does not.

    >>> str(Diagnostic("warning", "empty-act", "the act `Greet` has no actions", SourceLocation("acts/a.xml", 2, 3)))
    'acts/a.xml:2:3: warning empty-act: the act `Greet` has no actions'
    """

    severity: Severity
    code: str
    """Short, stable and readable: `unknown-element`."""
    message: str
    location: SourceLocation
    end: SourceLocation | UnsetType = UNSET
    """After its last character; unset: the diagnostic is about the whole file."""
    suggestion: Correction | UnsetType = UNSET
    """The wrong name or sign, and its correction."""
    related: SourceLocation | UnsetType = UNSET
    """Another affected place, such as the transition that is taken instead."""

    def __str__(self) -> str:
        """One line that is safe to print in a terminal."""
        return clean(f"{self.location}: {self.severity} {self.code}: {self.message}")


class Diagnostics:
    """Collects diagnostics of a scenario; reading does not stop at the first one."""

    def __init__(self) -> None:
        self._found: list[Diagnostic] = []
        self.errors = 0
        """The number of errors so far."""

    def error(self, code: str, location: SourceLocation, message: str, suggestion: Correction | None = None) -> None:
        """Report an error. `suggestion`: the correction; its words are added to the message."""
        self.errors += 1
        self._add("error", code, location, message, suggestion)

    def warning(
        self,
        code: str,
        location: SourceLocation,
        message: str,
        suggestion: Correction | None = None,
        related: SourceLocation | UnsetType = UNSET,
    ) -> None:
        """Report a warning. `related`: another affected place."""
        self._add("warning", code, location, message, suggestion, related)

    def _add(
        self,
        severity: Severity,
        code: str,
        location: SourceLocation,
        message: str,
        suggestion: Correction | None,
        related: SourceLocation | UnsetType = UNSET,
    ) -> None:
        whole = message + (suggestion.words if suggestion else "") + _template_note(location)
        self._found.append(Diagnostic(severity, code, whole, location, suggestion=suggestion or UNSET, related=related))

    def add(self, others: Diagnostics) -> None:
        """Add the contents of another collector."""
        self._found += others._found
        self.errors += others.errors

    def sorted(self) -> list[Diagnostic]:
        """All diagnostics in reading order, by file, line and column, without duplicates."""
        return sorted(set(self._found), key=_reading_order)


def unknown_code(code: str, name: str, known: Collection[str]) -> str:
    """The code for an unknown name: `unicode-form` if it is known in Unicode's other form."""
    return "unicode-form" if is_in_other_form(name, known) else code


def _reading_order(found: Diagnostic) -> tuple[str, int, int, str, str, str]:
    location = found.location
    return location.file, location.line, location.column, found.severity, found.code, found.message


def _template_note(location: SourceLocation) -> str:
    """The end of a message about a place in a template."""
    place = location.template
    return "" if place is UNSET else f" (in the template `{place.name}`: {place.file}, line {place.line})"


def join_uses(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Merge equal diagnostics about one place of a template into one, at the first `<use>`."""
    joined: dict[object, list[Diagnostic]] = {}
    for diagnostic in found:
        template = diagnostic.location.template
        key = diagnostic if template is UNSET else (diagnostic.severity, diagnostic.code, diagnostic.message, template)
        joined.setdefault(key, []).append(diagnostic)
    return [
        same[0] if len(same) == 1 else replace(same[0], message=f"{same[0].message[:-1]}; used {len(same)} times)")
        for same in joined.values()
    ]
