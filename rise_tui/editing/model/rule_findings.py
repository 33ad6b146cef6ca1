"""Which finding belongs to which state or way of a rule. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from rise_engine.edit.outline import Span, WrittenRule
from rise_engine.scenario.diagnostics import Diagnostic, Severity
from rise_engine.scenario.model import SourceLocation
from rise_tui.editing.model.rule_graph import GraphSpot

_LINE_END = re.compile(rb"\r\n|\r|\n")


class RuleFindings(NamedTuple):
    """The findings of a rule, in the order of the file."""

    of_rule: tuple[Diagnostic, ...]
    """All of them."""
    of_spot: Mapping[GraphSpot, tuple[Diagnostic, ...]]
    """Of each state what stands in it outside of its ways, and of each way what stands in it."""

    @property
    def marks(self) -> dict[GraphSpot, Severity]:
        """For each place the worst there is."""
        return {
            spot: "error" if any(each.severity == "error" for each in found) else "warning"
            for spot, found in self.of_spot.items()
        }


NO_FINDINGS = RuleFindings((), {})


def rule_findings(rule: WrittenRule, findings: Iterable[Diagnostic], data: bytes) -> RuleFindings:
    """The findings that stand in a rule.

    :param data: the rule's file.
    """
    starts = [0, *(found.end() for found in _LINE_END.finditer(data))]
    every: list[Diagnostic] = []
    spots: dict[GraphSpot, list[Diagnostic]] = {}
    for finding in findings:
        if finding.location.file != rule.file:
            continue
        offset = _byte_offset(finding.location, data, starts)
        if not _holds(rule.span, offset):
            continue
        every.append(finding)
        for spot in _spots_at(rule, offset):
            spots.setdefault(spot, []).append(finding)
    return RuleFindings(tuple(every), {spot: tuple(found) for spot, found in spots.items()})


def _spots_at(rule: WrittenRule, offset: int) -> Iterator[GraphSpot]:
    """The innermost places that hold a byte: several, where states share a way or come from one template."""
    ways = [
        GraphSpot(state.id, number)
        for state in rule.states
        for number, way in enumerate(state.transitions)
        if way.span != state.span and _holds(way.span, offset)
    ]
    yield from ways or (GraphSpot(state.id) for state in rule.states if _holds(state.span, offset))


def _holds(span: Span, offset: int) -> bool:
    return span.start <= offset < span.end


def _byte_offset(location: SourceLocation, data: bytes, starts: list[int]) -> int:
    if location.line > len(starts):
        return len(data)
    start = starts[location.line - 1]
    end = starts[location.line] if location.line < len(starts) else len(data)
    text = data[start:end].decode("utf-8", "replace").removeprefix("﻿")
    return start + len(text[: location.column - 1].encode())
