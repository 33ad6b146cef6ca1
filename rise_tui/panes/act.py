"""One act: its graph by levels, what runs now, and each action's parameters with the memory filled in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from textual import on
from textual.widget import Widget

from rise_engine.scenario.model import Act, Action
from rise_engine.scenario.template import MissingValue, Template, as_text
from rise_engine.view import ActionView, TaskView
from rise_tui.actions import bindings
from rise_tui.graph import levels
from rise_tui.panes.pane import ListPane
from rise_tui.states import READY, action_state, newest, task_state
from rise_tui.store import Store
from rise_tui.text import Line, Row, Span, Tone, cell, crop, duration, headed, seconds, wrap
from rise_tui.widgets.line import Lines
from rise_tui.widgets.rows import RowView

NARROW = 56
"""Below this width, sources stay out."""
NAME = 13
DETAILS = 5
"""Lines for the parameters of the selected action."""


class Details(Lines):
    DEFAULT_CSS = f"""
    Details {{ height: {DETAILS}; max-height: 40%; background: $surface; }}
    """


class ActPane(ListPane):
    """The act that ran last, or the one that the wizard selected since."""

    PLACE = "act"
    BINDINGS = bindings("act")
    TITLE = "Act"
    TOPICS = frozenset({"acts", "memory", "tasks"})
    EMPTY = "select an act in the list of acts, or start one"

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.details = Details(id="act-details")

    def body(self) -> Sequence[Widget]:
        return [self.list, self.details]

    def do(self, action: str) -> None:
        """This pane has no actions of its own."""

    @property
    def _act(self) -> Act | None:
        return self.store.scenario.acts.get(self.store.act_shown)

    def make_rows(self, width: int) -> list[Row]:
        act = self._act
        if act is None:
            return []
        task = newest(self.store, act.name)
        rows = [Row("", self._head(act, task, width), selectable=False)]
        id_width = min(16, max((len(action.id) for action in act.actions), default=1))
        for number, level in enumerate(levels(act), 1):
            for place, index in enumerate(level):
                action = act.actions[index]
                mark = _bracket(place, len(level))
                lead: Span = (f" {number if place == 0 else '':>2} {mark} ", "muted")
                done = task.actions.get(action.id) if task is not None else None
                rows.append(Row(action.id, crop((lead, *self._line(action, done, id_width)), width)))
        return rows

    def repaint(self) -> None:
        super().repaint()
        self._show_details()

    @on(RowView.Moved)
    def _moved(self, event: RowView.Moved) -> None:
        event.stop()
        self._show_details()

    def _head(self, act: Act, task: TaskView | None, width: int) -> Line:
        state = task_state(task) if task is not None else READY
        shown: Span = (f"{state.glyph} {state.word}", state.tone)
        if task is None:
            return headed(act.name, shown, (), width)
        end = task.ended if task.ended is not None else self.store.now()
        took = duration(end - task.started) if task.started is not None else ""
        if task.status == "ACTIVE" and (typical := self.store.typical(act.name)) is not None:
            took = f"{took.removesuffix(' s')} of {duration(typical)}"
        source = f"  {task.source} " if width >= NARROW else " "
        return headed(act.name, shown, ((took, "plain"), (source, "muted")), width)

    def _line(self, action: Action, done: ActionView | None, id_width: int) -> Line:
        state = action_state(done)
        word, time = state.word, ""
        if done is not None:
            end = done.ended if done.ended is not None else self.store.now()
            time = seconds(end - done.since)
        elif action.wait_for:
            word = "waits"
        kind = done.type if done is not None else action.calls[0].type
        if done is None and len(action.calls) > 1:
            kind = f"{kind} 1 of {len(action.calls)}"
        if done is not None and done.sent_as:
            kind = f"{kind}→{done.sent_as}"
        tail: Span = (
            (f"after {', '.join(action.wait_for)}  ", "muted") if done is None and action.wait_for else ("", "plain")
        )
        return (
            cell(action.id, id_width, "strong" if done is not None and done.ended is None else "plain"),
            (" ", "plain"),
            cell(kind, 12, "plain"),
            (f" {state.glyph} ", state.tone),
            cell(word, 8, state.tone),
            cell(time, 5, "plain", right=True),
            ("  ", "plain"),
            tail,
            (self._summary(action, done), "muted"),
        )

    def _summary(self, action: Action, done: ActionView | None) -> str:
        if done is not None and done.reason:
            return done.reason
        parts = [(name, as_text(value)) for name, value in self._values(action, done)]
        if len(parts) == 1:
            return parts[0][1]
        return "  ".join(f"{name} {value}" for name, value in parts)

    def _values(self, action: Action, done: ActionView | None) -> list[tuple[str, Any]]:
        if done is not None:
            return list(done.parameters.items())
        return [(name, self._filled(template)) for name, template in action.calls[0].parameters.items()]

    def _filled(self, template: Template) -> str:
        try:
            return template.fill(self.store.memory)
        except MissingValue as missing:
            return f"({missing.key} is not set)"

    def _show_details(self) -> None:
        act = self._act
        action = next((one for one in act.actions if one.id == self.list.current), None) if act is not None else None
        if act is None or action is None:
            self.details.show()
            return
        task = newest(self.store, act.name)
        done = task.actions.get(action.id) if task is not None else None
        lines: list[Line] = []
        width = self.details.size.width
        if done is not None:
            for name, value in done.parameters.items():
                lines += _parameter(name, as_text(value), "plain", width)
            lines += _parameter("reason", done.reason, "fault", width) if done.reason else []
        else:
            for number, call in enumerate(action.calls, 1):
                prefix = f"{number}. " if len(action.calls) > 1 else ""
                for name, template in call.parameters.items():
                    lines += _parameter(prefix + name, self._filled(template), "plain", width)
                    if template.constant is None:
                        lines += _parameter("", f"written: {template.text}", "muted", width)
        if len(lines) > DETAILS:
            lines[DETAILS - 1 :] = [((f" and {len(lines) - DETAILS + 1} more lines", "muted"),)]
        self.details.show(*(crop(line, width) for line in lines))


def _bracket(place: int, of: int) -> str:
    if of == 1:
        return "─"
    return "┌" if place == 0 else "└" if place == of - 1 else "│"


def _parameter(name: str, value: str, tone: Tone, width: int) -> list[Line]:
    """A parameter and its value, over as many lines as it needs."""
    lines = wrap(value, max(10, width - NAME - 2))
    return [(cell(f" {name if at == 0 else ''}", NAME, "muted"), (f" {line}", tone)) for at, line in enumerate(lines)]
