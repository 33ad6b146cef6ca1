"""Warnings that are meant: silenced at their place, with a reason (docs/reference/scenario.md).

    <!-- check: allow ambiguous-else: the outer one is meant -->      directly before the element
    # check: allow unheard-event: the camera node listens             directly before the line, in TOML
    [check] allow = [{ code = "unwritable-key", key = "Prénom", reason = "..." }]      for memory.json

Errors cannot be silenced. A silencing that cannot be read, or that silences nothing, is a finding itself.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence

from msgspec import Struct

from rise_engine.nearest_name import suggestion
from rise_engine.scenario.findings import WARNINGS, Finding, Findings
from rise_engine.scenario.model import Place
from rise_engine.scenario.source import Source

_MARK = "check:"
_ALLOW = re.compile(r"\s*check:\s*allow\b(.*)", re.DOTALL)
_PARTS = re.compile(r"\s+([\w-]+)\s*(?::(.*))?\Z", re.DOTALL)
_BLANK = re.compile(r"\s*+")
_START_TAG = re.compile(r"<[^!?/>\"'\s](?:[^>\"']++|\"[^\"]*+\"|'[^']*+')*+>")
_TOML_LINE = re.compile(r"[ \t]*#(.*)")
EXAMPLE = "check: allow ambiguous-else: the outer one is meant"


class Allow(Struct, frozen=True):
    """One silencing: of warnings with a code, from one place to another in a file."""

    place: Place
    """Where it stands."""
    code: str
    reason: str
    file: str
    start: tuple[int, int] = (1, 1)
    """Line and column."""
    end: tuple[int, int] = (1 << 60, 1)
    """Behind the last place."""

    def covers(self, finding: Finding) -> bool:
        place = finding.place
        return (
            finding.severity == "warning"
            and (finding.code, place.file) == (self.code, self.file)
            and self.start <= (place.line, place.column) < self.end
        )


class Silenced(Struct, frozen=True):
    """A warning that somebody has silenced, and why."""

    finding: Finding
    reason: str


def silence(
    found: Sequence[Finding], allows: Sequence[Allow], findings: Findings, *, complete: bool
) -> tuple[list[Finding], list[Silenced]]:
    """What is left of the findings, and what was silenced.

    `complete`: nothing was left unchecked because of errors, so that what silences nothing now is not needed.
    """
    silenced: list[Silenced] = []
    covered: set[Finding] = set()
    used: set[int] = set()
    by_place: dict[tuple[str, str], dict[tuple[int, int], int]] = {}
    for at, allow in enumerate(allows):
        by_place.setdefault((allow.file, allow.code), {}).setdefault(allow.start, at)
    starts = {which: sorted(places) for which, places in by_place.items()}
    for finding in found:
        which = (finding.place.file, finding.code)
        before = bisect_right(starts.get(which, ()), (finding.place.line, finding.place.column))
        if not before:
            continue
        at = by_place[which][starts[which][before - 1]]
        if allows[at].covers(finding):
            used.add(at)
            covered.add(finding)
            silenced.append(Silenced(finding, allows[at].reason))
    for at, allow in enumerate(allows if complete else ()):
        if at not in used:
            message = f"this silences nothing: there is no warning `{allow.code}` at what follows; delete it"
            findings.warning("unused-allow", allow.place, message)
    return [finding for finding in findings.sorted() if finding not in covered], silenced


def read_allows(sources: Sequence[Source], findings: Findings) -> list[Allow]:
    """The silencings that stand in the comments of XML and TOML files."""
    found: list[Allow] = []
    for source in sources:
        if _MARK not in source.text:
            continue
        if source.name.lower().endswith(".toml"):
            found += _in_toml_comments(source, findings)
        elif source.text.lstrip().startswith("<"):
            found += _in_xml_comments(source, findings)
    return found


def known_code(code: str, place: Place, findings: Findings) -> bool:
    """Whether a code is one of a warning; a finding if not."""
    if code in WARNINGS:
        return True
    findings.warning(
        "bad-allow", place, f"there is no warning `{code}` to silence{suggestion(code, WARNINGS, limit=0)}"
    )
    return False


def _parse_comment(comment: str, place: Place, findings: Findings) -> tuple[str, str] | None:
    """Code and reason of a comment that silences something; None, if need be after a finding."""
    allow = _ALLOW.match(comment)
    if allow is None:
        return None
    parts = _PARTS.match(allow.group(1))
    if parts is None:
        findings.warning("bad-allow", place, f"this silences nothing; write a code and a reason, as in: {EXAMPLE}")
        return None
    code, reason = parts.group(1), (parts.group(2) or "").strip()
    if not known_code(code, place, findings):
        return None
    if not reason:
        findings.warning("bad-allow", place, f"say why: check: allow {code}: REASON")
        return None
    return code, " ".join(reason.split())


def _in_xml_comments(source: Source, findings: Findings) -> Iterator[Allow]:
    text = source.text
    pending: list[tuple[Place, str, str]] = []
    """Read, and their element is still to come: other comments may stand between."""
    at = 0
    while (opened := text.find("<!", at)) >= 0:
        if not text.startswith("<!--", opened):
            at = text.find("]]>", opened) if text.startswith("<![CDATA[", opened) else opened + 2
            if at < 0:
                return
            continue
        at = text.find("-->", opened)
        if at < 0:
            return
        parsed = _parse_comment(text[opened + 4 : at], source.place(opened), findings)
        if parsed is not None:
            pending.append((source.place(opened), *parsed))
        blank = _BLANK.match(text, at + 3)
        at = blank.end() if blank else at + 3
        if pending and not text.startswith("<!--", at):
            element = _element_at(text, at)
            start, end = (source.place(offset) for offset in element or (at, at))
            for place, code, reason in pending:
                if element is None:
                    message = "no element follows here; this stands directly before the element that is meant"
                    findings.warning("bad-allow", place, message)
                else:
                    yield Allow(place, code, reason, source.name, (start.line, start.column), (end.line, end.column))
            pending.clear()


def _element_at(text: str, start: int) -> tuple[int, int] | None:
    """From where to where the start tag and the text of an element stand; None when there is none."""
    tag = _START_TAG.match(text, start)
    if tag is None:
        return None
    end = tag.end()
    while not tag.group().endswith("/>"):
        end = text.find("<", end)
        closing = "-->" if text.startswith("<!--", end) else "]]>" if text.startswith("<![CDATA[", end) else ""
        if not closing:
            break
        end = text.find(closing, end)
        if end < 0:
            break
    return start, end if end >= 0 else len(text)


def _in_toml_comments(source: Source, findings: Findings) -> Iterator[Allow]:
    pending: list[tuple[Place, str, str]] = []
    for number, line in enumerate(source.text.split("\n"), 1):
        comment = _TOML_LINE.match(line)
        if comment is not None:
            place = Place(source.name, number, line.find("#") + 1)
            parsed = _parse_comment(comment.group(1), place, findings)
            if parsed is not None:
                pending.append((place, *parsed))
        elif line.strip():
            for place, code, reason in pending:
                yield Allow(place, code, reason, source.name, (number, 1), (number + 1, 1))
            pending.clear()
    for place, _, _ in pending:
        message = "no line follows here; this stands directly before the line that is meant"
        findings.warning("bad-allow", place, message)


def allows_of_memory(allows: Sequence[tuple[Place, str, str, str]], keys: Mapping[str, Place]) -> Iterator[Allow]:
    """The silencings of scenario.toml, for the memory file: place, code, key and reason of each."""
    for place, code, key, reason in allows:
        at = keys.get(key)
        if at is None:
            yield Allow(place, code, reason, "")
        else:
            yield Allow(place, code, reason, at.file, (at.line, at.column), (at.line, at.column + 1))
