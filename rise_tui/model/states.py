"""The look of a state: always a word and a glyph. Colour only repeats them (console.md 7.1)."""

from __future__ import annotations

from typing import NamedTuple

from rich.cells import cell_len

from rise_engine.author.drawing.state_graph import GraphEdge, GraphLayout, GraphRow, edge_path
from rise_engine.author.drawing.study_keys import ACT, RULE
from rise_engine.kernel.records import ENDINGS
from rise_engine.kernel.task_view import ActionView, TaskView
from rise_engine.scenario.model import Act
from rise_tui.model.log_rows import REPORTS
from rise_tui.model.store import Store
from rise_tui.rendering.text import ListRow, StyledSpan, TextRole, clean, crop, line_width, shorten


class StateLabel(NamedTuple):
    glyph: str
    word: str
    role: TextRole

    @property
    def span(self) -> StyledSpan:
        return f"{self.glyph} {self.word}", self.role


READY = StateLabel("·", "ready", "muted")
SENT = StateLabel("↑", "sent", "wait")
ARMED = StateLabel("!", "again?", "wait")
EXPECTED = StateLabel("◇", "expected", "key")
"""An act or rule that the present state of a running rule waits for."""
RUNNING = StateLabel("►", "running", "accent")
WAITING = StateLabel("○", "waiting", "wait")
NOT_TAKEN = StateLabel("-", "not taken", "wait")
"""A raised event that no rule waited for."""

TASK_STATES = {
    "PENDING": WAITING,
    "ACTIVE": RUNNING,
    "SUCCEEDED": StateLabel("✓", "done", "muted"),
    "ABORTED": StateLabel("✗", "failed", "fault"),
    "CANCELED": StateLabel("■", "stopped", "muted"),
    "REJECTED": StateLabel("✗", "rejected", "wait"),
}

REMARK_STATES = {
    "note": StateLabel("·", "", "plain"),
    "connected": StateLabel("●", "connected", "plain"),
    "degraded": StateLabel("◐", "degraded", "wait"),
    "lost": StateLabel("✗", "lost", "fault"),
    "fault": StateLabel("✗", "faulted", "fault"),
}
"""Rows of the log that are not tasks, by their kind or by the robot's link."""

REPORT_STATES = {
    "passed": StateLabel("✓", "passed", "muted"),
    "failed": StateLabel("✗", "failed", "fault"),
    "skipped": StateLabel("-", "skipped", "wait"),
    "complete": StateLabel("✓", "complete", "plain"),
    "aborted": StateLabel("■", "aborted", "wait"),
    "excluded": StateLabel("■", "excluded", "wait"),
    "started": StateLabel("►", "started", "plain"),
    "running": StateLabel("►", "running", "plain"),
    "stalled": StateLabel("✗", "stalled", "fault"),
    "stopped": StateLabel("■", "stopped", "muted"),
}
"""Reports among them: a check, the outcome, the state of a recording."""

ACTION_STATES = {
    "started": StateLabel("►", "started", "accent"),
    "accepted": StateLabel("►", "running", "accent"),
    "succeeded": StateLabel("✓", "done", "muted"),
    "failed": StateLabel("✗", "failed", "fault"),
    "canceled": StateLabel("■", "stopped", "muted"),
    "timed-out": StateLabel("✗", "timed out", "fault"),
    "lost": StateLabel("✗", "lost", "fault"),
    "skipped": StateLabel("-", "skipped", "muted"),
}

RULE_STATES = {
    "": READY,
    "started": RUNNING,
    "entered": RUNNING,
    "stayed": RUNNING,
    "ended": StateLabel("✓", "ended", "muted"),
    "stopped": StateLabel("■", "stopped", "muted"),
    "faulted": StateLabel("✗", "faulted", "fault"),
}


MAX_OWN_TASKS = 8
"""The tasks after a rule's start among which its own are looked for: a rule that raises an event ends at once."""


def is_armed(store: Store, function: str, name: str) -> bool:
    """Whether one more press starts this act or rule."""
    return store.armed is not None and (store.armed.function, store.armed.behavior) == (function, name)


def act_state(store: Store, name: str) -> StateLabel:
    act = store.act(name)
    if is_armed(store, ACT, name):
        return ARMED
    if act.running:
        return RUNNING
    if act.waiting:
        return WAITING
    if store.is_sent(("startCommunicationRobotAct", "stopCommunicationRobotAct"), name):
        return SENT
    return task_state(act.last) if act.last is not None else READY


def rule_state(store: Store, name: str) -> StateLabel:
    if is_armed(store, RULE, name):
        return ARMED
    if store.is_sent(("startInteractionRule", "stopInteractionRule"), name):
        return SENT
    if raised_in_vain(store, name):
        return NOT_TAKEN
    return RULE_STATES.get(store.rule(name).status, READY)


def raised_in_vain(store: Store, name: str) -> bool:
    """Whether a rule has ended, and nothing took an event that it raised, such as a “next” that came too early."""
    rule, tasks = store.rule(name), store.view.tasks
    if rule.status != "ended" or rule.task is None:
        return False
    own = (tasks[id] for id in range(rule.task + 1, rule.task + 1 + MAX_OWN_TASKS) if id in tasks)
    return any(task.taken is False and task.source == f"rule:{name}" for task in own)


def task_state(task: TaskView) -> StateLabel:
    if not task.id:  # a row of the log that is not a task
        if task.function in REPORTS:
            return REPORT_STATES.get(task.status, REMARK_STATES["note"])
        kind = task.behavior if task.function == "robot" else task.function
        return REMARK_STATES.get(kind, StateLabel("·", "", "plain"))
    if task.taken is False:
        return NOT_TAKEN
    return TASK_STATES.get(task.status, StateLabel("?", task.status.lower(), "plain"))


def action_state(action: ActionView | None) -> StateLabel:
    if action is None:
        return READY
    return ACTION_STATES.get(action.status, StateLabel("?", action.status, "plain"))


def newest_task(store: Store, name: str) -> TaskView | None:
    """The task of an act for the screen: the running one, or else the waiting one, or else the last."""
    act = store.act(name)
    ids = (*act.running[-1:], *act.waiting[:1])
    return store.view.tasks[ids[0]] if ids else act.last


def act_progress(act: Act, task: TaskView) -> tuple[int, int]:
    """The number of ended actions, and of all."""
    return sum(action.status in ENDINGS for action in task.actions.values()), len(act.actions)


HERE, STATE = "here", "state"
"""The id prefixes of state rows, before a colon and the state's name: the present state, and the others."""
LONG_RAIL = 8
"""Rows. At a longer rail, the label also names the target, because its arrow may be out of view."""
MIN_NAME_WIDTH = 4
"""Cells of a state's name that are always shown."""
INDENT = 2
"""Indentation in cells of transitions behind names, if a state and its transition down share a row."""


class GraphPosition(NamedTuple):
    """The position of the rule at this moment."""

    state: str | None = None
    """The present state; None: the rule does not run."""
    last: tuple[str, int] | None = None
    """The last transition: the state that it left, and its index."""


def draw_state_graph(layout: GraphLayout, now: GraphPosition) -> list[ListRow]:
    """The rows, none wider than the layout. Only the marks depend on the moment."""
    last = layout.edges.get(now.last) if now.last is not None else None
    edges = [edge for edge in layout.edges.values() if edge.source == now.state]
    follows = {edge.target for edge in edges if edge.kind not in ("stays", "again")}
    roles: dict[tuple[int, int], TextRole] = {}
    for edge in edges:
        roles.update(dict.fromkeys(edge_path(layout, edge), "plain"))
    if last is not None:
        roles.update(dict.fromkeys(edge_path(layout, last), "accent"))
    rows = []
    for index, row in enumerate(layout.rows):
        is_present = row.is_state and row.state == now.state
        line: list[StyledSpan] = _rail_spans(row.rails, index, roles)
        if row.is_state:
            marks = ["here"] if is_present else ["maybe next"] if row.state in follows else []
            line += _state_spans(layout, row, marks)
        if row.edge is not None:
            line += _transition_spans(
                layout, row, row.edge, now, taken=row.edge is last, room=layout.width - line_width(line)
            )
        id = f"{HERE if is_present else STATE}:{row.state}" if row.is_state else ""
        rows.append(ListRow(id, crop(tuple(line), layout.width), selectable=row.is_state))
    return rows


def _rail_spans(rails: str, row: int, roles: dict[tuple[int, int], TextRole]) -> list[StyledSpan]:
    """The rails, in as few pieces as their roles allow."""
    spans: list[StyledSpan] = []
    for column, character in enumerate(rails):
        role = roles.get((row, column), "muted")
        if spans and (character == " " or spans[-1][1] == role):
            spans[-1] = (spans[-1][0] + character, spans[-1][1])
        else:
            spans.append((character, role))
    return spans


def _state_spans(layout: GraphLayout, row: GraphRow, marks: list[str]) -> list[StyledSpan]:
    """The state's glyph, name and marks. The name is cut first; before a transition, permanent notes may be omitted."""
    glyph: StyledSpan = (
        ("● ", "accent") if "here" in marks else ("◎ ", "plain") if "maybe next" in marks else ("○ ", "muted")
    )
    room = layout.names if layout.names and row.edge is not None else layout.width - layout.gutter - 2
    words = "".join(f"  {mark}" for mark in (*marks, *row.notes))
    if marks and row.edge is not None and cell_len(words) + MIN_NAME_WIDTH > room:
        words = "".join(f"  {mark}" for mark in marks)
    name = shorten(row.state, max(MIN_NAME_WIDTH, room - cell_len(words)))
    role: TextRole = "accent" if "here" in marks else "plain"
    padding = " " * max(0, room - cell_len(name) - cell_len(words)) if row.edge is not None else ""
    return [glyph, (name, role), (words, "accent" if "here" in marks else "muted"), (padding, "plain")]


def _transition_spans(
    layout: GraphLayout, row: GraphRow, edge: GraphEdge, now: GraphPosition, *, taken: bool, room: int
) -> list[StyledSpan]:
    """A transition's label and its end: its target if no rail shows it, and whether it was taken."""
    role: TextRole = "accent" if taken else "plain" if edge.source == now.state else "muted"
    lead = " ↓ " if row.is_state else f"{row.node} " + " " * (INDENT if layout.names else 0)
    label, room = clean(edge.label), room - len(lead)
    tail: list[StyledSpan] = [("  last step", "accent")] if taken else []
    if edge.kind in ("stays", "again"):
        tail.insert(0, (f"  {edge.kind}", "muted"))
    elif edge.target is not None and (edge.kind == "word" or _rail_length(layout, edge) > LONG_RAIL):
        free = room - line_width(tail) - 3
        target = shorten(edge.target, max(free // 2, free - cell_len(label)))
        tail.insert(0, (f" → {target}", role))
    return [(lead, role), (shorten(label, max(3, room - line_width(tail))), role), *tail]


def _rail_length(layout: GraphLayout, edge: GraphEdge) -> int:
    return abs(edge.row - layout.row_of[edge.target]) if edge.kind == "rail" and edge.target is not None else 0
