"""A rule's drawn graph with a cursor over its states and transitions. Pure.

The console draws it, too. Here the drawing comes from the written rule, even with errors, and every transition can be
selected.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from rise_engine.author.drawing.state_graph import GraphLayout, GraphRow, edge_path, lay_out_graph
from rise_engine.author.edit.outline import WrittenRule, WrittenTransition
from rise_engine.expression import Expression
from rise_engine.expression.nodes import Literal as LiteralNode
from rise_engine.scenario.diagnostics import Diagnostic, Severity
from rise_engine.scenario.durations import parse_time
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.model import Delay, Rule, State, Transition, normal_topic
from rise_engine.syntax.xml_writing import one_line
from rise_tui.editor.model.fields import NOTE_MARKS
from rise_tui.model.states import GraphPosition, draw_state_graph
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, TextRole, crop

MARGIN = 2
"""Cells left of the drawing, for the mark of a diagnostic."""


class GraphSpot(NamedTuple):
    """The cursor's place: a state, or one of its transitions."""

    state: str
    transition: int = -1
    """The transition's number; -1: the state."""

    @property
    def id(self) -> str:
        return f"transition:{self.transition}:{self.state}" if self.transition >= 0 else f"state:{self.state}"


def parse_spot(id: str) -> GraphSpot | None:
    """The place that a row's id names."""
    kind, _, rest = id.partition(":")
    if kind == "state":
        return GraphSpot(rest)
    if kind == "transition":
        number, _, state = rest.partition(":")
        return GraphSpot(state, int(number))
    return None


def drawn_rule(rule: WrittenRule) -> Rule:
    """Return a rule for drawing. Errors in it are drawn as written."""
    states: dict[str, State] = {}
    for state in rule.states:
        states.setdefault(state.id, State(state.id, transitions=tuple(map(_drawn_transition, state.transitions))))
    return Rule(rule.name, rule.initial, states)


def lay_out_rule(rule: WrittenRule, width: int) -> GraphLayout | None:
    """Return the layout in `width` cells; None: a rule without states."""
    drawn = drawn_rule(rule)
    return lay_out_graph(drawn, max(20, width - MARGIN)) if drawn.states else None


def draw_rule(layout: GraphLayout, spot: GraphSpot | None, marks: Mapping[GraphSpot, Severity]) -> list[ListRow]:
    """The rows, each with its place as id. A row with two places has the id of the selected one.

    :param spot: the cursor's place; the rail of its transition is highlighted up to the arrow.
    :param marks: places with diagnostics.
    """
    chosen = layout.edges.get((spot.state, spot.transition)) if spot is not None else None
    path = set(edge_path(layout, chosen)) if chosen is not None else set[tuple[int, int]]()
    rows = []
    for index, (row, drawn) in enumerate(zip(layout.rows, draw_state_graph(layout, GraphPosition()), strict=True)):
        here = row_spots(row)
        shown = spot if spot in here else here[0]
        line = _recolour(drawn.line, {column for at, column in path if at == index})
        if spot in here and len(here) > 1:
            line = _emphasize(line, transition=shown.transition >= 0)
        found = [marks[each] for each in here if each in marks]
        mark: StyledSpan = NOTE_MARKS["error" if "error" in found else "warning"] if found else ("  ", "plain")
        rows.append(ListRow(shown.id, crop((mark, *line), layout.width + MARGIN)))
    return rows


def row_spots(row: GraphRow) -> tuple[GraphSpot, ...]:
    """The places of a row: a state, a transition, or a state and its transition down."""
    if row.edge is None:
        return (GraphSpot(row.state),)
    transition = GraphSpot(row.edge.source, row.edge.number)
    return (GraphSpot(row.state), transition) if row.is_state else (transition,)


def beside(layout: GraphLayout, spot: GraphSpot, step: int) -> GraphSpot:
    """Return the place to the right (1) or left (-1) of another in its row, or the same place."""
    for row in layout.rows:
        here = row_spots(row)
        if spot in here:
            return here[min(max(here.index(spot) + step, 0), len(here) - 1)]
    return spot


def valid_spot(layout: GraphLayout, rule: WrittenRule, spot: GraphSpot | None) -> GraphSpot:
    """Return the place, or the nearest one that still exists."""
    if spot is not None and spot.state in layout.row_of:
        if spot.transition < 0 or (spot.state, spot.transition) in layout.edges:
            return spot
        return GraphSpot(spot.state)
    return GraphSpot(rule.initial if rule.initial in layout.row_of else rule.states[0].id)


def _drawn_transition(transition: WrittenTransition) -> Transition:
    form = transition.form
    return Transition(
        event=normal_topic(form.event) if form.event is not None else None,
        condition=_as_expression(form.condition),
        after=Delay(form.after.strip(), parse_time(form.after)) if form.after is not None else None,
        target=form.target.strip() if form.target is not None else None,
        ended=form.ended.strip() if form.ended is not None else None,
        outcomes=tuple(each for each in ("succeeded", "failed", "stopped") if each in form.outcomes),
        held=_as_expression(form.held),
    )


def _as_expression(text: str | None) -> Expression | None:
    """Return a condition only for its label. It may be unreadable."""
    return None if text is None else Expression(one_line(text), LiteralNode(True), frozenset(), frozenset())


def _recolour(line: StyledLine, columns: set[int]) -> StyledLine:
    """The line with these cells of its rails in the cursor's role."""
    if not columns:
        return line
    spans: list[StyledSpan] = []
    at = 0
    for text, role in line:
        if at > max(columns):
            spans.append((text, role))
        else:
            spans += [(character, "accent" if at + i in columns else role) for i, character in enumerate(text)]
        at += len(text)
    return tuple(spans)


def _emphasize(line: StyledLine, *, transition: bool) -> StyledLine:
    """A row with a state and its transition: the selected one is bright, the other is not."""
    at = next((index for index, (text, _) in enumerate(line) if text == " ↓ "), len(line))
    muted: TextRole = "muted"
    if transition:
        return (*((text, muted) for text, _ in line[:at]), *((text, "accent") for text, _ in line[at:]))
    name = next((index for index, (text, role) in enumerate(line[:at]) if role == "plain" and text.strip()), at)
    kept = [(text, "accent" if index == name else role) for index, (text, role) in enumerate(line[:at])]
    return (*kept, *((text, muted) for text, _ in line[at:]))


def worst(findings: Sequence[Diagnostic]) -> Severity:
    """An error, if any, or else a warning."""
    return "error" if any(each.severity == "error" for each in findings) else "warning"


def rule_findings(rule: WrittenRule, findings: Iterable[Diagnostic]) -> dict[GraphSpot, list[Diagnostic]]:
    """The diagnostics of each state outside its transitions, and of each transition, in the order of the file."""
    source = SourceFile(rule.file, b"", rule.node.tree.text)
    spots: dict[GraphSpot, list[Diagnostic]] = {}
    for finding in findings:
        if finding.location.file == rule.file:
            offset = source.offset(finding.location.line, finding.location.column)
            for spot in _spots_at(rule, offset):
                spots.setdefault(spot, []).append(finding)
    return spots


def _spots_at(rule: WrittenRule, offset: int) -> Iterator[GraphSpot]:
    """The innermost places around a character. Several, if states share a transition or a template."""
    transitions = [
        GraphSpot(state.id, number)
        for state in rule.states
        for number, transition in enumerate(state.transitions)
        if transition.node is not state.node and transition.holds(offset)
    ]
    yield from transitions or (GraphSpot(state.id) for state in rule.states if state.holds(offset))
