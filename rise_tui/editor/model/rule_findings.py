"""Which finding belongs to which state or way of a rule. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from rise_engine.author.edit.outline import WrittenRule
from rise_engine.scenario.diagnostics import Diagnostic, Severity
from rise_engine.scenario.source_files import SourceFile
from rise_tui.editor.model.rule_graph import GraphSpot


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


def rule_findings(rule: WrittenRule, findings: Iterable[Diagnostic]) -> RuleFindings:
    """The findings that stand in a rule."""
    source = SourceFile(rule.file, b"", rule.node.tree.text)
    every: list[Diagnostic] = []
    spots: dict[GraphSpot, list[Diagnostic]] = {}
    for finding in findings:
        if finding.location.file != rule.file:
            continue
        offset = source.offset(finding.location.line, finding.location.column)
        if not rule.holds(offset):
            continue
        every.append(finding)
        for spot in _spots_at(rule, offset):
            spots.setdefault(spot, []).append(finding)
    return RuleFindings(tuple(every), {spot: tuple(found) for spot, found in spots.items()})


def _spots_at(rule: WrittenRule, offset: int) -> Iterator[GraphSpot]:
    """The innermost places that hold a character: several, where states share a way or come from one template."""
    ways = [
        GraphSpot(state.id, number)
        for state in rule.states
        for number, way in enumerate(state.transitions)
        if way.node is not state.node and way.holds(offset)
    ]
    yield from ways or (GraphSpot(state.id) for state in rule.states if state.holds(offset))
