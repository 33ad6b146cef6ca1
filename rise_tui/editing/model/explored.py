"""What exploring has found in the study, as the editor shows it."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec
from msgspec import Struct

from rise_engine.text import clean, pluralize
from rise_tui.rendering.text import StyledLine, TextRole


class ExploredPlace(Struct, frozen=True):
    """A finding of exploring (`rise-engine check --deep --json`)."""

    level: str
    text: str
    file: str = ""
    line: int = 0
    rule: str = ""
    state: str = ""
    way: tuple[str, ...] = ()
    """How a session comes there, a sentence for each step."""

    @property
    def mark(self) -> str:
        return "✗" if self.level == "problem" else "▲"


class ExploredStudy(Struct, frozen=True):
    """What came of exploring the files as they were saved."""

    findings: tuple[ExploredPlace, ...] = ()
    """Without remarks."""
    situations: int = 0
    complete: bool = True
    at: str = ""
    """When it was begun: `14:05`."""

    def here(self, rule: str, state: str) -> list[ExploredPlace]:
        """What is about a rule, that about one of its states first."""
        own = [finding for finding in self.findings if rule and finding.rule == rule]
        return sorted(own, key=lambda finding: finding.state != state)

    @property
    def sentence(self) -> str:
        """What came of it, for the notice."""
        seen = f"explored {self.situations:,} situations" + ("" if self.complete else " (not all)")
        problems = sum(finding.level == "problem" for finding in self.findings)
        warnings = len(self.findings) - problems
        if not self.findings:
            return f"{seen}: nothing gets stuck"
        found = [pluralize(problems, "problem")] if problems else []
        found += [pluralize(warnings, "warning")] if warnings else []
        return f"{seen}: {' and '.join(found)}"


def read_explored(document: bytes, at: str) -> ExploredStudy | None:
    """What the program has printed; None: the study has errors, and nothing was explored."""
    try:
        explored = msgspec.json.decode(document)["explored"]
        findings = msgspec.convert(explored["findings"], tuple[ExploredPlace, ...])
        shown = tuple(finding for finding in findings if finding.level != "remark")
        return ExploredStudy(shown, explored["situations"], explored["complete"], at)
    except (msgspec.DecodeError, msgspec.ValidationError, KeyError):
        return None


def explored_line(findings: Sequence[ExploredPlace], *, stale: str) -> StyledLine:
    """The first of these findings. `stale`: when what they are about was saved, if it has changed since."""
    if not findings:
        return ()
    first = findings[0]
    role: TextRole = "fault" if first.level == "problem" else "wait"
    when = f" (as saved at {stale})" if stale else ""
    return ((f" {first.mark} explored{when}: ", role), (clean(first.text), role))
